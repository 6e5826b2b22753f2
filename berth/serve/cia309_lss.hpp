/// The LSS commands of CiA 309-3: requests that hold the network's turn, and the scans that only CiA 309 has. A device
/// in configuration state stays there from one command to the next, and the conversation keeps the network's turn
/// (`Net::has_turn`). Internal to room `serve`.
#pragma once

#include "berth/base/result.hpp"
#include "berth/lss/frames.hpp"
#include "berth/rt/task.hpp"
#include "berth/serve/cia309_permits.hpp"
#include "berth/serve/cia309_requests.hpp"

namespace berth::serve::cia309 {

class LssCommands {
 public:
  /// `permits` must outlive this.
  explicit LssCommands(const Permits& permits) noexcept : permits_(&permits), requests_(permits) {}
  /// Waits for the network's turn, and gives it back when no device may be in configuration state. Takes `allowed`
  /// requests.
  rt::Task<Outcome> run(const Request& request, Net& net);

 private:
  rt::Task<Outcome> service(const Request& request, Net& net);
  rt::Task<Outcome> select(const Request& request, Net& net);
  rt::Task<Outcome> switch_global(const Request& request, Net& net);
  rt::Task<Outcome> slowscan(const Request& request, Net& net);
  rt::Task<Outcome> fastscan(const Request& request, Net& net);
  rt::Task<Outcome> allnodes(const Request& request, Net& net);
  rt::Task<Result<bool>> anybody_in(lss::IdentifyRanges ranges, Net& net);

  const Permits* permits_;
  Requests requests_;
};

}  // namespace berth::serve::cia309
