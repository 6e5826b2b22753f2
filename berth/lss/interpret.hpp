/// Describes an LSS frame as the tables of paper 4 do (S4.14, S4.17): `table_row` reproduces its Table 1 and Table 2 as
/// printed. Services missing there are worded alike.
#pragma once

#include <cstdint>
#include <string>

#include "berth/lss/frames.hpp"

namespace berth::lss {

/// "LSS Fastscan: Vendor ID - Checking bits 16 - 31", "Identify Servant", "Configure Node ID - NID: 0x03", ... Invalid
/// LSS frames are described too: "... - Error 1: out of range", "LSS: unknown request 0x7F". So is the boot-up message,
/// with which the tables end: "Boot up of node 3". Empty for every other frame. `feedback_base`: the first of the
/// sixteen feedback identifiers; 0: no base frame is feedback. An extended frame of RAND's DIS looks like feedback and
/// is described as feedback (S1.24).
[[nodiscard]] std::string interpret(const can::Frame& frame, std::uint16_t feedback_base = 0);

/// A row of the tables: number, identifier, words, bytes; separated by tabs.
[[nodiscard]] std::string table_row(unsigned number, const can::Frame& frame, std::uint16_t feedback_base = 0);

}  // namespace berth::lss
