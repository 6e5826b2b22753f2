// A log's bytes: the reader ends with a trace and findings that have their places, and what it reads is written and
// read again the same.
#include <algorithm>
#include <string_view>

#include "berth/trace/candump.hpp"
#include "fuzz/require.hpp"

namespace candump_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using fuzz::require;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  auto reading = trace::read_candump(text, "fuzz.log");
  const auto lines = 1 + std::count(text.begin(), text.end(), '\n');
  require(reading.trace.entries.size() <= static_cast<std::size_t>(lines));
  require(reading.findings.size() <= trace::most_findings + 1);
  for (const auto& finding : reading.findings) require(finding.line <= lines && !to_string(finding).empty());
  for (std::uint16_t bus = 0; bus < reading.trace.buses.size(); ++bus) {
    const auto all = trace::statistics(reading.trace, bus);
    require(all.frames > 0 && all.load(125'000) == all.load(125'000));
  }
  // What is written is rounded to microseconds.
  for (auto& entry : reading.trace.entries) entry.at = rt::Duration((entry.at.count() + 500) / 1000 * 1000);
  const auto again = trace::read_candump(trace::write_candump(reading.trace), "again.log");
  require(again.trace == reading.trace && !has_errors(again.findings));
  return 0;
}

}  // namespace candump_target
