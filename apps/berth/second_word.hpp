/// A machine that never ran, on a bus where a node may be the master of a plant that runs: --yes alone is no consent to
/// a second master.
#pragma once

#include <optional>

#include "machine_run.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// Names those nodes (`Strangers::may_be_masters`), and asks whether the bus is taken all the same: where a person
/// types, with --yes too; else --beside-master says so. Empty: it is taken, or there is no such node.
[[nodiscard]] std::optional<Failure> no_second_word(MachineRun& run, const Options& options);

}  // namespace berth::cli
