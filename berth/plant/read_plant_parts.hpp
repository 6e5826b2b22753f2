/// Shared by the sources of the plant file's reader (read_plant.cpp, read_plant_device.cpp). Inside of room `plant`.
#pragma once

#include "berth/plant/plant_file.hpp"
#include "berth/text/reach.hpp"
#include "berth/text/toml.hpp"

namespace berth::plant {

inline constexpr text::Limits node_id_or_blank{1, 255};
/// Any bit rate that a controller can have, so that a node at a wrong one can be tried.
inline constexpr text::Limits bit_rates{1'000, 1'000'000};

/// The keys of a `[[device]]`, except its bus, name, identity and whether it is plugged.
void read_traits(text::Table& table, const text::Reach& reach, PlantDevice& device);

}  // namespace berth::plant
