#include "berth/studio/search.hpp"

#include <fmt/format.h>

#include <algorithm>
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
    if (!word.empty()) words_.push_back(std::move(word));
    text = blank == std::string_view::npos ? std::string_view() : text.substr(blank + 1);
  }
}

bool Filter::matches(std::string& row) const {
  lower_all(row);
  return std::ranges::all_of(words_, [&](const std::string& word) { return row.find(word) != std::string::npos; });
}

void FrameWords::of(const RingFrame& frame, std::string& out) {
  buses_[std::min<std::size_t>(frame.bus, buses_.size() - 1)].words(frame.frame, out);
}

void append_row(const RingFrame& frame, std::string_view bus, std::string_view words, std::string& out) {
  fmt::format_to(std::back_inserter(out), R"({{"n":{},"t_s":{:.6f},"bus":{},"id":{},"ext":{},"rtr":{},"data":")",
                 frame.number, operate::seconds(frame.at), in_quotes(bus), frame.frame.id, frame.frame.extended,
                 frame.frame.remote);
  append_hex(frame, out);
  out += "\",\"text\":" + in_quotes(words);
  if (frame.frame.remote) fmt::format_to(std::back_inserter(out), R"(,"dlc":{})", frame.frame.size);
  if (frame.cut) out += ",\"cut\":true";
  out += '}';
}

Search::Search(const FrameRing& ring, const std::vector<std::string>& buses, Message wanted)
    : ring_(&ring),
      buses_(&buses),
      wanted_(std::move(wanted)),
      filter_(wanted_.filter),
      words_(buses.size()),
      at_(ring.first()),
      end_(ring.next()),
      rows_from_(at_) {
  if (wanted_.from) rows_from_ = std::clamp(*wanted_.from, at_, end_);
  if (!filter_.empty()) return;
  // A range by itself: its rows, and what stands before them for the words.
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
  text_.clear();
  words_.of(frame, text_);
  if (!filter_.empty()) {
    row_ = name_of(*buses_, frame.bus);
    row_ += ' ';
    append_id(frame, row_);
    row_ += '#';
    append_hex(frame, row_);
    row_ += ' ';
    row_ += text_;
    if (!filter_.matches(row_)) return;
    ++matched_;
  }
  if (frame.number < rows_from_) return;
  const bool full = rows_.size() >= wanted_.count;
  if (full && wanted_.from) return;
  if (full) rows_.pop_front();
  Row& row = rows_.emplace_back(Row{frame.number, {}});
  append_row(frame, name_of(*buses_, frame.bus), text_, row.json);
}

std::string Search::answer() const {
  std::string out = fmt::format(R"({{"type":"frames","id":{},"first":{},"last":{},"matched":{},"rows":[)",
                                in_quotes(wanted_.id), rows_.empty() ? rows_from_ : rows_.front().number,
                                rows_.empty() ? rows_from_ : rows_.back().number, matched_);
  for (const auto& row : rows_) {
    if (out.back() != '[') out += ',';
    out += row.json;
  }
  out += "]}";
  return out;
}

}  // namespace berth::studio
