// Receives Berth's own frames on the bus "backbone": those that no device of the plant sends.
#pragma once

#include <algorithm>
#include <functional>

#include "tests/harness/rig.hpp"

namespace berth::harness {

class MasterEar final : private can::Tap {
 public:
  explicit MasterEar(Rig& rig) : rig_(rig) { rig_.world().bus("backbone")->add_tap(*this); }
  ~MasterEar() { rig_.world().bus("backbone")->remove_tap(*this); }
  unsigned frames = 0;
  std::function<void(const can::Frame&)> on_frame;  // may be empty

 private:
  void frame(const can::Frame& frame, rt::Time, int sender) noexcept override {
    const bool device =
        std::ranges::any_of(rig_.world().devices(), [&](const auto& d) { return d->controller().number() == sender; });
    if (device) return;
    ++frames;
    if (on_frame) on_frame(frame);
  }
  Rig& rig_;
};

}  // namespace berth::harness
