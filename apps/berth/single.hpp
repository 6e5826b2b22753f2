/// One request, carried out in a world of its own (`--sim`) or by a running `berth up`.
#pragma once

#include <tl/expected.hpp>

#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// scan, bind, replace, sdo, nmt, lss, status: carries it out and prints the reply; the exit status.
int run_single(const Options& options, command::Request request);

/// The reply, which may say no. Failures: no machine file, no such world, no process that runs it.
[[nodiscard]] tl::expected<command::Reply, Failure> carry_out(const Options& options, command::Request request);

}  // namespace berth::cli
