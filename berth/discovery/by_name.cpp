#include "berth/discovery/by_name.hpp"

#include <algorithm>

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
  // A device of another kind may have the same serial number.
  for (const Kind& k : known.kinds) {
    others.push_back({k.type.vendor, k.type.product, k.revision.value_or(device.revision), device.serial});
  }
  return lss::parts_to_ask(device, others);
}

rt::Task<Result<ByName>> assign_by_name(lss::Master& lss, LssAddress device, lss::PartMask parts,
                                        const Options& options) {
  ByName result;
  const lss::AloneOptions how{.parts = parts, .vacancy = options.assigner};
  const auto alone = co_await lss::select_alone(lss, device, how);
  if (!alone) co_return fail(alone.error());
  result.not_alone = *alone == lss::Selection::not_alone;
  if (*alone != lss::Selection::alone) co_return result;
  const NodeId id = options.assigner != nullptr ? options.assigner->assign(device, false) : NodeId();
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
      if (options.observer != nullptr) options.observer->found(*device);
    }
    todo.swap(again);
  }
  co_return Result<void>{};
}

}  // namespace berth::discovery
