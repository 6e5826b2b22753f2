#include "berth/decode/words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "berth/base/bytes.hpp"
#include "berth/can/bus_error.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/nmt.hpp"
#include "berth/co/time_stamp.hpp"
#include "berth/decode/say_parts.hpp"
#include "berth/lss/interpret.hpp"
#include "berth/nodeid/rand_frames.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/research/and_frames.hpp"
#include "berth/research/claim_frames.hpp"
#include "berth/research/negotiation_frames.hpp"

namespace berth::decode {
namespace {

constexpr std::array<std::string_view, services> service_names{"nmt",   "sync",        "time",  "emcy", "pdo",
                                                               "sdo",   "heartbeat",   "lss",   "rand", "and",
                                                               "claim", "negotiation", "error", "other"};

// Quicker than a format string, for frames that come a thousand times a second.
void put(std::string& out, std::string_view before, unsigned number) {
  const fmt::format_int digits(number);
  out += before;
  out.append(digits.data(), digits.size());
}

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

std::string of_and(const research::AndRequest& request) {
  using Kind = research::AndRequest::Kind;
  const auto address = request.address.value();
  switch (request.kind) {
    case Kind::identify:
      return request.phase == 0 ? "AND IURS: phase 0, who is unknown?"
                                : fmt::format("AND IURS: phase {}, the address begins with 0x{:0{}X}", request.phase,
                                              address >> (48 - 4 * request.phase), request.phase);
    case Kind::direct: return fmt::format("AND DIRS: the address is 0x{:012X}", address);
    case Kind::switch_global:
      return fmt::format("AND: switch identification state global to {}", nodeid::name(request.target));
    case Kind::switch_selective:
      return fmt::format("AND: switch identification state selective to {}, 0x{:012X}", nodeid::name(request.target),
                         address);
    case Kind::inquire: break;
  }
  return request.phase == 0 ? "AND: inquire Vendor ID and Product Code" : "AND: inquire Revision Nr. and Serial Nr.";
}

std::string of_and(const research::AndAnswer& answer) {
  using Kind = research::AndAnswer::Kind;
  if (answer.kind == Kind::address && answer.nibble == 0)
    return fmt::format("AND: Vendor ID 0x{:08X}, Product Code 0x{:08X}", answer.first, answer.second);
  if (answer.kind == Kind::address)
    return fmt::format("AND: Revision Nr. 0x{:08X}, Serial Nr. 0x{:08X}", answer.first, answer.second);
  return fmt::format("AND {}: nibble 0x{:X}", answer.kind == Kind::dis ? "DIS" : "IUS", answer.nibble);
}

void of_nmt(const can::Frame& frame, std::string& out, Meaning& meaning) {
  const auto request = co::parse_nmt(frame);
  if (!request) {
    out += "NMT: not a command";
  } else if (request->target.node == 0) {
    say(out, "NMT: {}, all nodes", co::name(request->command));
  } else {
    meaning.node = request->target.node;
    say(out, "NMT: {}, node {}", co::name(request->command), request->target.node);
  }
}

void of_error_control(const can::Frame& frame, unsigned node, std::string& out) {
  if (frame.remote) return say(out, "Node guarding of node {}", node);
  if (frame.size != 1) return say(out, "Error control of node {}: not one byte", node);
  if (frame.data[0] == 0) return say(out, "Boot up of node {}", node);
  const auto state = co::nmt_state(frame.data[0]);
  if (!state) return say(out, "Error control of node {}: no state", node);
  put(out, "Heartbeat of node ", node);
  out += ": ";
  out += name(*state);
}

void of_emcy(const can::Frame& frame, unsigned node, std::string& out) {
  if (frame.size != 8 || frame.remote) return say(out, "EMCY of node {}: not eight bytes", node);
  const auto code = load_le<std::uint16_t>(frame.data.data());
  say(out, "EMCY of node {}: {:04X}h {}, register {:02X}h", node, code, co::emcy_text(code), frame.data[2]);
  constexpr std::string_view bits[]{"generic",       "current", "voltage",  "temperature",
                                    "communication", "profile", "reserved", "manufacturer"};
  const char* between = " (";
  for (unsigned bit = 0; bit < 8; ++bit) {
    if ((frame.data[2] >> bit & 1U) == 0) continue;
    say(out, "{}{}", between, bits[bit]);
    between = ", ";
  }
  if (frame.data[2] != 0) out += ')';
  if (std::any_of(frame.data.begin() + 3, frame.data.begin() + 8, [](std::uint8_t b) { return b != 0; }))
    say(out, ", data {:02X} {:02X} {:02X} {:02X} {:02X}", frame.data[3], frame.data[4], frame.data[5], frame.data[6],
        frame.data[7]);
}

void of_time(const can::Frame& frame, std::string& out) {
  out += "TIME";
  const auto time = co::TimeOfDay::decode(frame.bytes());
  if (!time) return;
  const std::chrono::sys_seconds at{std::chrono::seconds(time->unix_seconds())};
  const auto day = std::chrono::floor<std::chrono::days>(at);
  const std::chrono::year_month_day date(day);
  const auto ms = time->milliseconds;
  say(out, ": {:04}-{:02}-{:02} {:02}:{:02}:{:02}.{:03}", static_cast<int>(date.year()),
      static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), ms / 3'600'000, ms / 60'000 % 60,
      ms / 1000 % 60, ms % 1000);
}

void object(const can::Frame& frame, std::string& out) {
  say(out, "{:04X}h:{:02X}", load_le<std::uint16_t>(frame.data.data() + 1), frame.data[3]);
}

void of_sdo(const can::Frame& frame, unsigned node, bool request, std::string& out) {
  say(out, "SDO {} node {}", request ? "to" : "of", node);
  const auto with_object = [&](std::string_view before, std::string_view behind = {}) {
    out += before;
    object(frame, out);
    out += behind;
  };
  if (frame.size != 8 || frame.remote) {
    out += ": not eight bytes";
    return;
  }
  switch (frame.data[0] >> 5) {
    case 0: out += request ? ": download segment" : ": upload segment"; return;
    case 1:
      if (request) return with_object(": write ");
      out += ": download segment done";
      return;
    case 2: return with_object(request ? ": read " : ": value of ");
    case 3:
      if (!request) return with_object(": ", " written");
      out += ": upload segment";
      return;
    case 4: {
      // Any other value: the last segment of a block, with bit 7 and its number.
      if (frame.data[0] != 0x80) break;
      const auto code = load_le<std::uint32_t>(frame.data.data() + 4);
      with_object(": abort ");
      return say(out, ", {:08X}h, {}", code, od::text(static_cast<od::AbortCode>(code)));
    }
    default: break;
  }
  out += ": block transfer";
}

}  // namespace

std::string_view name(Service service) noexcept { return service_names[static_cast<std::size_t>(service)]; }

std::optional<Service> parse_service(std::string_view text) noexcept {
  const auto found = std::find(service_names.begin(), service_names.end(), text);
  if (found == service_names.end()) return std::nullopt;
  return static_cast<Service>(found - service_names.begin());
}

Meaning Interpreter::extended(const can::Frame& frame, std::string& out) const {
  const auto said = [&](Service service, const std::string& text, std::uint8_t node = 0) {
    out += text;
    return Meaning{service, node};
  };
  if (const auto message = research::decode_negotiation(frame))
    return said(Service::negotiation, research::interpretation(*message));
  if (nodeid::rand_requests.contains(frame.key())) return said(Service::rand, of_rand(frame));
  if (asked_ != Asked::rand) {
    if (const auto text = lss::interpret(frame); !text.empty()) return said(Service::lss, text);
  }
  if (const auto answer = nodeid::decode_rand_answer(frame))
    return said(Service::rand, fmt::format("RAND {}: chunk 0x{:04X}", answer->direct ? "DIS" : "IUS", answer->chunk));
  if (const auto claim = research::decode_claim(frame)) {
    if (claim->id == research::claim_nobody)
      return said(Service::claim, fmt::format("Claim: NAME 0x{:016X} cannot claim a node-ID", claim->name));
    return said(Service::claim, fmt::format("Claim: node-ID {} for NAME 0x{:016X}", claim->id, claim->name), claim->id);
  }
  if (const auto asked = research::decode_claim_request(frame)) {
    return said(Service::claim, *asked == research::claim_everybody ? std::string("Claim request: everybody")
                                                                    : fmt::format("Claim request: node-ID {}", *asked));
  }
  return said(Service::other, "extended frame");
}

namespace {

// CiA 302-2.
constexpr std::uint32_t first_flying = 0x71, last_flying = 0x76;

Meaning of_flying_master(const can::Frame& frame, std::string& out) {
  constexpr std::array<std::string_view, 6> texts{
      "a claim of the wrong length",           "the negotiation begins",
      "which node is the active master?",      "here is a device that can be master",
      "is there a device that can be master?", "the active master is to negotiate"};
  out += "flying master: ";
  Meaning meaning{Service::nmt, 0};
  if (frame.id == first_flying && frame.size == 2) {
    meaning.node = frame.data[1];
    say(out, "node {} is the active master, priority {}", frame.data[1], frame.data[0]);
  } else {
    out += texts.at(frame.id - first_flying);
  }
  return meaning;
}

}  // namespace

Meaning Interpreter::base(const can::Frame& frame, std::string& out) const {
  const std::uint32_t id = frame.id;
  const std::uint8_t node = id & 0x7FU;
  Meaning meaning{Service::other, node};
  if (id >= first_flying && id <= last_flying && !frame.remote) return of_flying_master(frame, out);
  if (id == 0) {
    meaning.service = Service::nmt;
    of_nmt(frame, out, meaning);
  } else if (id == 0x80) {
    meaning.service = Service::sync;
    if (frame.size == 1) {
      say(out, "SYNC, counter {}", frame.data[0]);
    } else {
      out += "SYNC";
    }
  } else if (id == 0x100) {
    meaning.service = Service::time;
    of_time(frame, out);
  } else if (id > 0x80 && id < 0x100) {
    meaning.service = Service::emcy;
    of_emcy(frame, node, out);
  } else if (node != 0 && id > 0x180 && id < 0x580) {
    meaning.service = Service::pdo;
    const unsigned number = (id - 0x180U) / 0x100U + 1;
    put(out, (id & 0x80U) != 0 ? "TPDO " : "RPDO ", number);
    put(out, " of node ", node);
    if (frame.remote) out += ": remote request";
  } else if (node != 0 && id > 0x580 && id < 0x680) {
    meaning.service = Service::sdo;
    of_sdo(frame, node, id > 0x600, out);
  } else if (node != 0 && id > 0x700 && id < 0x780) {
    meaning.service = Service::heartbeat;
    of_error_control(frame, node, out);
  } else {
    meaning.node = 0;
    out += "frame";
  }
  return meaning;
}

namespace {

constexpr can::IdRange feedback{lss::default_feedback_base, lss::default_feedback_base + 15U};

}  // namespace

std::optional<unsigned> rests_on(const can::Frame& frame) noexcept {
  if (frame.fd || frame.extended || frame.id >= research::and_ius_id || feedback.contains(frame.id))
    return std::nullopt;
  const bool node = (frame.id & 0x7FU) != 0;
  if (node && frame.id > 0x180 && frame.id < 0x580) return 0;
  if (node && frame.id > 0x700) return 1;
  if (!node || frame.id < 0x580 || frame.id > 0x680) return 8;
  const unsigned command = frame.data[0] >> 5;
  return command == 0 || command > 4 ? 1 : command == 4 ? 8 : 4;  // a segment, an abort, an object
}

Meaning Interpreter::words(const can::Frame& frame, std::string& out) {
  if (frame.fd) {
    out += "FD frame";
    return {};
  }
  if (frame.extended) {
    if (nodeid::rand_requests.contains(frame.key())) asked_ = Asked::rand;
    return extended(frame, out);
  }
  // Most frames have identifiers that neither LSS nor a paper uses.
  if (frame.id >= research::and_ius_id || (asked_ == Asked::fastscan && feedback.contains(frame.id))) {
    if (lss::is_lss(frame, lss::master_cob_id) && lss::decode_fastscan(frame)) asked_ = Asked::fastscan;
    const std::uint16_t feedback_base = asked_ == Asked::fastscan ? lss::default_feedback_base : 0;
    if (const auto text = lss::interpret(frame, feedback_base); !text.empty()) {
      out += text;
      return {Service::lss, 0};
    }
    if (const auto request = research::decode_and_request(frame)) {
      out += of_and(*request);
      return {Service::and_, 0};
    }
    if (const auto answer = research::decode_and_answer(frame)) {
      out += of_and(*answer);
      return {Service::and_, 0};
    }
  }
  return base(frame, out);
}

std::string Interpreter::words(const can::Frame& frame) {
  std::string out;
  words(frame, out);
  return out;
}

namespace {

std::string_view place_of(std::uint8_t code) noexcept {
  using can::ErrorPlace;
  switch (static_cast<ErrorPlace>(code)) {
    case ErrorPlace::start: return "in start of frame";
    case ErrorPlace::id28_21:
    case ErrorPlace::id20_18:
    case ErrorPlace::id17_13:
    case ErrorPlace::id12_5:
    case ErrorPlace::id4_0: return "in the identifier";
    case ErrorPlace::srr:
    case ErrorPlace::rtr: return "in RTR";
    case ErrorPlace::ide: return "in IDE";
    case ErrorPlace::reserved0:
    case ErrorPlace::reserved1: return "in a reserved bit";
    case ErrorPlace::dlc: return "in DLC";
    case ErrorPlace::data: return "in the data";
    case ErrorPlace::crc: return "in CRC";
    case ErrorPlace::crc_delimiter: return "in the CRC delimiter";
    case ErrorPlace::acknowledge: return "in the ACK slot";
    case ErrorPlace::acknowledge_delimiter: return "in the ACK delimiter";
    case ErrorPlace::end_of_frame: return "in end of frame";
    case ErrorPlace::intermission: return "in intermission";
    case ErrorPlace::unknown: break;
  }
  return {};
}

}  // namespace

void error_words(const can::Frame& frame, std::string& out) {
  out += "error";
  const char* between = ": ";
  const auto add = [&](std::string_view text) {
    out += between;
    out += text;
    between = ", ";
  };
  constexpr std::pair<std::uint32_t, std::string_view> classes[]{
      {0x001, "transmit timeout"},    {0x002, "arbitration lost"}, {0x010, "transceiver"},
      {0x020, "no acknowledge"},      {0x040, "bus-off"},          {0x080, "bus error"},
      {0x100, "controller restarted"}};
  for (const auto& [bit, text] : classes) {
    if ((frame.id & bit) != 0) add(text);
  }
  const auto details = [&](std::uint32_t bit, std::string_view text, std::uint8_t bits, const auto& words) {
    if ((frame.id & bit) == 0) return;
    add(text);
    const char* detail = " (";
    for (unsigned i = 0; i < 8; ++i) {
      if ((bits >> i & 1U) == 0) continue;
      out += detail;
      out += words[i];
      detail = ", ";
    }
    if (bits != 0) out += ')';
  };
  constexpr std::string_view controller[]{
      "receive overflow", "transmit overflow", "receive warning", "transmit warning",
      "receive passive",  "transmit passive",  "active again",    "bit 7"};
  constexpr std::string_view protocol[]{"single bit",    "form",     "stuff",  "dominant bit",
                                        "recessive bit", "overload", "active", "while sending"};
  details(0x004, "controller", frame.data[1], controller);
  details(0x008, "protocol", frame.data[2], protocol);
  if ((frame.id & can::error_protocol) != 0 && frame.data[3] != 0) {
    const auto place = place_of(frame.data[3]);
    if (!place.empty()) say(out, ", {}", place);
  }
  if (frame.data[6] != 0 || frame.data[7] != 0) say(out, "; counters tx {}, rx {}", frame.data[6], frame.data[7]);
}

}  // namespace berth::decode
