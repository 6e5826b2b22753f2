#include "berth/tree/watch_beneath.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "berth/co/emcy.hpp"

namespace berth::tree {
namespace {

using operate::EventKind;
using places::SlotState;

constexpr std::uint16_t nmt_inhibit_time = 0x102A;
constexpr auto long_quiet = std::chrono::seconds(10);      // without an EMCY of two devices
constexpr auto at_once = std::chrono::seconds(2);          // two EMCYs of two devices
constexpr auto by_then_stopped = std::chrono::seconds(1);  // from the EMCY that reports it
constexpr const char* bus_failed = "a mandatory bus beneath it has failed";
constexpr auto look_pause = std::chrono::milliseconds(200);  // between two looks at a booting bus

// A device may lack all parts of 1018h, even its vendor-ID.
rt::Task<Result<Identity>> read_identity(co::SdoAccess& device, NodeId node) {
  std::array<std::uint32_t, 4> parts{};
  std::uint8_t unknown = 0;
  for (unsigned i = 0; i < 4; ++i) {
    const auto value = co_await device.read_u32(0x1018, static_cast<std::uint8_t>(i + 1));
    if (!value && value.error().code != Errc::aborted) co_return fail(value.error());
    if (value) parts[i] = *value;
    if (!value) unknown = static_cast<std::uint8_t>(unknown | 1U << i);
  }
  Identity who(parts[0], parts[1], parts[2], parts[3]);
  who.unknown = unknown;
  co_return who.with(node);
}

}  // namespace

WatchBeneath::WatchBeneath(SlotsBeneath& slots, const Way& way, multilevel::Routes& routes)
    : slots_(slots),
      way_(way),
      routes_(routes),
      master_(routes.access({way.gateways, slots.bus().master}), slots.bus().master) {}

bool WatchBeneath::set_gateway_runs(bool runs) noexcept {
  const bool returned = runs && !silence_.ran;
  if (returned) silence_.rest_until = {};
  silence_.ran = runs;
  return returned;
}

bool WatchBeneath::ask(NodeId node, bool lost) {
  PlaceBeneath* const place = slots_.at(node);
  if (place == nullptr) return false;
  asked_.set(node.value());
  if (lost) ++place->losses;
  if (lost) told_lost_.set(node.value());
  return true;
}

std::vector<NodeId> WatchBeneath::take_asked() {
  std::vector<NodeId> nodes;
  for (const NodeId node : slots_.nodes()) {
    if (asked_.test(node.value())) nodes.push_back(node);
  }
  asked_.reset();
  return nodes;
}

// ---- bringing it up ----

rt::Task<Result<void>> WatchBeneath::await_operational(rt::Time deadline) {
  for (bool over = false; !over;) {
    over = slots_.now() >= deadline;
    unsigned silent = 0;
    trouble_.begin(slots_.now());
    for (auto& place : slots_.all()) {
      const std::uint8_t node = place.spec.id.value();
      if (place.now.state == SlotState::operational && !asked_.test(node)) continue;
      const bool settled = over || place.now.state == SlotState::operational;
      asked_.reset(node);
      const auto looked = co_await look_at(place, settled);
      if (!looked && ++silent > 2) break;
    }
    if (slots_.operational()) break;
    if (!over) co_await rt::sleep_for(look_pause);
  }
  if (slots_.operational()) co_return Result<void>{};
  const auto missing = std::ranges::find_if(
      slots_.all(), [](const PlaceBeneath& p) { return !p.spec.optional && p.now.state != SlotState::operational; });
  co_return fail(Error{.code = Errc::mismatch,
                       .node = missing->spec.id.value(),
                       .text = "a bus beneath it is not operational: see its slots"});
}

// ---- watching it ----

rt::Task<void> WatchBeneath::look_around() {
  const rt::Time began = slots_.now();
  auto nodes = take_asked();
  if (nodes.empty()) {
    if (began < silence_.rest_until) co_return;
    auto& all = slots_.all();
    nodes.push_back(all[next_++ % all.size()].spec.id);
    for (auto& place : all) {
      const bool open = place.now.state != SlotState::operational || !place.identified;
      if (open && place.spec.id != nodes.front()) nodes.push_back(place.spec.id);
    }
  }
  const bool heard = co_await look_at_all(std::move(nodes));
  // An unanswered question blocks all others that go through the same gateways above.
  if (!heard) silence_.rest_until = slots_.now() + 3 * (slots_.now() - began);
}

rt::Task<void> WatchBeneath::look_at_asked() {
  auto nodes = take_asked();
  const bool heard = co_await look_at_all(std::move(nodes));
  static_cast<void>(heard);
}

// False: the gateway does not answer.
rt::Task<bool> WatchBeneath::look_at_all(std::vector<NodeId> nodes) {
  trouble_.begin(slots_.now());
  for (const NodeId node : nodes) {
    const auto looked = co_await look_at(*slots_.at(node), true);
    silence_.failures = looked ? 0 : silence_.failures + 1;
    constexpr unsigned most = 3;
    if (looked || (looked.error().code != Errc::timeout && silence_.failures < most)) continue;
    gateway_is_silent(looked.error());
    co_return false;
  }
  const bool any_fixed = std::ranges::any_of(slots_.all(), &PlaceBeneath::fixed);
  const std::string surplus = co_await trouble_.surplus(access(slots_.bus().master), any_fixed);
  if (!surplus.empty()) slots_.events().tell(EventKind::surplus, "", surplus);
  co_return true;
}

// None: another loss was reported meanwhile; it may be this node's, and the answer may be older.
rt::Task<WatchBeneath::Answer> WatchBeneath::state_of(PlaceBeneath& place) {
  const unsigned before = place.losses;
  const auto state = co_await master_.state(place.spec.id);
  if (!state) co_return fail(state.error());
  if (place.losses != before) co_return std::nullopt;
  co_return *state;
}

// `settled`: report a missing node; otherwise it may still come.
rt::Task<Result<void>> WatchBeneath::look_at(PlaceBeneath& place, bool settled) {
  auto state = co_await state_of(place);
  const bool asks = state && *state == static_cast<std::uint8_t>(NmtState::operational) && !place.identified;
  if (asks) {
    const bool answers = co_await identify(place);
    // The state from before the unanswered questions is outdated.
    if (!answers) state = co_await state_of(place);
  }
  if (!state) co_return fail(state.error());
  if (!*state) co_return Result<void>{};
  if (place.doubled && **state > GatewayMaster::missing) {
    const bool still = co_await is_doubled(place);
    place.doubled = still;
    if (still) co_return Result<void>{};
    // The state from before those questions is outdated.
    state = co_await state_of(place);
    if (!state) co_return fail(state.error());
    if (!*state) co_return Result<void>{};
  }
  switch (**state) {
    case static_cast<std::uint8_t>(NmtState::operational): co_return co_await look_at_running(place);
    case static_cast<std::uint8_t>(NmtState::stopped): co_return co_await look_at_stopped(place);
    case static_cast<std::uint8_t>(NmtState::pre_operational): co_return co_await look_at_waiting(place);
    default:
      place.stops_itself.reset();  // booting, or absent
      place.doubled = false;
      if (settled) co_await look_at_missing(place);
  }
  told_lost_.reset(place.spec.id.value());
  co_return Result<void>{};
}

rt::Task<Result<void>> WatchBeneath::look_at_running(PlaceBeneath& place) {
  const NodeId node = place.spec.id;
  if (place.stops_itself && slots_.now() - *place.stops_itself > by_then_stopped) place.stops_itself.reset();
  slots_.set_state(place, SlotState::operational);
  const bool told = told_lost_.test(node.value());
  told_lost_.reset(node.value());
  if (told && still_runs_) still_runs_(node);
  co_return Result<void>{};
}

void WatchBeneath::collided(PlaceBeneath& place) {
  const rt::Time now = slots_.now();
  const auto before = std::exchange(place.collided, now);
  if (place.doubled || !before || now - *before > at_once) return;
  place.doubled = true;
  slots_.set_state(
      place, SlotState::duplicate,
      "two devices use this node-ID (each sent EMCY 8150h): take one of them off the bus, and restart the other");
}

// Two devices answer with different serial numbers, and their frames destroy each other: a communication error after
// that (1001h) means a second device. A device that was restarted alone has none.
rt::Task<bool> WatchBeneath::is_doubled(PlaceBeneath& place) {
  if (slots_.now() - place.collided.value_or(slots_.now()) < long_quiet) co_return true;
  co::SdoAccess& node = access(place.spec.id);
  const auto known = co_await read_identity(node, place.spec.id);
  if (!known) co_return true;
  const auto errors = co_await node.read(0x1001, 0);
  if (!errors) co_return true;
  const auto bytes = errors->bytes();
  co_return bytes.empty() || (bytes.front() & co::error_register::communication) != 0;
}

// The master may know more than that the node is missing.
rt::Task<void> WatchBeneath::look_at_missing(PlaceBeneath& place) {
  const NodeId node = place.spec.id;
  const unsigned losses = place.losses;
  const std::string path = to_string(multilevel::Path{way_.gateways, slots_.bus().master});
  const unsigned asked = trouble_.asked();
  const auto knows = co_await trouble_.of(access(slots_.bus().master), place.spec, path);
  if (place.losses != losses) co_return;
  if (trouble_.asked() != asked) {
    // The node may have come back while its master was asked.
    const auto state = co_await state_of(place);
    const bool still = state && *state && **state <= GatewayMaster::missing;
    if (!still) co_return;
  }
  place.identified = false;
  const bool told = told_lost_.test(node.value());
  if (knows && (knows->is_news || !told)) {
    if (knows->is_news || place.now.state != knows->state) slots_.set_state(place, knows->state, knows->reason);
    co_return;
  }
  if (!place.now.device && !told) {
    slots_.set_state(place, SlotState::empty,
                     place.fixed() ? fmt::format("no device answers under node-ID {}: set its switches", node.value())
                                   : std::string("no device of its type was found"));
    co_return;
  }
  if (place.now.state == SlotState::absent) co_return;
  slots_.set_state(place, SlotState::absent,
                   told ? "heartbeat lost: the gateway reported it (EMCY 8130h), and its master misses it"
                        : "the gateway's master misses it");
}

// A gateway stops itself when a mandatory bus beneath it failed (paper 3 Figure 1). While stopped it forwards nothing:
// Berth makes it pre-operational, and starts it when that bus runs.
rt::Task<Result<void>> WatchBeneath::look_at_stopped(PlaceBeneath& place) {
  const NodeId node = place.spec.id;
  told_lost_.reset(node.value());
  if (!place.stops_itself) {
    slots_.set_state(place, SlotState::present, "stopped");
    co_return Result<void>{};
  }
  slots_.set_state(place, SlotState::present, bus_failed);
  co_return co_await master_.command(node, co::NmtCommand::enter_pre_operational);
}

rt::Task<Result<void>> WatchBeneath::look_at_waiting(PlaceBeneath& place) {
  const NodeId node = place.spec.id;
  place.identified = false;  // it booted, and may be another device
  told_lost_.reset(node.value());
  if (place.stops_itself) {
    slots_.set_state(place, SlotState::present, bus_failed);
    if (!ready_ || !ready_(node)) co_return Result<void>{};
    slots_.events().tell(EventKind::step, place.now.name, "the buses beneath it run again: it is started");
    co_return co_await master_.command(node, co::NmtCommand::start);
  }
  slots_.set_state(place, SlotState::present);
  if (!provided_ || !place.left_lying(slots_.now())) co_return Result<void>{};
  place.booted_again = slots_.now();
  slots_.events().tell(EventKind::step, place.now.name, "was not started by its gateway's master: it is reset");
  co_return co_await master_.command(node, co::NmtCommand::reset_node);
}

// Nothing waits for the identity. Accesses of the buses above use the same gateways and come first. False: the node
// does not answer, or was lost meanwhile.
rt::Task<bool> WatchBeneath::identify(PlaceBeneath& place) {
  constexpr auto in_any_case = std::chrono::seconds(3);
  const bool late = slots_.now() - place.now.since > in_any_case;
  if (hurries_ || !(silence_.ran || late)) co_return true;
  const unsigned losses = place.losses;
  co::SdoAccess& node = access(place.spec.id);
  const auto known = co_await read_identity(node, place.spec.id);
  if (!known || place.losses != losses) co_return false;
  const auto type = co_await node.read_u32(0x1000, 0);
  if (place.losses != losses) co_return false;
  if (type) place.profile = static_cast<std::uint16_t>(*type);
  slots_.set_device(place, *known);
  co_return true;
}

void WatchBeneath::gateway_is_silent(const Error& error) {
  const multilevel::Hop last = way_.gateways.back();
  // Any other object may be one that a gateway on the way could not reach.
  const bool keeps_none = error.code == Errc::aborted && error.index == nmt_inhibit_time &&
                          error.detail == static_cast<std::uint32_t>(od::AbortCode::no_object);
  if (keeps_none) {
    return slots_.set_all_absent(fmt::format(
        "the own node of gateway {} on this bus has no object {:04X}h: it is no NMT master that keeps a network "
        "list (docs/multilevel.md; a simulated one needs master = {{ flying = false }})",
        last.gateway.value(), error.index));
  }
  // Through several gateways, the timeout may be that of a gateway waiting for another.
  const bool answered = way_.gateways.size() == 1 && error.code == Errc::timeout &&
                        std::string_view(error.text) == multilevel::node_silent;
  if (answered) {
    return slots_.set_all_absent(fmt::format(
        "gateway {} above does not reach node {}, its own node and NMT master of this bus: is master_id right, "
        "and the gateway plugged into this bus?",
        last.gateway.value(), slots_.bus().master.value()));
  }
  slots_.set_all_absent(fmt::format("gateway {} above does not {}: {}", last.gateway.value(),
                                    error.code == Errc::unsupported ? "reach this bus" : "answer", error.text));
}

rt::Task<Result<std::vector<operate::Seen>>> WatchBeneath::scan() {
  std::vector<operate::Seen> all;
  for (const auto& place : slots_.all()) {
    const NodeId node = place.spec.id;
    const auto state = co_await master_.state(node);
    if (!state) co_return fail(state.error());
    if (*state <= GatewayMaster::missing) continue;
    operate::Seen seen;
    seen.id = node;
    seen.slot = place.spec.name.name;
    seen.state = static_cast<NmtState>(*state);
    co::SdoAccess& device = access(node);
    const auto type = co_await device.read_u32(0x1000, 0);
    if (type) seen.device_type = *type;
    const auto known = co_await read_identity(device, node);
    if (known) seen.device = *known;
    all.push_back(seen);
  }
  co_return all;
}

}  // namespace berth::tree
