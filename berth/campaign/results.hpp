/// Lines of one or more files of campaigns, each seed once.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/campaign/line.hpp"

namespace berth::campaign {

/// Two lines of one key say different things.
struct Contradiction {
  Line first, other;
  std::string first_from, other_from;  ///< files
};

/// What was read of one file.
struct FileRead {
  std::uint64_t lines = 0;      ///< good ones, doubles too
  std::uint64_t torn_at = 0;    ///< the first byte of a last line without its end; the file's size where there is none
  std::uint64_t size = 0;       ///< bytes
  std::uint64_t pieces = 0;     ///< torn ones before the last, as `cat` may leave them: passed over
  std::uint64_t bad_lines = 0;  ///< those that have nothing of one: passed over
  std::uint64_t first_bad = 0;  ///< number of the first one; 0: there is none
  std::string why_bad;
  bool begins_as_one = true;     ///< its first bytes are those of a line; a short or empty file's as far as they go
  bool lacks_line_feed = false;  ///< its last line is whole, and only its line feed is missing
  [[nodiscard]] bool torn() const noexcept { return torn_at < size; }
  /// It has no line, and not the beginning of one: it is another file, named by mistake.
  [[nodiscard]] bool foreign() const noexcept { return lines == 0 && (bad_lines > 0 || torn()) && !begins_as_one; }
};

/// How every line of a campaign begins; nothing within one is like it, as quotes in texts are escaped.
inline constexpr std::string_view line_begin = "{\"kind\":\"";

class Results {
 public:
  /// Reads a file's lines. `cat` may have joined it of several, also of such as end with a torn line. Empty lines are
  /// passed over. A last line without a line feed counts where it is whole. `Errc::io`: it cannot be read (errno in
  /// `detail`); what was read before stays.
  [[nodiscard]] Result<FileRead> read(const std::string& path);
  /// `from`: a file, for contradictions. The first line of a key stays, unless it is no result (`is_result`) and the
  /// other is one.
  void add(Line line, const std::string& from);

  /// By kind, options, version and seed.
  [[nodiscard]] const std::map<Key, Line>& lines() const noexcept { return lines_; }
  /// How many lines said what another had said.
  [[nodiscard]] std::uint64_t doubles() const noexcept { return doubles_; }
  [[nodiscard]] const std::vector<Contradiction>& contradictions() const noexcept { return contradictions_; }

 private:
  bool take(std::string_view text, const std::string& from, FileRead& file);
  std::map<Key, Line> lines_;
  std::map<Key, std::uint32_t> from_;  // places in `files_`
  std::vector<std::string> files_;
  std::uint64_t doubles_ = 0;
  std::vector<Contradiction> contradictions_;
};

}  // namespace berth::campaign
