#include "berth/linker/process_variables.hpp"

namespace berth::linker {

std::vector<process::NetworkVariable> variables_of(const Earlier& plan, std::string_view slot) {
  std::vector<process::NetworkVariable> variables;
  for (const auto& each : plan.variables) {
    if (each.node == slot) variables.push_back({each.name, each.type, each.object});
  }
  return variables;
}

}  // namespace berth::linker
