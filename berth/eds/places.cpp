#include "berth/eds/places.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "berth/eds/objects.hpp"

namespace berth::eds {
namespace {

constexpr std::uint32_t object_key(std::uint16_t index) noexcept { return static_cast<std::uint32_t>(index) << 16U; }
constexpr std::uint32_t sub_key(ObjectRef ref) noexcept { return object_key(ref.index) | (ref.sub + 1U); }

/// Calls `each` for the words between the bars, until it returns true.
template <class F>
void for_words(std::string_view words, F&& each) {
  while (!words.empty()) {
    const auto bar = words.find('|');
    if (each(words.substr(0, bar))) return;
    words = bar == std::string_view::npos ? std::string_view{} : words.substr(bar + 1);
  }
}

std::optional<std::uint32_t> hex_attribute(std::string_view tag, std::string_view name) noexcept {
  const std::size_t at = tag.find(name);
  if (at == std::string_view::npos) return std::nullopt;
  std::uint32_t value = 0;
  const std::string_view rest = tag.substr(at + name.size());
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value, 16);
  return error == std::errc() ? std::optional(value) : std::nullopt;
}

}  // namespace

Places::Places(const Document& document, std::string_view xml) : document_(document), xml_(xml) {
  for (const Section& section : document.sections()) {
    const auto named = object_section(document.name(section));
    if (!named) continue;
    if (named->part == Part::object) sections_[object_key(named->index)] = &section;
    if (named->part == Part::sub) sections_[sub_key({named->index, named->sub})] = &section;
  }
  lines_.push_back(0);
  for (std::size_t at = xml.find('\n'); at != std::string_view::npos; at = xml.find('\n', at + 1))
    lines_.push_back(at + 1);
  std::uint16_t index = 0;
  for (std::size_t at = xml.find('<'); at != std::string_view::npos; at = xml.find('<', at + 1)) {
    const std::string_view tag = xml.substr(at, xml.find('>', at) - at);
    const std::string_view name = tag.substr(0, tag.find_first_of(" \t\r\n"));
    if (name.ends_with("CANopenObject")) {
      index = static_cast<std::uint16_t>(hex_attribute(tag, " index=\"").value_or(0));
      tags_.try_emplace(object_key(index), at);
    } else if (name.ends_with("CANopenSubObject")) {
      if (const auto sub = hex_attribute(tag, " subIndex=\""))
        tags_.try_emplace(sub_key({index, static_cast<std::uint8_t>(*sub)}), at);
    }
  }
}

Places::Place Places::place(std::size_t at, std::string_view key) const {
  const auto after = std::ranges::upper_bound(lines_, at);
  const auto line = static_cast<std::size_t>(after - lines_.begin());
  return {static_cast<std::uint32_t>(line), static_cast<std::uint32_t>(at - lines_[line - 1] + 1), key};
}

Places::Place Places::in_section(const Section& section, std::string_view keys) const {
  Place found{section.line, document_.column(section.name_at), {}};
  for_words(keys, [&](std::string_view key) {
    const Entry* const entry = document_.find(section, key);
    if (entry == nullptr || document_.value(*entry).empty()) return false;
    found = {entry->line, document_.column(entry->value_at), key};
    return true;
  });
  return found;
}

Places::Place Places::in_tag(std::size_t at, std::string_view keys) const {
  const std::string_view tag = xml_.substr(at, xml_.find('>', at) - at);
  Place found = place(at, {});
  for_words(keys, [&](std::string_view key) {
    const std::string wanted = fmt::format(" {}=\"", key);
    const std::size_t in = tag.find(wanted);
    if (in == std::string_view::npos) return false;
    found = place(at + in + wanted.size(), key);
    return true;
  });
  return found;
}

Places::Place Places::of(ObjectRef ref, bool whole, std::string_view keys) const {
  if (!whole) {
    if (const auto found = sections_.find(sub_key(ref)); found != sections_.end())
      return in_section(*found->second, keys);
    if (const auto found = tags_.find(sub_key(ref)); found != tags_.end()) return in_tag(found->second, keys);
  }
  if (const auto found = sections_.find(object_key(ref.index)); found != sections_.end())
    return in_section(*found->second, whole || ref.sub == 0 ? keys : "");
  if (const auto found = tags_.find(object_key(ref.index)); found != tags_.end())
    return in_tag(found->second, whole || ref.sub == 0 ? keys : "");
  return {};
}

Places::Place Places::of_device(std::string_view key) const {
  for (const char* const name : {"DeviceInfo", "DeviceComissioning", "DeviceCommissioning"}) {
    const Section* const section = document_.find(name);
    if (section == nullptr) continue;
    const Place found = in_section(*section, key);
    if (!found.key.empty()) return found;
  }
  if (const Section* const section = document_.find("DeviceInfo")) return in_section(*section, {});
  const std::size_t at = xml_.find(fmt::format(" {}=\"", key));
  return at == std::string_view::npos ? Place{} : place(at + key.size() + 3, key);
}

std::string Places::key(ObjectRef ref, bool whole, std::string_view key) const {
  const std::string_view blank = key.empty() ? "" : " ";
  const bool sub = !whole && (sections_.contains(sub_key(ref)) || tags_.contains(sub_key(ref)) || ref.sub != 0);
  if (!xml_.empty())
    return sub ? fmt::format("{:04X}:{:02X}{}{}", ref.index, ref.sub, blank, key)
               : fmt::format("{:04X}{}{}", ref.index, blank, key);
  return sub ? fmt::format("[{:04X}sub{:X}]{}{}", ref.index, ref.sub, blank, key)
             : fmt::format("[{:04X}]{}{}", ref.index, blank, key);
}

}  // namespace berth::eds
