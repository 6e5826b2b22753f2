/// The NMT master in a gateway, which commands a bus beneath: the states of its nodes (1F82h), commands to it, and the
/// network list in its dictionary (CiA 302-2, 302-3). Each question is an SDO access through gateways; nothing is
/// cached here.
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
  /// `master`: its dictionary, must outlive this. `own`: its node-ID on the bus that it commands.
  GatewayMaster(co::SdoAccess& master, NodeId own) noexcept : master_(&master), own_(own) {}

  /// The progress of `bring_objects`, after each value.
  void on_progress(std::function<void(const manager::Progress&)> call) { progress_ = std::move(call); }

  /// 1F82h: the node is in the network list but not heard. 0: the master does not know it.
  static constexpr std::uint8_t missing = 1;
  /// The value of 1F82h for a node: an NMT state, `missing`, or 0.
  [[nodiscard]] rt::Task<Result<std::uint8_t>> state(NodeId node);
  /// By 1F82h.
  [[nodiscard]] rt::Task<Result<void>> command(NodeId node, co::NmtCommand command);
  /// Restarts the master itself: its bus boots after it.
  [[nodiscard]] rt::Task<Result<void>> restart() { return command(own_, co::NmtCommand::reset_node); }

  /// It hears all of these nodes. True also if it does not answer: such a master is not asked any more.
  [[nodiscard]] rt::Task<bool> has_all(const std::vector<NodeId>& nodes);
  /// The same; errors: why it could not be asked.
  [[nodiscard]] rt::Task<Result<bool>> knows_all(const std::vector<NodeId>& nodes);
  /// It hears at least one of these nodes. True also if it does not answer.
  [[nodiscard]] rt::Task<bool> has_any(const std::vector<NodeId>& nodes);
  /// All of these are operational.
  [[nodiscard]] rt::Task<bool> all_run(const std::vector<NodeId>& nodes);

  /// 1020h has the list's date.
  [[nodiscard]] rt::Task<bool> has_list(const manager::Wanted& list);
  /// 1020h answers, with another date or none.
  [[nodiscard]] rt::Task<bool> has_another_list(const manager::Wanted& list);
  /// Its list has no date and none of `nodes` is there: it has no list yet, or an unfinished one.
  [[nodiscard]] rt::Task<bool> is_bare(const std::vector<NodeId>& nodes);
  /// Changes the date of its list, so that the list is written anew.
  [[nodiscard]] rt::Task<Result<void>> undate();
  /// Compares the list, writes differences, dates and saves it. In one transfer if the master supports it (1F22h of its
  /// own node-ID, then 1F25h), else object by object. `changed`: something was written.
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
