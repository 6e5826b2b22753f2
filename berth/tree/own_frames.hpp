/// Frames that Berth itself sent, for parts that listen to a bus: a bus's dispatcher only receives other nodes' frames.
/// The owner of the ports reports them here (`Rig`).
#pragma once

#include <algorithm>
#include <string_view>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::tree {

class OwnFrames {
 public:
  /// Receives the frames of one bus during its lifetime. It must not construct or destroy another listener while it is
  /// called.
  class Listener {
   public:
    /// Both must outlive this.
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
