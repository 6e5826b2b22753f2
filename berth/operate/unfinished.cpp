#include "berth/operate/unfinished.hpp"

#include <fmt/format.h>

#include "berth/base/shell_word.hpp"
#include "berth/rt/task.hpp"

namespace berth::operate {
namespace {

constexpr unsigned most_resets = 3;  // of one device: it lost the command, or does not obey it

// A device without a serial number may be one that uses a node-ID of no slot: its next boot-up shows what it stored.
// Empty: none, or each has booted since it was told to.
std::vector<NodeId> who_may_be_its_device(const BusServices& s, const SlotTable& slots, const FoundDevices& found,
                                          const Seat& seat) {
  const Identity& device = seat.slot.record.intended->device;
  std::vector<NodeId> ids;
  if (device.has_serial()) return ids;
  for (const auto& f : found.all()) {
    const bool on_its_own = f.active.configured() && f.active != s.bus.master && slots.at(f.active) == nullptr;
    const bool may_be = on_its_own && !f.lent && !f.clone && f.device.agrees(device);
    const bool booted = seat.last.reset && s.boots.booted_since(f.active, *seat.last.reset);
    if (may_be && !booted) ids.push_back(f.active);
  }
  return ids;
}

// If one of its kind boots under its former node-ID after a reset, it has not stored the slot's.
bool kept_its_former(const BusServices& s, const FoundDevices& found, const Seat& seat, const Identity& device) {
  const Identity one = found.one_for(device);
  return seat.last.reset && one != device && s.boots.booted_since(found.active_of(one), *seat.last.reset);
}

}  // namespace

// The device that used its node-ID, and left it now, may have answered in place of the slot's device, which seemed to
// refuse or to fail a store.
void left_node_id(SlotTable& slots, NodeId id) {
  if (!id.configured()) return;
  for (const auto& seat : slots.seats()) {
    if (seat->id() != id) continue;
    const bool again = seat->configuration.stuck;
    seat->configuration.stuck = false;
    seat->configuration.failed_savings = 0;
    if (again) slots.happened(*seat, SlotEvent::tried_again, "trying again: another device has left its node-ID");
  }
}

// One question for each instead of a whole binding at every look: a device can be absent forever.
rt::Task<void> Unfinished::look(std::vector<Identity>& avoid) {
  bool told_one = false;
  for (auto& seat : slots_.seats()) {
    const bool by_lss = seat->slot.spec.assign == places::Assign::lss && seat->slot.record.intended.has_value();
    if (!by_lss) continue;
    const Identity device = seat->slot.record.intended->device;
    if (seat->life == Life::waits) {
      const bool waits = co_await waits_for_its_power_cycle(*seat, told_one);
      if (waits) avoid.push_back(device);
      continue;
    }
    const bool answers = co_await answers_by_lss(device);
    if (answers || kept_its_former(s_, found_, *seat, device)) continue;
    avoid.push_back(device);
    co_await reset_who_may_be_its_device(*seat);
    keep(*seat);
  }
  for (const auto& blank : slots_.unfinished_here()) {
    const Identity device = blank.device;
    if (equals_.came_without(device)) {
      left_node_id(slots_, erased_.forget(device));
      continue;
    }
    const bool answers = co_await answers_by_lss(device);
    if (!answers) {
      left_node_id(slots_, erased_.forget(device));
      continue;
    }
    const auto found = found_.of(device);
    // A device that used a loan before had no node-ID when it was found: it was switched off and on.
    const auto* const loan = loans_.of(device);
    const bool lent = found != nullptr && loan != nullptr && loan->id == found->active;
    const bool rests = found != nullptr && !lent && erased_.rests(device, found->active, told_one);
    if (rests) avoid.push_back(device);
  }
}

rt::Task<bool> Unfinished::answers_by_lss(Identity device) {
  const bool known = found_.of(device) != nullptr || found_.of(device.with(NodeId())) != nullptr;
  if (known) co_return true;
  const auto id = co_await asking_.active_id(device);
  const bool clone = !id && id.error().code == Errc::duplicate;
  if (id || clone) found_.note({device, id ? *id : NodeId(), clone});
  co_return id || clone;
}

// It stored its node-ID and still uses another: telling it again would wear out its memory. It is told again at growing
// intervals, in case a power cycle was not heard and had no effect.
rt::Task<bool> Unfinished::waits_for_its_power_cycle(Seat& seat, bool& told_one) {
  if (!seat.power_cycle.binding || ErasedNodeIds::tells_again(seat.power_cycle.looked_at, told_one)) co_return false;
  const NodeId old = seat.power_cycle.binding->old_id();
  const auto booted = old.configured() ? s_.boots.boot_up(old) : std::nullopt;
  if (booted && *booted > seat.since) co_return false;
  const auto id = co_await asking_.active_id(seat.power_cycle.binding->assignment().device);
  co_return !id || *id == old;
}

rt::Task<void> Unfinished::reset_who_may_be_its_device(Seat& seat) {
  const auto ids = who_may_be_its_device(s_, slots_, found_, seat);
  if (ids.empty() || !s_.may_command() || seat.last.resets == most_resets) co_return;
  // A single-slot receive buffer would lose this right after a `04 00`: the one just sent, or the next one.
  const auto pause = asking_.binder_options().slow_inhibit;
  co_await rt::sleep_for(pause);
  if (!seat.last.reset) seat.last.reset = s_.executor.now();
  for (const NodeId id : ids) {
    const auto sent = co_await s_.nmt.send(co::NmtCommand::reset_node, id);
    if (!sent) co_return;
  }
  ++seat.last.resets;
  co_await rt::sleep_for(pause);
}

void Unfinished::keep(Seat& seat) {
  slots_.happened(
      seat, SlotEvent::gone,
      fmt::format("{} may have node-ID {} in its memory and does not answer: the node-ID is reserved for "
                  "it; switch it on, or release the slot with `berth replace {}`",
                  to_string(seat.slot.record.intended->device), seat.id().value(), shell_word(seat.name())));
}

}  // namespace berth::operate
