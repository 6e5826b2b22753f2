#include "berth/multilevel/event_log.hpp"

#include <algorithm>

namespace berth::multilevel {
namespace {

std::string hex(std::uint16_t code) {
  static constexpr std::string_view digits = "0123456789ABCDEF";
  std::string made;
  for (int shift = 12; shift >= 0; shift -= 4) made += digits[code >> static_cast<unsigned>(shift) & 15U];
  return made + "h";
}

const char* words_of(std::uint16_t code, std::uint16_t profile, EmcyWords words) {
  const char* const own = gateway_code_text(code);
  return own != nullptr && profile == 0 ? own : words(code, profile);
}

}  // namespace

std::string text(const LoggedEmcy& entry, EmcyWords words) {
  const EmcyReading& reading = entry.reading;
  std::string line = path_text(reading.path) + ":";
  if (reading.exiting != 0) {
    line += " error " + hex(reading.exiting) + " gone: " + words_of(reading.exiting, entry.profile, words);
  }
  if (reading.code != 0 || reading.exiting == 0) {
    if (reading.exiting != 0) line += "; pending:";
    line += " " + hex(reading.code) + " " + words_of(reading.code, entry.profile, words);
  }
  if (reading.port != 0) line += ", port " + std::to_string(reading.port);
  if (reading.signal != 0) line += ", signal " + std::to_string(reading.signal);
  if (reading.garbled) line += " (its sub-net bytes are none)";
  return line;
}

EventLog::EventLog(can::Dispatcher& backbone, EmcyLayout layout, std::size_t most)
    : consumer_(backbone, *this), layout_(layout), most_(most) {}

std::vector<std::uint16_t> EventLog::pending(const std::vector<NodeId>& path) const {
  const auto known = pending_.find(path);
  return known == pending_.end() ? std::vector<std::uint16_t>{} : known->second;
}

void EventLog::emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept {
  LoggedEmcy entry{.at = at, .reading = read_emcy(layout_, node, message)};
  const auto profile = profiles_.find(entry.reading.path);
  if (profile != profiles_.end()) entry.profile = profile->second;
  // Figure 7 has no field for the error that is gone. If one error is pending, 0000h means that one.
  const auto pending_now = pending(entry.reading.path);
  const bool all_gone = entry.reading.code == 0 && entry.reading.exiting == 0;
  if (all_gone && !has_exit(layout_) && pending_now.size() == 1) entry.reading.exiting = pending_now.front();
  note(entry.reading);
  ++count_;
  if (entries_.size() == most_) entries_.pop_front();
  entries_.push_back(entry);
  if (told_) told_(entry);
}

void EventLog::note(const EmcyReading& reading) {
  auto& codes = pending_[reading.path];
  std::erase(codes, reading.exiting);
  if (reading.code == 0) codes.clear();
  const bool is_error = (reading.code >> 8U) != 0;
  if (is_error && std::ranges::find(codes, reading.code) == codes.end()) codes.push_back(reading.code);
}

}  // namespace berth::multilevel
