/// Finds frames of the ring by range and filter, with their meaning: the answer to "frames". Works in steps, so that
/// the thread can do other work in between. Internal to room `studio`.
#pragma once

#include <bitset>
#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "berth/decode/words.hpp"
#include "berth/studio/frame_ring.hpp"
#include "berth/studio/messages.hpp"

namespace berth::studio {

/// Text that a row must contain: all of its words, each anywhere, regardless of case (ASCII).
class Filter {
 public:
  explicit Filter(std::string_view text);
  [[nodiscard]] bool empty() const noexcept { return words_.empty(); }
  /// One bit for each of its words.
  using Words = std::bitset<longest_filter / 2 + 1>;
  [[nodiscard]] const Words& all() const noexcept { return all_; }
  /// Those that may occur in `id#data`.
  [[nodiscard]] const Words& digits() const noexcept { return digits_; }
  /// The wanted words that occur in `text`, which is changed to lower case.
  [[nodiscard]] Words in(std::string& text, const Words& wanted) const;

 private:
  std::vector<std::string> words_;
  Words all_, digits_;
};

/// Caches which words of a filter occur in the text of a frame, for frames whose text depends only on themselves
/// (`decode::rests_on`): most frames of a bus repeat an earlier one.
class FoundBefore {
 public:
  FoundBefore() : entries_(size) {}
  struct Entry {
    std::uint64_t head = 0;  // 0: none
    std::uint64_t data = 0;
    Filter::Words found;
  };
  /// The place of a frame that depends on this number of its bytes, and whether it is cached.
  [[nodiscard]] std::pair<Entry&, bool> at(const can::Frame& frame, unsigned bytes) noexcept;

 private:
  static constexpr std::size_t size = 4096;
  std::vector<Entry> entries_;
};

/// The frames' texts, bus by bus: the meaning of a RAND or Fastscan answer depends on the previous frame. Call in the
/// frames' order.
class FrameWords {
 public:
  explicit FrameWords(std::size_t buses) : buses_(buses < 1 ? 1 : buses) {}
  void of(const RingFrame& frame, std::string& out);

 private:
  std::vector<decode::Interpreter> buses_;
};

/// Which frames of the ring pass a filter. Call once per frame, in the order of their numbers.
class Matcher {
 public:
  /// The names must outlive this.
  Matcher(const std::vector<std::string>& buses, std::string_view filter);
  [[nodiscard]] bool lets_all() const noexcept { return filter_.empty(); }
  [[nodiscard]] bool fits(const RingFrame& frame);
  /// The text of the last frame that was checked; empty: it was not needed.
  [[nodiscard]] const std::string& words() const noexcept { return text_; }
  /// Makes the text of a frame without a filter check.
  void say(const RingFrame& frame);

 private:
  [[nodiscard]] Filter::Words said(const RingFrame& frame);

  Filter filter_;
  FrameWords words_;
  FoundBefore found_before_;
  std::vector<Filter::Words> in_bus_;  // of the buses' names
  std::string text_;
  std::string row_;
};

/// {"n", "t_s", "bus", "id", "ext", "rtr", "data", "text"}; also "cut" for an FD frame of more than 8 bytes, "own" for
/// one that the recording program sent, "error" for a report of an error.
void append_row(const RingFrame& frame, std::string_view bus, std::string_view words, std::string& out);

class Search {
 public:
  static constexpr std::uint64_t warm_up = 256;  ///< frames before the first row that are read for its text

  /// `wanted`: a message "frames". Ring and names must outlive this. Later frames are not searched.
  Search(const FrameRing& ring, const std::vector<std::string>& buses, Message wanted);
  /// Searches this number of frames; false: there are more.
  bool step(std::size_t frames);
  /// When it is done: `{"type":"frames",...}`.
  [[nodiscard]] std::string answer() const;

 private:
  struct Row {
    RingFrame frame;
    std::string words;
  };
  void look(const RingFrame& frame);
  void keep(const RingFrame& frame);

  const FrameRing* ring_;
  const std::vector<std::string>* buses_;
  Message wanted_;
  Matcher matcher_;
  std::uint64_t at_;   // the next to be searched
  std::uint64_t end_;  // after the last
  std::uint64_t rows_from_;
  std::uint64_t matched_ = 0;
  std::deque<Row> rows_;
};

}  // namespace berth::studio
