/// The LSS commands of CiA 309-3. A device that is put into configuration state stays there from one command to the
/// next, and so does the network's turn (`Net309::has_turn`). Inside of room `serve`.
#pragma once

#include "berth/base/result.hpp"
#include "berth/lss/frames.hpp"
#include "berth/rt/task.hpp"
#include "berth/serve/gateway_309_permits.hpp"

namespace berth::serve {

class LssCommands309 {
 public:
  /// `permits` must stay.
  explicit LssCommands309(const Permits309& permits) noexcept : permits_(&permits) {}
  /// Waits for the network's turn, and gives it back when no device may be in configuration state. Takes requests that
  /// are `allowed`.
  rt::Task<Outcome309> run(const Request309& request, Net309& net);

 private:
  rt::Task<Outcome309> service(const Request309& request, Net309& net);
  rt::Task<Outcome309> switch_global(bool configuration, Net309& net);
  rt::Task<Outcome309> switch_selective(LssAddress address, Net309& net);
  rt::Task<Outcome309> set_node(NodeId id, Net309& net);
  rt::Task<Outcome309> configure(const Request309& request, Net309& net);
  rt::Task<Outcome309> inquire(const Request309& request, Net309& net);
  rt::Task<Outcome309> identify(const Request309& request, Net309& net);
  rt::Task<Outcome309> slowscan(const Request309& request, Net309& net);
  rt::Task<Outcome309> fastscan(const Request309& request, Net309& net);
  rt::Task<Outcome309> allnodes(const Request309& request, Net309& net);
  rt::Task<bool> is_taken(NodeId id, Net309& net);
  rt::Task<Result<bool>> anybody_in(lss::IdentifyRanges ranges, Net309& net);
  [[nodiscard]] bool may_select(const LssAddress& address, Net309& net) const;
  [[nodiscard]] bool may_configure(Net309& net) const;
  [[nodiscard]] Outcome309 failed(const Error& error, Net309& net, Code309 refused) const;

  const Permits309* permits_;
};

}  // namespace berth::serve
