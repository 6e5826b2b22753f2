/// One request, carried out in a world of its own (`--sim`) or by a running `berth up`.
#pragma once

#include <chrono>
#include <functional>
#include <tl/expected.hpp>

#include "berth/command/reply.hpp"
#include "berth/io/loop.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// scan, bind, replace, sdo, nmt, lss, status: carries it out and prints the reply; the exit status.
int run_single(const Options& options, command::Request request);

/// The reply, which may say no. Failures: no machine file, no such world, no process that runs it.
[[nodiscard]] tl::expected<command::Reply, Failure> carry_out(const Options& options, command::Request request);

/// Whoever carries out requests, for a verb that makes many.
struct Conversation {
  /// `goes_on` is asked again and again while the answer is not there; false: it is given up. Keys and signals are
  /// taken meanwhile; a signal gives it up, too.
  std::function<tl::expected<command::Reply, Failure>(const command::Request&, const std::function<bool()>& goes_on)>
      ask;
  std::function<bool(std::chrono::nanoseconds)> wait;  ///< false: a signal came, or nobody reads the output any more
  std::function<rt::Time()> now;                       ///< of the bus
  io::Loop* loop = nullptr;                            ///< for keys; null: time is that of a simulated world
};
/// Does `talk` with the process that runs the machine, or in a world or on ports of its own; gives what it gave.
/// `kind`: one of the requests, for what has to be known before the first.
[[nodiscard]] tl::expected<int, Failure> converse(const Options& options, const command::Request& kind,
                                                  const std::function<int(const Conversation&)>& talk);

}  // namespace berth::cli
