#include "berth/sparkplug/forwarder_parts.hpp"

#include <algorithm>

namespace berth::sparkplug {
namespace {

constexpr std::size_t read_at_once = 1000;
constexpr int most_reads = 10;

}  // namespace

void Forwarder::keep(const Kept& change) {
  if (!backlog_->append(change)) {
    ++lost_;
    return;
  }
  more_ = true;
}

std::vector<Backlog::Entry> Forwarder::portion(std::size_t most, const Judge& judge) {
  std::vector<Backlog::Entry> out;
  std::vector<std::uint64_t> gone;
  // A long row of entries that wait is passed over in several calls.
  for (int reads = 0; reads < most_reads && out.size() < most; ++reads) {
    auto entries = backlog_->after(cursor_, most - out.size());
    more_ = !entries.empty();
    if (!more_) break;
    for (auto& entry : entries) {
      cursor_ = entry.id;
      if (in_flight_.contains(entry.id)) continue;
      const auto fate = judge(entry.kept);
      if (fate == Fate::send) out.push_back(std::move(entry));
      if (fate == Fate::never) gone.push_back(entry.id);
    }
  }
  lost_ += gone.size();
  backlog_->drop(gone);
  return out;
}

void Forwarder::sent(std::uint64_t mark, std::uint64_t id) {
  sent_.push_back({mark, id});
  in_flight_.insert(id);
}

void Forwarder::live(std::uint64_t mark, Kept change) {
  live_.push_back({mark, std::move(change)});
  while (live_.size() > most_unproven_) {
    keep(live_.front().change);
    live_.pop_front();
  }
}

void Forwarder::answered(std::uint64_t mark) {
  while (!live_.empty() && live_.front().mark <= mark) live_.pop_front();
  std::vector<std::uint64_t> delivered;
  while (!sent_.empty() && sent_.front().mark <= mark) {
    delivered.push_back(sent_.front().id);
    in_flight_.erase(sent_.front().id);
    sent_.pop_front();
  }
  backlog_->drop(delivered);
}

void Forwarder::broken() {
  sent_.clear();
  in_flight_.clear();
  cursor_ = 0;
  more_ = true;
  for (const auto& each : live_) keep(each.change);
  live_.clear();
}

void Forwarder::give_up(const std::string& device) {
  std::erase_if(live_, [&](const Live& each) { return each.change.device == device; });
  std::uint64_t after = 0;
  for (auto entries = backlog_->after(after, read_at_once); !entries.empty();
       entries = backlog_->after(after, read_at_once)) {
    std::vector<std::uint64_t> gone;
    for (const auto& entry : entries) {
      after = entry.id;
      if (entry.kept.device == device && !in_flight_.contains(entry.id)) gone.push_back(entry.id);
    }
    lost_ += gone.size();
    backlog_->drop(gone);
  }
}

}  // namespace berth::sparkplug
