#include "berth/trace/lines.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::trace {

std::string line_name(std::string_view name) {
  std::string fit(name);
  for (char& c : fit) {
    if (is_blank(c) || c == '\n') c = '_';
  }
  return fit.empty() ? "_" : fit;
}

bool LineNames::add(std::uint16_t bus, std::string_view name) {
  if (bus < numbers_.size() && numbers_[bus] != 0) [[likely]]
    return false;
  if (bus >= numbers_.size()) {
    names_.resize(bus + std::size_t{1});
    numbers_.resize(bus + std::size_t{1});
  }
  names_[bus] = line_name(name);
  numbers_[bus] = ++count_;
  return true;
}

void LineReader::feed(std::string_view bytes, Sink& sink) {
  sink_ = &sink;
  while (!bytes.empty()) {
    const void* const found = std::memchr(bytes.data(), '\n', bytes.size());
    if (found == nullptr) return partial(bytes);
    const auto length = static_cast<std::size_t>(static_cast<const char*>(found) - bytes.data());
    const auto line_bytes = bytes.substr(0, length);
    bytes.remove_prefix(length + 1);
    if (passing_) [[unlikely]] {
      passing_ = false;
    } else if (rest_.empty() && length <= longest_line) [[likely]] {
      one(line_bytes);
    } else {
      partial(line_bytes);
      if (!passing_) one(rest_);
      passing_ = false;
      rest_.clear();
    }
  }
}

void LineReader::partial(std::string_view bytes) {
  if (passing_) return;
  if (rest_.size() + bytes.size() <= longest_line) {
    rest_ += bytes;
    return;
  }
  ++number_;
  error(longest_line, fmt::format("the line is longer than {} characters; it is left out", longest_line));
  rest_.clear();
  passing_ = true;
}

void LineReader::finish(Sink& sink) {
  sink_ = &sink;
  if (!rest_.empty()) {
    const std::string last = std::move(rest_);
    rest_.clear();
    one(last);
    tell(Finding::Severity::note, last.size(), "the file ends without a line end: it may be cut short here");
  }
  over();
}

void LineReader::tell(Finding::Severity severity, std::size_t column, std::string message, std::string fix) {
  sink_->finding({severity, file_, number_, static_cast<int>(column) + 1, {}, std::move(message), std::move(fix)});
}

void LineReader::tell_of_file(Finding::Severity severity, std::string message, std::string fix) {
  sink_->finding({severity, file_, 0, 0, {}, std::move(message), std::move(fix)});
}

void LineReader::tell_back() {
  tell(Finding::Severity::warning, 0,
       "earlier than the line before of this bus: the clock was set back, or two logs were joined");
}

std::optional<std::uint16_t> LineReader::known_bus(std::string_view name) const {
  const auto known = known_.find(std::string(name));
  return known == known_.end() ? std::nullopt : std::optional(known->second);
}

std::optional<std::uint16_t> LineReader::bus(std::string_view name) {
  const auto [place, added] = known_.try_emplace(std::string(name), static_cast<std::uint16_t>(buses_.size()));
  if (!added) return place->second;
  if (buses_.size() >= most_buses) {
    known_.erase(place);
    error(0, fmt::format("a trace has at most {} buses", most_buses));
    return std::nullopt;
  }
  buses_.emplace_back(name);
  latest_.push_back(rt::Duration::min());
  return place->second;
}

}  // namespace berth::trace
