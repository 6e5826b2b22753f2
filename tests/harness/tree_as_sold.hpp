// The trees of berth/harness/tree_as_sold.hpp, their description files in the folder for temporary files.
#pragma once

#include <filesystem>
#include <utility>

#include "berth/harness/tree_as_sold.hpp"

namespace berth::harness {

inline TreePlan as_sold(TreePlan plan) { return as_sold(std::move(plan), std::filesystem::temp_directory_path()); }

}  // namespace berth::harness
