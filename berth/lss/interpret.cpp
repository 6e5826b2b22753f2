#include "berth/lss/interpret.hpp"

#include <string_view>

namespace berth::lss {
namespace {

constexpr std::array<std::string_view, 4> parts{"Vendor ID", "Product Code", "Revision Nr.", "Serial Nr."};

std::string hex(std::uint32_t value, unsigned digits) {
  constexpr std::string_view digit = "0123456789ABCDEF";
  std::string text(digits, '0');
  for (unsigned i = digits; i-- > 0; value >>= 4) text[i] = digit[value & 15U];
  return text;
}
std::string hex0x(std::uint32_t value, unsigned digits) { return "0x" + hex(value, digits); }

std::string part(unsigned i) { return std::string(parts[i & 3U]); }

// The part of the address that 40h..43h, 46h..4Bh and 5Ah..5Dh are about.
unsigned part_of(Command command) noexcept {
  switch (command) {
    case Command::select_product:
    case Command::identify_product:
    case Command::inquire_product: return 1;
    case Command::select_revision:
    case Command::identify_revision_low:
    case Command::identify_revision_high:
    case Command::inquire_revision: return 2;
    case Command::select_serial:
    case Command::identify_serial_low:
    case Command::identify_serial_high:
    case Command::inquire_serial: return 3;
    default: return 0;
  }
}

std::string fastscan(const can::Frame& frame) {
  const auto request = decode_fastscan(frame);
  if (!request) return "LSS Fastscan: not a legal request";
  if (request->starts()) return "LSS Fastscan: Checking for new nodes";
  return "LSS Fastscan: " + part(request->sub) + " - Checking bits " + std::to_string(request->bit_checked) + " - 31";
}

std::string bit_timing(const can::Frame& frame) {
  const unsigned selector = frame.data[1];
  const unsigned index = frame.data[2];
  std::string text = "Configure Bit Timing - Table: " + std::to_string(selector) + ", Index: " + std::to_string(index);
  const auto rate = selector == 0 ? bit_rate(static_cast<BitRateIndex>(index)) : std::nullopt;
  if (!rate) return text;
  return text + (*rate == 0 ? " (automatic)" : " (" + std::to_string(*rate / 1000) + " kbit/s)");
}

std::string mode(std::uint8_t value) {
  switch (value) {
    case 0: return "Operation Mode";
    case 1: return "Configuration Mode";
    default: return "unknown mode " + hex0x(value, 2);
  }
}

std::string request_text(const can::Frame& frame) {
  const auto value = [&] { return hex0x(value32(frame), 8); };
  const auto c = command(frame);
  switch (c) {
    case Command::switch_global: return "Switch Mode Global - " + mode(frame.data[1]);
    case Command::configure_node_id: return "Configure Node ID - NID: " + hex0x(frame.data[1], 2);
    case Command::configure_bit_timing: return bit_timing(frame);
    case Command::activate_bit_timing:
      return "Activate Bit Timing - Delay: " + std::to_string(load_le<std::uint16_t>(frame.data.data() + 1)) + " ms";
    case Command::store: return "Store Configuration";
    case Command::select_vendor:
    case Command::select_product:
    case Command::select_revision:
    case Command::select_serial: return "Switch Mode Selective - " + part(part_of(c)) + ": " + value();
    case Command::identify_vendor:
    case Command::identify_product: return "Identify Remote Servants - " + part(part_of(c)) + ": " + value();
    case Command::identify_revision_low:
    case Command::identify_serial_low: return "Identify Remote Servants - " + part(part_of(c)) + " from " + value();
    case Command::identify_revision_high:
    case Command::identify_serial_high: return "Identify Remote Servants - " + part(part_of(c)) + " to " + value();
    case Command::identify_non_configured: return "Identify Non-Configured Servants";
    case Command::fastscan: return fastscan(frame);
    case Command::inquire_vendor:
    case Command::inquire_product:
    case Command::inquire_revision:
    case Command::inquire_serial: return "Inquire " + part(part_of(c));
    case Command::inquire_node_id: return "Inquire Node ID";
    default: return "LSS: unknown request " + hex0x(frame.data[0], 2);
  }
}

// Byte 1 of the answers to 11h, 13h and 17h; `one` and `two`: what these codes mean here.
std::string result(const can::Frame& frame, std::string_view one, std::string_view two = {}) {
  const unsigned code = frame.data[1];
  if (code == error::ok) return "Success";
  std::string text = "Error " + std::to_string(code);
  if (code == error::specific) return text + ": manufacturer's " + hex0x(frame.data[2], 2);
  const auto meaning = code == 1 ? one : code == 2 ? two : std::string_view{};
  return meaning.empty() ? text : text + ": " + std::string(meaning);
}

std::string answer_text(const can::Frame& frame) {
  const auto c = command(frame);
  switch (c) {
    case Command::configure_node_id: return "Configure Node ID - " + result(frame, "out of range");
    case Command::configure_bit_timing: return "Configure Bit Timing - " + result(frame, "not supported");
    case Command::store: return "Store Configuration - " + result(frame, "not supported", "storage media access");
    case Command::selected: return "Switch Mode Selective - Success";
    case Command::identified: return "Identify Servant";
    case Command::non_configured: return "Identify Non-Configured Servant";
    case Command::inquire_vendor:
    case Command::inquire_product:
    case Command::inquire_revision:
    case Command::inquire_serial: return "Inquire " + part(part_of(c)) + " - " + hex0x(value32(frame), 8);
    case Command::inquire_node_id: return "Inquire Node ID - NID: " + hex0x(frame.data[1], 2);
    default: return "LSS: unknown answer " + hex0x(frame.data[0], 2);
  }
}

std::string short_text(const can::Frame& answer) {
  return answer.size == 8 ? std::string() : " (" + std::to_string(answer.size) + " bytes, CiA 305 has 8)";
}

std::string feedback_text(const FeedbackValue& feedback) {
  if (feedback.kind == Feedback::base) return "LSS Fastscan: Next 4 bits are 0x" + hex(feedback.value, 1);
  return std::string("LSS Fastscan: Bits ") + (feedback.toggle ? "0 - 15" : "16 - 31") + " are " +
         hex0x(feedback.value, 4);
}

bool is_boot_up(const can::Frame& frame) noexcept {
  return !frame.extended && !frame.remote && !frame.fd && frame.id > 0x700 && frame.id <= 0x77F && frame.size == 1 &&
         frame.data[0] == 0;
}

}  // namespace

std::string interpret(const can::Frame& frame, std::uint16_t feedback_base) {
  if (is_lss(frame, master_cob_id)) return request_text(frame);
  if (is_answer(frame)) return answer_text(whole_answer(frame)) + short_text(frame);
  if (const auto feedback = decode_feedback(frame, feedback_base)) return feedback_text(*feedback);
  if (is_boot_up(frame)) return "Boot up of node " + std::to_string(frame.id - 0x700);
  return {};
}

std::string table_row(unsigned number, const can::Frame& frame, std::uint16_t feedback_base) {
  std::string row = std::to_string(number) + '\t' + hex0x(frame.id, frame.extended ? 8 : 3) + '\t' +
                    interpret(frame, feedback_base) + '\t';
  for (const auto byte : frame.bytes()) row += hex(byte, 2) + ' ';
  if (row.back() == ' ') row.pop_back();
  return row;
}

}  // namespace berth::lss
