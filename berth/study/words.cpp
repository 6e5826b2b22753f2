#include "berth/study/words.hpp"

#include <fmt/format.h>

#include "berth/research/negotiation_frames.hpp"

namespace berth::study {

std::string raw(const can::Frame& frame) {
  if (frame.remote) return fmt::format("remote, {}", frame.size);
  std::string text;
  for (const auto byte : frame.bytes()) text += fmt::format("{}{:02X}", text.empty() ? "" : " ", byte);
  return text;
}

std::string id_text(const can::Frame& frame) {
  return frame.extended ? fmt::format("0x{:08X}", frame.id) : fmt::format("0x{:03X}", frame.id);
}

std::vector<std::string> message_table(const trace::Trace& trace) {
  std::vector<std::string> lines{"Msg\tID\tDetails\tRaw Message"};
  Interpreter interpreter;
  for (const auto& entry : trace.entries) {
    lines.push_back(fmt::format("{}\t{}\t{}\t{}", lines.size(), id_text(entry.frame), interpreter.words(entry.frame),
                                raw(entry.frame)));
  }
  return lines;
}

std::vector<std::string> time_table(const trace::Trace& trace) {
  std::vector<std::string> lines{"time\tid\tide\tl\td"};
  for (const auto& entry : trace.entries) {
    const auto& f = entry.frame;
    std::string data;
    for (const auto byte : f.bytes()) data += fmt::format("{}0x{:02x}", data.empty() ? "" : " ", byte);
    lines.push_back(fmt::format("{:.6f}\t{}/0x{:x}\t{}\t{}\t{}",
                                std::chrono::duration<double>(entry.at - trace.entries.front().at).count(), f.id, f.id,
                                f.extended ? "EXT" : "-", f.size, data));
    while (lines.back().ends_with('\t')) lines.back().pop_back();
  }
  return lines;
}

std::vector<std::string> view_table(const trace::Trace& trace) {
  std::vector<std::string> lines{"Time Stamp\tCAN-ID\tType\tData\tInterpretation"};
  Interpreter interpreter;
  for (const auto& entry : trace.entries) {
    const auto& f = entry.frame;
    const bool negotiates = research::decode_negotiation(f).has_value();
    lines.push_back(fmt::format("{:.6f}\t{}/0x{:x}\t{}\t{}\t{}", std::chrono::duration<double>(entry.at).count(), f.id,
                                f.id, negotiates ? "ID Negotiation" : "CANopen", raw(f), interpreter.words(f)));
  }
  return lines;
}

}  // namespace berth::study
