/// The kernel's reports about one interface, by name: on request, and whenever something about it changes. Internal to
/// room `io`.
#pragma once

#include <string>

#include "berth/io/loop.hpp"
#include "berth/io/netlink_socket.hpp"

namespace berth::io {

class LinkNews final : private Watcher {
 public:
  class Owner {
   public:
    /// The answer to the newest question. An answer that is older than a later report is dropped.
    virtual void answered(const LinkNotice& notice) = 0;

   protected:
    ~Owner() = default;
  };
  LinkNews(Loop& loop, std::string name, Owner& owner) noexcept
      : loop_(&loop), name_(std::move(name)), owner_(&owner) {}
  ~LinkNews() {
    if (links_.fd() >= 0) loop_->forget(links_.fd());
  }
  LinkNews(const LinkNews&) = delete;
  LinkNews& operator=(const LinkNews&) = delete;

  /// False: see errno.
  [[nodiscard]] bool open() { return links_.open() && loop_->watch(links_.fd(), *this, EPOLLIN); }
  void ask() noexcept { links_.ask(++sequence_, name_); }
  /// The last known index of the name: the kernel reports the end of an interface by index.
  void know(int index) noexcept { index_ = index; }

 private:
  static constexpr std::uint32_t first_sequence = 0xBE00'0000U;  // others start theirs from small numbers or the time
  void ready(std::uint32_t events) noexcept override;

  Loop* loop_;
  std::string name_;
  Owner* owner_;
  LinkWatch links_;
  std::uint32_t sequence_ = first_sequence;
  int index_ = 0;
};

}  // namespace berth::io
