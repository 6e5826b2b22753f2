/// Which seeds a test of random worlds runs: a few by default, and what `./run worlds --from SEED --count N` says.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace berth::worlds {

struct Seeds {
  std::uint64_t from = 1;
  std::uint64_t count = 0;
  [[nodiscard]] std::uint64_t end() const noexcept { return from + count; }
};

inline Seeds seeds(std::uint64_t few) {
  const char* const from = std::getenv("BERTH_WORLDS_FROM");
  const char* const count = std::getenv("BERTH_WORLDS_COUNT");
  return {from == nullptr ? 1 : std::strtoull(from, nullptr, 10),
          count == nullptr ? few : std::strtoull(count, nullptr, 10)};
}

}  // namespace berth::worlds
