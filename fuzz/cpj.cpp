// Any bytes as a nodelist project: answered within bounds, and what is written is read as the same.
#include <cstdint>
#include <cstdlib>
#include <string>

#include "berth/eds/cpj.hpp"
#include "fuzz/require.hpp"

namespace cpj_target {

using berth::fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  const auto reading =
      eds::read_cpj(std::string(data, data + size), "fuzz.cpj", {.max_bytes = 1U << 20U, .max_findings = 200});
  require(reading.findings.size() <= 202);
  if (!reading.usable()) return 0;
  for (const auto& topology : reading.project.topologies) {
    std::uint8_t before = 0;
    for (const auto& node : topology.nodes) {
      require(node.node_id > before && node.node_id <= 127);
      before = node.node_id;
      const auto path = eds::dcf_path("plant/p.cpj", topology, node);
      require(!path || path->string().starts_with("plant/"));
    }
  }
  const auto written = eds::write_cpj(reading.project);
  for (const auto& each : written.findings) require(each.severity == Finding::Severity::note);
  const auto back = eds::read_cpj(written.text, "back.cpj");
  require(back.usable());
  require(eds::write_cpj(back.project).text == written.text);
  return 0;
}

}  // namespace cpj_target
