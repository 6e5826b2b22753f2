/// Frames of a SocketCAN port that the kernel has not taken yet: written in order when the sending job is over, and
/// tried again when the kernel was full. Internal to room `io`.
#pragma once

#include <deque>

#include "berth/can/port.hpp"
#include "berth/io/controller_status.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/socketcan_socket.hpp"
#include "berth/rt/later.hpp"

namespace berth::io {

class KernelQueue {
 public:
  class Owner {
   public:
    /// The kernel has taken it.
    virtual void wrote(const can::Frame& frame, std::uint32_t tag) noexcept = 0;
    virtual void goes_down() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// `watcher`: the socket's watcher in the loop. Nothing is written while `status` is down or bus-off.
  KernelQueue(Loop& loop, CanSocket& socket, Watcher& watcher, const ControllerStatus& status, std::size_t depth,
              Owner& owner) noexcept
      : loop_(&loop), socket_(&socket), watcher_(&watcher), status_(&status), depth_(depth), owner_(&owner) {}

  /// `full`: there is no room for it.
  [[nodiscard]] can::Queued push(const can::Frame& frame, std::uint32_t tag) noexcept;
  void withdraw(std::uint32_t tag) noexcept;
  void clear() noexcept;
  [[nodiscard]] std::size_t size() const noexcept { return waiting_.size(); }
  /// Writes what the kernel takes.
  void flush() noexcept;
  /// The socket has been replaced.
  void bound() noexcept { watches_out_ = false; }

 private:
  struct Given {
    can::Frame frame;
    std::uint32_t tag;
  };
  void try_later() noexcept;
  void try_when_writable(bool on) noexcept;

  Loop* loop_;
  CanSocket* socket_;
  Watcher* watcher_;
  const ControllerStatus* status_;
  std::size_t depth_;
  Owner* owner_;
  std::deque<Given> waiting_;
  bool stuck_ = false;  // the kernel takes nothing at present
  bool watches_out_ = false;
  rt::Later<KernelQueue, &KernelQueue::flush> write_{*this, loop_->executor()};
  rt::Later<KernelQueue, &KernelQueue::flush> retry_{*this, loop_->executor()};
};

}  // namespace berth::io
