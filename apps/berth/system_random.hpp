/// Random numbers that differ between machines and starts.
#pragma once

#include <random>

#include "berth/base/random.hpp"

namespace berth::cli {

inline Random system_random() {
  std::random_device seed;
  return Random(std::uint64_t{seed()} << 32U | seed());
}

}  // namespace berth::cli
