// The sections that describe neither objects nor the device: comments, tools, dynamic channels, connected modules.
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/eds/info.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

constexpr std::size_t most_segments = 64;
constexpr std::uint16_t most_slots = 1024;

std::string_view trimmed(std::string_view text) noexcept {
  const std::size_t begin = text.find_first_not_of(" \t");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

std::optional<std::uint32_t> plain_number(std::string_view text, std::uint64_t most) noexcept {
  const auto number = od::parse_number(trimmed(text));
  if (!number || number->node_id || number->negative || number->magnitude > most) return std::nullopt;
  return static_cast<std::uint32_t>(number->magnitude);
}

/// "Line12" with the word "Line" is 12.
std::optional<std::uint32_t> numbered_word(std::string_view key, std::string_view word) noexcept {
  if (!same_word(key.substr(0, word.size()), word)) return std::nullopt;
  return number_key(key.substr(word.size()));
}

void check_counter(Context& context, const Section& section, const char* counter, std::size_t found) {
  const Entry* const entry = context.document().find(section, counter);
  const auto promised = context.number(section, entry, 0xFFFF'FFFF, Severity::warning);
  if (!promised || *promised == found) return;
  context.tell(Severity::note, section, entry, fmt::format("says {}, {} are there", *promised, found));
}

/// CiA 306: `Lines` is an Unsigned16.
constexpr std::size_t most_numbered = 0xFFFF;

void tell_too_many(Context& context, const Section& section, const char* what, std::size_t found) {
  if (found <= most_numbered) return;
  context.tell(Severity::warning, section, nullptr,
               fmt::format("{} {}, and {} can be counted: the rest is left out", found, what, most_numbered));
}

/// The data types of the index ranges of network variables (CiA 302-4), 64 indices each, in this order: from A000h on
/// for what the device produces, and from A480h on for what it consumes.
constexpr std::array<od::DataType, 18> variable_types{
    od::DataType::integer8,   od::DataType::unsigned8,  od::DataType::boolean,    od::DataType::integer16,
    od::DataType::unsigned16, od::DataType::integer24,  od::DataType::unsigned24, od::DataType::integer32,
    od::DataType::unsigned32, od::DataType::real32,     od::DataType::unsigned40, od::DataType::integer40,
    od::DataType::unsigned48, od::DataType::integer48,  od::DataType::unsigned56, od::DataType::integer56,
    od::DataType::integer64,  od::DataType::unsigned64,
};

bool usual_range(const DynamicSegment& segment) noexcept {
  const bool produced = segment.access == od::Access::ro || segment.access == od::Access::rwr;
  const auto* const found = std::ranges::find(variable_types, segment.type);
  if (found == variable_types.end()) return false;
  const unsigned first = (produced ? 0xA000U : 0xA480U) + 64U * static_cast<unsigned>(found - variable_types.begin());
  return segment.first >= first && segment.last < first + 64U;
}

/// TypeN, DirN, RangeN, PPOffsetN.
class SegmentReader {
 public:
  SegmentReader(Context& context, const Section& section) : context_(context), section_(section) {}

  std::optional<DynamicSegment> read(std::size_t number) {
    number_ = number;
    DynamicSegment segment;
    const Entry* const type = entry("Type");
    const auto code = plain_number(context_.raw(type), 0xFFFF);
    if (!code) return bad(type, "Type is not a data type");
    segment.type = static_cast<od::DataType>(*code);
    if (!direction(segment) || !range(segment) || !offset(segment)) return std::nullopt;
    if (!usual_range(segment)) {
      context_.tell(Severity::note, section_, entry("Range"),
                    fmt::format("CiA 302-4 has other indices for {} of this direction", od::name(segment.type)));
    }
    return segment;
  }

 private:
  const Entry* entry(std::string_view word) const {
    return context_.document().find(section_, fmt::format("{}{}", word, number_));
  }
  std::nullopt_t bad(const Entry* entry, std::string_view message) {
    context_.warn(section_, entry, fmt::format("segment {}: {}; the segment is left out", number_, message));
    return std::nullopt;
  }

  bool direction(DynamicSegment& segment) {
    const Entry* const key = entry("Dir");
    for (const od::Access each : {od::Access::ro, od::Access::wo, od::Access::rw, od::Access::rwr, od::Access::rww}) {
      if (!same_word(context_.raw(key), od::name(each))) continue;
      segment.access = each;
      return true;
    }
    return bad(key, "Dir is none of ro, rwr, rww, wo"), false;
  }
  bool range(DynamicSegment& segment) {
    const Entry* const key = entry("Range");
    const std::string_view text = context_.raw(key);
    const std::size_t dash = text.find('-');
    const auto first = plain_number(text.substr(0, dash), 0xFFFF);
    const auto last = dash == std::string_view::npos ? first : plain_number(text.substr(dash + 1), 0xFFFF);
    if (!first || !last || *last < *first) return bad(key, "Range is not first-last"), false;
    segment.first = static_cast<std::uint16_t>(*first);
    segment.last = static_cast<std::uint16_t>(*last);
    return true;
  }
  bool offset(DynamicSegment& segment) {
    const Entry* const key = entry("PPOffset");
    const std::string_view text = context_.raw(key);
    if (text.empty()) return true;
    const std::size_t comma = text.find(',');
    const auto offset = plain_number(text.substr(0, comma), 0xFFFF'FFFF);
    const auto difference =
        comma == std::string_view::npos ? std::optional(1U) : plain_number(text.substr(comma + 1), 0xFFFF'FFFF);
    if (!offset || !difference) return bad(key, "PPOffset is not offset or offset,difference"), false;
    segment.offset = *offset;
    segment.difference = *difference;
    return true;
  }

  Context& context_;
  const Section& section_;
  std::size_t number_ = 0;
};

}  // namespace

std::optional<std::uint32_t> DynamicSegment::address(ObjectRef variable) const noexcept {
  if (variable.index < first || variable.index > last || variable.sub == 0 || variable.sub == 0xFF) return std::nullopt;
  const std::uint32_t number = (variable.index - first) * 254U + variable.sub - 1U;
  const std::size_t size = type == od::DataType::boolean ? difference : od::byte_size(type);
  return offset + number * static_cast<std::uint32_t>(size);
}

std::vector<std::string> read_comments(Context& context, const Section& section) {
  std::vector<std::pair<std::uint32_t, std::string>> lines;
  std::size_t found = 0;
  for (const Entry& each : context.document().entries(section)) {
    const auto number = numbered_word(context.document().key(each), "Line");
    if (number && ++found <= most_numbered) lines.emplace_back(*number, context.text(&each));
  }
  tell_too_many(context, section, "lines", found);
  std::ranges::stable_sort(lines, {}, &std::pair<std::uint32_t, std::string>::first);
  check_counter(context, section, "Lines", found);
  std::vector<std::string> made;
  made.reserve(lines.size());
  for (auto& [number, line] : lines) made.push_back(std::move(line));
  return made;
}

std::vector<Tool> read_tools(Context& context) {
  const Document& document = context.document();
  std::vector<std::pair<std::uint32_t, Tool>> found;
  for (const Section& each : document.sections()) {
    const auto number = numbered_word(document.name(each), "Tool");
    if (!number || found.size() == most_numbered) continue;
    found.emplace_back(*number,
                       Tool{context.text(document.find(each, "Name")), context.text(document.find(each, "Command"))});
  }
  std::ranges::stable_sort(found, {}, &std::pair<std::uint32_t, Tool>::first);
  if (const Section* const section = document.find("Tools")) check_counter(context, *section, "Items", found.size());
  std::vector<Tool> made;
  for (auto& [number, tool] : found) made.push_back(std::move(tool));
  return made;
}

std::vector<DynamicSegment> read_dynamic_segments(Context& context) {
  std::vector<DynamicSegment> made;
  const Section* const section = context.document().find("DynamicChannels");
  if (section == nullptr) return made;
  const Entry* const counter = context.document().find(*section, "NrOfSeg");
  const auto promised = context.number(*section, counter, 0xFFFF'FFFF, Severity::warning).value_or(0);
  if (promised > most_segments) {
    context.warn(*section, counter, fmt::format("more than {} segments; the others are left out", most_segments));
  }
  SegmentReader reader(context, *section);
  for (std::size_t i = 1; i <= std::min<std::uint64_t>(promised, most_segments); ++i) {
    if (const auto segment = reader.read(i)) made.push_back(*segment);
  }
  return made;
}

std::vector<std::uint16_t> read_connected_modules(Context& context) {
  std::vector<std::uint16_t> slots;
  const Section* const section = context.document().find("ConnectedModules");
  if (section == nullptr) return slots;
  for (const Entry& each : context.document().entries(*section)) {
    const auto slot = number_key(context.document().key(each));
    if (!slot) continue;
    const auto kind = context.number(*section, &each, 0xFFFF, Severity::warning);
    if (!kind) continue;
    if (*slot == 0 || *slot > most_slots) {
      context.warn(*section, &each, fmt::format("slots count from 1 to {}; left out", most_slots));
      continue;
    }
    slots.resize(std::max<std::size_t>(slots.size(), *slot));
    slots[*slot - 1] = static_cast<std::uint16_t>(*kind);
  }
  check_counter(context, *section, "NrOfEntries", slots.size());
  return slots;
}

}  // namespace berth::eds
