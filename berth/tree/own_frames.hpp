/// Frames that Berth itself sent, for who listens to a bus beside it: a bus's dispatcher hears what others send only.
/// Who knows the ports tells them here (`Rig`).
#pragma once

#include <algorithm>
#include <string_view>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::tree {

class OwnFrames {
 public:
  /// Hears the frames of one bus from its making to its end. It must not make or end another one while it is told.
  class Listener {
   public:
    /// Both must stay.
    Listener(OwnFrames& frames, std::string_view bus) : frames_(&frames), bus_(bus) {
      frames_->listeners_.push_back(this);
    }
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;

   protected:
    ~Listener() { std::erase(frames_->listeners_, this); }

   private:
    friend class OwnFrames;
    virtual void sent(const can::Frame& frame, rt::Time at) noexcept = 0;
    OwnFrames* frames_;
    std::string_view bus_;
  };

  OwnFrames() = default;
  OwnFrames(const OwnFrames&) = delete;
  OwnFrames& operator=(const OwnFrames&) = delete;
  void sent(std::string_view bus, const can::Frame& frame, rt::Time at) noexcept {
    for (auto* const listener : listeners_) {
      if (listener->bus_ == bus) listener->sent(frame, at);
    }
  }

 private:
  std::vector<Listener*> listeners_;
};

}  // namespace berth::tree
