/// What a machine file wants of gateways that its plant file does not have. On the bus it would only show as a gateway
/// that does not come up; here it is found before anything runs.
#pragma once

#include "berth/base/finding.hpp"
#include "berth/design/machine.hpp"
#include "berth/plant/plant_file.hpp"

namespace berth::cli {

/// Warnings, at the plant's device or gateway. Pure.
[[nodiscard]] Findings contradictions(const design::Machine& machine, const plant::PlantFile& plant,
                                      const std::string& plant_file);

}  // namespace berth::cli
