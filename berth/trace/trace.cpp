#include "berth/trace/trace.hpp"

#include <algorithm>
#include <map>

#include "berth/can/length.hpp"

namespace berth::trace {

std::uint16_t Trace::bus(std::string_view name) {
  const auto known = std::ranges::find(buses, name);
  if (known != buses.end()) return static_cast<std::uint16_t>(known - buses.begin());
  buses.emplace_back(name);
  return static_cast<std::uint16_t>(buses.size() - 1);
}

double Statistics::load(std::uint32_t bit_rate) const noexcept {
  const double seconds = std::chrono::duration<double>(span()).count();
  if (seconds <= 0 || bit_rate == 0) return 0;
  return static_cast<double>(bits - first_bits) / bit_rate / seconds;
}

Statistics statistics(const Trace& trace, std::uint16_t bus) {
  Statistics all;
  std::map<std::uint32_t, IdStatistics> ids;
  for (const Entry& entry : trace.entries) {
    if (entry.bus != bus) continue;
    const unsigned bits = entry.frame.fd ? 0 : can::exact_bits(entry.frame);
    if (all.frames == 0) {
      all.first = all.last = entry.at;
      all.first_bits = bits;
    }
    all.longest_gap = std::max(all.longest_gap, entry.at - all.last);
    all.last = entry.at;
    ++all.frames;
    all.bits += bits;
    if (entry.frame.fd) ++all.fd_frames;
    auto& id = ids[entry.frame.key()];
    id.key = entry.frame.key();
    ++id.frames;
    id.bits += bits;
  }
  for (const auto& [key, id] : ids) all.ids.push_back(id);
  return all;
}

}  // namespace berth::trace
