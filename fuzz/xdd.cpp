// Any bytes as an XDD or XDC: answered within bounds; what was read can be reviewed, compared with itself, written, and
// read again to the same.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "berth/eds/diff.hpp"
#include "berth/eds/review.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/od/values.hpp"
#include "fuzz/require.hpp"

namespace xdd_target {

namespace {

using namespace berth;

using fuzz::require;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(data, data + size);
  const eds::ReadOptions bounds{
      .max_bytes = 1U << 20U, .max_sub_objects = 4096, .max_value_bytes = 1U << 18U, .max_findings = 200};
  auto reading = eds::read_xdd(text, "fuzz.xdd", bounds);
  require(reading.findings.size() <= 202);
  require(reading.file.description != nullptr);
  for (const auto& each : reading.findings) require(each.line >= 0 && static_cast<std::size_t>(each.line) <= size + 1);
  const od::Description& description = *reading.file.description;
  require(description.subs().size() <= 4096 + description.objects().size());
  const od::Values device(reading.file.description, NodeId(127));
  for (const auto& each : reading.file.parameters) require(description.find(each.object) != nullptr);
  (void)eds::review(reading.file, "fuzz.xdd", text);
  require(eds::diff(reading.file, reading.file).empty());
  if (!reading.usable()) return 0;
  // The schema wants a network number; none is 0.
  if (auto& given = reading.file.commissioning; given && !given->net_number) given->net_number = 0;
  const auto written = eds::write_xdd(reading.file, {.values = true});
  const auto again = eds::read_xdd(written.text, "again.xdd");
  require(again.usable());
  // What XML cannot carry was told, and then something differs.
  if (!written.findings.empty()) return 0;
  const auto differences = eds::diff(reading.file, again.file);
  for (const auto& each : differences) std::fprintf(stderr, "%s\n", eds::to_string(each).c_str());
  require(differences.empty());
  return 0;
}

}  // namespace xdd_target
