/// The texts of examples/five-slaves.toml and its plant, built in (CMakeLists.txt).
#pragma once

#include <string_view>

namespace berth::cli {

extern const std::string_view demo_machine;
extern const std::string_view demo_plant;

}  // namespace berth::cli
