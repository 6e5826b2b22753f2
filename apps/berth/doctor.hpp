/// `berth doctor`: what is wrong with a machine's buses.
#pragma once

#include <chrono>
#include <optional>
#include <string>

#include "options.hpp"

namespace berth::cli {

struct DoctorOptions {
  std::optional<std::chrono::nanoseconds> listen;  ///< empty: five heartbeat times of the slowest bus, 5 s at least
  bool active = false;                             ///< LSS questions
  bool intrusive = false;                          ///< SDO questions too
  std::optional<unsigned> conformance;             ///< this node is examined instead (docs/doctor.md)
  std::string eds;                                 ///< its description; empty: its slot's
};

/// Exit status: 0 no findings, 1 findings, 3 a bus could not be reached or asked.
int run_doctor(const Options& options, const DoctorOptions& doctor);

}  // namespace berth::cli
