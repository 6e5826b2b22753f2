#include "berth/studio/opened.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "berth/studio/query.hpp"

namespace berth::studio {
namespace {

std::string as_text(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

/// In the form that the ring has.
RingFrame row_of(const trace::Entry& entry, std::uint64_t number) {
  RingFrame row;
  row.number = number;
  row.at = rt::Time(entry.at);
  row.own = entry.direction == trace::Direction::sent;
  row.cut = entry.frame.size > 8;
  row.error = entry.error;
  row.frame = entry.frame;
  row.frame.size = std::min<std::uint8_t>(entry.frame.size, 8);
  return row;
}

}  // namespace

Opened::Opened(std::string name, std::string bytes) : name_(std::move(name)), bytes_(std::move(bytes)), file_(name_) {}

bool Opened::step() {
  constexpr std::size_t piece = std::size_t{64} << 10U;
  if (fed_ < bytes_.size()) {
    const auto bytes = std::string_view(bytes_).substr(fed_, piece);
    fed_ += bytes.size();
    wrong_ = file_.feed(bytes, *this);
    if (wrong_.empty() && frames_ > most_entries)
      wrong_ = fmt::format(
          "{}: more than {} frames: cut it into parts (berth trace FILE --after TIME --before TIME -o "
          "PART)",
          name_, most_entries);
    return !wrong_.empty();
  }
  wrong_ = file_.end(*this);
  if (wrong_.empty()) file_.finish(*this);
  return true;
}

tl::expected<std::string, std::string> Opened::answer() const {
  if (!wrong_.empty()) return tl::unexpected(wrong_);
  const auto format = file_.format();
  return fmt::format(
      R"({{"name":{},"format":"{}","buses":{},"frames":{},"rows":[{}],"findings":{},"more_findings":{}}})",
      as_text(name_), format ? trace::name(*format) : "", as_text(file_.buses()), frames_, rows_, as_text(findings_),
      more_findings_);
}

void Opened::entry(const trace::Entry& entry) {
  const auto number = frames_++;
  if (number >= most_frames || entry.bus >= most_buses) return;
  if (words_.size() <= entry.bus) words_.resize(entry.bus + std::size_t{1});
  if (!rows_.empty()) rows_ += ',';
  std::string words;
  if (entry.error) {
    decode::error_words(entry.frame, words);
  } else {
    words_[entry.bus].words(entry.frame, words);
  }
  append_row(row_of(entry, number), file_.buses()[entry.bus], words, rows_);
}

void Opened::finding(Finding finding) {
  if (findings_.size() < most_findings) {
    findings_.push_back(to_string(finding));
  } else {
    ++more_findings_;
  }
}

tl::expected<std::string, std::string> parse_name_query(std::string_view query) {
  const std::string_view key = "name=";
  constexpr std::size_t longest = 255;
  const auto name = query.starts_with(key) ? decoded(query.substr(key.size())) : std::nullopt;
  if (!name || name->empty() || name->size() > longest || query.find('&') != std::string_view::npos)
    return tl::unexpected(fmt::format("the file's name is in the address, 1 to {} bytes: ?name=run.log", longest));
  return name->substr(name->rfind('/') + 1);
}

}  // namespace berth::studio
