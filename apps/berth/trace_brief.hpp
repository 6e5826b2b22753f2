/// A row of a live trace for a terminal: one line, whatever its width. Pure.
///
///        12.3457 705  heartbeat node 5: operational                            05
///        12.4012 585  SDO read node 5 1018h:01 Identity object.Vendor-ID = 31 (0x0000001F)
///
/// Time, bus (where there are several), identifier, what it means, bytes. Values and the reasons of aborts are what a
/// row is read for: where the line is too narrow, the bytes are given up first, then the device's type in brackets, the
/// first part of the objects' names ("Read input 8 bit." of "Read input 8 bit.Inputs 1 to 8"), the end of each name
/// down to four letters, and last the end of the words.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "berth/rt/executor.hpp"

namespace berth::cli {

struct BriefStyle {
  std::size_t width = 80;
  bool bus = false;
};

/// `frame`: as `can::to_string` writes it. Without a line feed.
[[nodiscard]] std::string brief_line(rt::Duration at, std::string_view bus, std::string_view frame,
                                     std::string_view words, const BriefStyle& style);

}  // namespace berth::cli
