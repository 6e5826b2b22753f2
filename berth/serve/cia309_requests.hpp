/// Maps those CiA 309-3 commands that berth/command has: the line to a request, the reply to the codes of CiA 309-1.
/// Rights, confirmations and frames are the request's. Internal to room `serve`.
#pragma once

#include "berth/command/reply.hpp"
#include "berth/rt/task.hpp"
#include "berth/serve/cia309_permits.hpp"

namespace berth::serve::cia309 {

/// SDO, NMT, and the LSS services. An empty verb: no request exists for the line.
[[nodiscard]] command::Request request_of(const Request& line, const Net& net);
/// `reply`: of `request_of(line)`.
[[nodiscard]] Outcome outcome_of(const Request& line, const command::Reply& reply, const Net& net);

class Requests {
 public:
  static constexpr std::size_t longest_value = std::size_t{1} << 20U;  ///< bytes of an object

  /// `permits` must outlive this.
  explicit Requests(const Permits& permits) noexcept : permits_(&permits) {}
  /// Carries out a line for which there is a request. For LSS, the caller holds the network's turn. Refusals by Berth
  /// itself are reported with their reason. `line` and `net` must outlive the task.
  rt::Task<Outcome> run(const Request& line, Net& net);

 private:
  const Permits* permits_;
};

}  // namespace berth::serve::cia309
