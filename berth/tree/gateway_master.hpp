/// The NMT master in a gateway, which commands a bus beneath: what it knows of its nodes (1F82h), what it is told to
/// do, and the network list in its dictionary (CiA 302-2, 302-3). Each question is an SDO access through gateways;
/// nothing is remembered here.
///
/// Errors are those of `multilevel::GatewayAccess`: Errc::timeout the gateway or the master is silent, Errc::aborted
/// the master refuses.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/co/nmt.hpp"
#include "berth/co/sdo_access.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/rt/task.hpp"

namespace berth::tree {

class GatewayMaster {
 public:
  /// `master`: its dictionary, must stay. `own`: its node-ID on the bus that it commands.
  GatewayMaster(co::SdoAccess& master, NodeId own) noexcept : master_(&master), own_(own) {}

  /// How far `bring_objects` is, after each value.
  void on_progress(std::function<void(const manager::Progress&)> call) { progress_ = std::move(call); }

  /// 1F82h: the node is in the network list and not heard. 0: the master knows nothing of it.
  static constexpr std::uint8_t missing = 1;
  /// What 1F82h says of a node: an NMT state, `missing`, or 0.
  [[nodiscard]] rt::Task<Result<std::uint8_t>> state(NodeId node);
  /// By 1F82h.
  [[nodiscard]] rt::Task<Result<void>> command(NodeId node, co::NmtCommand command);
  /// Restarts the master itself: its bus boots after it.
  [[nodiscard]] rt::Task<Result<void>> restart() { return command(own_, co::NmtCommand::reset_node); }

  /// It hears all of these. True also when it does not answer: such a master is not asked on.
  [[nodiscard]] rt::Task<bool> has_all(const std::vector<NodeId>& nodes);
  /// The same; why it could not be asked.
  [[nodiscard]] rt::Task<Result<bool>> knows_all(const std::vector<NodeId>& nodes);
  /// It hears one of these at least. True also when it does not answer.
  [[nodiscard]] rt::Task<bool> has_any(const std::vector<NodeId>& nodes);
  /// All of these are operational.
  [[nodiscard]] rt::Task<bool> all_run(const std::vector<NodeId>& nodes);

  /// 1020h has the list's date.
  [[nodiscard]] rt::Task<bool> has_list(const manager::Wanted& list);
  /// 1020h answers, with another date or none.
  [[nodiscard]] rt::Task<bool> has_another_list(const manager::Wanted& list);
  /// Its list has no date and none of `nodes` is there: it has none yet, or one that was never finished.
  [[nodiscard]] rt::Task<bool> is_bare(const std::vector<NodeId>& nodes);
  /// Makes the date of its list another, so that the list is brought in anew.
  [[nodiscard]] rt::Task<Result<void>> undate();
  /// Compares the list, writes what differs, dates and saves it. In one transfer where the master takes it so (1F22h of
  /// its own node-ID, then 1F25h), else object by object. `changed`: something was written.
  [[nodiscard]] rt::Task<Result<void>> bring(const manager::Wanted& list, bool& changed);
  /// The same, object by object.
  [[nodiscard]] rt::Task<Result<void>> bring_objects(const manager::Wanted& list, bool& changed);

 private:
  rt::Task<bool> put_whole(const manager::Wanted& list);

  co::SdoAccess* master_;
  NodeId own_;
  std::function<void(const manager::Progress&)> progress_;
};

}  // namespace berth::tree
