#include "berth/manager/node_id_search.hpp"

#include <algorithm>

#include "berth/places/inquiry.hpp"

namespace berth::manager {
namespace {

// A device may need paper 4's 10 ms, and a master in a gateway's firmware processes the answer some time after it
// arrived.
constexpr rt::Duration longest = std::chrono::milliseconds(13);

}  // namespace

NodeIdSearch::NodeIdSearch(ListBus& bus)
    : bus_(bus),
      rand_(bus.services().dispatcher),
      rand_planner_(discovery::make(discovery::Method::planner_rand, {bus.services().dispatcher, bus.lss()})),
      rest_({bus.services().dispatcher, bus.lss()}, {.rand = false, .configured = false}) {}

// Known parts of types need not be asked; devices that answer under their node-IDs need not be found.
discovery::Known NodeIdSearch::known(bool all_types) {
  discovery::Known known;
  for (const auto& slot : bus_.slots) {
    const auto sits = slot.device ? slot.device : slot.slot.record.device();
    const bool equals = sits && slot.there && !sits->has_serial();
    if (equals) known.equals.push_back(sits->address);
    if (slot.device && !equals) known.registered.push_back(slot.device->address);
    const discovery::Kind kind{slot.slot.spec.type, std::nullopt};
    const bool named = std::ranges::find(known.kinds, kind) != known.kinds.end();
    if ((slot.missing() || (all_types && slot.typed)) && !named) known.kinds.push_back(kind);
  }
  known.equals.insert(known.equals.end(), shared_.begin(), shared_.end());
  for (const auto& f : bus_.found) {
    const bool equals = !f.device.has_serial() && f.active.configured();
    (equals ? known.equals : known.registered).push_back(f.device.address);
  }
  return known;
}

rt::Task<Result<void>> NodeIdSearch::by_rand() {
  by_rand_.clear();
  const discovery::Options options;
  const auto anybody = co_await rand_planner_->anybody(options);
  if (!anybody) co_return fail(anybody.error());
  if (!*anybody) co_return Result<void>{};
  discovery::Known kinds = known(false);
  kinds.registered.clear();
  const auto report = co_await rand_planner_->find(kinds, options);
  if (!report) co_return fail(report.error());
  places::Inquiry inquiry(bus_.binder_services());
  for (std::size_t i = 0; i < report->found.size(); ++i) {
    const Identity device = report->found[i].address;
    by_rand_.push_back(device);
    if (bus_.found.has_equals(device)) {
      const auto looked = co_await look_among_equals(device);
      if (!looked) co_return looked;
      continue;
    }
    const bool whole = report->found[i].possible_clone;
    const auto id = co_await inquiry.active_id(device.address, whole, ListBus::pause);
    const bool clone = !id && id.error().code == Errc::duplicate;
    if (!id && id.error().code == Errc::bus) co_return fail(id.error());
    if (id || clone) bus_.found.note({device, id ? *id : NodeId(), clone});
  }
  co_return Result<void>{};
}

// Its equals have node-IDs, and it may be one of them: Fastscan is for devices without.
rt::Task<Result<void>> NodeIdSearch::look_among_equals(Identity device) {
  const auto another = co_await lss::any_without_node_id(bus_.lss(), device.address);
  if (!another) co_return fail(another.error());
  if (*another) bus_.found.note({device, NodeId()});
  co_return Result<void>{};
}

rt::Task<Result<void>> NodeIdSearch::by_lss(Whom whom) {
  discovery::AutoOptions options = rest_.options();
  options.configured = whom == Whom::configured;
  rest_.set_options(options);
  const discovery::Known kinds = known(whom != Whom::missing);
  if (kinds.kinds.empty()) co_return Result<void>{};
  discovery::Options how;
  how.assigner = this;
  how.window = longest;
  const auto report = co_await rest_.find(kinds, how);
  if (!report) co_return fail(report.error());
  const auto quiet = co_await bus_.lss().switch_global(lss::State::waiting);
  if (!quiet) co_return fail(quiet.error());
  for (const auto& d : report->found) {
    // Those with node-IDs did not report their whole address in 1018h: here it is.
    const bool shared = d.possible_clone && bus_.found.has_equals(d.address);
    if (shared && std::ranges::find(shared_, d.address) == shared_.end()) shared_.push_back(d.address);
    bus_.found.note({d.address, d.assigned.configured() ? d.assigned : d.active, d.possible_clone});
  }
  co_return Result<void>{};
}

rt::Task<Result<bool>> NodeIdSearch::anybody() {
  const discovery::Options usual;
  const auto by_rand = co_await rand_planner_->anybody(usual);
  if (!by_rand || *by_rand) co_return by_rand;
  discovery::Options patient;
  patient.window = longest;
  co_return co_await rest_.anybody(patient);
}

rt::Task<Result<void>> NodeIdSearch::release_found() {
  for (std::size_t i = 0; i < by_rand_.size(); ++i) {
    const Identity device = by_rand_[i];
    const ListSlot* const seat = bus_.of(device);
    if (seat != nullptr && seat->there) continue;
    // Those with node-IDs would hear it too, and answer each search.
    if (bus_.found.has_equals(device) && bus_.found.find(device) == nullptr) continue;
    const auto told = co_await rand_.switch_selective(device.address, nodeid::Identification::unknown);
    if (!told) co_return fail(told.error());
  }
  by_rand_.clear();
  co_return Result<void>{};
}

// Returns the slot that the plan has for it by all findings so far. Among its equals Fastscan selects it, while it has
// no node-ID: it gets one after the search.
NodeId NodeIdSearch::assign(const LssAddress& device, bool) noexcept {
  if (bus_.found.find(device) == nullptr) bus_.found.note({device, NodeId()});
  if (bus_.found.has_equals(device)) return {};
  const auto planned = bus_.plan();
  const auto bind = std::ranges::find_if(planned.plan.actions, [&](const places::Action& action) {
    const auto* const f = bus_.found.one_for(action.device);
    return action.kind == places::Action::Kind::bind && f != nullptr && f->device == device;
  });
  if (bind == planned.plan.actions.end()) return {};
  ListSlot& slot = bus_.slots[planned.slots[bind->slot]];
  const bool held = std::ranges::find(bus_.found, slot.id(), &places::Found::active) != bus_.found.end();
  if (held || !bus_.vacant(slot.id())) return {};
  const auto asked =
      bus_.store().ask(slot.slot.record.slot, {Identity(device).with(slot.id()), slot.id()}, "found by a search");
  if (!asked) return {};
  bus_.refresh(slot);
  return slot.id();
}

}  // namespace berth::manager
