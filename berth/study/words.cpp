#include "berth/study/words.hpp"

#include <fmt/format.h>

#include "berth/base/bytes.hpp"
#include "berth/co/nmt.hpp"
#include "berth/lss/interpret.hpp"
#include "berth/nodeid/negotiation_frames.hpp"
#include "berth/nodeid/rand_frames.hpp"

namespace berth::study {
namespace {

std::string of_rand(const can::Frame& frame) {
  const auto request = nodeid::decode_rand_request(frame);
  if (!request) return "RAND: not a request";
  using Kind = nodeid::RandRequest::Kind;
  switch (request->kind) {
    case Kind::identify:
      return request->phase == 0 ? "RAND IURS: phase 0, who is unknown?"
                                 : fmt::format("RAND IURS: phase {}, chunk({}) is 0x{:04X}", request->phase,
                                               request->phase - 1, request->mask);
    case Kind::direct: return fmt::format("RAND DIRS: chunk(7) is 0x{:04X}", request->mask);
    case Kind::switch_global:
      return fmt::format("RAND: switch identification state global to {}", nodeid::name(request->target));
    case Kind::resume: return "RAND: resume";
    case Kind::switch_selective: break;
  }
  constexpr const char* parts[]{"Vendor ID", "Product Code", "Revision Nr.", "Serial Nr."};
  return fmt::format("RAND: switch identification state selective to {}, {} 0x{:08X}", nodeid::name(request->target),
                     parts[request->part & 3U], request->value);
}

std::string of_nmt(const can::Frame& frame) {
  const auto request = co::parse_nmt(frame);
  if (!request) return "NMT: not a command";
  return request->target.node == 0 ? fmt::format("NMT: {}, all nodes", co::name(request->command))
                                   : fmt::format("NMT: {}, node {}", co::name(request->command), request->target.node);
}

std::string of_error_control(const can::Frame& frame, unsigned node) {
  if (frame.remote) return fmt::format("Node guarding of node {}", node);
  if (frame.size != 1) return fmt::format("Error control of node {}: not one byte", node);
  if (frame.data[0] == 0) return fmt::format("Boot up of node {}", node);
  const auto state = co::nmt_state(frame.data[0]);
  if (!state) return fmt::format("Error control of node {}: no state", node);
  return fmt::format("Heartbeat of node {}: {}", node, name(*state));
}

std::string object(const can::Frame& frame) {
  return fmt::format("{:04X}h:{:02X}", load_le<std::uint16_t>(frame.data.data() + 1), frame.data[3]);
}

std::string of_sdo(const can::Frame& frame, unsigned node, bool request) {
  const std::string who = fmt::format("SDO {} node {}", request ? "to" : "of", node);
  if (frame.size != 8 || frame.remote) return who + ": not eight bytes";
  switch (frame.data[0] >> 5) {
    case 0: return who + (request ? ": download segment" : ": upload segment");
    case 1:
      return request ? fmt::format("{}: write {}", who, object(frame)) : fmt::format("{}: download segment done", who);
    case 2:
      return request ? fmt::format("{}: read {}", who, object(frame))
                     : fmt::format("{}: value of {}", who, object(frame));
    case 3: return request ? who + ": upload segment" : fmt::format("{}: {} written", who, object(frame));
    case 4:
      return fmt::format("{}: abort {}, {:08X}h", who, object(frame), load_le<std::uint32_t>(frame.data.data() + 4));
    default: return who + ": block transfer";
  }
}

std::string of_extended(const can::Frame& frame, bool rand) {
  if (const auto message = nodeid::decode_negotiation(frame)) return nodeid::interpretation(*message);
  if (nodeid::rand_requests.contains(frame.key())) return of_rand(frame);
  if (auto text = lss::interpret(frame); !text.empty() && !rand) return text;
  if (const auto answer = nodeid::decode_rand_answer(frame))
    return fmt::format("RAND {}: chunk 0x{:04X}", answer->direct ? "DIS" : "IUS", answer->chunk);
  return "extended frame";
}

std::string of_base(const can::Frame& frame) {
  const std::uint32_t id = frame.id;
  const unsigned node = id & 0x7FU;
  if (id == 0) return of_nmt(frame);
  if (id == 0x80) return frame.size == 1 ? fmt::format("SYNC, counter {}", frame.data[0]) : "SYNC";
  if (id == 0x100) return "TIME";
  if (id > 0x80 && id < 0x100) {
    return frame.size == 8 ? fmt::format("EMCY of node {}: {:04X}h", node, load_le<std::uint16_t>(frame.data.data()))
                           : fmt::format("EMCY of node {}: not eight bytes", node);
  }
  if (node == 0) return "frame";
  if (id > 0x180 && id < 0x580) {
    const unsigned number = (id - 0x180U) / 0x100U + 1;
    return fmt::format("{} {} of node {}", (id & 0x80U) != 0 ? "TPDO" : "RPDO", number, node);
  }
  if (id > 0x580 && id < 0x600) return of_sdo(frame, node, false);
  if (id > 0x600 && id < 0x680) return of_sdo(frame, node, true);
  if (id > 0x700 && id < 0x780) return of_error_control(frame, node);
  return "frame";
}

}  // namespace

std::string Interpreter::words(const can::Frame& frame) {
  if (frame.fd) return "FD frame";
  if (frame.extended) {
    if (nodeid::rand_requests.contains(frame.key())) asked_ = Asked::rand;
    return of_extended(frame, asked_ == Asked::rand);
  }
  if (lss::is_lss(frame, lss::master_cob_id) && lss::decode_fastscan(frame)) asked_ = Asked::fastscan;
  const std::uint16_t feedback_base = asked_ == Asked::fastscan ? lss::default_feedback_base : 0;
  if (auto text = lss::interpret(frame, feedback_base); !text.empty()) return text;
  return of_base(frame);
}

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
    const bool negotiates = nodeid::decode_negotiation(f).has_value();
    lines.push_back(fmt::format("{:.6f}\t{}/0x{:x}\t{}\t{}\t{}", std::chrono::duration<double>(entry.at).count(), f.id,
                                f.id, negotiates ? "ID Negotiation" : "CANopen", raw(f), interpreter.words(f)));
  }
  return lines;
}

}  // namespace berth::study
