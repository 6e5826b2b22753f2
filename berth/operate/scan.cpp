#include "berth/operate/scan.hpp"

#include <algorithm>

#include "berth/co/guarding.hpp"
#include "berth/rt/scope.hpp"

namespace berth::operate {

rt::Task<void> Scan::ask(NodeId id, Seen& seen) {
  const co::SdoOptions patience = p_.asking.patience(id, 1);
  seen.id = id;
  const auto type = co_await p_.bus.sdo.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (type) seen.device_type = *type;
  const bool answered = type || type.error().code == Errc::aborted || type.error().code == Errc::mismatch;
  if (answered) {
    const auto answer = co_await places::identify(p_.bus.sdo, id);
    if (answer.who) seen.device = *answer.who;
    seen.duplicate = answer.by_two;
  } else {
    const auto guarded = co_await co::guard_once(p_.bus.dispatcher, id, p_.bus.bus.timing.guard_timeout, 1);
    if (guarded) seen.state = guarded->state;
  }
  const auto heard = p_.bus.boots.heard(id);
  const bool lately = heard && p_.bus.executor.now() - *heard < p_.bus.bus.timing.heartbeat_timeout;
  if (lately) seen.state = p_.bus.boots.state(id);
  // Behind its boot-up message a device is pre-operational (CiA 301 §7.3.2.2.2).
  if (seen.state == NmtState::initialising) seen.state = NmtState::pre_operational;
}

rt::Task<Result<std::vector<Seen>>> Scan::run() {
  co_await p_.bus.turn.take();
  const rt::Held held(p_.bus.turn);
  std::vector<Seen> nodes(127);
  {
    rt::Scope asked(p_.bus.executor, p_.asking.most_at_once());
    for (std::uint8_t i = 1; i <= 127; ++i) {
      const NodeId id(i);
      if (id != p_.bus.bus.master) asked.spawn(ask(id, nodes[i - 1U]));
    }
    co_await asked.join();
  }
  std::erase_if(nodes, [](const Seen& s) { return !s.device_type && !s.device && !s.state; });
  const auto found = co_await p_.finding.search.find_new();
  if (!found) co_return fail(found.error());
  for (const auto& d : found->found) {
    const Identity device(d.address);
    const auto known = std::ranges::find_if(nodes, [&](const Seen& s) { return s.device == device; });
    if (known != nodes.end()) {
      known->duplicate = known->duplicate || d.possible_clone;
      continue;
    }
    Seen seen;
    const auto id = co_await p_.asking.active_id(d.address);
    if (id) seen.id = *id;
    seen.device = d.address;
    seen.duplicate = d.possible_clone;
    const auto under = std::ranges::find(nodes, seen.id, &Seen::id);
    const bool shares = seen.id.configured() && under != nodes.end();
    // One of several that LSS does not tell apart, and that are known by their node-IDs.
    const bool listed = !id && !device.has_serial() &&
                        std::ranges::any_of(nodes, [&](const Seen& s) { return s.device && s.device->agrees(device); });
    if (listed) continue;
    // A stopped device speaks no SDO: it is known by its node-ID from guarding, and by its address from LSS. And 1018h
    // may have less than LSS tells.
    if (shares && (!under->device || under->device->agrees(device))) {
      if (!under->device) under->device = device.with(seen.id);
      under->duplicate = under->duplicate || d.possible_clone;
      continue;
    }
    seen.duplicate = seen.duplicate || shares;
    nodes.push_back(seen);
  }
  for (auto& s : nodes) {
    const Seat* seat = s.device ? p_.slots.of(*s.device) : nullptr;
    if (seat != nullptr) s.slot = seat->name();
  }
  co_return nodes;
}

}  // namespace berth::operate
