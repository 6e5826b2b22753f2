#include "berth/linker/symbols.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/base/words.hpp"

namespace berth::linker {
namespace {

using od::DataType;

// Words reserved in IEC 61131-3 that users might choose for a variable; the elementary types and operators.
constexpr std::array<std::string_view, 66> reserved{"action",
                                                    "and",
                                                    "any",
                                                    "array",
                                                    "at",
                                                    "bool",
                                                    "by",
                                                    "byte",
                                                    "case",
                                                    "class",
                                                    "configuration",
                                                    "constant",
                                                    "date",
                                                    "dint",
                                                    "do",
                                                    "dt",
                                                    "dword",
                                                    "else",
                                                    "elsif",
                                                    "end_if",
                                                    "end_var",
                                                    "exit",
                                                    "false",
                                                    "for",
                                                    "from",
                                                    "function",
                                                    "if",
                                                    "initial_step",
                                                    "int",
                                                    "interface",
                                                    "lint",
                                                    "lreal",
                                                    "lword",
                                                    "method",
                                                    "mod",
                                                    "namespace",
                                                    "not",
                                                    "of",
                                                    "on",
                                                    "or",
                                                    "program",
                                                    "real",
                                                    "repeat",
                                                    "resource",
                                                    "retain",
                                                    "return",
                                                    "sint",
                                                    "step",
                                                    "string",
                                                    "struct",
                                                    "task",
                                                    "then",
                                                    "time",
                                                    "to",
                                                    "tod",
                                                    "transition",
                                                    "true",
                                                    "type",
                                                    "udint",
                                                    "uint",
                                                    "ulint",
                                                    "until",
                                                    "usint",
                                                    "var",
                                                    "while",
                                                    "word"};

bool letter(char c) noexcept { return lower(c) >= 'a' && lower(c) <= 'z'; }
bool digit(char c) noexcept { return c >= '0' && c <= '9'; }

/// Without characters that would end a comment of structured text.
std::string in_comment(std::string text) {
  std::ranges::replace(text, '*', '+');
  return text;
}

std::string where(const Variable& variable) {
  return fmt::format("{:04X}h:{:02X} {}, {} the network, byte {}", variable.object.index, variable.object.sub,
                     od::name(variable.type), variable.input ? "to" : "from", variable.offset);
}

}  // namespace

std::string wrong_identifier(std::string_view name) {
  if (name.empty()) return "it is empty";
  if (name.size() > 100) return "it is longer than 100 characters";
  if (!letter(name.front()) && name.front() != '_') return "it does not begin with a letter";
  for (std::size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    if (!letter(c) && !digit(c) && c != '_')
      return fmt::format("{} is not a letter or digit", berth::quoted(name.substr(i, 1)));
    if (c == '_' && i + 1 < name.size() && name[i + 1] == '_') return "two underscores in a row";
  }
  if (name.back() == '_') return "it ends with an underscore";
  const bool kept = std::ranges::any_of(reserved, [&](auto word) { return same_word(word, name); });
  return kept ? "IEC 61131-3 keeps this word for itself" : "";
}

std::string symbol_of(ObjectRef object) { return fmt::format("NV_{:04X}_{:02X}", object.index, object.sub); }

std::string_view iec_type(DataType type) noexcept {
  switch (type) {
    case DataType::boolean: return "BOOL";
    case DataType::integer8: return "SINT";
    case DataType::unsigned8: return "USINT";
    case DataType::integer16: return "INT";
    case DataType::unsigned16: return "UINT";
    case DataType::integer24:
    case DataType::integer32: return "DINT";
    case DataType::unsigned24:
    case DataType::unsigned32: return "UDINT";
    case DataType::real32: return "REAL";
    case DataType::real64: return "LREAL";
    case DataType::integer40:
    case DataType::integer48:
    case DataType::integer56:
    case DataType::integer64: return "LINT";
    default: return "ULINT";
  }
}

std::string iec_address(const Variable& variable) {
  const char area = variable.input ? 'Q' : 'I';
  const auto size = static_cast<std::uint32_t>(od::byte_size(variable.type));
  if (variable.type == DataType::boolean) return fmt::format("%{}X{}.0", area, variable.offset);
  if (size == 0 || variable.offset % size != 0) return {};
  switch (size) {
    case 1: return fmt::format("%{}B{}", area, variable.offset);
    case 2: return fmt::format("%{}W{}", area, variable.offset / 2);
    case 4: return fmt::format("%{}D{}", area, variable.offset / 4);
    case 8: return fmt::format("%{}L{}", area, variable.offset / 8);
    default: return {};
  }
}

std::string plcopen_xml(const LinkNetwork& network, const Plan& plan, std::size_t node) {
  std::string variables;
  for (const Variable& each : plan.variables) {
    if (each.node != node) continue;
    const std::string address = iec_address(each);
    variables += fmt::format(
        "            <variable name=\"{}\"{}>\n"
        "              <type><{}/></type>\n"
        "              <documentation><xhtml xmlns=\"http://www.w3.org/1999/xhtml\">{}</xhtml></documentation>\n"
        "            </variable>\n",
        markup(each.name), address.empty() ? "" : fmt::format(" address=\"{}\"", address), iec_type(each.type),
        markup(where(each)));
  }
  // The schema requires a date; a fixed one, so that the same links give the same file.
  constexpr std::string_view head =
      "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
      "<project xmlns=\"http://www.plcopen.org/xml/tc6_0201\">\n"
      "  <fileHeader companyName=\"\" productName=\"berth link\" productVersion=\"1\" "
      "creationDateTime=\"1984-01-01T00:00:00\"/>\n"
      "  <contentHeader name=\"{}\">\n"
      "    <coordinateInfo>\n"
      "      <fbd><scaling x=\"1\" y=\"1\"/></fbd>\n"
      "      <ld><scaling x=\"1\" y=\"1\"/></ld>\n"
      "      <sfc><scaling x=\"1\" y=\"1\"/></sfc>\n"
      "    </coordinateInfo>\n"
      "  </contentHeader>\n"
      "  <types><dataTypes/><pous/></types>\n"
      "  <instances>\n"
      "    <configurations>\n"
      "      <configuration name=\"network\">\n"
      "        <resource name=\"{}\">\n"
      "          <globalVars name=\"network_variables\">\n";
  return fmt::format(head, markup(network.name), markup(network.nodes[node].name)) + variables +
         "          </globalVars>\n"
         "        </resource>\n"
         "      </configuration>\n"
         "    </configurations>\n"
         "  </instances>\n"
         "</project>\n";
}

std::string global_variables(const LinkNetwork& network, const Plan& plan, std::size_t node) {
  std::string text =
      fmt::format("(* Network variables of {}, made by berth link from the links of {}. *)\nVAR_GLOBAL\n",
                  in_comment(network.nodes[node].name), in_comment(network.name));
  for (const Variable& each : plan.variables) {
    if (each.node != node) continue;
    const std::string address = iec_address(each);
    text += fmt::format("  {}{} : {}; (* {} *)\n", each.name, address.empty() ? "" : " AT " + address,
                        iec_type(each.type), where(each));
  }
  return text + "END_VAR\n";
}

}  // namespace berth::linker
