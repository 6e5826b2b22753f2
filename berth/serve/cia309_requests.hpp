/// CiA 309-3's commands that a request of berth/command does, in both directions: the line as a request, the reply in
/// the codes of CiA 309-1. Rights, confirmations and what is sent are the request's. Inside of room `serve`.
#pragma once

#include "berth/command/reply.hpp"
#include "berth/rt/task.hpp"
#include "berth/serve/cia309_permits.hpp"

namespace berth::serve::cia309 {

/// SDO, NMT, and the LSS services. An empty verb: the line asks for something that no request does.
[[nodiscard]] command::Request request_of(const Request& line, const Net& net);
/// `reply`: of `request_of(line)`.
[[nodiscard]] Outcome outcome_of(const Request& line, const command::Reply& reply, const Net& net);

class Requests {
 public:
  static constexpr std::size_t longest_value = std::size_t{1} << 20U;  ///< bytes of an object

  /// `permits` must stay.
  explicit Requests(const Permits& permits) noexcept : permits_(&permits) {}
  /// Carries a line out for which there is a request. Of LSS, the caller holds the network's turn. What Berth itself
  /// refused is told in words. `line` and `net` must stay.
  rt::Task<Outcome> run(const Request& line, Net& net);

 private:
  const Permits* permits_;
};

}  // namespace berth::serve::cia309
