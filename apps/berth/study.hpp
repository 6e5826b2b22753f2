/// `berth reproduce`, `berth compare`: the papers' figures and the methods side by side. One source file a command.
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
  std::string listing;  ///< --trace: which of the papers' traces to print
  bool negotiation_load = false;
  // compare
  std::string methods, devices, bit_rates, serials;  ///< lists, as written; empty: all
  unsigned seeds = 0;                                ///< 0: the default
  unsigned threads = 0;                              ///< 0: one a processor
  std::string csv, plot;                             ///< files; empty: none
};

int run_reproduce(const Options& options, const StudyOptions& study);
int run_compare(const Options& options, const StudyOptions& study);

}  // namespace berth::cli
