/// Processes that work on seeds side by side. Processes and not threads: a seed that ends its process by a mistake of
/// Berth's ends that one alone, one that never ends can be ended, and no world shares memory with another.
///
/// The process that makes a crew must have one thread: its workers are forked.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/result.hpp"

namespace berth::campaign {

/// How a seed's work ended.
struct Ended {
  enum class How : std::uint8_t { done, died, killed, too_long };
  std::uint64_t seed = 0;
  How how = How::done;
  std::string text;  ///< `done`: what the work gave; `died`: "signal 11 (Segmentation fault)", "exit status 3";
                     ///< `killed`: "signal 9 (Killed)"
};

struct CrewOptions {
  unsigned jobs = 1;                   ///< processes, from 1 on
  std::chrono::nanoseconds limit{0};   ///< of real time for one seed; 0: none
  int stop = -1;                       ///< a descriptor; when it can be read the crew ends. -1: none
  std::vector<int> not_for_workers{};  ///< descriptors that each worker closes
  std::function<bool()> must_stop = [] { return false; };  ///< asked after each seed
};

/// Done in a worker: the text of one seed, at most 1 MiB.
using SeedWork = std::function<std::string(std::uint64_t seed)>;
/// The next seed; none: there is no more. Called in this process.
using NextSeed = std::function<std::optional<std::uint64_t>()>;
/// Called in this process, in the order in which seeds end. False: the crew ends.
using TakeEnded = std::function<bool(const Ended& ended)>;

/// Runs until there is no more seed, `take` said so or `stop` can be read; true: every seed that `next` gave has ended.
/// Otherwise the workers are killed, and their seeds have no result. `Errc::io`: no process could be made (errno in
/// `detail`).
[[nodiscard]] Result<bool> run_crew(const CrewOptions& options, const SeedWork& work, const NextSeed& next,
                                    const TakeEnded& take);

}  // namespace berth::campaign
