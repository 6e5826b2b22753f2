// Any bytes as what simulated devices remember between runs: refused, or written and read back the same.
#include <algorithm>

#include "berth/plant/device_plan.hpp"
#include "fuzz/require.hpp"

namespace sim_state_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  const auto kept = plant::parse_state({reinterpret_cast<const char*>(data), size});
  if (!kept) return 0;
  const auto again = plant::parse_state(plant::write_state(*kept));
  fuzz::require(again.has_value() && again->size() == kept->size());
  for (std::size_t i = 0; i < kept->size(); ++i) {
    const auto& a = (*kept)[i];
    const auto& b = (*again)[i];
    fuzz::require(a.serial == b.serial && a.node_id == b.node_id && a.bit_rate == b.bit_rate);
    fuzz::require(a.plugged == b.plugged && a.image == b.image && a.name == b.name);
  }
  return 0;
}

}  // namespace sim_state_target
