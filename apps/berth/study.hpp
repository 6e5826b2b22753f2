/// `berth reproduce`, `berth compare`: reproduce the papers' figures, compare the methods. One source file per command.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "berth/text/quantity.hpp"
#include "options.hpp"

namespace berth::cli {

struct StudyOptions {
  // reproduce
  std::optional<std::uint32_t> bit_rate;
  std::optional<text::Duration> latency;
  std::string folder;   ///< --record
  std::string listing;  ///< --trace: which trace of the papers to print
  bool negotiation_load = false;
  // compare
  std::string methods, devices, bit_rates, serials;  ///< lists, as written; empty: all
  unsigned seeds = 0;                                ///< 0: the default
  unsigned threads = 0;                              ///< 0: one per processor
  std::string csv, plot;                             ///< files; empty: none
};

int run_reproduce(const Options& options, const StudyOptions& study);
int run_compare(const Options& options, const StudyOptions& study);

}  // namespace berth::cli
