#include "berth/operate/slot_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "berth/base/words.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/printable.hpp"

namespace berth::operate {

namespace {

constexpr std::size_t shortest_name = 8;  // a name is not cut further

// The field's short words: berth nmt preop.
const char* short_word(NmtState state) noexcept {
  switch (state) {
    case NmtState::initialising: return "init";
    case NmtState::stopped: return "stop";
    case NmtState::operational: return "op";
    case NmtState::pre_operational: return "preop";
  }
  return "?";
}

// As its device reports it, because a slot may take several types. Else the slot's.
std::string type_of(const SlotReport& s) {
  if (s.unasked == 0)
    return to_string(s.device && s.device->knows(0) && s.device->knows(1) ? s.device->type() : s.type);
  Identity type(s.type.vendor, s.type.product, 0, 0);
  type.unknown = s.unasked;
  constexpr std::size_t columns = 17;
  return to_string(s.device.value_or(type)).substr(0, columns);
}

std::string fitted(const std::string& name, std::size_t width) {
  const std::string shown = text::one_line(name);
  return text::columns(shown) > width ? text::cut(shown, width - 1) + "~" : shown;
}

}  // namespace

std::string age_cell(rt::Duration age) {
  const double seconds = std::chrono::duration<double>(std::max(rt::Duration{}, age)).count();
  if (seconds < 100) return fmt::format("{:.1f} s", seconds);
  return seconds < 6000 ? fmt::format("{:.0f} min", seconds / 60) : fmt::format("{:.0f} h", seconds / 3600);
}

std::string emcy_cell(const EmcyReport& emcy) {
  return emcy.count == 1 ? fmt::format("{:04X}h", emcy.code) : fmt::format("{:04X}h x{}", emcy.code, emcy.count);
}

const char* SlotRows::head(Kind kind) noexcept {
  switch (kind) {
    case Kind::bus: return "bus";
    case Kind::id: return "id";
    case Kind::name: return "slot";
    case Kind::state: return "state";
    case Kind::nmt: return "NMT";
    case Kind::heard: return "heard";
    case Kind::emcy: return "EMCY";
    case Kind::since: return "since";
    case Kind::type: return "type";
    case Kind::serial: return "serial";
  }
  return "";
}

std::string SlotRows::cell(Kind kind, const SlotReport& s) const {
  switch (kind) {
    case Kind::bus: return fitted(s.bus, options_.widest_name);
    case Kind::id: return std::to_string(s.id.value());
    case Kind::name: return fitted(s.name, options_.widest_name);
    case Kind::state: return places::name(s.state);
    case Kind::nmt: return s.nmt ? short_word(*s.nmt) : "";
    case Kind::heard: return s.heard && options_.now ? age_cell(*options_.now - *s.heard) : "";
    case Kind::emcy: return s.emcy ? emcy_cell(*s.emcy) : "";
    case Kind::since: return fmt::format("{:.3f} s", seconds(s.since));
    case Kind::type: return type_of(s);
    case Kind::serial:
      return s.device && s.device->knows(3) ? fmt::format("{:08X}", s.device->address.serial) : std::string("-");
  }
  return {};
}

SlotRows::SlotRows(const std::vector<SlotReport>& slots, const SlotRowOptions& options) : options_(options) {
  constexpr std::array all{Kind::bus,   Kind::id,   Kind::name,  Kind::state, Kind::nmt,
                           Kind::heard, Kind::emcy, Kind::since, Kind::type,  Kind::serial};
  const bool one = std::ranges::all_of(slots, [&](const auto& s) { return s.bus == slots.front().bus; });
  for (const Kind kind : all) {
    std::size_t widest = 0;
    for (const auto& slot : slots) widest = std::max(widest, text::columns(cell(kind, slot)));
    const bool kept = kind != Kind::bus || options_.bus || !one;
    if (!kept || (widest == 0 && !slots.empty())) continue;
    constexpr std::size_t usual_state = 11;  // most slots are "operational" in the end
    constexpr std::size_t usual_id = 3;
    constexpr std::size_t usual_since = 10;  // "9999.999 s": the width stays the same while time passes
    if (kind == Kind::since) widest = std::max(widest, usual_since);
    if (kind == Kind::state) widest = std::max(widest, usual_state);
    if (kind == Kind::id) widest = std::max(widest, usual_id);
    columns_.push_back({kind, std::max(widest, text::columns(head(kind)))});
  }
  fit();
}

std::size_t SlotRows::width() const noexcept {
  std::size_t all = 0;
  for (const auto& column : columns_) all += column.width + 2;
  return all == 0 ? 0 : all - 2;
}

void SlotRows::fit() {
  for (const Kind first : {Kind::since, Kind::type, Kind::heard, Kind::nmt, Kind::serial, Kind::bus}) {
    if (width() <= options_.width) return;
    std::erase_if(columns_, [first](const Column& column) { return column.kind == first; });
  }
  const auto name = std::ranges::find(columns_, Kind::name, &Column::kind);
  if (name == columns_.end() || width() <= options_.width) return;
  const std::size_t over = width() - options_.width;
  name->width = name->width > over + shortest_name ? name->width - over : shortest_name;
  options_.widest_name = name->width;
}

std::string SlotRows::line(const std::vector<std::string>& cells) const {
  std::string made;
  for (std::size_t i = 0; i < columns_.size(); ++i) {
    const auto& [kind, width] = columns_[i];
    const bool right = kind == Kind::id || kind == Kind::heard || kind == Kind::since;
    const std::string left(right ? width - std::min(width, text::columns(cells[i])) : 0, ' ');
    made += (i == 0 ? "" : "  ") + text::padded(left + cells[i], width);
  }
  made.erase(made.find_last_not_of(' ') + 1);
  return made;
}

std::string SlotRows::heading() const {
  std::vector<std::string> cells;
  for (const auto& column : columns_) cells.emplace_back(head(column.kind));
  return line(cells);
}

std::string SlotRows::row(const SlotReport& slot) const {
  std::vector<std::string> cells;
  for (const auto& column : columns_) cells.push_back(cell(column.kind, slot));
  return line(cells);
}

std::vector<std::string> reasons_of(const std::vector<SlotReport>& slots) {
  const bool one_bus = std::ranges::all_of(slots, [&](const auto& s) { return s.bus == slots.front().bus; });
  std::vector<std::pair<const SlotReport*, std::vector<std::string>>> told;  // the first of each, and the names
  std::map<std::pair<places::SlotState, std::string_view>, std::size_t> where;
  for (const auto& s : slots) {
    if (s.reason.empty()) continue;
    const auto [it, added] = where.try_emplace({s.state, s.reason}, told.size());
    if (added) told.push_back({&s, {}});
    told[it->second].second.push_back(one_bus ? s.name : s.bus + "/" + s.name);
  }
  std::vector<std::string> lines;
  for (const auto& [slot, names] : told) {
    lines.push_back(fmt::format("{}: {}: {}", some_of(names, 4), places::name(slot->state), slot->reason));
  }
  return lines;
}

std::vector<std::string> to_table(const std::vector<SlotReport>& slots, std::optional<rt::Time> now) {
  const SlotRows rows(slots, {.now = now});
  std::vector<std::string> lines{rows.heading()};
  for (const auto& slot : slots) lines.push_back(rows.row(slot));
  std::ranges::move(reasons_of(slots), std::back_inserter(lines));
  return lines;
}

}  // namespace berth::operate
