#include "berth/doctor/findings.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::doctor {

Diagnosis finding(const Expected& expected, Kind kind, Certainty certainty, NodeId node) {
  Diagnosis d;
  d.kind = kind;
  d.certainty = certainty;
  d.node = node;
  if (const auto* slot = node.configured() ? expected.slot(node) : nullptr) d.slot = slot->name.name;
  return d;
}

void when(Diagnosis& diagnosis, const Count& count) {
  if (count.count == 0) return;
  diagnosis.first = diagnosis.count == 0 ? count.first : std::min(diagnosis.first, count.first);
  diagnosis.last = std::max(diagnosis.last, count.last);
  diagnosis.count += count.count;
}

std::string who(const Expected& expected, NodeId node) {
  const auto* slot = expected.slot(node);
  if (slot != nullptr) return fmt::format("node {} ({})", node.value(), slot->name.name);
  return fmt::format("node {}{}", node.value(), node == expected.master ? " (the master)" : "");
}

std::string times(const Count& count) {
  if (count.count == 1) return fmt::format("once, at {:.3f} s", in_seconds(count.first));
  return fmt::format("{} times, from {:.3f} s to {:.3f} s", count.count, in_seconds(count.first),
                     in_seconds(count.last));
}

std::string list(const std::vector<NodeId>& nodes) {
  std::string text;
  for (const auto n : nodes) text += fmt::format("{}{}", text.empty() ? "" : ", ", n.value());
  return text;
}

double in_seconds(rt::Time at) noexcept { return std::chrono::duration<double>(at.time_since_epoch()).count(); }
double in_ms(rt::Duration time) noexcept { return std::chrono::duration<double, std::milli>(time).count(); }

}  // namespace berth::doctor
