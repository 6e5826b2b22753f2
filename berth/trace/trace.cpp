#include "berth/trace/trace.hpp"

#include <algorithm>
#include <cmath>

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

void Counter::add(const Entry& entry) {
  if (entry.error) return;
  const unsigned bits = entry.frame.fd ? 0 : can::exact_bits(entry.frame);
  if (all_.frames == 0) {
    all_.first = all_.last = entry.at;
    all_.first_bits = bits;
  }
  all_.longest_gap = std::max(all_.longest_gap, entry.at - all_.last);
  all_.last = entry.at;
  ++all_.frames;
  all_.bits += bits;
  if (entry.frame.fd) ++all_.fd_frames;
  Id& id = entry.frame.extended ? extended_[entry.frame.key()] : base_[entry.frame.id & can::base_mask];
  ++id.frames;
  id.bits += bits;
  if (id.frames == 1) {
    id.first = id.last = entry.at;
    return;
  }
  const rt::Duration period = entry.at - id.last;
  id.last = entry.at;
  id.shortest = id.frames == 2 ? period : std::min(id.shortest, period);
  id.longest = std::max(id.longest, period);
  const double deviation = static_cast<double>(period.count()) - id.mean;
  id.mean += deviation / static_cast<double>(id.frames - 1);
  id.squares += deviation * (static_cast<double>(period.count()) - id.mean);
}

Statistics Counter::statistics() const {
  Statistics all = all_;
  const auto put = [&](std::uint32_t key, const Id& id) {
    if (id.frames == 0) return;
    IdStatistics& one = all.ids.emplace_back();
    one.key = key;
    one.frames = id.frames;
    one.bits = id.bits;
    if (id.frames < 2) return;
    const auto periods = id.frames - 1;
    one.shortest = id.shortest;
    one.longest = id.longest;
    one.average = (id.last - id.first) / static_cast<std::int64_t>(periods);
    one.jitter = rt::Duration(std::llround(std::sqrt(id.squares / static_cast<double>(periods))));
  };
  for (std::uint32_t id = 0; id < base_.size(); ++id) put(id, base_[id]);
  std::vector<std::uint32_t> keys;
  for (const auto& [key, id] : extended_) keys.push_back(key);
  std::sort(keys.begin(), keys.end());
  for (const auto key : keys) put(key, extended_.at(key));
  return all;
}

Statistics statistics(const Trace& trace, std::uint16_t bus) {
  Counter counter;
  for (const Entry& entry : trace.entries) {
    if (entry.bus == bus) counter.add(entry);
  }
  return counter.statistics();
}

}  // namespace berth::trace
