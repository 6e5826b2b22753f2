#include "berth/operate/beneath.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/eds/concise_dcf.hpp"
#include "berth/manager/configuration_requests.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/manager/network_requests.hpp"
#include "berth/od/cia302.hpp"

namespace berth::operate {
namespace {

using places::SlotState;

constexpr auto look_pause = std::chrono::milliseconds(200);  // between two looks at a bus that boots
constexpr std::uint8_t missing = 1;                          // 1F82h: the node is in the network list and not heard
constexpr std::uint16_t heartbeat_lost = 0x8130;
constexpr std::uint16_t configuration_date = 0x1020;

Error error_of(const manager::Failure& failure) noexcept {
  if (failure.why == manager::Failure::Why::error) return failure.error;
  return {.code = Errc::mismatch,
          .sub = failure.object.sub,
          .index = failure.object.index,
          .text = "the gateway's master does not keep its network list"};
}

rt::Task<bool> has_list(co::SdoAccess& master, const manager::Wanted& whole) {
  const manager::ConfiguratorOptions options;
  manager::Configurator configurator(master, master, whole, options);
  co_return co_await configurator.has_date();
}

// A device may lack all of 1018h but its vendor-ID.
rt::Task<Result<void>> read_address(co::SdoAccess& device, LssAddress& address) {
  std::uint8_t sub = 0;
  for (std::uint32_t* const part : {&address.vendor, &address.product, &address.revision, &address.serial}) {
    ++sub;
    const auto value = co_await device.read_u32(0x1018, sub);
    if (value) *part = *value;
    if (!value && value.error().code != Errc::aborted) co_return fail(value.error());
  }
  co_return Result<void>{};
}

rt::Task<Result<void>> bring(co::SdoAccess& master, const manager::Wanted& list, bool& changed) {
  manager::ConfiguratorOptions options;
  manager::ConfigurationReport report;
  manager::Configurator configurator(master, master, list, options);
  co_await configurator.run(report);
  if (report.failure) co_return fail(error_of(*report.failure));
  changed = report.changed();
  co_return Result<void>{};
}

// The whole in one transfer, of which its master takes each object itself: 1F22h of its own node-ID, and 1F25h. False:
// it does not do that, or refuses one.
rt::Task<bool> put_whole(co::SdoAccess& master, NodeId own, const manager::Wanted& list) {
  eds::ConciseDcf stream;
  for (const auto& entry : list.entries) {
    if (!entry.compare_only) stream.entries.push_back({entry.object, entry.bytes});
  }
  const auto bytes = eds::encode(eds::in_working_order(std::move(stream)));
  const std::span<const std::uint8_t> data = bytes;
  auto done = co_await master.write_u32(configuration_date, 1, 0);
  if (done) done = co_await master.write(od::cia302::concise_dcf, own.value(), data);
  if (!done) co_return false;
  constexpr std::uint32_t configure = manager::ConfigurationRequests::signature;
  done = co_await master.write_u32(od::cia302::request_configuration, own.value(), configure);
  co_return done.has_value();
}

// Through gateways each access costs several: object by object only where the master cannot do it at once.
rt::Task<Result<void>> bring_whole(co::SdoAccess& master, NodeId own, const manager::Wanted& list, bool& changed) {
  manager::Wanted rest = list;
  bool there = co_await has_list(master, list);
  if (!there) there = co_await put_whole(master, own, list);
  if (there) rest.entries.clear();
  co_return co_await bring(master, rest, changed);
}

// By 1F82h of the master of that bus.
rt::Task<Result<void>> command_by(co::SdoAccess& master, NodeId node, co::NmtCommand command) {
  const std::array<std::uint8_t, 1> value{manager::request_value(command)};
  const std::span<const std::uint8_t> data = value;
  const std::uint8_t sub = node.value();
  const auto done = co_await master.write(od::cia302::request_nmt, sub, data);
  co_return done;
}

// What 1F82h of the master of that bus says of a node; 0: nothing.
rt::Task<Result<std::uint8_t>> state_by(co::SdoAccess& master, NodeId node) {
  const std::uint8_t sub = node.value();
  const auto value = co_await master.read(od::cia302::request_nmt, sub);
  if (!value) co_return fail(value.error());
  const auto bytes = value->bytes();
  co_return bytes.empty() ? std::uint8_t{0} : bytes.front();
}

// None: meanwhile the gateway told of one more loss of the node, and the answer may be from before.
rt::Task<Result<std::optional<std::uint8_t>>> state_by(co::SdoAccess& master, NodeId node, const unsigned& losses) {
  const unsigned before = losses;
  const auto state = co_await state_by(master, node);
  if (!state) co_return fail(state.error());
  if (losses != before) co_return std::nullopt;
  co_return *state;
}

// A slave's boot-up message makes it boot that slave.
rt::Task<Result<void>> reset_by(co::SdoAccess& master, NodeId node) {
  return command_by(master, node, co::NmtCommand::reset_node);
}

// A master whose list is not in use yet has none of its nodes. One that does not answer is not asked on.
rt::Task<bool> has_all(co::SdoAccess& master, const std::vector<NodeId>& nodes) {
  for (const NodeId node : nodes) {
    const auto state = co_await state_by(master, node);
    if (!state && state.error().code != Errc::aborted) co_return true;
    if (!state || *state <= missing) co_return false;
  }
  co_return true;
}

// True also when the master does not answer.
template <class Places>
rt::Task<bool> has_any(co::SdoAccess& master, const Places& places) {
  for (const auto& place : places) {
    const auto state = co_await state_by(master, place.spec.id);
    if (!state && state.error().code != Errc::aborted) co_return true;
    if (state && *state > missing) co_return true;
  }
  co_return false;
}

rt::Task<bool> all_run(co::SdoAccess& master, const std::vector<NodeId>& nodes) {
  for (const NodeId node : nodes) {
    const auto state = co_await state_by(master, node);
    if (!state || *state != static_cast<std::uint8_t>(NmtState::operational)) co_return false;
  }
  co_return true;
}

// Asked itself before it has its node-ID, it would keep the SDO client of the gateway's master waiting.
rt::Task<void> await_heard(rt::Executor& executor, co::SdoAccess& master, co::SdoAccess& gateway, NodeId node) {
  constexpr auto hidden = std::chrono::seconds(10);  // its boot-up message was lost
  const rt::Time began = executor.now();
  const std::vector<NodeId> one{node};
  for (bool heard = false; !heard && executor.now() < began + Beneath::patience;) {
    heard = co_await has_all(master, one);
    if (!heard && executor.now() >= began + hidden) {
      const auto type = co_await gateway.read_u32(0x1000, 0);
      heard = type.has_value();
    }
    if (!heard) co_await rt::sleep_for(look_pause / 4);  // one question
  }
}

// `first` is what the master has.
rt::Task<Result<void>> let_in(rt::Executor& executor, co::SdoAccess& master, NodeId own, const manager::Wanted& first,
                              const manager::Wanted& whole, const std::vector<NodeId>& gateways) {
  manager::Wanted change = whole;
  std::erase_if(change.entries, [&](const manager::Entry& entry) {
    const auto had = std::ranges::find(first.entries, entry.object, &manager::Entry::object);
    return had != first.entries.end() && had->bytes == entry.bytes;
  });
  bool changed = false;
  auto done = co_await bring(master, change, changed);
  for (std::size_t i = 0; i < gateways.size() && done; ++i) {
    const NodeId node = gateways[i];
    done = co_await command_by(master, node, co::NmtCommand::reset_communication);
  }
  if (!done) co_return done;
  constexpr auto in_time = std::chrono::seconds(5);
  for (const rt::Time deadline = executor.now() + in_time; executor.now() < deadline;) {
    const bool run = co_await all_run(master, gateways);
    if (run) co_return done;
    co_await rt::sleep_for(look_pause / 4);  // one question
  }
  // A master that reads its list at its own boot-up only.
  co_return co_await reset_by(master, own);
}

std::vector<NodeId> gateways_of(const std::vector<Beneath::Deeper>& all) {
  std::vector<NodeId> nodes;
  for (const auto& deeper : all) {
    const NodeId node = deeper.gateway.slot;
    if (std::ranges::find(nodes, node) == nodes.end()) nodes.push_back(node);
  }
  return nodes;
}

rt::Task<void> bring_up_deeper(const Beneath::Deeper& deeper, std::optional<Error>& failed) {
  auto task = deeper.bring_up();
  const auto done = co_await task;
  if (!done && deeper.gateway.mandatory && !failed) failed = done.error();
}

rt::Task<Result<void>> bring_up_all(rt::Executor& executor, const std::vector<Beneath::Deeper>& all) {
  std::optional<Error> failed;
  {
    rt::Scope side_by_side(executor);
    for (const auto& deeper : all) side_by_side.spawn(bring_up_deeper(deeper, failed));
    co_await side_by_side.join();
  }
  if (failed) co_return fail(*failed);
  co_return Result<void>{};
}

}  // namespace

Way way_to(const design::Machine& machine, const std::string& bus) {
  Way way{bus};
  const design::Bus* at = machine.bus(bus);
  while (at != nullptr && !at->own_port && at->gateway) {
    way.gateways.insert(way.gateways.begin(), {at->gateway->slot, at->gateway->port});
    way.bus = at->gateway->bus;
    at = machine.bus(way.bus);
  }
  return way;
}

const design::Bus* bus_at(const design::Machine& machine, const Way& way) noexcept {
  const design::Bus* at = machine.bus(way.bus);
  for (const auto& hop : way.gateways) {
    if (at != nullptr) at = machine.bus_beneath(*at, hop.gateway.value(), hop.port);
  }
  return at;
}

Beneath::Beneath(rt::Executor& executor, const design::Bus& bus, Way way, std::vector<places::SlotSpec> slots,
                 const SlotSettings& settings, multilevel::Routes& routes, NetworkObserver observer)
    : executor_(executor),
      bus_(bus),
      way_(std::move(way)),
      settings_(settings),
      routes_(routes),
      events_(executor, bus.name, std::move(observer)),
      wakes_(executor),
      scope_(executor) {
  std::ranges::sort(slots, {}, &places::SlotSpec::id);
  for (auto& spec : slots) {
    Place place;
    place.now.bus = bus_.name;
    place.now.id = spec.id;
    place.now.name = spec.name.name;
    place.now.type = spec.type;
    place.spec = std::move(spec);
    places_.push_back(std::move(place));
  }
}

void Beneath::start() {
  if (scope_.running() == 0) scope_.spawn(watch());
}

void Beneath::stop() noexcept { scope_.cancel(); }

Beneath::Place* Beneath::at(NodeId node) noexcept {
  const auto it = std::ranges::find(places_, node, [](const Place& p) { return p.spec.id; });
  return it == places_.end() ? nullptr : &*it;
}

std::vector<SlotReport> Beneath::report() const {
  std::vector<SlotReport> slots;
  for (const auto& place : places_) slots.push_back(place.now);
  return slots;
}

bool Beneath::operational() const noexcept {
  return std::ranges::all_of(places_,
                             [](const Place& p) { return p.spec.optional || p.now.state == SlotState::operational; });
}

void Beneath::set_state(Place& place, SlotState state, std::string reason) {
  if (place.now.state == state && place.now.reason == reason) return;
  if (place.now.state != state) place.now.since = executor_.now();
  place.now.state = state;
  place.now.reason = std::move(reason);
  events_.tell(
      EventKind::state, place.now.name,
      place.now.reason.empty() ? places::name(state) : fmt::format("{}: {}", places::name(state), place.now.reason));
  const bool all = operational();
  if (all && !std::exchange(was_operational_, all) && operational_call_) operational_call_();
  was_operational_ = all;
}

// ---- bringing it up

manager::Wanted Beneath::list(std::span<const NodeId> held_back) {
  std::vector<places::SlotSpec> slots;
  for (const auto& place : places_) slots.push_back(place.spec);
  Findings findings;
  auto made = network_list(bus_, slots, held_back, settings_, findings);
  for (const auto& finding : findings) {
    if (finding.severity == Finding::Severity::error) events_.tell_once(EventKind::error, to_string(finding));
  }
  return made;
}

// The gateway's master counts what is written from its next boot-up on. A list that is there and of which nodes are
// missing may have been written by a Berth that ended before that: then the master is reset too, once.
rt::Task<Result<void>> Beneath::put_list(const manager::Wanted& list, std::vector<NodeId> nodes) {
  co::SdoAccess& master = access(bus_.master);
  bool changed = false;
  auto put = co_await bring_whole(master, bus_.master, list, changed);
  if (!put) co_return put;
  if (!changed) {
    if (was_reset_) co_return Result<void>{};
    const bool in_use = co_await has_all(master, nodes);
    if (in_use) co_return Result<void>{};
    was_reset_ = true;
    // What is there may be unsaved: it is brought in again as if its date were another.
    put = co_await master.write_u32(configuration_date, 1, 0);
    if (put) put = co_await bring_whole(master, bus_.master, list, changed);
    if (!put) co_return put;
    events_.tell(EventKind::step, "", "its gateway boots it again: it misses nodes of its network list");
  } else {
    events_.tell(EventKind::step, "", "its gateway has a new network list");
  }
  // Who is reset is itself: its bus boots behind it.
  co_return co_await reset_by(master, bus_.master);
}

rt::Task<Result<void>> Beneath::bring_up() {
  brings_up_ = true;
  up_ = true;
  has_list_ = false;
  const manager::Wanted whole = list();
  co::SdoAccess& master = access(bus_.master);
  const bool has_it = co_await has_list(master, whole);
  std::vector<NodeId> nodes;
  for (const auto& place : places_) {
    if (!place.spec.optional) nodes.push_back(place.spec.id);
  }
  const bool in_steps = !has_it && !deeper_.empty();
  auto task = in_steps ? with_deeper(whole) : put_list(whole, std::move(nodes));
  auto done = co_await task;
  has_list_ = done.has_value();
  again_at_ = executor_.now() + patience;
  if (done) done = co_await await_operational();
  if (done && has_it) done = co_await bring_up_all(executor_, deeper_);
  brings_up_ = false;
  if (!done && done.error().code == Errc::timeout) gateway_is_silent(done.error());
  co_return done;
}

// The gateways on it get their node-IDs with the others and are not booted, so that the buses beneath them come first.
rt::Task<Result<void>> Beneath::with_deeper(const manager::Wanted& whole) {
  const std::vector<NodeId> gateways = gateways_of(deeper_);
  co::SdoAccess& master = access(bus_.master);
  const manager::Wanted first = list(gateways);
  auto done = co_await put_list(first, gateways);
  if (!done) co_return done;
  for (std::size_t i = 0; i < gateways.size(); ++i) {
    const NodeId node = gateways[i];
    co_await await_heard(executor_, master, access(node), node);
  }
  done = co_await bring_up_all(executor_, deeper_);
  if (!done) co_return done;
  co_return co_await let_in(executor_, master, bus_.master, first, whole, gateways);
}

rt::Task<Result<void>> Beneath::await_operational() {
  const rt::Duration boot_time = bus_.startup.boot_time;
  const rt::Time deadline = executor_.now() + (boot_time.count() > 0 ? boot_time : patience);
  for (bool over = false; !over;) {
    over = executor_.now() >= deadline;
    unsigned silent = 0;
    for (auto& place : places_) {
      if (place.now.state == SlotState::operational) continue;
      const auto looked = co_await look_at(place, over);
      if (!looked && ++silent > 2) break;
    }
    if (operational()) co_return Result<void>{};
    if (!over) co_await rt::sleep_for(look_pause);
  }
  const auto missing = std::ranges::find_if(
      places_, [](const Place& p) { return !p.spec.optional && p.now.state != SlotState::operational; });
  co_return fail(Error{.code = Errc::mismatch,
                       .node = missing->spec.id.value(),
                       .text = "a bus beneath it is not operational: its slots say why"});
}

// ---- watching it

// One slot after the other, and at once the one of which the gateway has told something.
rt::Task<void> Beneath::watch() {
  const rt::Duration period = std::max<rt::Duration>(bus_.timing.heartbeat_period, look_pause);
  for (;;) {
    const rt::Time deadline = executor_.now() + period;
    const auto wake = co_await wakes_.next(deadline);
    if (brings_up_ || places_.empty()) continue;
    const bool runs = gateway_runs_ && gateway_runs_();
    if (runs && !silence_.ran) silence_.rest_until = {};
    silence_.ran = runs;
    if (up_ && !has_list_ && executor_.now() >= again_at_) {
      const auto done = co_await bring_up();
      again_at_ = executor_.now() + (done ? rt::Duration(0) : patience);
    } else if (up_) {
      const bool rests = !wake && executor_.now() < silence_.rest_until;
      if (rests) continue;
      const auto told = wake;
      const rt::Time began = executor_.now();
      const bool heard = co_await look_around(told);
      // Who asks a gateway in vain holds up all others that ask through the same ones above it.
      if (!heard) silence_.rest_until = executor_.now() + 3 * (executor_.now() - began);
    } else if (runs) {
      co_await adopt();
    }
  }
}

// The one that the gateway has told of; else the next, and all that do not run or are not known. False: it does not
// answer.
rt::Task<bool> Beneath::look_around(std::optional<NodeId> told) {
  std::vector<Place*> looked_at;
  if (told) {
    looked_at.push_back(at(*told));
  } else {
    looked_at.push_back(&places_[next_++ % places_.size()]);
    for (auto& place : places_) {
      const bool open = place.now.state != SlotState::operational || !place.identified;
      if (open && &place != looked_at.front()) looked_at.push_back(&place);
    }
  }
  for (Place* const place : looked_at) {
    if (place == nullptr) continue;
    const auto looked = co_await look_at(*place, true);
    silence_.failures = looked ? 0 : silence_.failures + 1;
    constexpr unsigned most = 3;
    if (looked || (looked.error().code != Errc::timeout && silence_.failures < most)) continue;
    gateway_is_silent(looked.error());
    co_return false;
  }
  const rt::Time now = executor_.now();
  const std::string surplus = co_await trouble_.surplus(access(bus_.master), now);
  if (!surplus.empty()) events_.tell(EventKind::surplus, "", surplus);
  co_return true;
}

// What runs is not disturbed: another list than the machine file's is told, no more. But a Berth that ended in the
// middle leaves a list that nobody but the next brings into use, or one without its gateways, which nobody else lets
// in.
rt::Task<void> Beneath::adopt() {
  const manager::Wanted whole = list();
  co::SdoAccess& master = access(bus_.master);
  const bool has_it = co_await has_list(master, whole);
  const char* unfinished = nullptr;
  if (has_it) {
    const bool used = co_await has_any(master, places_);
    if (!used) unfinished = "its gateway has no node of its network list";
  } else if (!deeper_.empty()) {
    const manager::Wanted first = list(gateways_of(deeper_));
    const bool begun = co_await has_list(master, first);
    if (begun) unfinished = "its gateway's network list is without the gateways on it";
  }
  if (unfinished != nullptr) {
    events_.tell(EventKind::step, "", fmt::format("finishing what an earlier run began: {}", unfinished));
    again_at_ = executor_.now();
    up_ = true;
    co_return;
  }
  if (!has_it) {
    events_.tell_once(
        EventKind::error,
        "its gateway runs with another network list than this machine file's: it gets the new one when the "
        "gateway boots");
  }
  up_ = has_list_ = true;
}

rt::Task<Result<void>> Beneath::look_at(Place& place, bool settled) {
  co::SdoAccess& master = access(bus_.master);
  auto state = co_await state_by(master, place.spec.id, place.losses);
  const bool asks = state && *state == static_cast<std::uint8_t>(NmtState::operational) && !place.identified;
  if (asks) {
    const bool answers = co_await identify(place);
    // What it was before the questions that it left unanswered is old.
    if (!answers) state = co_await state_by(master, place.spec.id, place.losses);
  }
  if (!state) co_return fail(state.error());
  if (!*state) co_return Result<void>{};
  switch (**state) {
    case static_cast<std::uint8_t>(NmtState::operational): set_state(place, SlotState::operational); break;
    case static_cast<std::uint8_t>(NmtState::stopped): set_state(place, SlotState::present, "stopped"); break;
    case static_cast<std::uint8_t>(NmtState::pre_operational):
      set_state(place, SlotState::present);
      if (has_list_ && place.left_lying(executor_.now())) {
        place.booted_again = executor_.now();
        events_.tell(EventKind::step, place.now.name, "was not started by its gateway's master: it is reset");
        co_return co_await reset_by(master, place.spec.id);
      }
      break;
    default:
      if (settled) co_await tell_missing(place);
  }
  co_return Result<void>{};
}

// Its master may know more than that it misses it.
rt::Task<void> Beneath::tell_missing(Place& place) {
  const std::string path = to_string(multilevel::Path{way_.gateways, bus_.master});
  const unsigned losses = place.losses;
  const NodeId node = place.spec.id;
  co::SdoAccess& master = access(bus_.master);
  const auto told = co_await trouble_.of(master, node, path);
  if (place.losses != losses) co_return;
  place.identified = false;
  if (told) {
    if (told->is_news || place.now.state != told->state) set_state(place, told->state, told->reason);
  } else if (!place.now.device) {
    set_state(place, SlotState::empty, "no device of its type was found");
  } else if (place.now.state != SlotState::absent) {
    set_state(place, SlotState::absent, "the gateway's master misses it");
  }
}

// Nothing waits for it, and what the buses above need goes through the same gateways: they come first. False: it was
// asked and does not answer, or was lost meanwhile.
rt::Task<bool> Beneath::identify(Place& place) {
  constexpr auto in_any_case = std::chrono::seconds(3);
  const bool started = gateway_runs_ && gateway_runs_();
  const bool late = executor_.now() - place.now.since > in_any_case;
  if (brings_up_ || !(started || late)) co_return true;
  const unsigned losses = place.losses;
  LssAddress device;
  co::SdoAccess& node = access(place.spec.id);
  const auto known = co_await read_address(node, device);
  if (!known || place.losses != losses) co_return false;
  place.identified = true;
  if (place.now.device == device) co_return true;
  place.now.device = device;
  events_.tell(EventKind::bound, place.now.name, fmt::format("its gateway's master gave it to {}", to_string(device)));
  co_return true;
}

rt::Task<Result<std::vector<Seen>>> Beneath::scan() {
  std::vector<Seen> all;
  co::SdoAccess& master = access(bus_.master);
  for (const auto& place : places_) {
    const NodeId node = place.spec.id;
    const auto state = co_await state_by(master, node);
    if (!state) co_return fail(state.error());
    if (*state <= missing) continue;
    Seen seen;
    seen.id = node;
    seen.slot = place.spec.name.name;
    seen.state = static_cast<NmtState>(*state);
    co::SdoAccess& device = access(node);
    const auto type = co_await device.read_u32(0x1000, 0);
    if (type) seen.device_type = *type;
    LssAddress address;
    const auto known = co_await read_address(device, address);
    if (known) seen.device = address;
    all.push_back(seen);
  }
  co_return all;
}

void Beneath::gateway_is_silent(const Error& error) {
  const multilevel::Hop last = way_.gateways.back();
  for (auto& place : places_) {
    place.identified = false;
    if (place.now.state == SlotState::absent) continue;
    set_state(place, SlotState::absent,
              fmt::format("gateway {} above does not {}: {}", last.gateway.value(),
                          error.code == Errc::unsupported ? "reach this bus" : "answer", error.text));
  }
}

void Beneath::heard(NodeId node, const multilevel::LoggedEmcy& entry) {
  Place* const place = at(node);
  const auto& reading = entry.reading;
  const bool lost = reading.code == heartbeat_lost;
  if (place != nullptr && lost) ++place->losses;
  if (place != nullptr && lost && up_) {
    set_state(*place, SlotState::absent, "its heartbeat stopped: the gateway told it (EMCY 8130h)");
    place->identified = false;
  } else if (!lost && reading.exiting != heartbeat_lost) {
    const auto words = [](std::uint16_t code, std::uint16_t) {
      const char* const own = multilevel::gateway_code_text(code);
      return own != nullptr ? own : co::emcy_text(code);
    };
    events_.tell(EventKind::error, place == nullptr ? "" : place->now.name, "EMCY " + multilevel::text(entry, words));
  }
  if (place != nullptr && !lost) wakes_.push(node);
}

}  // namespace berth::operate
