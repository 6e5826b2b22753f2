/// CiA 309-3, the ASCII mapping, for single lines: parsing of requests, error codes, texts of values. Pure;
/// `cia309_client.hpp` carries requests out.
///
///     const auto line = serve::cia309::parse_line("[1] 2 5 read 0x1018 1 u32");
///     if (line.error) reply(cia309::error_line(line.request.sequence, *line.error));
///
/// A line is `"[" sequence "]" [[net] node] command`, ended by LF or CR LF. One number before the command is the node,
/// or the net for commands that concern a whole net; two are net and node. Numbers in C notation (decimal, 0x
/// hexadecimal, 0 octal). Keywords in upper or lower case. `#` outside quotes begins a comment. Words with blanks are
/// in double quotes; `""` in them is one quote. docs/gateway.md has the table of commands, and the differences from the
/// standard and other gateways.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/od/data_type.hpp"

namespace berth::serve::cia309 {

/// CiA 309-1's internal error codes.
enum class Code : std::uint16_t {
  not_supported = 100,
  syntax = 101,
  internal_state = 102,  ///< not processed: roles, an operational node, another master, a busy bus
  timeout = 103,
  no_default_net = 104,
  no_default_node = 105,
  unsupported_net = 106,
  unsupported_node = 107,
  guarding_message_lost = 200,
  guarding_lost = 201,
  heartbeat_started = 202,
  heartbeat_lost = 203,
  wrong_state = 204,
  boot_up = 205,
  error_passive = 300,
  bus_off = 301,
  buffer_overflow = 303,
  can_init = 304,
  can_active = 305,
  pdo_used = 400,
  pdo_length = 401,
  lss_specific = 501,  ///< implementation- or manufacturer-specific
  lss_node_id = 502,
  lss_bit_rate = 503,
  lss_store = 504,
  lss_medium = 505,
  no_memory = 600,
};
/// "time-out"; never null.
[[nodiscard]] const char* text_of(Code code) noexcept;

/// A data type as written in a line: CiA 309-3's, and CANopenNode's x8 .. x64 (unsigned, shown in hexadecimal) and hex
/// (bytes, two digits each).
struct Type {
  enum class Shown : std::uint8_t { plain, hex_number, hex_bytes };
  od::DataType type = od::DataType::none;
  Shown shown = Shown::hex_bytes;
  friend bool operator==(const Type&, const Type&) = default;
};
[[nodiscard]] std::optional<Type> type_named(std::string_view word);
/// The text of an object's value. Numbers decimal; times "days milliseconds"; VISIBLE_STRING in quotes, `"` as `""`,
/// and, to keep a reply in one line, control characters as \xNN and a backslash doubled; os, us, d in base64 (RFC 2045,
/// one line), empty as `""`. Empty: the bytes do not have the type's length.
[[nodiscard]] std::optional<std::string> value_text(Type type, std::span<const std::uint8_t> bytes);
/// The reverse: from the words after the type. Empty: no such value, or out of the type's range.
struct Word {
  std::string text;
  bool quoted = false;
};
[[nodiscard]] std::optional<std::vector<std::uint8_t>> value_bytes(Type type, std::span<const Word> words);

/// One object, or one value without an object, in a PDO.
struct PdoField {
  od::DataType type = od::DataType::none;  ///< a scalar
  std::uint16_t index = 0;                 ///< 0: not named
  std::uint8_t sub = 0;
  friend bool operator==(const PdoField&, const PdoField&) = default;
};
struct PdoSetting {
  std::uint16_t number = 1;       ///< 1..512
  std::uint32_t cob_id = 0;       ///< bit 31: not valid, bit 29: 29-bit identifier
  std::uint8_t transmission = 0;  ///< 0..240 SYNC, FDh remote frame, FFh event
  std::uint16_t inhibit = 0;      ///< 100 us
  std::uint16_t event_timer = 0;  ///< ms
  std::uint8_t sync_start = 0;
  std::vector<PdoField> fields{};
  friend bool operator==(const PdoSetting&, const PdoSetting&) = default;
};

/// The commands; comments list their arguments, which are in `numbers` unless they have their own member.
enum class Verb : std::uint8_t {
  nothing,          ///< blank line, comment: no reply
  read,             ///< `index`, `sub`, `type`
  write,            ///< `index`, `sub`, `type`, `data`
  set_sdo_timeout,  ///< ms, 1..65535
  set_sdo_block,    ///< 0, 1
  set_rpdo,         ///< `pdo`
  set_tpdo,         ///< `pdo`
  read_pdo,         ///< number
  write_pdo,        ///< number, `values`
  start,
  stop,
  preop,
  reset_node,
  reset_comm,
  enable_guarding,  ///< guard time in ms, life time factor
  disable_guarding,
  enable_heartbeat,  ///< ms
  disable_heartbeat,
  init,                 ///< bit rate index 0..9
  set_heartbeat,        ///< ms
  set_id,               ///< 1..127, 255
  set_command_timeout,  ///< ms
  boot_up_indication,   ///< 0, 1
  sync_indication,      ///< 0, 1 (Berth's own)
  set_network,          ///< 1..65535
  set_node,             ///< 1..127
  info_version,
  set_command_size,      ///< bytes
  lss_switch_global,     ///< 0, 1
  lss_switch_selective,  ///< vendor, product, revision, serial
  lss_set_node,          ///< 1..127, 255
  lss_conf_bitrate,      ///< table selector, index 0..9
  lss_activate_bitrate,  ///< ms
  lss_store,
  lss_inquire_address,  ///< part 0..3; `count` 0: all four
  lss_get_node,
  lss_identity,  ///< vendor, product, revision low, high, serial low, high
  lss_identify_non_configured,
  lss_fastscan,  ///< [ms [vendor mask product mask revision mask serial mask]]; a mask's bits are known
  lss_slowscan,  ///< as lss_identity
  lss_allnodes,  ///< [ms [first-id store [vendor mask product mask revision mask serial mask]]]
  help,
};
/// The numbers before a command: none that matters, a net, or a net and a node.
enum class Level : std::uint8_t { gateway, net, node };
[[nodiscard]] Level level_of(Verb verb) noexcept;

struct Request {
  std::uint32_t sequence = 0;
  std::optional<std::uint16_t> net{};  ///< 1..65535; empty: the default
  std::optional<std::uint8_t> node{};  ///< 0..127, 0 = all; empty: the default
  Verb verb = Verb::nothing;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  Type type{};
  std::vector<std::uint8_t> data{};
  std::array<std::uint32_t, 11> numbers{};
  std::uint8_t count = 0;  ///< number of given `numbers`
  PdoSetting pdo{};
  std::vector<std::uint64_t> values{};
  friend bool operator==(const Request&, const Request&) = default;
};
struct Line {
  Request request{};  ///< with an error: the sequence number if it could be read, else 0
  std::optional<Code> error{};
};
/// `line`: without its end. Any bytes.
[[nodiscard]] Line parse_line(std::string_view line);

// Replies, with their CR LF.
[[nodiscard]] std::string ok_line(std::uint32_t sequence);
[[nodiscard]] std::string reply_line(std::uint32_t sequence, std::string_view value);
[[nodiscard]] std::string error_line(std::uint32_t sequence, Code code);
[[nodiscard]] std::string abort_line(std::uint32_t sequence, std::uint32_t abort_code);
/// The lines of `help`, each ended, each a comment.
[[nodiscard]] std::string help_text();

}  // namespace berth::serve::cia309
