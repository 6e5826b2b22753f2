/// Files of examples/eds that are built into the program (cmake/Berth.cmake): the random worlds have devices of theirs.
#pragma once

#include <span>
#include <string_view>

namespace berth::harness {

struct ExampleData {
  std::string_view name;  ///< "pump.eds"
  std::string_view text;
};
[[nodiscard]] std::span<const ExampleData> example_data() noexcept;

}  // namespace berth::harness
