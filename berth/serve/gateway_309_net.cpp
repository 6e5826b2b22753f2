#include "berth/serve/gateway_309_net.hpp"

#include <utility>

#include "berth/lss/frames.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::serve {

using namespace std::chrono_literals;

rt::Task<bool> Net309::take_turn() {
  if (has_turn) co_return true;
  const rt::Executor& executor = network.services().dispatcher.executor();
  const rt::Time end = executor.now() + turn_patience;
  while (network.services().turn.taken() && executor.now() < end) co_await rt::sleep_for(2ms);
  if (network.services().turn.taken()) co_return false;
  co_await network.services().turn.take();
  has_turn = true;
  co_return true;
}

// The frame is not waited for: the conversation may be on its way out.
void Net309::release() noexcept {
  if (std::exchange(selected, false)) network.services().dispatcher.send(lss::request(lss::Command::switch_global, 0));
  if (std::exchange(has_turn, false)) network.services().turn.give();
}

Outcome309 Net309::failed(const Error& error) const {
  switch (error.code) {
    case Errc::aborted: return Outcome309::aborted(error.detail);
    case Errc::timeout: return Outcome309::refused(Code309::timeout);
    case Errc::mismatch:
      return Outcome309::aborted(error.detail != 0 ? error.detail : static_cast<std::uint32_t>(od::AbortCode::general));
    case Errc::exhausted: return Outcome309::refused(Code309::no_memory);
    case Errc::bus: break;
    default: return Outcome309::refused(Code309::internal_state);
  }
  const auto status = network.services().dispatcher.port().status();
  if (status.bus_off) return Outcome309::refused(Code309::bus_off);
  if (!status.up) return Outcome309::refused(Code309::can_init);
  if (status.listen_only) return Outcome309::refused(Code309::internal_state);
  if (status.error_passive()) return Outcome309::refused(Code309::error_passive);
  return Outcome309::refused(Code309::buffer_overflow);
}

}  // namespace berth::serve
