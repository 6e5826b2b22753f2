#include "berth/command/arguments.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/command/verbs.hpp"
#include "berth/od/data_type.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {

Arguments::Arguments(const Request& request) : request_(request) {
  const Verb* const known = verb(request.verb);
  if (known == nullptr) {
    wrong(fmt::format("there is no command {}", text::quoted(request.verb)));
    return;
  }
  for (const auto& [key, value] : request.arguments) {
    const bool takes = known->parameter(key) != nullptr;
    if (!takes) wrong(fmt::format("\"{}\" has no argument \"{}\"", request.verb, key));
  }
  for (const Parameter& parameter : known->parameters) {
    const std::string name(parameter.name);
    if (parameter.required && !has(name)) required(name);
  }
}

bool Arguments::has(const std::string& key) const { return request_.arguments.contains(key); }

std::string Arguments::text(const std::string& key) const {
  const auto it = request_.arguments.find(key);
  return it == request_.arguments.end() ? std::string() : it->second;
}

std::string Arguments::required(const std::string& key) {
  if (text(key).empty()) wrong(fmt::format("\"{}\" needs {}", request_.verb, key));
  return text(key);
}

void Arguments::wrong(std::string problem) {
  if (problem_.empty()) problem_ = std::move(problem);
}

std::uint32_t Arguments::number(const std::string& key, std::uint32_t low, std::uint32_t high,
                                std::optional<std::uint32_t> fallback) {
  if (!has(key) && fallback) return *fallback;
  const std::string word = required(key);
  const auto parsed = od::parse_number(word);
  const bool good =
      parsed && !parsed->negative && !parsed->node_id && parsed->magnitude >= low && parsed->magnitude <= high;
  if (good) return static_cast<std::uint32_t>(parsed->magnitude);
  const bool as_hex = high > 0xFFF;
  wrong(as_hex ? fmt::format("{} {} is not a number from 0x{:X} to 0x{:X}", key, text::quoted(word), low, high)
               : fmt::format("{} {} is not a number from {} to {}", key, text::quoted(word), low, high));
  return low;
}

LssAddress Arguments::address(const std::string& key) {
  const std::string word = required(key);
  const auto parsed = parse_lss_address(word);
  if (parsed) return *parsed;
  wrong(
      fmt::format("{} {} is not an LSS address; write vendor-product-revision-serial, eight hex digits each, such as "
                  "00000001-00000001-00000000-00000005",
                  key, text::quoted(word)));
  return {};
}

std::optional<LssAddress> Arguments::optional_address(const std::string& key) {
  if (!has(key)) return std::nullopt;
  return address(key);
}

Identity Arguments::device(const std::string& key) {
  const std::string word = required(key);
  const auto parsed = parse_identity(word);
  if (parsed) return *parsed;
  wrong(
      fmt::format("{} {} is not a device; write vendor-product-revision-serial, eight hex digits each, such as "
                  "00000001-00000001-00000000-00000005, and @NODE-ID after it if the device has no serial number",
                  key, text::quoted(word)));
  return {};
}

std::optional<Identity> Arguments::optional_device(const std::string& key) {
  if (!has(key)) return std::nullopt;
  return device(key);
}

}  // namespace berth::command
