#include "berth/eds/context.hpp"

#include <fmt/format.h>

#include "berth/eds/odd_values.hpp"

namespace berth::eds {

void Context::tell(Severity severity, const Section& section, const Entry* entry, std::string message, std::string fix,
                   std::size_t at) {
  std::string key = fmt::format("[{}]", document_.utf8(document_.name(section)));
  if (entry == nullptr) {
    report_.add(severity, section.line, document_.column(section.name_at), std::move(key), std::move(message),
                std::move(fix));
    return;
  }
  key += fmt::format(" {}", document_.utf8(document_.key(*entry)));
  const std::uint32_t column = document_.column(entry->value_at + static_cast<std::uint32_t>(at));
  report_.add(severity, entry->line, column, std::move(key), std::move(message), std::move(fix));
}

std::optional<std::uint64_t> Context::number(const Section& section, const Entry* entry, std::uint64_t most,
                                             Severity severity) {
  const std::string_view value = raw(entry);
  if (value.empty()) return std::nullopt;
  auto parsed = od::parse_number(value);
  const auto plain = parsed ? std::nullopt : plain_sense(od::DataType::unsigned64, value);
  if (plain) {
    warn(section, entry, fmt::format("\"{}\" is taken as {}", document_.utf8(value.substr(0, 40)), *plain),
         "write a decimal or 0x number");
    parsed = od::parse_number(*plain);
  }
  if (!parsed) {
    tell(severity, section, entry, fmt::format("\"{}\": {}", document_.utf8(value.substr(0, 40)), parsed.error().what),
         "write a decimal or 0x number", parsed.error().at);
    return std::nullopt;
  }
  if (parsed->node_id || parsed->negative || parsed->magnitude > most) {
    tell(severity, section, entry,
         fmt::format("\"{}\" is not a number from 0 to {}", document_.utf8(value.substr(0, 40)), most));
    return std::nullopt;
  }
  tell_notes(section, *entry, parsed->notes, od::DataType::unsigned64);
  return parsed->magnitude;
}

bool Context::flag(const Section& section, const Entry* entry) {
  const std::string_view text = raw(entry);
  if (text.empty() || text == "0") return false;
  if (text == "1") return true;
  const auto value = number(section, entry, 0xFFFF'FFFF, Severity::warning);
  if (value && *value > 1) warn(section, entry, "is 0 or 1; taken as 1");
  return value.value_or(0) != 0;
}

void Context::tell_notes(const Section& section, const Entry& entry, od::Notes notes, od::DataType type) {
  if (notes.bits == 0) return;
  const std::string value = document_.utf8(document_.value(entry).substr(0, 40));
  if (notes.has(od::Note::octal)) {
    warn(section, &entry, fmt::format("{} has a leading 0 and is read as octal (CiA 306)", value),
         "write it without the 0, or with 0x");
  }
  if (notes.has(od::Note::node_id_last)) {
    warn(section, &entry, fmt::format("{}: $NODEID must be first (CiA 306)", value), "write $NODEID+number");
  }
  if (notes.has(od::Note::wrapped)) {
    warn(section, &entry, fmt::format("{} is out of the range of {}; taken by its bits", value, od::name(type)));
  }
  if (notes.has(od::Note::plain_text)) {
    tell(Severity::note, section, &entry, fmt::format("{} is not hex text; taken as plain text", value));
  }
  if (notes.has(od::Note::real_bits)) {
    tell(Severity::note, section, &entry, fmt::format("{} is taken as the bits of a {}", value, od::name(type)));
  }
}

std::optional<std::uint32_t> number_key(std::string_view key) noexcept {
  if (key.empty() || key.size() > 9) return std::nullopt;
  std::uint32_t value = 0;
  for (const char c : key) {
    if (c < '0' || c > '9') return std::nullopt;
    value = value * 10 + static_cast<std::uint32_t>(c - '0');
  }
  return value;
}

}  // namespace berth::eds
