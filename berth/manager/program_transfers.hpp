/// How many programs go down side by side on one bus, and how they share it. A device that takes a sub-block needs time
/// for its flash memory, in which others can have the bus; but a device that waits for its turn longer than its SDO
/// server's time-out gives up. So there are as many transfers at once as have their turn again within `turn_time`.
///
///     ProgramTransfers transfers(executor, bit_rate);
///     auto ticket = co_await transfers.enter();       // waits; given back when it is destroyed
///     how.pace = &transfers.pace();
#pragma once

#include <utility>

#include "berth/co/block_pace.hpp"
#include "berth/rt/mailbox.hpp"
#include "berth/rt/turn.hpp"

namespace berth::manager {

class ProgramTransfers {
 public:
  static constexpr std::size_t most = 16;  ///< at once
  /// Within it each transfer sends a sub-block: a third of the second that SDO servers wait.
  static constexpr rt::Duration turn_time = std::chrono::milliseconds(330);

  /// `bit_rate` in bit/s; 0: not known, then two at once.
  ProgramTransfers(rt::Executor& executor, std::uint32_t bit_rate) noexcept;

  class Ticket {
   public:
    explicit Ticket(ProgramTransfers& of) noexcept : of_(&of) {}
    Ticket(Ticket&& other) noexcept : of_(std::exchange(other.of_, nullptr)) {}
    Ticket& operator=(Ticket&&) = delete;
    ~Ticket() {
      if (of_ != nullptr) of_->free_.push(true);
    }

   private:
    ProgramTransfers* of_;
  };
  [[nodiscard]] rt::Task<Ticket> enter();
  [[nodiscard]] co::BlockPace& pace() noexcept { return pace_; }
  [[nodiscard]] std::size_t at_once() const noexcept { return at_once_; }

 private:
  std::size_t at_once_;
  co::BlockPace pace_;
  rt::Turn door_;
  rt::Mailbox<bool, most> free_;
};

}  // namespace berth::manager
