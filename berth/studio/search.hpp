/// Frames of the ring by range and by filter, with what they mean: the answer to "frames". Works in steps, so that the
/// thread does other things between them. Inside of room `studio`.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "berth/decode/words.hpp"
#include "berth/studio/frame_ring.hpp"
#include "berth/studio/messages.hpp"

namespace berth::studio {

/// Text that a row must contain: all of its words, each anywhere, in capitals or not (ASCII).
class Filter {
 public:
  explicit Filter(std::string_view text);
  [[nodiscard]] bool empty() const noexcept { return words_.empty(); }
  /// Changes `row` to lower case.
  [[nodiscard]] bool matches(std::string& row) const;

 private:
  std::vector<std::string> words_;
};

/// The frames' words, bus by bus: what a RAND or a Fastscan answer is, the frame before it says. Frames in their order.
class FrameWords {
 public:
  explicit FrameWords(std::size_t buses) : buses_(buses < 1 ? 1 : buses) {}
  void of(const RingFrame& frame, std::string& out);

 private:
  std::vector<decode::Interpreter> buses_;
};

/// {"n", "t_s", "bus", "id", "ext", "rtr", "data", "text"}; "cut" too for an FD frame of more than 8 bytes.
void append_row(const RingFrame& frame, std::string_view bus, std::string_view words, std::string& out);

class Search {
 public:
  static constexpr std::uint64_t warm_up = 256;  ///< frames before the first row, for the words of the first

  /// `wanted`: a message "frames". Ring and names must stay. What comes after this moment is not looked at.
  Search(const FrameRing& ring, const std::vector<std::string>& buses, Message wanted);
  /// Looks at so many frames; false: there are more.
  bool step(std::size_t frames);
  /// When it is done: `{"type":"frames",...}`.
  [[nodiscard]] std::string answer() const;

 private:
  struct Row {
    std::uint64_t number;
    std::string json;
  };
  void look(const RingFrame& frame);

  const FrameRing* ring_;
  const std::vector<std::string>* buses_;
  Message wanted_;
  Filter filter_;
  FrameWords words_;
  std::uint64_t at_;   // the next that is looked at
  std::uint64_t end_;  // behind the last
  std::uint64_t rows_from_;
  std::uint64_t matched_ = 0;
  std::deque<Row> rows_;
  std::string text_;
  std::string row_;
};

}  // namespace berth::studio
