/// How many programs go down side by side on one bus, and how they share it. A device that takes a sub-block needs time
/// for its flash memory, in which others can have the bus; but a device that waits for its turn longer than its SDO
/// server's time-out gives up. So there are as many transfers at once as have their turn again within `turn_time`.
///
///     ProgramTransfers transfers(dispatcher);
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

  /// By the bit rate of the dispatcher's port; not known: two at once. It must stay.
  explicit ProgramTransfers(can::Dispatcher& dispatcher) noexcept;
  /// How many: `bit_rate` in bit/s.
  [[nodiscard]] static std::size_t at_once(std::uint32_t bit_rate) noexcept;

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

  /// A loader that is at work: held from its first question to its last.
  class Loader {
   public:
    explicit Loader(ProgramTransfers* of) noexcept : of_(of) {
      if (of_ != nullptr) ++of_->loaders_;
    }
    ~Loader() {
      if (of_ != nullptr) --of_->loaders_;
    }
    Loader(const Loader&) = delete;
    Loader& operator=(const Loader&) = delete;

   private:
    ProgramTransfers* of_;
  };
  /// The least time between two questions of one loader, so that those of all take a fifth of the bus at most.
  [[nodiscard]] rt::Duration poll() const noexcept;

 private:
  std::uint32_t bit_rate_;
  std::size_t loaders_ = 0;
  co::BlockPace pace_;
  rt::Turn door_;
  rt::Mailbox<bool, most> free_;
};

}  // namespace berth::manager
