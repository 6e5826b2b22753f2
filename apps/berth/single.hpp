/// One request, carried out in its own world (`--sim`) or by a running `berth up`.
#pragma once

#include <chrono>
#include <functional>
#include <tl/expected.hpp>

#include "berth/command/reply.hpp"
#include "berth/io/loop.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// scan, bind, replace, sdo, nmt, lss, status: carries it out and prints the reply; returns the exit status.
int run_single(const Options& options, command::Request request);

/// The reply, which may be a refusal. Failures: no machine file, no such world, no process that runs it.
[[nodiscard]] tl::expected<command::Reply, Failure> carry_out(const Options& options, command::Request request);

/// Carries out requests for a verb that makes many.
struct Conversation {
  /// `goes_on` is asked repeatedly until the answer comes; false cancels the request, as a signal does. Keys and
  /// signals are handled meanwhile.
  std::function<tl::expected<command::Reply, Failure>(const command::Request&, const std::function<bool()>& goes_on)>
      ask;
  std::function<bool(std::chrono::nanoseconds)> wait;  ///< false: a signal came, or the output has no reader any more
  std::function<rt::Time()> now;                       ///< of the bus
  io::Loop* loop = nullptr;                            ///< for keys; null: a simulated world gives the time
};
/// Runs `talk` with the process that runs the machine, or with a world or ports of its own; returns the result of
/// `talk`. `kind`: an example of the requests, for what must be known before the first.
[[nodiscard]] tl::expected<int, Failure> converse(const Options& options, const command::Request& kind,
                                                  const std::function<int(const Conversation&)>& talk);

}  // namespace berth::cli
