/// `berth study`: a campaign over many seeds, its files joined, and their summary.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/campaign/line.hpp"
#include "berth/campaign/results.hpp"
#include "berth/campaign/seeds.hpp"
#include "berth/campaign/work.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

struct CampaignOptions {
  std::string kind = "faults";
  std::string variant = "usual";
  std::optional<campaign::Seeds> seeds;
  unsigned jobs = 0;  ///< 0: one per processor
  bool twice = false;
  bool show = false;
  std::chrono::nanoseconds limit = std::chrono::minutes(10);
  std::string out;                          ///< file; empty: standard output
  std::vector<std::string> merge, summary;  ///< files; empty: not asked for
};

int run_campaign(const Options& options, const CampaignOptions& wanted);
int run_merge(const Options& options, const CampaignOptions& wanted);
int run_summary(const Options& options, const CampaignOptions& wanted);

/// "faults 17 failed: why", and how it is done again.
[[nodiscard]] std::vector<std::string> lines_of(const campaign::Line& line);

}  // namespace berth::cli
