/// For a machine that never ran, on a bus with a possible master of a running plant: --yes alone does not permit a
/// second master.
#pragma once

#include <optional>

#include "machine_run.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// Prints those nodes (`Strangers::may_be_masters`), and asks whether to take the bus nevertheless: on a terminal even
/// with --yes; elsewhere --beside-master permits it. Empty: take the bus, or there is no such node.
[[nodiscard]] std::optional<Failure> no_second_word(MachineRun& run, const Options& options);

}  // namespace berth::cli
