#include "berth/serve/cia309.hpp"
#include "berth/od/pdo_objects.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace berth::serve::cia309 {
namespace {

using Numbers = std::optional<std::uint64_t>;

bool same(std::string_view word, std::string_view keyword) {
  return std::ranges::equal(word, keyword, [](char a, char b) {
    const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
    return lower(a) == lower(b);
  });
}

bool blank(char c) noexcept { return c == ' ' || c == '\t'; }

Numbers number_in(std::string_view word, std::uint64_t low, std::uint64_t high) {
  const auto read = od::parse_number(word);
  if (!read || read->node_id || read->negative || word.front() == '+') return std::nullopt;
  if (read->magnitude < low || read->magnitude > high) return std::nullopt;
  return read->magnitude;
}

/// The words of a line, up to its comment. Empty: a quote is missing or stands inside a word, or there are control
/// characters.
std::optional<std::vector<Word>> words_of(std::string_view line) {
  std::vector<Word> words;
  std::size_t i = 0;
  while (true) {
    while (i < line.size() && blank(line[i])) ++i;
    if (i == line.size() || line[i] == '#') return words;
    Word word;
    word.quoted = line[i] == '"';
    if (word.quoted) {
      for (++i;; ++i) {
        if (i == line.size()) return std::nullopt;
        if (line[i] == '"') {
          if (i + 1 == line.size() || line[i + 1] != '"') break;
          ++i;
        }
        word.text += line[i];
      }
      ++i;
      if (i < line.size() && !blank(line[i]) && line[i] != '#') return std::nullopt;
    } else {
      for (; i < line.size() && !blank(line[i]) && line[i] != '#'; ++i) {
        if (line[i] == '"') return std::nullopt;
        word.text += line[i];
      }
    }
    const auto control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; };
    if (std::ranges::any_of(word.text, control)) return std::nullopt;
    words.push_back(std::move(word));
  }
}

/// Reads the words of a line into its request. The line keeps the first error; nothing is thrown.
class Reader {
 public:
  Reader(std::span<const Word> words, Line& line) : words_(words), line_(&line) {}

  void command();

 private:
  [[nodiscard]] Request& request() noexcept { return line_->request; }
  bool wrong(Code code = Code::syntax) {
    if (!line_->error) line_->error = code;
    return false;
  }
  [[nodiscard]] bool over() const noexcept { return at_ == words_.size(); }
  [[nodiscard]] bool is(std::string_view keyword) const {
    return !over() && !words_[at_].quoted && same(words_[at_].text, keyword);
  }
  bool take(std::string_view keyword) {
    const bool there = is(keyword);
    if (there) ++at_;
    return there;
  }
  [[nodiscard]] bool numeric() const {
    return !over() && !words_[at_].quoted && !words_[at_].text.empty() && words_[at_].text.front() >= '0' &&
           words_[at_].text.front() <= '9';
  }
  std::uint64_t number(std::uint64_t low, std::uint64_t high) {
    const Numbers value = over() || words_[at_].quoted ? std::nullopt : number_in(words_[at_].text, low, high);
    if (!value) wrong();
    if (!over()) ++at_;
    return value.value_or(low);
  }
  void argument(std::uint32_t low, std::uint32_t high) { put(static_cast<std::uint32_t>(number(low, high))); }
  void put(std::uint32_t value) {
    if (request().count < request().numbers.size()) request().numbers[request().count++] = value;
  }
  void arguments(unsigned count) {
    for (unsigned i = 0; i < count; ++i) argument(0, 0xFFFF'FFFF);
  }
  void object() {
    request().index = static_cast<std::uint16_t>(number(0, 0xFFFF));
    request().sub = static_cast<std::uint8_t>(number(0, 0xFF));
  }
  Type type() {
    const auto known = over() || words_[at_].quoted ? std::nullopt : type_named(words_[at_].text);
    if (!known) wrong();
    if (!over()) ++at_;
    return known.value_or(Type{});
  }
  void switched(std::string_view off, std::string_view on) {
    if (take(on)) return put(1);
    if (take(off)) return put(0);
    wrong();
  }
  void identity(unsigned values) { arguments(values); }
  void read_or_write(bool write);
  void set();
  void set_pdo(bool transmit, bool extended);
  void node_id() {
    argument(1, 255);
    const auto id = request().numbers[0];
    if (id > 127 && id != 255) wrong();
  }
  bool lss();
  void fastscan();
  void allnodes();
  bool nmt();

  std::span<const Word> words_;
  Line* line_;
  std::size_t at_ = 0;
};

void Reader::read_or_write(bool write) {
  Request& r = request();
  if (take("p") || take("pdo")) {
    r.verb = write ? Verb::write_pdo : Verb::read_pdo;
    argument(1, od::most_pdos);
    if (!write) return;
    const auto count = number(0, 64);
    for (std::uint64_t i = 0; i < count && !line_->error; ++i) {
      const auto value =
          over() || words_[at_].quoted ? tl::make_unexpected(od::TextError{}) : od::parse_number(words_[at_].text);
      if (!value || value->node_id) return static_cast<void>(wrong());
      r.values.push_back(value->negative ? ~value->magnitude + 1 : value->magnitude);
      ++at_;
    }
    return;
  }
  r.verb = write ? Verb::write : Verb::read;
  object();
  if (!write) {
    if (!over() && !line_->error) r.type = type();
    return;
  }
  r.type = type();
  if (line_->error) return;
  auto bytes = value_bytes(r.type, words_.subspan(at_));
  at_ = words_.size();
  if (!bytes) return static_cast<void>(wrong());
  r.data = std::move(*bytes);
}

void Reader::set_pdo(bool transmit, bool extended) {
  request().verb = transmit ? Verb::set_tpdo : Verb::set_rpdo;
  PdoSetting& pdo = request().pdo;
  pdo.number = static_cast<std::uint16_t>(number(1, od::most_pdos));
  pdo.cob_id = static_cast<std::uint32_t>(number(0, 0xFFFF'FFFF));
  if (take("event")) {
    pdo.transmission = 0xFF;
  } else if (take("rtr")) {
    pdo.transmission = 0xFD;
  } else if (!over() && !words_[at_].quoted && words_[at_].text.size() > 4 &&
             same(std::string_view(words_[at_].text).substr(0, 4), "sync")) {
    const auto period = number_in(std::string_view(words_[at_].text).substr(4), 0, 240);
    if (!period) return static_cast<void>(wrong());
    pdo.transmission = static_cast<std::uint8_t>(*period);
    ++at_;
  } else {
    return static_cast<void>(wrong());
  }
  if (extended && pdo.transmission == 0xFF) pdo.inhibit = static_cast<std::uint16_t>(number(0, 0xFFFF));
  if (extended && pdo.transmission >= 0xFD) pdo.event_timer = static_cast<std::uint16_t>(number(0, 0xFFFF));
  if (extended && pdo.transmission <= 240) pdo.sync_start = static_cast<std::uint8_t>(number(0, 240));
  const auto count = number(0, 64);
  for (std::uint64_t i = 0; i < count && !line_->error; ++i) {
    PdoField field;
    if (numeric()) {
      field.index = static_cast<std::uint16_t>(number(0, 0xFFFF));
      field.sub = static_cast<std::uint8_t>(number(0, 0xFF));
    }
    field.type = type().type;
    if (od::bit_length(field.type) == 0) wrong();
    pdo.fields.push_back(field);
  }
}

void Reader::set() {
  const auto one = [this](Verb verb, std::uint32_t low, std::uint32_t high) {
    request().verb = verb;
    argument(low, high);
  };
  if (take("network")) return one(Verb::set_network, 1, 0xFFFF);
  if (take("node")) return one(Verb::set_node, 0, 127);
  if (take("sdo_timeout")) return one(Verb::set_sdo_timeout, 1, 0xFFFF);
  if (take("sdo_block")) return one(Verb::set_sdo_block, 0, 1);
  if (take("heartbeat")) return one(Verb::set_heartbeat, 0, 0xFFFF);
  if (take("command_timeout")) return one(Verb::set_command_timeout, 0, 0xFFFF'FFFF);
  if (take("command_size")) return one(Verb::set_command_size, 0, 0xFFFF'FFFF);
  if (take("rpdo")) return set_pdo(false, false);
  if (take("tpdo")) return set_pdo(true, false);
  if (take("tpdox")) return set_pdo(true, true);
  if (take("id")) {
    request().verb = Verb::set_id;
    return node_id();
  }
  wrong(over() ? Code::syntax : Code::not_supported);
}

// "_lss_fastscan [ms]" as in CANopenNode, or eight numbers as in Lely.
void Reader::fastscan() {
  request().verb = Verb::lss_fastscan;
  const auto left = words_.size() - at_;
  if (left == 1 || left == 9) argument(0, 0xFFFF);
  if (left == 8) put(0);
  if (left >= 8) arguments(8);
}

// CANopenNode's scan types: 0 search, 1 ignore, 2 equal to the value.
void Reader::allnodes() {
  request().verb = Verb::lss_allnodes;
  if (over()) return;
  argument(0, 0xFFFF);
  if (over()) return;
  argument(1, 127);
  argument(0, 1);
  if (over()) return;
  for (int i = 0; i < 4; ++i) {
    const auto how = number(0, 2);
    const auto value = static_cast<std::uint32_t>(number(0, 0xFFFF'FFFF));
    if (how == 1) wrong(Code::not_supported);
    put(how == 2 ? value : 0);
    put(how == 2 ? 0xFFFF'FFFF : 0);
  }
}

bool Reader::lss() {
  Request& r = request();
  const auto is_verb = [&](std::string_view keyword, Verb verb) {
    const bool there = take(keyword);
    if (there) r.verb = verb;
    return there;
  };
  if (is_verb("lss_switch_glob", Verb::lss_switch_global)) {
    argument(0, 1);
  } else if (is_verb("lss_switch_sel", Verb::lss_switch_selective)) {
    identity(4);
  } else if (take("lss_set_node")) {
    r.verb = Verb::lss_set_node;
    node_id();
  } else if (is_verb("lss_conf_bitrate", Verb::lss_conf_bitrate)) {
    argument(0, 0xFF);
    argument(0, 9);
  } else if (is_verb("lss_activate_bitrate", Verb::lss_activate_bitrate)) {
    argument(0, 0xFFFF);
  } else if (is_verb("lss_store", Verb::lss_store) || is_verb("lss_get_node", Verb::lss_get_node) ||
             is_verb("lss_ident_nonconf", Verb::lss_identify_non_configured)) {
    return true;
  } else if (is_verb("lss_inquire_addr", Verb::lss_inquire_address)) {
    if (over()) return true;
    auto part = static_cast<std::uint32_t>(number(0, 0x5D));
    if (part >= 0x5A) part -= 0x5A;  // the standard gives the command specifier
    if (part > 3) wrong();
    put(part);
  } else if (is_verb("lss_identity", Verb::lss_identity) || is_verb("_lss_slowscan", Verb::lss_slowscan)) {
    identity(6);
  } else if (take("_lss_fastscan")) {
    fastscan();
  } else if (take("lss_allnodes")) {
    allnodes();
  } else {
    return false;
  }
  return true;
}

bool Reader::nmt() {
  Request& r = request();
  if (take("start")) {
    r.verb = Verb::start;
  } else if (take("stop")) {
    r.verb = Verb::stop;
  } else if (take("preop") || take("preoperational")) {
    r.verb = Verb::preop;
  } else if (take("reset")) {
    if (take("node")) {
      r.verb = Verb::reset_node;
    } else if (take("comm") || take("communication")) {
      r.verb = Verb::reset_comm;
    } else {
      wrong();
    }
  } else if (take("enable")) {
    if (take("guarding")) {
      r.verb = Verb::enable_guarding;
      argument(1, 0xFFFF);
      argument(1, 0xFF);
    } else if (take("heartbeat")) {
      r.verb = Verb::enable_heartbeat;
      argument(1, 0xFFFF);
    } else {
      wrong();
    }
  } else if (take("disable")) {
    if (take("guarding")) {
      r.verb = Verb::disable_guarding;
    } else if (take("heartbeat")) {
      r.verb = Verb::disable_heartbeat;
    } else {
      wrong();
    }
  } else {
    return false;
  }
  return true;
}

void Reader::command() {
  std::array<std::uint16_t, 2> before{};
  unsigned count = 0;
  while (numeric()) {
    if (count == 2) return static_cast<void>(wrong());
    before[count++] = static_cast<std::uint16_t>(number(0, 0xFFFF));
  }
  if (over()) return static_cast<void>(wrong());
  Request& r = request();
  if (take("r") || take("read")) {
    read_or_write(false);
  } else if (take("w") || take("write")) {
    read_or_write(true);
  } else if (take("set")) {
    set();
  } else if (take("init")) {
    r.verb = Verb::init;
    argument(0, 9);
  } else if (take("boot_up_indication")) {
    r.verb = Verb::boot_up_indication;
    switched("Disable", "Enable");
  } else if (take("_sync_indication")) {
    r.verb = Verb::sync_indication;
    switched("Disable", "Enable");
  } else if (take("info")) {
    r.verb = Verb::info_version;
    if (!take("version")) wrong();
  } else if (take("help")) {
    r.verb = Verb::help;
  } else if (!nmt() && !lss()) {
    wrong(Code::not_supported);
  }
  if (!line_->error && !over()) wrong();
  if (line_->error) return;
  const Level level = level_of(r.verb);
  if (count == 2 && level != Level::node) return static_cast<void>(wrong());
  if (count > 0 && level != Level::node) r.net = before[0];
  if (count == 2) r.net = before[0];
  if (count > 0 && level == Level::node) {
    const auto node = before[count - 1];
    if (node > 127) return static_cast<void>(wrong(Code::unsupported_node));
    r.node = static_cast<std::uint8_t>(node);
  }
  if (r.net == 0) wrong(Code::unsupported_net);
}

/// Removes the sequence number, "[5]", from the front of a line. Empty: there is none.
std::optional<std::uint32_t> take_sequence(std::string_view& line) {
  const auto end = line.find(']');
  if (line.empty() || line.front() != '[' || end == std::string_view::npos) return std::nullopt;
  std::string_view word = line.substr(1, end - 1);
  while (!word.empty() && blank(word.front())) word.remove_prefix(1);
  while (!word.empty() && blank(word.back())) word.remove_suffix(1);
  if (word.empty()) return std::nullopt;
  const auto number = number_in(word, 0, 0xFFFF'FFFF);
  if (!number) return std::nullopt;
  line.remove_prefix(end + 1);
  return static_cast<std::uint32_t>(*number);
}

}  // namespace

Level level_of(Verb verb) noexcept {
  using enum Verb;
  switch (verb) {
    case read:
    case write:
    case start:
    case stop:
    case preop:
    case reset_node:
    case reset_comm:
    case enable_guarding:
    case disable_guarding:
    case enable_heartbeat:
    case disable_heartbeat: return Level::node;
    case nothing:
    case set_network:
    case set_command_timeout:
    case set_command_size:
    case help: return Level::gateway;
    default: return Level::net;
  }
}

Line parse_line(std::string_view line) {
  Line parsed;
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  while (!line.empty() && blank(line.front())) line.remove_prefix(1);
  if (line.empty() || line.front() == '#') return parsed;
  const auto sequence = take_sequence(line);
  if (!sequence) {
    parsed.error = Code::syntax;
    return parsed;
  }
  parsed.request.sequence = *sequence;
  const auto words = words_of(line);
  if (!words) {
    parsed.error = Code::syntax;
    return parsed;
  }
  Reader(*words, parsed).command();
  return parsed;
}

std::string ok_line(std::uint32_t sequence) { return reply_line(sequence, "OK"); }
std::string reply_line(std::uint32_t sequence, std::string_view value) {
  return fmt::format("[{}] {}\r\n", sequence, value);
}
std::string error_line(std::uint32_t sequence, Code code) {
  return fmt::format("[{}] ERROR:{}\r\n", sequence, static_cast<unsigned>(code));
}
std::string abort_line(std::uint32_t sequence, std::uint32_t abort_code) {
  return fmt::format("[{}] ERROR:0x{:08X}\r\n", sequence, abort_code);
}

const char* text_of(Code code) noexcept {
  switch (code) {
    case Code::not_supported: return "request not supported";
    case Code::syntax: return "syntax error";
    case Code::internal_state: return "request not processed due to internal state";
    case Code::timeout: return "time-out";
    case Code::no_default_net: return "no default net set";
    case Code::no_default_node: return "no default node set";
    case Code::unsupported_net: return "unsupported net";
    case Code::unsupported_node: return "unsupported node";
    case Code::guarding_message_lost: return "lost guarding message";
    case Code::guarding_lost: return "lost connection";
    case Code::heartbeat_started: return "heartbeat started";
    case Code::heartbeat_lost: return "heartbeat lost";
    case Code::wrong_state: return "wrong NMT state";
    case Code::boot_up: return "boot-up";
    case Code::error_passive: return "error passive";
    case Code::bus_off: return "bus-off";
    case Code::buffer_overflow: return "CAN buffer overflow";
    case Code::can_init: return "CAN init";
    case Code::can_active: return "CAN active";
    case Code::pdo_used: return "PDO already used";
    case Code::pdo_length: return "PDO length exceeded";
    case Code::lss_specific: return "LSS implementation- or manufacturer-specific error";
    case Code::lss_node_id: return "LSS node-ID not supported";
    case Code::lss_bit_rate: return "LSS bit rate not supported";
    case Code::lss_store: return "LSS parameter storing failed";
    case Code::lss_medium: return "LSS command failed because of a media error";
    case Code::no_memory: return "running out of memory";
  }
  return "";
}

std::string help_text() {
  static constexpr std::array<std::string_view, 27> lines{
      "[seq] [[net] node] command; numbers in C notation; # begins a comment",
      "r[ead] index sub [type]; w[rite] index sub type value",
      "types: b i8..i64 u8..u64 x8..x64 r32 r64 t td vs os us d (base64) hex",
      "start, stop, preop[erational], reset node, reset comm[unication]",
      "enable guarding ms factor, disable guarding",
      "enable heartbeat ms, disable heartbeat",
      "commands below take [net] only",
      "set network n, set node n, set sdo_timeout ms, set sdo_block 0|1",
      "set command_timeout ms, set command_size bytes",
      "set heartbeat ms, set id node, init index, info version",
      "boot_up_indication Enable|Disable, _sync_indication Enable|Disable",
      "set rpdo nr cob trans n (type | index sub type)...",
      "set tpdo nr cob trans n (type | index sub type)...",
      "set tpdox nr cob event inhibit timer n ..., rtr timer n ..., syncK start n ...",
      "trans: event, rtr, sync0..sync240",
      "r[ead] p[do] nr, w[rite] p[do] nr n value...",
      "lss_switch_glob 0|1",
      "lss_switch_sel vendor product revision serial",
      "lss_set_node id, lss_conf_bitrate 0 index, lss_activate_bitrate ms",
      "lss_store, lss_inquire_addr [part], lss_get_node",
      "lss_identity vendor product rev-low rev-high ser-low ser-high",
      "lss_ident_nonconf",
      "_lss_fastscan [ms] [vendor mask product mask revision mask serial mask]",
      "_lss_slowscan vendor product rev-low rev-high ser-low ser-high",
      "lss_allnodes [ms [first-id store [(0 | 2) value, four times]]]",
      "index: 0 1000, 1 800, 2 500, 3 250, 4 125, 6 50, 7 20, 8 10 kbit/s, 9 automatic",
      "replies: OK, a value, ERROR:code (100..600) or ERROR:0x (SDO abort code)",
  };
  std::string text;
  for (const auto line : lines) text += fmt::format("# {}\r\n", line);
  return text;
}

}  // namespace berth::serve::cia309
