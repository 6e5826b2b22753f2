/// Says in words what an LSS frame is, as the tables of paper 4 do (S4.14, S4.17): its Table 1 and Table 2 come out of
/// `table_row` as they are printed. Services that the tables do not show are worded alike.
#pragma once

#include <cstdint>
#include <string>

#include "berth/lss/frames.hpp"

namespace berth::lss {

/// "LSS Fastscan: Vendor ID - Checking bits 16 - 31", "Identify Servant", "Configure Node ID - NID: 0x03", ... What an
/// LSS frame can be but must not is said: "... - Error 1: out of range", "LSS: unknown request 0x7F". The boot-up
/// message too, "Boot up of node 3", which the tables end with. Empty for every other frame.
/// `feedback_base`: the first of the sixteen feedback identifiers; 0: no base frame is feedback. An extended frame of
/// RAND's DIS looks the same as feedback and is taken for it (S1.24).
[[nodiscard]] std::string interpret(const can::Frame& frame, std::uint16_t feedback_base = 0);

/// A row of the tables: number, identifier, words, bytes; with tabs between.
[[nodiscard]] std::string table_row(unsigned number, const can::Frame& frame, std::uint16_t feedback_base = 0);

}  // namespace berth::lss
