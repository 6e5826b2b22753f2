#include "berth/manager/program_transfers.hpp"

#include <algorithm>

#include "berth/co/sdo_block.hpp"

namespace berth::manager {
namespace {

constexpr std::uint64_t frame_bits = 135;  // of eight bytes, with the stuff bits of a program
constexpr std::size_t fewest = 2;          // with fewer, the bus is idle while a device writes its flash memory

}  // namespace

std::size_t ProgramTransfers::at_once(std::uint32_t bit_rate) noexcept {
  constexpr std::uint64_t sub_block_bits = co::sdo::longest_block * frame_bits;
  const auto turn_ms = std::chrono::duration_cast<std::chrono::milliseconds>(ProgramTransfers::turn_time).count();
  const auto in_time = static_cast<std::uint64_t>(turn_ms) * bit_rate / 1000;
  return std::clamp<std::size_t>(in_time / sub_block_bits, fewest, ProgramTransfers::most);
}

ProgramTransfers::ProgramTransfers(can::Dispatcher& dispatcher) noexcept
    : bit_rate_(dispatcher.port().status().bit_rate), pace_(dispatcher), free_(dispatcher.executor()) {
  const std::size_t count = at_once(bit_rate_);
  for (std::size_t i = 0; i < count; ++i) free_.push(true);
}

rt::Duration ProgramTransfers::poll() const noexcept {
  constexpr std::uint64_t bits = 5 * 2 * frame_bits;  // a fifth of the bus; question and answer
  if (bit_rate_ == 0) return {};
  return std::chrono::microseconds(loaders_ * bits * 1'000'000 / bit_rate_);
}

rt::Task<ProgramTransfers::Ticket> ProgramTransfers::enter() {
  co_await door_.take();
  const rt::Held held(door_);
  const auto token = co_await free_.next(rt::never);
  static_cast<void>(token);
  Ticket ticket(*this);
  co_return ticket;
}

}  // namespace berth::manager
