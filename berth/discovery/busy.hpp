/// Allows one procedure at a time: holds a flag while it exists.
#pragma once

namespace berth::discovery {

struct Busy {
  explicit Busy(bool& flag) noexcept : flag_(flag) { flag_ = true; }
  ~Busy() { flag_ = false; }
  Busy(const Busy&) = delete;
  Busy& operator=(const Busy&) = delete;
  bool& flag_;
};

}  // namespace berth::discovery
