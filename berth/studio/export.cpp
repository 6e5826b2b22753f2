#include "berth/studio/export.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "berth/studio/messages.hpp"
#include "berth/studio/query.hpp"

namespace berth::studio {
namespace {

std::optional<std::uint64_t> number(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool whole = error == std::errc() && end == text.data() + text.size();
  return whole ? std::optional(value) : std::nullopt;
}

/// Empty: the key was read. Otherwise the error.
std::string read_key(std::string_view key, const std::string& value, TraceQuery& into) {
  if (key == "format") {
    into.trc_1_1 = value == "trc1.1";
    const auto format = trace::parse_format(into.trc_1_1 ? "trc" : value);
    if (!format || !trace::is_written(*format)) return "\"format\" is candump, pcapng, asc, trc or trc1.1";
    into.format = *format;
    return {};
  }
  if (key == "filter") {
    into.filter = value;
    if (value.size() <= longest_filter) return {};
    return fmt::format("\"filter\" has at most {} bytes", longest_filter);
  }
  if (key != "from" && key != "to") return "a trace request takes format, from, to and filter";
  const auto read = number(value);
  if (!read) return fmt::format("\"{}\" is the number of a frame", key);
  if (key == "from") into.from = *read;
  if (key == "to") into.to = *read;
  return {};
}

}  // namespace

tl::expected<TraceQuery, std::string> parse_trace_query(std::string_view query) {
  TraceQuery wanted;
  while (!query.empty()) {
    const auto end = query.find('&');
    const auto pair = query.substr(0, end);
    query = end == std::string_view::npos ? std::string_view() : query.substr(end + 1);
    const auto equals = pair.find('=');
    const auto value = decoded(equals == std::string_view::npos ? std::string_view() : pair.substr(equals + 1));
    if (!value) return tl::unexpected(std::string("two hexadecimal digits must follow a %"));
    auto problem = read_key(pair.substr(0, equals), *value, wanted);
    if (!problem.empty()) return tl::unexpected(std::move(problem));
  }
  return wanted;
}

std::string_view ending_of(trace::Format format) noexcept {
  return format == trace::Format::candump ? "log" : trace::name(format);
}

// Reads some frames before the first written one: RAND's and Fastscan's answers are decoded from their requests.
Export::Export(const FrameRing& ring, const std::vector<std::string>& buses, const TraceQuery& query)
    : ring_(&ring),
      buses_(&buses),
      matcher_(buses, query.filter),
      writer_(trace::make_writer(query.format, {.trc_1_1 = query.trc_1_1})),
      at_(ring.first()),
      from_(0),
      end_(ring.next()) {
  from_ = std::clamp(query.from, at_, end_);
  if (query.to && *query.to < end_) end_ = std::max(from_, *query.to + 1);
  at_ = matcher_.lets_all() ? from_ : from_ - std::min(Search::warm_up, from_ - at_);
}

bool Export::step(std::size_t frames, std::string& out) {
  RingFrame frame;
  for (; frames > 0 && at_ < end_; --frames, ++at_) {
    if (!ring_->read(at_, frame) || frame.bus >= buses_->size()) continue;
    const bool fits = matcher_.lets_all() || matcher_.fits(frame);
    if (!fits || at_ < from_) continue;
    if (frame.fd && !ring_->whole(at_, frame.frame)) continue;
    const trace::Entry entry{.at = frame.at.time_since_epoch(),
                             .bus = frame.bus,
                             .frame = frame.frame,
                             .direction = frame.own ? trace::Direction::sent : trace::Direction::received,
                             .error = frame.error};
    writer_->write(entry, (*buses_)[frame.bus], out);
  }
  if (at_ < end_) return false;
  writer_->finish(out);
  return true;
}

}  // namespace berth::studio
