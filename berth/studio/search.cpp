#include "berth/studio/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "berth/base/words.hpp"
#include "berth/operate/report.hpp"

namespace berth::studio {
namespace {

void lower_all(std::string& text) {
  for (char& c : text) c = lower(c);
}

std::string in_quotes(std::string_view text) {
  return nlohmann::json(text).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

void append_hex(const RingFrame& frame, std::string& out) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  for (const auto byte : frame.frame.bytes()) {
    out += digits[byte >> 4U];
    out += digits[byte & 15U];
  }
}

void append_id(const RingFrame& frame, std::string& out) {
  const auto to = std::back_inserter(out);
  if (frame.frame.extended) {
    fmt::format_to(to, "{:08X}", frame.frame.id);
  } else {
    fmt::format_to(to, "{:03X}", frame.frame.id);
  }
}

const std::string& name_of(const std::vector<std::string>& buses, std::uint8_t bus) {
  static const std::string none = "?";
  return bus < buses.size() ? buses[bus] : none;
}

}  // namespace

Filter::Filter(std::string_view text) {
  while (!text.empty()) {
    const auto blank = text.find(' ');
    std::string word(text.substr(0, blank));
    lower_all(word);
    if (!word.empty()) {
      const bool digits = word.find_first_not_of("0123456789abcdef#") == std::string::npos;
      all_.set(words_.size());
      digits_.set(words_.size(), digits);
      words_.push_back(std::move(word));
    }
    text = blank == std::string_view::npos ? std::string_view() : text.substr(blank + 1);
  }
}

Filter::Words Filter::in(std::string& text, const Words& wanted) const {
  lower_all(text);
  Words found;
  for (std::size_t i = 0; i < words_.size(); ++i) {
    if (wanted.test(i) && text.find(words_[i]) != std::string::npos) found.set(i);
  }
  return found;
}

std::pair<FoundBefore::Entry&, bool> FoundBefore::at(const can::Frame& frame, unsigned bytes) noexcept {
  Entry key;
  key.head =
      frame.key() | std::uint64_t{frame.size} << 32U | std::uint64_t{frame.remote} << 40U | std::uint64_t{1} << 48U;
  std::memcpy(&key.data, frame.data.data(), std::min<std::size_t>(bytes, sizeof key.data));
  const std::uint64_t mixed = (key.head ^ key.data * 0x9E37'79B9'7F4A'7C15ULL) * 0xD6E8'FEB8'6659'FD93ULL;
  Entry& entry = entries_[mixed >> 52U];
  static_assert(size == std::size_t{1} << 12U);
  const bool there = entry.head == key.head && entry.data == key.data;
  if (!there) entry = key;
  return {entry, there};
}

void FrameWords::of(const RingFrame& frame, std::string& out) {
  if (!frame.error) {
    buses_[std::min<std::size_t>(frame.bus, buses_.size() - 1)].words(frame.frame, out);
    return;
  }
  decode::error_words(frame.frame, out);
  if (!frame.about.empty()) fmt::format_to(std::back_inserter(out), "; {}", frame.about);
}

void append_row(const RingFrame& frame, std::string_view bus, std::string_view words, std::string& out) {
  fmt::format_to(std::back_inserter(out), R"({{"n":{},"t_s":{:.6f},"bus":{},"id":{},"ext":{},"rtr":{},"data":")",
                 frame.number, operate::seconds(frame.at), in_quotes(bus), frame.frame.id, frame.frame.extended,
                 frame.frame.remote);
  append_hex(frame, out);
  out += "\",\"text\":" + in_quotes(words);
  if (frame.frame.remote) fmt::format_to(std::back_inserter(out), R"(,"dlc":{})", frame.frame.size);
  if (frame.cut) out += ",\"cut\":true";
  if (frame.own) out += ",\"own\":true";
  if (frame.error) out += ",\"error\":true";
  out += '}';
}

Matcher::Matcher(const std::vector<std::string>& buses, std::string_view filter)
    : filter_(filter), words_(buses.size()) {
  for (auto name : buses) in_bus_.push_back(filter_.in(name, filter_.all()));
  in_bus_.emplace_back();  // for frames of an unknown bus
}

void Matcher::say(const RingFrame& frame) {
  text_.clear();
  words_.of(frame, text_);
}

// No word has a blank, so each is wholly in the bus's name, in `id#data` or in the frame's words.
bool Matcher::fits(const RingFrame& frame) {
  Filter::Words missing = filter_.all() & ~in_bus_[std::min<std::size_t>(frame.bus, in_bus_.size() - 1)];
  missing &= ~said(frame);
  if (missing.none()) return true;
  if ((missing & ~filter_.digits()).any()) return false;
  row_.clear();
  append_id(frame, row_);
  row_ += '#';
  append_hex(frame, row_);
  return filter_.in(row_, missing) == missing;
}

Filter::Words Matcher::said(const RingFrame& frame) {
  text_.clear();
  const auto bytes = frame.error ? std::nullopt : decode::rests_on(frame.frame);
  if (!bytes) {
    words_.of(frame, text_);
    row_ = text_;
    return filter_.in(row_, filter_.all());
  }
  const auto [entry, there] = found_before_.at(frame.frame, *bytes);
  if (!there) {
    row_.clear();
    words_.of(frame, row_);
    entry.found = filter_.in(row_, filter_.all());
  }
  return entry.found;
}

Search::Search(const FrameRing& ring, const std::vector<std::string>& buses, Message wanted)
    : ring_(&ring),
      buses_(&buses),
      wanted_(std::move(wanted)),
      matcher_(buses, wanted_.filter),
      at_(ring.first()),
      end_(ring.next()),
      rows_from_(at_) {
  if (wanted_.from) rows_from_ = std::clamp(*wanted_.from, at_, end_);
  if (!matcher_.lets_all()) return;
  // Without a filter: the rows of the range, and some frames before them for the decoder.
  matched_ = end_ - at_;
  if (!wanted_.from) rows_from_ = end_ - std::min<std::uint64_t>(wanted_.count, end_ - at_);
  end_ = std::min(end_, rows_from_ + wanted_.count);
  at_ = rows_from_ - std::min(warm_up, rows_from_ - at_);
}

bool Search::step(std::size_t frames) {
  RingFrame frame;
  for (; frames > 0 && at_ < end_; --frames, ++at_) {
    if (ring_->read(at_, frame)) look(frame);
  }
  return at_ >= end_;
}

void Search::look(const RingFrame& frame) {
  if (matcher_.lets_all()) {
    matcher_.say(frame);
  } else if (!matcher_.fits(frame)) {
    return;
  } else {
    ++matched_;
  }
  keep(frame);
}

void Search::keep(const RingFrame& frame) {
  if (frame.number < rows_from_) return;
  const bool full = rows_.size() >= wanted_.count;
  if (full && wanted_.from) return;
  if (full) rows_.pop_front();
  rows_.push_back({frame, matcher_.words()});
}

std::string Search::answer() const {
  std::string out = fmt::format(R"({{"type":"frames","id":{},"first":{},"last":{},"matched":{},"rows":[)",
                                in_quotes(wanted_.id), rows_.empty() ? rows_from_ : rows_.front().frame.number,
                                rows_.empty() ? rows_from_ : rows_.back().frame.number, matched_);
  FrameWords words(buses_->size());
  for (const auto& row : rows_) {
    if (out.back() != '[') out += ',';
    std::string text = row.words;
    if (text.empty()) words.of(row.frame, text);
    append_row(row.frame, name_of(*buses_, row.frame.bus), text, out);
  }
  out += "]}";
  return out;
}

}  // namespace berth::studio
