/// How many programs are downloaded side by side on one bus, and how they share it. A device needs time to write a
/// sub-block to its flash memory; others can use the bus meanwhile. But a device that waits for its turn longer than
/// its SDO server's timeout gives up. So the number of transfers is limited: each gets its next turn within
/// `turn_time`.
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
  /// In this time each transfer sends a sub-block: a third of the second that SDO servers wait.
  static constexpr rt::Duration turn_time = std::chrono::milliseconds(330);

  /// By the bit rate of the dispatcher's port; if unknown: two at once. The dispatcher must outlive this.
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

  /// A loader at work: held from its first question to its last.
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
  /// The shortest time between two questions of one loader, so that all loaders together use at most a fifth of the
  /// bus.
  [[nodiscard]] rt::Duration poll() const noexcept;

 private:
  std::uint32_t bit_rate_;
  std::size_t loaders_ = 0;
  co::BlockPace pace_;
  rt::Turn door_;
  rt::Mailbox<bool, most> free_;
};

}  // namespace berth::manager
