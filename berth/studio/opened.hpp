/// Reads a trace file sent by a page, for its list: the frames with their texts, and the errors in the file, as `berth
/// trace` reads it. Works in steps, so that the thread can do other work in between. Internal to room `studio`.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/studio/search.hpp"
#include "berth/trace/any_file.hpp"

namespace berth::studio {

inline constexpr std::size_t longest_file = std::size_t{16} << 20U;  ///< bytes, as sent

class Opened final : private trace::Sink {
 public:
  static constexpr std::uint64_t most_frames = 100'000;                   ///< in the answer; others are counted
  static constexpr std::size_t most_findings = 100;                       ///< the same
  static constexpr std::size_t most_buses = 255;                          ///< frames of further buses are omitted
  static constexpr std::uint64_t most_entries = std::uint64_t{4} << 20U;  ///< of one in gzip

  Opened(std::string name, std::string bytes);
  /// Reads a piece; true: that was the end, and `answer` is complete.
  bool step();
  /// {"name", "format", "buses", "frames", "rows", "findings", "more_findings"}; or the reason why nothing could be
  /// read.
  [[nodiscard]] tl::expected<std::string, std::string> answer() const;

 private:
  void entry(const trace::Entry& entry) override;
  void finding(Finding finding) override;

  std::string name_;
  std::string bytes_;
  std::size_t fed_ = 0;
  trace::AnyFile file_;
  std::string wrong_;
  std::vector<decode::Interpreter> words_;  // by bus
  std::uint64_t frames_ = 0;
  std::string rows_;  // JSON
  std::vector<std::string> findings_;
  std::uint64_t more_findings_ = 0;
};

/// "name=run.log": the name used in findings; the reason as text for anything else. Not a path: everything up to the
/// last slash is removed.
[[nodiscard]] tl::expected<std::string, std::string> parse_name_query(std::string_view query);

}  // namespace berth::studio
