#include "berth/operate/scan.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"
#include "berth/co/guarding.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

namespace {

constexpr can::IdRange of_one_node{0x081, 0x77F};  // of the predefined connection set
constexpr can::IdRange of_pdos{0x181, 0x57F};

// The nodes seen on a bus without asking: those that send, and those that another SDO client asks. Own frames are not
// received.
class Listening final : private can::Handler {
 public:
  explicit Listening(can::Dispatcher& dispatcher) { dispatcher.add(of_one_node, *this); }
  std::bitset<128> heard;
  std::bitset<128> asked;  // by another client

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    const auto key = frame.key();
    const auto id = key & 0x7FU;
    if (id == 0) return;
    const bool request = co::all_sdo_requests.contains(key) && !frame.remote;
    if (request) asked.set(id);
    const bool speaks = co::all_emcy.contains(key) || of_pdos.contains(key) || co::all_sdo_responses.contains(key) ||
                        co::all_error_control.contains(key);
    if (request || speaks) heard.set(id);
  }
};

}  // namespace

// ---- one node ----

rt::Task<void> Scan::ask(NodeId id, Seen& seen, ScanRange range) {
  co::SdoOptions patience = p_.asking.first_patience();
  patience.retries = 1;
  seen.id = id;
  const auto type = co_await p_.bus.sdo.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (type) seen.device_type = *type;
  const bool answered = type || type.error().code == Errc::aborted || type.error().code == Errc::mismatch;
  if (answered) {
    const auto answer = co_await places::identify(p_.bus.sdo, id);
    if (answer.who) seen.device = *answer.who;
    seen.duplicate = answer.by_two;
  }
  // A stopped device has no SDO (CiA 301 §7.3.2.2): one that answers has left that state since it was heard.
  const bool was_stopped = answered && p_.bus.boots.heard(id) && p_.bus.boots.state(id) == NmtState::stopped;
  const bool guards = was_stopped || (!answered && range == ScanRange::all);
  if (guards) {
    const auto guarded = co_await co::guard_once(p_.bus.dispatcher, id, p_.bus.bus.timing.guard_timeout, 1);
    if (guarded) seen.state = guarded->state;
    if (guarded || was_stopped) co_return;
  }
  tell_state(seen, range);
}

void Scan::tell_state(Seen& seen, ScanRange range) const {
  const auto heard = p_.bus.boots.heard(seen.id);
  const rt::Duration timeout = p_.bus.bus.timing.heartbeat_timeout;
  const rt::Duration fresh = range == ScanRange::all ? timeout : std::max<rt::Duration>(timeout, listens);
  const bool lately = heard && p_.bus.executor.now() - *heard < fresh;
  if (lately) seen.state = p_.bus.boots.state(seen.id);
  // After its boot-up message a device is pre-operational (CiA 301 §7.3.2.2.2).
  if (seen.state == NmtState::initialising) seen.state = NmtState::pre_operational;
}

rt::Task<void> Scan::ask_nodes(std::vector<Seen>& nodes, std::bitset<128> ids, ScanRange range) {
  // Of all node-IDs most are silent; those that were heard answer, beside the traffic of a plant.
  const bool every = range == ScanRange::all;
  rt::Scope asked(p_.bus.executor, every ? p_.asking.most_first_at_once() : p_.asking.most_at_once());
  for (std::uint8_t i = 1; i <= 127; ++i) {
    const NodeId id(i);
    if (ids.test(i) && id != p_.bus.bus.master) asked.spawn(ask(id, nodes[i - 1U], range));
  }
  co_await asked.join();
}

void Scan::name_slots(std::vector<Seen>& nodes) const {
  std::erase_if(nodes, [](const Seen& s) { return !s.device_type && !s.device && !s.state && !s.left_alone; });
  for (auto& s : nodes) {
    const Seat* seat = s.device ? p_.slots.of(*s.device) : nullptr;
    if (seat != nullptr) s.slot = seat->name();
  }
}

// ---- the bus ----

rt::Task<Result<std::vector<Seen>>> Scan::run(ScanRange range) {
  if (range == ScanRange::heard) co_return co_await ask_who_was_heard();
  co_return co_await ask_everybody();
}

// SDO to one node needs no turn: it does not wait for a long search.
rt::Task<Result<std::vector<Seen>>> Scan::ask_who_was_heard() {
  const Listening listening(p_.bus.dispatcher);
  co_await rt::sleep_for(listens);
  std::bitset<128> ids = listening.heard;
  for (std::uint8_t i = 1; i <= 127; ++i) {
    if (p_.bus.boots.heard(NodeId(i))) ids.set(i);
  }
  // A device without a heartbeat is known by its slot.
  for (const auto& seat : p_.slots.seats()) {
    if (seat->there()) ids.set(seat->id().value());
  }
  std::vector<Seen> nodes(127);
  co_await ask_nodes(nodes, ids & ~listening.asked, ScanRange::heard);
  // Two clients in the one default channel of a node break each other's transfers.
  for (std::uint8_t i = 1; i <= 127; ++i) {
    if (!listening.asked.test(i) || NodeId(i) == p_.bus.bus.master) continue;
    nodes[i - 1U].id = NodeId(i);
    nodes[i - 1U].left_alone = true;
    tell_state(nodes[i - 1U], ScanRange::heard);
  }
  name_slots(nodes);
  co_return nodes;
}

rt::Task<Result<std::vector<Seen>>> Scan::ask_everybody() {
  co_await p_.bus.turn.take();
  const rt::Held held(p_.bus.turn);
  std::vector<Seen> nodes(127);
  const auto every = ~std::bitset<128>();
  co_await ask_nodes(nodes, every, ScanRange::all);
  std::erase_if(nodes, [](const Seen& s) { return !s.device_type && !s.device && !s.state; });
  const auto found = co_await p_.finding.search.find_new();
  if (!found) co_return fail(found.error());
  for (const auto& d : found->found) co_await add(d, nodes);
  name_slots(nodes);
  co_return nodes;
}

// A device found by a search beside the nodes that answered SDO.
rt::Task<void> Scan::add(discovery::Found d, std::vector<Seen>& nodes) {
  const Identity device(d.address);
  const auto known = std::ranges::find_if(nodes, [&](const Seen& s) { return s.device == device; });
  if (known != nodes.end()) {
    known->duplicate = known->duplicate || d.possible_clone;
    co_return;
  }
  Seen seen;
  const auto id = co_await p_.asking.active_id(d.address);
  if (id) seen.id = *id;
  seen.device = d.address;
  seen.duplicate = d.possible_clone;
  const auto under = std::ranges::find(nodes, seen.id, &Seen::id);
  const bool shares = seen.id.configured() && under != nodes.end();
  // One of several that LSS cannot distinguish, and that are known by their node-IDs.
  const bool listed = !id && !device.has_serial() &&
                      std::ranges::any_of(nodes, [&](const Seen& s) { return s.device && s.device->agrees(device); });
  if (listed) co_return;
  // A stopped device has no SDO: its node-ID is known from guarding, its address from LSS. 1018h may also have less
  // than LSS reports.
  if (shares && (!under->device || under->device->agrees(device))) {
    if (!under->device) under->device = device.with(seen.id);
    under->duplicate = under->duplicate || d.possible_clone;
    co_return;
  }
  seen.duplicate = seen.duplicate || shares;
  nodes.push_back(seen);
}

}  // namespace berth::operate
