/// A row of a live trace, shortened to one line of a terminal of any width. Pure.
///
///        12.3457 705  heartbeat node 5: operational                            05
///        12.4012 585  SDO read node 5 1018h:01 Identity object.Vendor-ID = 31 (0x0000001F)
///
/// Columns: time, bus (if there are several), identifier, meaning, bytes. Values and the reasons of aborts matter most.
/// If the line is too narrow, these are cut, in this order:
/// 1. the bytes
/// 2. the device's type in brackets
/// 3. the first part of the objects' names ("Read input 8 bit." of "Read input 8 bit.Inputs 1 to 8")
/// 4. the end of each name, down to four letters
/// 5. the end of the words
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

/// `frame`: as `can::to_string` writes it. Returns no line feed.
[[nodiscard]] std::string brief_line(rt::Duration at, std::string_view bus, std::string_view frame,
                                     std::string_view words, const BriefStyle& style);

}  // namespace berth::cli
