#include "berth/discovery/by_name.hpp"

#include <algorithm>
#include <optional>

namespace berth::discovery {

namespace {
constexpr unsigned most_passes = 4;

bool wants_one(const Found& device) noexcept {
  return !device.active.configured() && !device.assigned.configured() && !device.possible_clone;
}
}  // namespace

lss::PartMask parts_that_tell(const LssAddress& device, const Known& known, const Report& report) {
  std::vector<LssAddress> others;
  for (const Found& f : report.found) others.push_back(f.address);
  others.insert(others.end(), known.registered.begin(), known.registered.end());
  others.insert(others.end(), known.expected.begin(), known.expected.end());
  // One of another kind may have the same serial number.
  for (const Kind& k : known.kinds) {
    others.push_back({k.type.vendor, k.type.product, k.revision.value_or(device.revision), device.serial});
  }
  return lss::parts_to_ask(device, others);
}

namespace {

// It is alone in configuration. Empty: it does not tell its node-ID, or keeps what it has.
rt::Task<std::optional<NodeId>> node_id_to_change(lss::Master& lss, LssAddress device, const Options& options,
                                                  ByName& result) {
  const lss::ServiceOptions service{.retries = 2, .full_window = false};
  const auto told = co_await lss.inquire_node_id(service);
  if (!told) co_return std::nullopt;
  const NodeId active = NodeId::make(told->byte()).value_or(NodeId());
  if (!options.assigner->keeps(device, active)) co_return active;
  result.kept = active;
  co_return std::nullopt;
}

// What it has is told to the assigner, and nothing is changed.
rt::Task<Result<ByName>> look_by_name(lss::Master& lss, LssAddress device, lss::PartMask parts,
                                      const Options& options) {
  ByName result;
  const lss::AloneOptions how{.parts = parts};
  const auto selected = co_await lss::select_alone(lss, device, how);
  if (!selected) co_return fail(selected.error());
  result.not_alone = *selected == lss::Selection::not_alone;
  if (*selected != lss::Selection::alone) co_return result;
  const auto told = co_await node_id_to_change(lss, device, options, result);
  static_cast<void>(told);
  const auto waiting = co_await lss.switch_global(lss::State::waiting);
  if (!waiting) co_return fail(waiting.error());
  co_return result;
}

// All of them, before the first is given one: what a later one has must not be given to an earlier one.
rt::Task<Result<void>> look_at_all(lss::Master& lss, const Known& known, Report& report, const Options& options,
                                   std::vector<LssAddress>& todo) {
  std::vector<LssAddress> asked = todo;
  for (unsigned pass = 0; pass < most_passes && !asked.empty(); ++pass) {
    std::vector<LssAddress> again;
    for (std::size_t i = 0; i < asked.size(); ++i) {
      const LssAddress address = asked[i];
      const lss::PartMask parts = parts_that_tell(address, known, report);
      const auto looked = co_await look_by_name(lss, address, parts, options);
      if (!looked) co_return fail(looked.error());
      if (looked->not_alone) again.push_back(address);
      if (!looked->kept.configured()) continue;
      std::ranges::find(report.found, address, &Found::address)->active = looked->kept;
      std::erase(todo, address);
    }
    asked.swap(again);
  }
  co_return Result<void>{};
}

}  // namespace

rt::Task<Result<ByName>> assign_by_name(lss::Master& lss, LssAddress device, lss::PartMask parts,
                                        const Options& options) {
  ByName result;
  const lss::AloneOptions how{.parts = parts, .vacancy = options.assigner};
  const auto alone = co_await lss::select_alone(lss, device, how);
  if (!alone) co_return fail(alone.error());
  result.not_alone = *alone == lss::Selection::not_alone;
  if (*alone != lss::Selection::alone) co_return result;
  bool wants = options.assigner != nullptr;
  if (wants && options.inquire) {
    const auto has = co_await node_id_to_change(lss, device, options, result);
    wants = has.has_value();
  }
  const NodeId id = wants ? options.assigner->assign(device) : NodeId();
  if (!id.configured()) {
    const auto waiting = co_await lss.switch_global(lss::State::waiting);
    if (!waiting) co_return fail(waiting.error());
    co_return result;
  }
  const auto given = co_await lss::configure_alone(lss, device, id, options.store, how);
  if (!given) co_return fail(given.error());
  if (given->outcome == lss::Given::Outcome::taken) result.id = id;
  co_return result;
}

rt::Task<Result<void>> assign_all(lss::Master& lss, const Known& known, Report& report, const Options& options) {
  if (options.assigner == nullptr) co_return Result<void>{};
  std::vector<LssAddress> todo;
  for (const Found& f : report.found) {
    if (wants_one(f)) todo.push_back(f.address);
  }
  if (options.inquire) {
    const auto looked = co_await look_at_all(lss, known, report, options, todo);
    if (!looked) co_return fail(looked.error());
  }
  for (unsigned pass = 0; pass < most_passes && !todo.empty(); ++pass) {
    std::vector<LssAddress> again;
    for (std::size_t i = 0; i < todo.size(); ++i) {
      const LssAddress address = todo[i];
      const lss::PartMask parts = parts_that_tell(address, known, report);
      const auto done = co_await assign_by_name(lss, address, parts, options);
      if (!done) co_return fail(done.error());
      if (done->not_alone) again.push_back(address);
      const auto device = std::ranges::find(report.found, address, &Found::address);
      device->assigned = done->id;
      device->active = done->kept;
      if (options.observer != nullptr) options.observer->found(*device);
    }
    todo.swap(again);
  }
  co_return Result<void>{};
}

}  // namespace berth::discovery
