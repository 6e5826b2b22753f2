#include "berth/manager/node_id_assigner.hpp"

#include <algorithm>

#include "berth/co/guarding.hpp"
#include "berth/places/identity.hpp"
#include "berth/places/inquiry.hpp"
#include "berth/rt/scope.hpp"

namespace berth::manager {
namespace {

constexpr unsigned seldom = 8;      // runs
constexpr unsigned most_tries = 3;  // to separate two devices under one node-ID; after that rarely

// Blank equals that answered at different moments cannot be distinguished, by LSS or otherwise. If some equals have
// node-IDs, the answers may be theirs.
bool are_blank_equals(const ListFound& found, const places::Found& f) {
  return f.clone && !f.active.configured() && !f.device.has_serial() && !found.has_equals(f.device);
}

bool equals_wait(const ListFound& found, const ListSlot& slot) {
  return std::ranges::any_of(found, [&](const places::Found& f) {
    return are_blank_equals(found, f) && places::fits(slot.slot.spec, f.device);
  });
}

}  // namespace

NodeIdAssigner::NodeIdAssigner(const ListServices& services)
    : bus_(services),
      search_(bus_),
      seating_(bus_),
      report_(services.values, [this](NodeId node) { return forget(node); }) {}

void NodeIdAssigner::begin(NodeId own) noexcept {
  bus_.begin(own);
  seating_.begin();
  report_.begin();
  answered_.reset();
  doubled_.reset();
  tries_ = {};
  asked_at_ = former_asked_ = {};
  for (std::uint8_t node = 1; node <= 127; ++node) surplus_[node] = bus_.services().sdo.surplus(NodeId(node));
  runs_ = 0;
}

rt::Task<Result<void>> NodeIdAssigner::run(std::bitset<128> there) {
  answered_.reset();
  silent_.reset();
  bus_.read_list(there);
  if (bus_.slots.empty()) co_return Result<void>{};
  if (!bus_.nobody_listens) {
    const auto opened = co_await open();
    if (!opened) co_return opened;
    bus_.nobody_listens = true;
  }
  note_doubles();
  co_await ask_all();
  co_await look_for_formers();
  for (auto& slot : bus_.slots) {
    if (slot.fixed() && slot.there) seating_.take_where_it_is(slot, doubled_[slot.id().value()]);
    settle(slot);
  }
  if (!bus_.found.empty()) co_await seating_.carry_out();
  const auto searched = co_await search();
  if (!searched) bus_.nobody_listens = false;
  tell();
  ++runs_;
  co_return searched;
}

// A master that was reset during a binding may have left one device in LSS configuration with a node-ID pending, which
// the next `04 00` would activate. A listening device gives it up first (berth/places/binding.hpp).
rt::Task<Result<void>> NodeIdAssigner::open() {
  const bool intends =
      std::ranges::any_of(bus_.slots, [](const ListSlot& slot) { return slot.slot.record.intended.has_value(); });
  const bool unfinished = intends || !bus_.formers().empty();
  if (unfinished) {
    bus_.stores_end = bus_.executor().now() + bus_.lss().options().store.timeout;
    const lss::ServiceOptions once{.timeout = ListBus::timeout, .retries = 0, .full_window = false};
    const NodeId none;
    const auto reverted = co_await bus_.lss().configure_node_id(none, once);
    if (!reverted && reverted.error().code == Errc::bus) co_return fail(reverted.error());
  }
  const auto quiet = co_await bus_.lss().switch_global(lss::State::waiting);
  if (!quiet) co_return fail(quiet.error());
  // A single receive buffer would lose the frame after `04 00`.
  co_await rt::sleep_for(ListBus::pause);
  if (!unfinished) co_return Result<void>{};
  // A device that keeps its node-ID pending, as Lely core's slaves do, would be silent until the next reset of all.
  places::wake_unconfigured(bus_.services().dispatcher);
  co_await rt::sleep_for(ListBus::pause);
  co_return Result<void>{};
}

// ---- which devices are there ----------------------------------------------------------------------------------------

bool NodeIdAssigner::booted_since_asked(NodeId node) const noexcept {
  const auto booted = bus_.boots().boot_up(node);
  return booted && *booted > asked_at_[node.value()];
}

// Asks slaves that the master does not know to be there, devices that booted since and may be different ones, and
// devices with a node-ID that is not in the list.
rt::Task<void> NodeIdAssigner::ask_all() {
  rt::Scope asked(bus_.executor());
  for (auto& slot : bus_.slots) {
    const bool doubtful = doubled_[slot.id().value()] || bus_.given_up[slot.id().value()];
    const bool asks = !slot.there || slot.free() || doubtful || booted_since_asked(slot.id());
    if (asks) asked.spawn(ask(slot));
  }
  for (std::uint8_t number = 1; number <= 127; ++number) {
    const NodeId node(number);
    const bool strange = node != bus_.own() && bus_.at(node) == nullptr && booted_since_asked(node);
    if (strange) asked.spawn(ask_stranger(node));
  }
  co_await asked.join();
}

rt::Task<Result<Identity>> NodeIdAssigner::identity_of(NodeId node) {
  auto who = co_await places::read_identity(bus_.services().sdo, node, bus_.patience());
  if (who) who = bus_.found.known_as({*who, node});
  co_return who;
}

rt::Task<void> NodeIdAssigner::guard(ListSlot& slot) {
  const auto answer = co_await co::guard_once(bus_.services().dispatcher, slot.id(), ListBus::timeout, 1);
  slot.guarded = answer.has_value();
}

rt::Task<void> NodeIdAssigner::ask(ListSlot& slot) {
  const NodeId node = slot.id();
  const rt::Time began = bus_.executor().now();
  asked_at_[node.value()] = began;
  const auto surplus = bus_.services().sdo.surplus(node);
  const auto device = co_await identity_of(node);
  if (device) slot.device = *device;
  if (device) answered_.set(node.value());
  if (device && bus_.given_up[node.value()]) co_await boot_who_stayed(node);
  const bool silent = !device && (device.error().code == Errc::timeout || device.error().code == Errc::bus);
  // Only then: the master's heartbeat consumer takes the answer for a heartbeat, and would wait for the next one.
  const bool guards = silent && !slot.there;
  if (guards) co_await guard(slot);
  if (silent && !slot.guarded && !slot.there) {
    bus_.vacancy()[node.value()] = began;
    silent_.set(node.value());
  }
  slot.there = slot.there || !silent || slot.guarded;
  const auto& record = slot.slot.record;
  const bool comes = device && (!record.confirmed || record.intended || record.confirmed->device != *device);
  if (!doubled_[node.value()] && !comes) co_return;
  co_await rt::sleep_for(places::second_answer);
  if (bus_.services().sdo.surplus(node) != surplus) {
    if (doubled_[node.value()]) co_return;
    // Asked again before it is taken as the slot's device: the answer may be another device's.
    const auto again = co_await places::identify(bus_.services().sdo, node, places::second_answer);
    if (again.by_two) doubled_.set(node.value());
    if (again.who) slot.device = bus_.found.known_as({*again.who, node});
    co_return;
  }
  doubled_.reset(node.value());  // one of them is gone
  tries_[node.value()] = 0;
}

rt::Task<void> NodeIdAssigner::ask_stranger(NodeId node) {
  asked_at_[node.value()] = bus_.executor().now();
  const auto surplus = bus_.services().sdo.surplus(node);
  const auto device = co_await identity_of(node);
  co_await rt::sleep_for(places::second_answer);
  if (bus_.services().sdo.surplus(node) != surplus) doubled_.set(node.value());
  if (device && !doubled_[node.value()]) bus_.found.note({*device, node});
}

// One device gave this node-ID up, and another answers under it. Frames that both sent at once may have driven the
// second one bus-off for a while. It then returned in NMT state pre-operational (1029h), without a boot-up message, and
// missed the reset by which the first one left.
rt::Task<void> NodeIdAssigner::boot_who_stayed(NodeId node) {
  bus_.given_up.reset(node.value());
  const bool lies = bus_.boots().state(node) == NmtState::pre_operational && !bus_.boots().boot_up(node);
  if (!lies) co_return;
  const auto sent = co_await bus_.services().nmt.send(co::NmtCommand::reset_communication, node);
  static_cast<void>(sent);
}

// Second answers to one SDO request, from any client.
void NodeIdAssigner::note_doubles() {
  for (std::uint8_t number = 1; number <= 127; ++number) {
    const auto now = bus_.services().sdo.surplus(NodeId(number));
    if (now != surplus_[number]) doubled_.set(number);
    surplus_[number] = now;
  }
}

// A device whose node-ID was given away returns under it: a boot-up message, and perhaps two answers to one request.
rt::Task<void> NodeIdAssigner::look_for_formers() {
  places::Inquiry inquiry(bus_.binder_services());
  const auto formers = bus_.formers();
  std::bitset<128> due;
  for (const auto& former : formers) {
    if (!former.id.configured()) continue;
    const std::uint8_t node = former.id.value();
    const auto booted = bus_.boots().boot_up(former.id);
    const bool came = booted && *booted > former_asked_[node];
    if (came || doubled_[node]) due.set(node);
  }
  for (std::size_t node = 1; node < due.size(); ++node) {
    if (due[node]) former_asked_[node] = bus_.executor().now();
  }
  for (const auto& each : formers) {
    const Identity device = each.device;
    const bool asks = each.id.configured() && due[each.id.value()] && bus_.found.find(device) == nullptr &&
                      bus_.found.can_be_selected(device);
    if (!asks) continue;
    const bool whole = false;
    const auto id = co_await inquiry.active_id_once(device.address, whole);
    const bool clone = !id && id.error().code == Errc::duplicate;
    if (id || clone) bus_.found.note({device, id ? *id : NodeId(), clone});
    // Without a node-ID it has another identity.
    const bool without = id && !id->configured() && !device.has_serial();
    if (!without) continue;
    const auto ended = bus_.store().confirm_blank(each.who(), "it came without a node-ID");
    static_cast<void>(ended);
  }
}

// The device that answers under the node-ID, and is not confirmed there: the plan decides about it.
void NodeIdAssigner::settle(ListSlot& slot) {
  if (slot.there) seating_.seen(slot.id());
  if (!slot.device || bus_.found.find(*slot.device) != nullptr) return;
  const auto& record = slot.slot.record;
  const bool its_own = record.confirmed && !record.intended && record.confirmed->device == *slot.device;
  if (its_own) return;
  places::Found found{*slot.device, slot.id()};
  found.shared = doubled_[slot.id().value()];
  bus_.found.note(found);
}

// ---- which slaves are missing ---------------------------------------------------------------------------------------

bool NodeIdAssigner::is_one_missing() const noexcept { return std::ranges::any_of(bus_.slots, &ListSlot::missing); }

// LSS separates two devices under one node-ID, among all that have a node-ID.
bool NodeIdAssigner::tells_apart() {
  bool any = false;
  for (std::uint8_t node = 1; node <= 127; ++node) {
    const bool tries = doubled_[node] && (tries_[node] < most_tries || runs_ % seldom == 0);
    if (tries) ++tries_[node];
    any = any || tries;
  }
  return any;
}

rt::Task<Result<void>> NodeIdAssigner::search() {
  const bool apart = tells_apart();
  const bool missing = is_one_missing();
  if (!apart && !missing) co_return co_await look_for_surplus();
  co_await recall_surplus();
  const auto by_rand = co_await search_.by_rand();
  if (!by_rand) co_return by_rand;
  co_await seating_.carry_out();
  if (is_one_missing()) {
    const auto by_lss = co_await search_.by_lss(NodeIdSearch::Whom::missing);
    if (!by_lss) co_return by_lss;
    co_await seating_.carry_out();
  }
  const bool rare = runs_ % seldom == 1 && is_one_missing();
  if (apart || rare) {
    const auto all = co_await search_.by_lss(NodeIdSearch::Whom::configured);
    if (!all) co_return all;
    co_await seating_.carry_out();
  }
  co_return co_await search_.release_found();
}

// A device without a place is reported, even if no slave is missing.
rt::Task<Result<void>> NodeIdAssigner::look_for_surplus() {
  if (runs_ % seldom != 0 || runs_ == 0) co_return Result<void>{};
  co_await recall_surplus();
  const auto anybody = co_await search_.anybody();
  if (!anybody) co_return fail(anybody.error());
  if (*anybody) {
    const auto by_rand = co_await search_.by_rand();
    if (!by_rand) co_return by_rand;
    const auto by_lss = co_await search_.by_lss(NodeIdSearch::Whom::all_blank);
    if (!by_lss) co_return by_lss;
  }
  co_await seating_.carry_out();
  co_return co_await search_.release_found();
}

// A device without a place that has its own node-ID: no search finds it quickly.
rt::Task<void> NodeIdAssigner::recall_surplus() {
  rt::Scope asked(bus_.executor());
  const std::vector<places::Found> surplus = seating_.without_place();
  for (const auto& f : surplus) {
    const bool known = !f.active.configured() || bus_.at(f.active) != nullptr || bus_.found.find(f.device) != nullptr;
    if (!known) asked.spawn(recall(f));
  }
  co_await asked.join();
}

rt::Task<void> NodeIdAssigner::recall(places::Found device) {
  const auto now = co_await identity_of(device.active);
  if (now && *now == device.device) bus_.found.note(device);
}

// ---- reports --------------------------------------------------------------------------------------------------------

// Two devices answer to its LSS address, wherever they are.
bool NodeIdAssigner::is_clone(const std::optional<Identity>& device) {
  const auto* const found = device ? bus_.found.find(*device) : nullptr;
  return found != nullptr && found->clone;
}

// A binding's report of another device under the slot's node-ID is outdated when nothing answers there.
void NodeIdAssigner::tell() {
  for (const auto& slot : bus_.slots) {
    const auto& record = slot.slot.record;
    NodeIdTrouble trouble = slot.trouble;
    std::optional<Identity> about = record.device();
    const bool strange = slot.there && slot.typed && slot.device && record.device() != slot.device;
    // A device that left in this run is asked about in the next one.
    if (doubled_[slot.id().value()] && !bus_.given_up[slot.id().value()]) {
      trouble = NodeIdTrouble::doubled;
    } else if (strange) {
      trouble = NodeIdTrouble::stranger;
      about = slot.device;
    } else if (slot.there || !slot.typed) {
      trouble = slot.trouble == NodeIdTrouble::doubled ? slot.trouble : NodeIdTrouble::none;
    } else if (trouble == NodeIdTrouble::none || (trouble == NodeIdTrouble::doubled && !is_clone(about))) {
      trouble = record.intended ? NodeIdTrouble::kept : record.confirmed ? NodeIdTrouble::lost : NodeIdTrouble::nobody;
      if (equals_wait(bus_.found, slot) && !record.intended) trouble = NodeIdTrouble::equals;
    }
    const bool tells_who = trouble != NodeIdTrouble::none && about.has_value();
    report_.tell(slot.id(), trouble, tells_who ? about->address.serial : 0);
  }
  std::vector<Identity> surplus;
  for (const auto& f : seating_.without_place()) {
    const bool is_told = std::ranges::any_of(bus_.slots, [&](const ListSlot& slot) {
      return are_blank_equals(bus_.found, f) && slot.missing() && places::fits(slot.slot.spec, f.device);
    });
    if (!is_told) surplus.push_back(f.device);
  }
  report_.tell_surplus(surplus);
}

bool NodeIdAssigner::forget(NodeId node) {
  const auto slot = ListStore::slot_of(node);
  places::SlotStore& store = bus_.store();
  const auto record = store.load(slot);
  if (!record || !record->intended) return false;
  return store.clear(slot, places::by_a_person).has_value();
}

}  // namespace berth::manager
