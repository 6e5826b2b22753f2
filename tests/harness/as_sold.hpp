// The worlds of berth/harness/as_sold.hpp with the example files of this repository.
#pragma once

#include <cstdint>
#include <filesystem>

#include "berth/harness/as_sold.hpp"
#include "tests/harness/description_of.hpp"
#include "tests/harness/rig.hpp"

namespace berth::harness {

inline Folders folders_of_tests() {
  return {berth::test::source_dir() + "/examples/eds", std::filesystem::temp_directory_path()};
}

inline WorldPlan plan_world(std::uint64_t seed, Draws draws = {}) {
  return plan_world(seed, draws, folders_of_tests());
}

}  // namespace berth::harness
