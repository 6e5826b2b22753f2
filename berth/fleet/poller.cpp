#include "berth/fleet/poller.hpp"

#include <algorithm>
#include <utility>

#include "berth/fleet/told.hpp"
#include "berth/od/data_type.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/printable.hpp"

namespace berth::fleet {

using namespace std::chrono_literals;

namespace {

constexpr rt::Duration shortest_pause = 100ms;

}  // namespace

Poller::Poller(tree::Session& session, const std::vector<Signal>& signals, SignalTable& table, Carry carry)
    : session_(&session), signals_(&signals), table_(&table), carry_(std::move(carry)), scope_(session.executor()) {
  if (std::ranges::any_of(signals, &Signal::polled)) scope_.spawn(run());
}

bool Poller::may_ask(std::size_t index) const {
  const auto& spec = session_->machine().slots[(*signals_)[index].slot].spec;
  const auto slots = session_->slots();
  return std::ranges::any_of(slots, [&](const operate::SlotReport& slot) {
    return slot.bus == spec.name.bus && slot.id == spec.id && slot.state == places::SlotState::operational;
  });
}

rt::Task<void> Poller::run() {
  auto& executor = session_->executor();
  std::vector<rt::Time> due(signals_->size(), executor.now());
  for (;;) {
    for (std::size_t i = 0; i < due.size(); ++i) {
      const Signal& signal = (*signals_)[i];
      if (!signal.polled() || executor.now() < due[i]) continue;
      due[i] = executor.now() + signal.wanted.every;
      if (may_ask(i)) co_await read(i);
    }
    co_await rt::sleep_for(shortest_pause);
  }
}

rt::Task<void> Poller::read(std::size_t index) {
  const Signal& signal = (*signals_)[index];
  const auto& name = session_->machine().slots[signal.slot].spec.name;
  request_ = {"sdo read", {{"node", name.bus + "/" + name.name}, {"object", od::write_object(signal.object)}}};
  reply_ = {};
  co_await carry_(request_, reply_);
  SignalTable::State state = table_->state(index);
  state.failed = true;
  const auto bytes = bytes_in(reply_.json);
  const std::size_t size = od::byte_size(signal.type);
  if (reply_.status == 0 && bytes && (size == 0 || bytes->size() == size)) {
    state = {.at = session_->executor().now(), .known = true};
    if (size == 0) state.text = text::one_line(std::string(bytes->begin(), bytes->end()));
    if (size > 0) state.raw = od::load(signal.type, bytes->data());
  }
  table_->set(index, std::move(state));
}

}  // namespace berth::fleet
