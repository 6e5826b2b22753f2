#include "berth/discovery/by_name.hpp"

namespace berth::discovery {

rt::Task<Result<NodeId>> assign_by_name(lss::Master& lss, const LssAddress& device, const Options& options) {
  const NodeId id = options.assigner == nullptr ? NodeId() : options.assigner->assign(device);
  if (!id.configured()) co_return NodeId();
  NodeId taken;
  const auto selected = co_await lss.switch_selective(device);
  if (!selected && selected.error().code == Errc::bus) co_return fail(selected.error());
  if (selected) {
    const auto configured = co_await lss.configure_node_id(id);
    if (configured && !configured->differ) taken = id;
    const bool stores = taken.configured() && options.store;
    if (stores) co_await lss.store();
  }
  const auto waiting = co_await lss.switch_global(lss::State::waiting);
  if (!waiting) co_return fail(waiting.error());
  co_return taken;
}

rt::Task<Result<void>> assign_all(lss::Master& lss, Report& report, const Options& options) {
  if (options.assigner == nullptr) co_return Result<void>{};
  const auto waiting = co_await lss.switch_global(lss::State::waiting);
  if (!waiting) co_return fail(waiting.error());
  for (std::size_t i = 0; i < report.found.size(); ++i) {
    Found& device = report.found[i];
    if (device.active.configured() || device.assigned.configured() || device.possible_clone) continue;
    const auto id = co_await assign_by_name(lss, device.address, options);
    if (!id) co_return fail(id.error());
    device.assigned = *id;
    if (options.observer != nullptr) options.observer->found(device);
  }
  co_return Result<void>{};
}

}  // namespace berth::discovery
