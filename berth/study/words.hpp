/// Frames in words, and traces in the form of the papers.
#pragma once

#include <string>
#include <vector>

#include "berth/can/frame.hpp"
#include "berth/decode/words.hpp"
#include "berth/trace/trace.hpp"

namespace berth::study {

/// Says in words what a frame is.
using decode::Interpreter;

/// "51 00 00 00 00 80 00 00"; "remote, 1" for a remote frame.
[[nodiscard]] std::string raw(const can::Frame& frame);
/// "0x7E5", "0x1F900135".
[[nodiscard]] std::string id_text(const can::Frame& frame);

/// Columns Msg, ID, Details, Raw Message, separated by tabs, as paper 4 prints its tables (S4.14, S4.17).
[[nodiscard]] std::vector<std::string> message_table(const trace::Trace& trace);
/// Columns time, id, ide, l, d, separated by tabs: paper 2's Table 4 (S2.18). Time is counted from the first frame.
[[nodiscard]] std::vector<std::string> time_table(const trace::Trace& trace);
/// Columns Time Stamp, CAN-ID, Type, Data, Interpretation: paper 2's Figure 2 (S2.16).
[[nodiscard]] std::vector<std::string> view_table(const trace::Trace& trace);

}  // namespace berth::study
