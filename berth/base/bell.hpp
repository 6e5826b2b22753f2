/// Wakes another thread that waits in a poll: an eventfd.
#pragma once

namespace berth {

class Bell {
 public:
  Bell() noexcept;
  ~Bell();
  Bell(const Bell&) = delete;
  Bell& operator=(const Bell&) = delete;

  /// False: the system refused to create it.
  [[nodiscard]] bool good() const noexcept { return fd_ >= 0; }
  /// Readable (EPOLLIN) from `ring` until `silence`. Owned by this object.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// Any thread; never waits.
  void ring() const noexcept;
  /// Call it before handling what it was rung for, so that no ring is lost.
  void silence() const noexcept;

 private:
  int fd_;
};

}  // namespace berth
