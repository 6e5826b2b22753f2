/// Wakes another thread that waits in a poll: an eventfd. Inside of room `studio`.
#pragma once

namespace berth::studio {

class Bell {
 public:
  Bell() noexcept;
  ~Bell();
  Bell(const Bell&) = delete;
  Bell& operator=(const Bell&) = delete;

  /// False: the system refused to make it.
  [[nodiscard]] bool good() const noexcept { return fd_ >= 0; }
  /// Can be read (EPOLLIN) once it was rung, until `silence`. Stays this object's.
  [[nodiscard]] int descriptor() const noexcept { return fd_; }
  /// Any thread; never waits.
  void ring() const noexcept;
  /// Before what it was rung for is looked at, so that no ring is lost.
  void silence() const noexcept;

 private:
  int fd_;
};

}  // namespace berth::studio
