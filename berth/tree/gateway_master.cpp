#include "berth/tree/gateway_master.hpp"

#include <algorithm>
#include <array>

#include "berth/eds/concise_dcf.hpp"
#include "berth/network/configuration_requests.hpp"
#include "berth/network/network_requests.hpp"
#include "berth/od/cia302.hpp"
#include "berth/od/paper3.hpp"

namespace berth::tree {
namespace {

constexpr std::uint16_t configuration_date = 0x1020;

Error error_of(const manager::Failure& failure) noexcept {
  if (failure.why == manager::Failure::Why::error) {
    // Through gateways, the error names an object of the gateway.
    Error error = failure.error;
    error.index = failure.object.index;
    error.sub = failure.object.sub;
    return error;
  }
  return {.code = Errc::mismatch,
          .sub = failure.object.sub,
          .index = failure.object.index,
          .text = "the gateway's master does not keep its network list"};
}

// A master that restarts before saving its list has lost it, and must not get that list's date.
std::vector<manager::Entry> one_to_look_at(const manager::Wanted& list) {
  const auto slave = std::ranges::find_if(
      list.entries, [](const manager::Entry& e) { return e.object.index == od::cia302::slave_assignment; });
  if (slave == list.entries.end()) return {};
  manager::Entry entry = *slave;
  entry.compare_only = true;
  return {entry};
}

}  // namespace

rt::Task<Result<std::uint8_t>> GatewayMaster::state(NodeId node) {
  const std::uint8_t sub = node.value();
  const auto value = co_await master_->read(od::cia302::request_nmt, sub);
  if (!value) co_return fail(value.error());
  const auto bytes = value->bytes();
  co_return bytes.empty() ? std::uint8_t{0} : bytes.front();
}

rt::Task<Result<void>> GatewayMaster::command(NodeId node, co::NmtCommand command) {
  const std::array<std::uint8_t, 1> value{network::request_value(command)};
  const std::span<const std::uint8_t> data = value;
  const std::uint8_t sub = node.value();
  const auto done = co_await master_->write(od::cia302::request_nmt, sub, data);
  co_return done;
}

// A master whose list is not in use yet has none of its nodes.
rt::Task<Result<bool>> GatewayMaster::knows_all(const std::vector<NodeId>& nodes) {
  for (const NodeId node : nodes) {
    const auto known = co_await state(node);
    if (!known && known.error().code != Errc::aborted) co_return fail(known.error());
    if (!known || *known <= missing) co_return false;
  }
  co_return true;
}

rt::Task<bool> GatewayMaster::has_all(const std::vector<NodeId>& nodes) {
  const auto known = co_await knows_all(nodes);
  co_return !known || *known;
}

rt::Task<bool> GatewayMaster::has_any(const std::vector<NodeId>& nodes) {
  for (const NodeId node : nodes) {
    const auto known = co_await state(node);
    if (!known && known.error().code != Errc::aborted) co_return true;
    if (known && *known > missing) co_return true;
  }
  co_return false;
}

rt::Task<bool> GatewayMaster::all_run(const std::vector<NodeId>& nodes) {
  for (const NodeId node : nodes) {
    const auto known = co_await state(node);
    if (!known || *known != static_cast<std::uint8_t>(NmtState::operational)) co_return false;
  }
  co_return true;
}

// ---- its network list ----

rt::Task<bool> GatewayMaster::has_list(const manager::Wanted& list) {
  const manager::ConfiguratorOptions options;
  manager::Configurator configurator(*master_, *master_, list, options);
  co_return co_await configurator.has_date();
}

rt::Task<bool> GatewayMaster::has_another_list(const manager::Wanted& list) {
  const auto days = co_await master_->read_u32(configuration_date, 1);
  if (!days) co_return false;
  const auto ms = co_await master_->read_u32(configuration_date, 2);
  co_return ms&& manager::ConfigurationDate{*days, *ms} != list.date;
}

rt::Task<bool> GatewayMaster::is_bare(const std::vector<NodeId>& nodes) {
  const auto date = co_await master_->read_u32(configuration_date, 1);
  if (!date || *date != 0) co_return false;
  const bool runs = co_await has_any(nodes);
  co_return !runs;
}

rt::Task<Result<void>> GatewayMaster::undate() {
  const auto done = co_await master_->write_u32(configuration_date, 1, 0);
  co_return done;
}

rt::Task<Result<void>> GatewayMaster::bring_objects(const manager::Wanted& list, bool& changed) {
  manager::ConfiguratorOptions options;
  if (!list.entries.empty()) options.progress = progress_;
  options.each_value = true;
  manager::ConfigurationReport report;
  manager::Configurator configurator(*master_, *master_, list, options);
  co_await configurator.run(report);
  if (report.failure) co_return fail(error_of(*report.failure));
  changed = report.changed();
  co_return Result<void>{};
}

// In one transfer; the master writes each object itself. False: it cannot do that, or refuses an object.
rt::Task<bool> GatewayMaster::put_whole(const manager::Wanted& list) {
  eds::ConciseDcf stream;
  for (const auto& entry : list.entries) {
    if (!entry.compare_only) stream.entries.push_back({entry.object, entry.bytes});
  }
  const auto bytes = eds::encode(eds::in_working_order(std::move(stream)));
  const std::span<const std::uint8_t> data = bytes;
  auto done = co_await undate();
  if (done) done = co_await master_->write(od::cia302::concise_dcf, own_.value(), data);
  if (!done) co_return false;
  constexpr std::uint32_t configure = network::ConfigurationRequests::signature;
  done = co_await master_->write_u32(od::cia302::request_configuration, own_.value(), configure);
  co_return done.has_value();
}

// Through gateways, each access costs several; so the whole list goes first.
rt::Task<Result<void>> GatewayMaster::bring(const manager::Wanted& list, bool& changed) {
  manager::Wanted rest = list;
  const bool there = co_await has_list(list);
  bool whole = false;
  if (!there) whole = co_await put_whole(list);
  if (there) rest.entries.clear();
  if (whole) rest.entries = one_to_look_at(list);
  auto done = co_await bring_objects(rest, changed);
  const bool lacks = !done && done.error().code == Errc::aborted && done.error().index == od::paper3::fixed_node_ids;
  if (!lacks) co_return done;
  // A master that assigns no node-IDs need not know which are fixed.
  std::erase_if(rest.entries, [](const manager::Entry& e) { return e.object.index == od::paper3::fixed_node_ids; });
  done = co_await bring_objects(rest, changed);
  co_return done;
}

}  // namespace berth::tree
