#include "berth/trace/stream.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/trace/asc.hpp"
#include "berth/trace/candump.hpp"
#include "berth/trace/candump_plain.hpp"
#include "berth/trace/pcap.hpp"
#include "berth/trace/pcapng.hpp"
#include "berth/trace/trc.hpp"

namespace berth::trace {
namespace {

std::string small(std::string_view text) {
  std::string letters(text);
  for (char& c : letters) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + ('a' - 'A')) : c;
  return letters;
}

// True: this is a line of a TRC 1.0 without a head: "     1)      1841 0001 8 ...".
bool numbered(std::string_view line) noexcept {
  const auto close = line.find(')');
  return close != std::string_view::npos && close > 0 &&
         std::all_of(line.begin(), line.begin() + static_cast<std::ptrdiff_t>(close),
                     [](char c) { return is_digit(c) || is_blank(c); });
}

}  // namespace

std::string_view name(Format format) noexcept {
  switch (format) {
    case Format::candump: return "candump";
    case Format::pcapng: return "pcapng";
    case Format::asc: return "asc";
    case Format::pcap: return "pcap";
    case Format::trc: break;
  }
  return "trc";
}

bool is_written(Format format) noexcept { return format != Format::pcap; }

std::optional<Format> parse_format(std::string_view text) noexcept {
  if (text == "log") return Format::candump;
  if (text == "pcap") return Format::pcap;
  const auto found =
      std::find_if(std::begin(all_formats), std::end(all_formats), [&](Format f) { return name(f) == text; });
  return found == std::end(all_formats) ? std::nullopt : std::optional(*found);
}

std::optional<Format> format_of_path(std::string_view path) noexcept {
  const auto dot = path.rfind('.');
  if (dot == std::string_view::npos) return std::nullopt;
  const std::string ending = small(path.substr(dot + 1));
  return ending == "candump" ? std::nullopt : parse_format(ending);
}

std::optional<Format> recognise(std::string_view head) noexcept {
  if (head.starts_with("\x0A\x0D\x0D\x0A")) return Format::pcapng;
  if (is_pcap(head)) return Format::pcap;
  if (head.starts_with("\xEF\xBB\xBF")) head.remove_prefix(3);
  // The first lines of a log may be wrong. A line that can only be of one format decides.
  while (!head.empty()) {
    const auto line = head.substr(0, head.find('\n'));
    head.remove_prefix(std::min(line.size() + 1, head.size()));
    if (line.starts_with('(') && line.size() > 1 && is_digit(line[1])) return Format::candump;
    if (parse_plain_candump(line)) return Format::candump;
    if (line.starts_with(';') || numbered(line)) return Format::trc;
    const std::string letters = small(line.substr(0, 16));
    if (letters.starts_with("date ") || letters.starts_with("base hex") || letters.starts_with("base dec") ||
        letters.starts_with("begin trigger"))
      return Format::asc;
  }
  return std::nullopt;
}

std::string_view foreign(std::string_view head) noexcept {
  struct Kind {
    std::string_view begins;
    std::string_view words;
  };
  using namespace std::string_view_literals;
  static constexpr Kind kinds[] = {{"LOGG"sv, "a BLF file (Vector's binary log); export it as ASC"sv},
                                   {"MDF "sv, "an MDF file (ASAM); export it as ASC or candump"sv},
                                   {"\xFF\xFE"sv, "text in UTF-16; convert it: iconv -f UTF-16 -t UTF-8"sv},
                                   {"\xFE\xFF"sv, "text in UTF-16; convert it: iconv -f UTF-16 -t UTF-8"sv},
                                   {"PK\x03\x04"sv, "a ZIP archive; unpack it"sv},
                                   {"\x28\xB5\x2F\xFD"sv, "compressed by zstd; unpack it: zstd -d"sv},
                                   {"\xFD"
                                    "7zXZ"sv,
                                    "compressed by xz; unpack it: unxz"sv},
                                   {"BZh"sv, "compressed by bzip2; unpack it: bunzip2"sv},
                                   {"SQLite format 3"sv, "an SQLite database"sv},
                                   {"\x7F"
                                    "ELF"sv,
                                    "a program"sv}};
  const auto* const found =
      std::find_if(std::begin(kinds), std::end(kinds), [&](const Kind& k) { return head.starts_with(k.begins); });
  return found == std::end(kinds) ? std::string_view() : found->words;
}

std::unique_ptr<Reader> make_reader(Format format, std::string file_name, const ReadOptions& options) {
  switch (format) {
    case Format::pcapng: return std::make_unique<PcapngReader>(std::move(file_name));
    case Format::pcap: return std::make_unique<PcapReader>(std::move(file_name));
    case Format::asc: return std::make_unique<AscReader>(std::move(file_name));
    case Format::trc: return std::make_unique<TrcReader>(std::move(file_name));
    case Format::candump: break;
  }
  const bool error_frames = true;
  return std::make_unique<CandumpReader>(std::move(file_name), error_frames, options.deltas);
}

std::unique_ptr<Writer> make_writer(Format format, const WriteOptions& options) {
  switch (format) {
    case Format::pcapng: return std::make_unique<PcapngWriter>();
    case Format::asc: return std::make_unique<AscWriter>();
    case Format::trc: return std::make_unique<TrcWriter>(options.trc_1_1);
    case Format::pcap:
    case Format::candump: break;
  }
  return std::make_unique<CandumpWriter>(options.directions);
}

std::vector<std::string> Writer::lost() const {
  constexpr const char* words[] = {
      "FD frames are left out: the format has none",
      "times are rounded to the format's unit",
      "times before zero are written as zero",
      "frames whose direction is unknown are written as received (Rx)",
      "error frames are written without their details",
      "frames are of further buses: the format has one",
  };
  static_assert(std::size(words) == static_cast<std::size_t>(Loss::count_));
  std::vector<std::string> lines;
  for (std::size_t i = 0; i < lost_.size(); ++i) {
    if (lost_[i] > 0) lines.push_back(fmt::format("{} {}", lost_[i], words[i]));
  }
  return lines;
}

}  // namespace berth::trace
