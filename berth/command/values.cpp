#include "berth/command/values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/command/meanings.hpp"
#include "berth/od/notation.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {

using od::DataType;

std::string hex_bytes(std::span<const std::uint8_t> bytes) {
  std::string out;
  for (const auto byte : bytes) out += fmt::format("{}{:02X}", out.empty() ? "" : " ", byte);
  return out;
}

bool fits(DataType type, std::span<const std::uint8_t> bytes) noexcept {
  const std::size_t size = od::byte_size(type);
  return size == 0 || size == bytes.size();
}

namespace {

/// The time unit of a communication object that holds a time (CiA 301 §7.5.2); 0: it holds none.
text::Duration tick(ObjectRef ref) {
  using namespace std::chrono_literals;
  const bool pdo = od::is_pdo_communication(ref.index);
  if (pdo && ref.sub == od::pdo_sub::inhibit) return 100us;
  if (pdo && ref.sub == od::pdo_sub::timer) return 1ms;
  if (ref.sub != 0) return 0ns;
  switch (ref.index) {
    case 0x1006:
    case 0x1007:
    case 0x1013: return 1us;
    case 0x100C:
    case 0x1017: return 1ms;
    case 0x1015: return 100us;
    default: return 0ns;
  }
}

bool printable(std::span<const std::uint8_t> bytes) {
  return !bytes.empty() && std::ranges::all_of(bytes, [](std::uint8_t b) { return b >= 0x20 && b <= 0x7E; });
}

}  // namespace

std::string unit_text(const KnownObject& object, std::span<const std::uint8_t> bytes) {
  const auto one = tick(object.ref);
  const bool counts = one.count() != 0 && od::is_unsigned(object.type) && fits(object.type, bytes);
  if (!counts) return {};
  return text::write_duration(one * static_cast<std::int64_t>(od::load(object.type, bytes.data())));
}

// ---- output for the user ----

std::string value_text(const KnownObject& object, std::span<const std::uint8_t> bytes) {
  const DataType type = object.type;
  if (type != DataType::none && fits(type, bytes)) {
    std::string meant;
    for (const auto& each : {unit_text(object, bytes), quantity_text(object, bytes), value_name(object, bytes)}) {
      if (!each.empty()) meant += " = " + each;
    }
    const bool number = od::is_unsigned(type) && type != DataType::boolean;
    if (!number) return od::print(type, bytes) + meant;
    const auto digits = static_cast<int>(2 * od::byte_size(type));
    return fmt::format("{} (0x{:0{}X}){}", od::print(type, bytes), od::load(type, bytes.data()), digits, meant);
  }
  std::string text = bytes.empty() ? "(no bytes)" : hex_bytes(bytes);
  if (printable(bytes)) text += fmt::format("  \"{}\"", std::string(bytes.begin(), bytes.end()));
  std::uint64_t number = 0;
  for (std::size_t i = bytes.size(); i-- > 0 && bytes.size() <= 8;) number = number << 8U | bytes[i];
  if (!bytes.empty() && bytes.size() <= 8) text += fmt::format("  = {} (0x{:X})", number, number);
  if (const std::string name = value_name(object, bytes); !name.empty()) text += " = " + name;
  return text;
}

namespace {

// Only numbers that JSON readers keep exactly are written as numbers.
void put_typed(nlohmann::ordered_json& json, const KnownObject& object, std::span<const std::uint8_t> bytes) {
  const DataType type = object.type;
  if (type == DataType::none || !fits(type, bytes)) return;
  json["type"] = std::string(od::name(type));
  if (!od::is_integer(type)) {
    json["value"] = od::print(type, bytes);
  } else if (od::is_signed(type)) {
    json["value"] = static_cast<std::int64_t>(od::load(type, bytes.data()));
  } else {
    json["value"] = od::load(type, bytes.data());
  }
  if (const std::string unit = unit_text(object, bytes); !unit.empty()) json["time"] = unit;
  if (object.meaning == nullptr || !object.type_is_described()) return;
  if (!object.meaning->unit.empty()) json["unit"] = one_count(*object.meaning);
  if (const auto quantity = quantity_text(object, bytes); !quantity.empty()) json["quantity"] = quantity;
}

}  // namespace

void put_value(nlohmann::ordered_json& json, const KnownObject& object, std::span<const std::uint8_t> bytes) {
  json["bytes"] = hex_bytes(bytes);
  put_typed(json, object, bytes);
  if (const auto name = value_name(object, bytes); !name.empty()) json["meaning"] = name;
}

// ---- input from the user ----

namespace {

using Bytes = std::vector<std::uint8_t>;

// "F4 01": two digits per byte, with spaces between.
bool is_row_of_bytes(const std::string& text) {
  const auto is_hex = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); };
  if (text.size() % 3 != 2 || text.size() < 5) return false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (i % 3 == 2 ? text[i] != ' ' : !is_hex(text[i])) return false;
  }
  return true;
}

Checked<Bytes> untyped(const std::string& text) {
  if (text.empty()) return Bytes();
  const auto parsed = od::parse(DataType::octet_string, text);
  if (!parsed) return tl::unexpected(fmt::format("value {}: {}", text::quoted(text), parsed.error().what));
  if (!parsed->value.present()) return tl::unexpected(std::string("the value is empty"));
  if (!parsed->notes.has(od::Note::plain_text)) return parsed->value.bytes;
  return tl::unexpected(
      fmt::format("value {} is not a row of hex bytes such as \"91 01 0F 00\"; the object's type is not known: give "
                  "--type for anything else",
                  text::quoted(text)));
}

// "500 ms": a decimal number, then a unit.
bool has_unit(const std::string& text) {
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c & 0x80) != 0; };
  const auto last_digit = text.find_last_of("0123456789");
  const bool number_first = !text.empty() && text.front() >= '0' && text.front() <= '9';
  const bool as_hex = text.starts_with("0x") || text.starts_with("0X");
  return number_first && !as_hex && last_digit + 1 < text.size() &&
         std::any_of(text.begin() + static_cast<std::ptrdiff_t>(last_digit) + 1, text.end(), letter);
}

Checked<std::uint64_t> in_ticks(const KnownObject& object, const std::string& text) {
  const auto one = tick(object.ref);
  if (one.count() == 0) {
    return tl::unexpected(fmt::format("value {}: the unit of {} is not known; write the number alone",
                                      text::quoted(text), od::write_object(object.ref)));
  }
  const auto time = text::parse_duration(text);
  if (!time) {
    return tl::unexpected(
        fmt::format("value {} is not a time; the units are ns, us, ms, s, min and h", text::quoted(text)));
  }
  if (*time % one != text::Duration(0)) {
    return tl::unexpected(fmt::format("value {} is not a multiple of {}, the unit of {}", text::quoted(text),
                                      text::write_duration(one), od::write_object(object.ref)));
  }
  return static_cast<std::uint64_t>(*time / one);
}

Checked<void> within_limits(const KnownObject& object, std::uint64_t raw, NodeId node, const std::string& text) {
  const auto* const limits = object.limits;
  const auto is = [&](const od::Literal& limit) { return limit.resolve(object.type, node.value()); };
  const bool low = limits->low.present() && od::compare(object.type, raw, is(limits->low)) < 0;
  const bool high = limits->high.present() && od::compare(object.type, raw, is(limits->high)) == 1;
  if (!low && !high) return {};
  Bytes bytes(od::byte_size(object.type));
  od::store(object.type, is(low ? limits->low : limits->high), bytes.data());
  return tl::unexpected(fmt::format("value {} is {} {}, the {} limit of {} in the description; write it with --anyway",
                                    text::quoted(text), low ? "below" : "above", od::print(object.type, bytes),
                                    low ? "low" : "high", od::write_object(object.ref)));
}

// "UNSIGNED16 of 1017h:00: 0 to 65535".
std::string range_of(const KnownObject& object) {
  const std::string what = fmt::format("{} of {}", od::name(object.type), od::write_object(object.ref));
  if (!od::is_integer(object.type)) return what;
  const unsigned bits = od::bit_length(object.type);
  const std::uint64_t half = std::uint64_t{1} << (bits - 1);
  if (od::is_signed(object.type)) return fmt::format("{}: -{} to {}", what, half, half - 1);
  return fmt::format("{}: 0 to {}", what, half - 1 + half);
}

Checked<std::uint64_t> plain_number(const KnownObject& object, const std::string& text, NodeId node) {
  const auto parsed = od::parse(object.type, text);
  if (!parsed) {
    return tl::unexpected(fmt::format("value {}: {} ({})", text::quoted(text), parsed.error().what, range_of(object)));
  }
  if (!parsed->value.present()) return tl::unexpected(std::string("the value is empty"));
  if (parsed->notes.has(od::Note::wrapped)) {
    return tl::unexpected(fmt::format("value {} does not fit {}", text::quoted(text), range_of(object)));
  }
  return parsed->value.resolve(object.type, node.value());
}

Checked<std::uint64_t> raw_of(const KnownObject& object, const std::string& text, NodeId node) {
  if (object.meaning != nullptr && object.type_is_described()) {
    if (auto meant = raw_meant(object, text, node)) return std::move(*meant);
  }
  const bool unit = od::is_integer(object.type) && has_unit(text);
  return unit ? in_ticks(object, text) : plain_number(object, text, node);
}

Checked<Bytes> scalar(const KnownObject& object, const std::string& text, NodeId node) {
  const auto raw = raw_of(object, text, node);
  if (!raw) return tl::unexpected(raw.error());
  if (od::wrap(object.type, *raw) != *raw) {
    return tl::unexpected(fmt::format("value {} does not fit {}", text::quoted(text), range_of(object)));
  }
  Bytes bytes(od::byte_size(object.type));
  od::store(object.type, *raw, bytes.data());
  return bytes;
}

}  // namespace

Checked<Bytes> value_bytes(const KnownObject& object, const std::string& text, NodeId node, bool anyway) {
  const DataType type = object.type;
  if (type == DataType::none) return untyped(text);
  const bool text_like = od::byte_size(type) == 0;
  if (text.empty() && (text_like || !object.type_given)) return Bytes();
  if (!object.type_given && !text_like && is_row_of_bytes(text)) {
    auto bytes = untyped(text);
    if (bytes && fits(type, *bytes)) return bytes;
    return tl::unexpected(fmt::format("value {} has {} bytes, {} has {}", text::quoted(text), text.size() / 3 + 1,
                                      od::name(type), od::byte_size(type)));
  }
  if (text_like) {
    const auto parsed = od::parse(type, text);
    if (!parsed) return tl::unexpected(fmt::format("value {}: {}", text::quoted(text), parsed.error().what));
    return parsed->value.bytes;
  }
  auto bytes = scalar(object, text, node);
  if (!bytes || anyway) return bytes;
  const auto raw = od::load(type, bytes->data());
  if (object.limits != nullptr) {
    const auto good = within_limits(object, raw, node, text);
    if (!good) return tl::unexpected(good.error());
  }
  const std::string wrong = not_allowed(object, raw, text);
  if (!wrong.empty()) return tl::unexpected(wrong);
  return bytes;
}

}  // namespace berth::command
