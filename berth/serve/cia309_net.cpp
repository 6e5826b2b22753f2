#include "berth/serve/cia309_net.hpp"

#include <utility>

#include "berth/lss/frames.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::serve::cia309 {

using namespace std::chrono_literals;

rt::Task<bool> Net::take_turn() {
  if (has_turn) co_return true;
  const rt::Executor& executor = network.services().dispatcher.executor();
  const rt::Time end = executor.now() + turn_patience;
  while (network.services().turn.taken() && executor.now() < end) co_await rt::sleep_for(2ms);
  if (network.services().turn.taken()) co_return false;
  co_await network.services().turn.take();
  has_turn = true;
  co_return true;
}

// Does not wait for the frame: the conversation may be ending.
void Net::release() noexcept {
  if (std::exchange(selected, false)) network.services().dispatcher.send(lss::request(lss::Command::switch_global, 0));
  if (std::exchange(has_turn, false)) network.services().turn.give();
}

Outcome Net::failed(const Error& error) const {
  switch (error.code) {
    case Errc::aborted: return Outcome::aborted(error.detail);
    case Errc::timeout: return Outcome::refused(Code::timeout);
    case Errc::mismatch:
      return Outcome::aborted(error.detail != 0 ? error.detail : static_cast<std::uint32_t>(od::AbortCode::general));
    case Errc::exhausted: return Outcome::refused(Code::no_memory);
    case Errc::bus: break;
    default: return Outcome::refused(Code::internal_state);
  }
  const auto status = network.services().dispatcher.port().status();
  if (status.bus_off) return Outcome::refused(Code::bus_off);
  if (!status.up) return Outcome::refused(Code::can_init);
  if (status.listen_only) return Outcome::refused(Code::internal_state);
  if (status.error_passive()) return Outcome::refused(Code::error_passive);
  return Outcome::refused(Code::buffer_overflow);
}

}  // namespace berth::serve::cia309
