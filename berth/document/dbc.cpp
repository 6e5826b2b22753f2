#include "berth/document/dbc.hpp"

#include <fmt/format.h>

#include <cmath>
#include <set>

#include "berth/can/frame.hpp"
#include "berth/od/notation.hpp"

namespace berth::document {
namespace {

constexpr std::size_t longest_name = 32;
constexpr std::uint32_t dbc_extended = 0x8000'0000;
constexpr const char* nobody = "Vector__XXX";

/// Unique names in one scope.
class Names {
 public:
  std::string of(std::string_view text) {
    std::string name;
    for (const char c : text) {
      const bool good = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z');
      if (good || (!name.empty() && name.back() != '_')) name += good ? c : '_';
    }
    while (!name.empty() && name.back() == '_') name.pop_back();
    const bool digit = !name.empty() && name.front() >= '0' && name.front() <= '9';
    if (name.empty() || digit) name.insert(0, "_");
    name = name.substr(0, longest_name);
    std::string free = name;
    for (unsigned n = 2; !taken_.insert(free).second; ++n) {
      const std::string number = fmt::format("_{}", n);
      free = name.substr(0, longest_name - number.size()) + number;
    }
    return free;
  }

 private:
  std::set<std::string> taken_;
};

// Converts UTF-8. Windows-1252 differs from Unicode in 80h to 9Fh: these characters become "?", except the euro sign.
std::string windows_1252(std::string_view text) {
  std::string made;
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
    const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0U;
    const unsigned code = length == 1 ? lead : length == 2 ? (lead & 0x1FU) << 6U | (next & 0x3FU) : 0xFFFF;
    const bool euro = text.substr(i, length) == "\xE2\x82\xAC";
    made += euro ? '\x80' : code < 0x80 || (code >= 0xA0 && code < 0x100) ? static_cast<char>(code) : '?';
    i += length;
  }
  return made;
}

// DBC has no way to write a quotation mark within quotes.
std::string in_quotes(std::string_view text) {
  std::string made = "\"";
  for (const char c : text) made += c == '"' || c == '\\' ? '\'' : static_cast<unsigned char>(c) < ' ' ? ' ' : c;
  return made + '"';
}

std::uint32_t dbc_id(std::uint32_t key) noexcept {
  return (key & can::extended_flag) != 0 ? (key & ~can::extended_flag) | dbc_extended : key;
}

bool is_float(const Signal& signal) noexcept {
  return (signal.type == od::DataType::real32 && signal.bits == 32) ||
         (signal.type == od::DataType::real64 && signal.bits == 64);
}

double factor_of(const Signal& signal) {
  return static_cast<double>(signal.meaning.number) * std::pow(10.0, signal.meaning.exponent);
}

class Writer {
 public:
  explicit Writer(const BusSignals& bus) : bus_(bus) {}

  std::string run() {
    out_ = "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_:";
    for (const auto& sender : bus_.senders) {
      const std::string name = nodes_.of(sender);
      node_names_.emplace_back(sender, name);
      out_ += " " + name;
      if (name != sender) comments_ += fmt::format("CM_ BU_ {} {};\n", name, in_quotes(sender));
    }
    out_ += "\n\n";
    for (const Message& message : bus_.messages) add(message);
    add_attributes();
    return windows_1252(out_);
  }

 private:
  std::string node(const std::string& name) const {
    for (const auto& [given, dbc] : node_names_) {
      if (given == name) return dbc;
    }
    return nobody;
  }

  void add(const Message& message) {
    const bool of_sender = !message.sender.empty() && message.sender != "master";
    const std::string words = of_sender ? message.sender + " " + message.name : message.name;
    const std::uint32_t id = dbc_id(message.key);
    out_ += fmt::format("BO_ {} {}: {} {}\n", id, messages_.of(words), message.bytes, node(message.sender));
    comments_ += fmt::format("CM_ BO_ {} {};\n", id, in_quotes(words));
    Names names;
    for (const Signal& signal : message.signals) add(signal, id, names);
    out_ += "\n";
    if (message.period) {
      const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(*message.period).count();
      cycles_ += fmt::format("BA_ \"GenMsgCycleTime\" BO_ {} {};\n", id, ms);
    }
  }

  void add(const Signal& signal, std::uint32_t id, Names& names) {
    const std::string object = od::write_object(signal.object);
    const bool has_object = signal.object.index != 0;
    const std::string name = names.of(signal.name.empty() ? "object " + object : signal.name);
    std::string receivers;
    for (const auto& each : signal.receivers) receivers += (receivers.empty() ? "" : ",") + node(each);
    if (receivers.empty()) receivers = nobody;
    out_ += fmt::format(" SG_ {} : {}|{}@1{} ({:g},0) [0|0] {} {}\n", name, signal.at, signal.bits,
                        od::is_signed(signal.type) ? '-' : '+', factor_of(signal), in_quotes(signal.meaning.unit),
                        receivers);
    comments_ += fmt::format("CM_ SG_ {} {} {};\n", id, name,
                             in_quotes(has_object ? fmt::format("{} {}", object, signal.name) : signal.name));
    if (is_float(signal)) types_ += fmt::format("SIG_VALTYPE_ {} {} : {};\n", id, name, signal.bits == 32 ? 1 : 2);
    add_values(signal, id, name);
  }

  void add_values(const Signal& signal, std::uint32_t id, const std::string& name) {
    std::string values;
    for (const auto& value : signal.meaning.values) {
      if (value.name.empty()) continue;
      const auto raw = od::is_signed(signal.type) ? fmt::format("{}", static_cast<std::int64_t>(value.raw))
                                                  : fmt::format("{}", value.raw);
      values += fmt::format(" {} {}", raw, in_quotes(value.name));
    }
    if (!values.empty()) values_ += fmt::format("VAL_ {} {}{} ;\n", id, name, values);
  }

  void add_attributes() {
    out_ += comments_;
    out_ +=
        "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 3600000;\nBA_DEF_ \"Baudrate\" INT 0 1000000;\n"
        "BA_DEF_ \"BusType\" STRING;\nBA_DEF_DEF_ \"GenMsgCycleTime\" 0;\nBA_DEF_DEF_ \"Baudrate\" 0;\n"
        "BA_DEF_DEF_ \"BusType\" \"CAN\";\n";
    out_ += fmt::format("BA_ \"Baudrate\" {};\n", bus_.bit_rate);
    out_ += cycles_ + values_ + types_;
  }

  const BusSignals& bus_;
  Names nodes_;
  Names messages_;
  std::vector<std::pair<std::string, std::string>> node_names_;
  std::string out_;
  std::string comments_;
  std::string cycles_;
  std::string values_;
  std::string types_;
};

}  // namespace

std::string dbc_of(const BusSignals& bus) { return Writer(bus).run(); }

}  // namespace berth::document
