#include "berth/fleet/roll_out.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/fleet/commands.hpp"
#include "berth/fleet/machines.hpp"

namespace berth::fleet {
namespace {

constexpr std::string_view operational = "operational";

// A row as `end_of` makes it, if it is of this command.
std::optional<CommandEnd> end_in(const sparkplug::Fleet& fleet, const sparkplug::FleetNode& node, const char* metric,
                                 const std::string& slot, const std::string& command) {
  const auto* const found = fleet.find(node.self, metric);
  const auto* const table =
      found == nullptr ? nullptr : std::get_if<sparkplug::Boxed<sparkplug::DataSet>>(&found->value);
  if (table == nullptr || (*table)->rows.empty()) return std::nullopt;
  const auto& row = (*table)->rows.front();
  const auto text = [&](std::string_view name) -> std::string {
    const auto column = std::ranges::find((*table)->columns, name, &sparkplug::DataSet::Column::name);
    const auto place = static_cast<std::size_t>(column - (*table)->columns.begin());
    const auto* const words = place < row.size() ? std::get_if<std::string>(&row[place]) : nullptr;
    return words == nullptr ? std::string() : *words;
  };
  if (text("Device") != slot || text("Command") != command) return std::nullopt;
  const auto* const time = std::get_if<std::uint64_t>(&row.front());
  return CommandEnd{time == nullptr ? 0 : *time, text("Value"), text("Answer")};
}

// "slot drive is absent: heartbeat lost".
std::string state_words(const std::string& slot, const RollOutView& view) {
  return fmt::format("slot {} is {}{}{}", slot, view.state, view.reason.empty() ? "" : ": ", view.reason);
}

bool is_under_way(RollOut::Stage stage) noexcept {
  return stage == RollOut::Stage::sent || stage == RollOut::Stage::carried_out;
}

}  // namespace

RollOutView see(const sparkplug::Fleet& fleet, const sparkplug::EdgeNodeId& machine, const std::string& slot,
                const std::string& command) {
  const auto* const node = fleet.find(machine);
  if (node == nullptr) return {};
  const std::string path = slot_path(slot);
  RollOutView view{.known = true, .online = node->self.online};
  view.has_slot = fleet.find(node->self, path + "/State") != nullptr;
  view.state = text_of(fleet, node->self, path + "/State");
  view.reason = text_of(fleet, node->self, path + "/Reason");
  const auto* const device = fleet.find(*node, slot);
  view.device_there = device != nullptr && device->online;
  view.allows = device != nullptr && fleet.find(*device, command) != nullptr;
  view.done = end_in(fleet, *node, done_metric, slot, command);
  view.refused = end_in(fleet, *node, refused_metric, slot, command);
  return view;
}

std::string obstacle(const RollOutView& view, const std::string& slot, const std::string& command) {
  if (!view.known) return "nothing was heard of it at this broker";
  if (!view.online) return "it is offline";
  if (!view.has_slot) return fmt::format("it has no slot {}", slot);
  if (!view.device_there) return state_words(slot, view);
  if (!view.allows) return fmt::format("its machine file does not allow it: commands = [\"{}\"] in [mqtt]", command);
  return {};
}

RollOut::RollOut(Options options, std::vector<sparkplug::EdgeNodeId> machines) : options_(std::move(options)) {
  for (auto& machine : machines) rows_.push_back({.machine = std::move(machine)});
}

bool RollOut::over() const noexcept {
  return std::ranges::none_of(
      rows_, [this](const Row& row) { return is_under_way(row.stage) || (row.stage == Stage::waiting && !stopped_); });
}

void RollOut::fail(Row& row, std::string why) {
  row.stage = Stage::failed;
  row.words = std::move(why);
  if (options_.stop_on_failure) stopped_ = true;
}

// After the command was carried out the device may boot once more.
void RollOut::settle(Row& row, const RollOutView& view, Time now) {
  const bool is_good = view.online && view.device_there && view.state == operational;
  if (!is_good) {
    row.good.reset();
  } else if (!row.good) {
    row.good = now;
  } else if (now - *row.good >= options_.steady) {
    row.stage = Stage::done;
  }
}

void RollOut::look(Row& row, const RollOutView& view, Time now) {
  const auto is_new = [&](const std::optional<CommandEnd>& end, const std::optional<CommandEnd>& before) {
    return end && end != before && end->value == options_.value;
  };
  if (row.stage == Stage::sent && is_new(view.refused, row.refused)) return fail(row, view.refused->answer);
  if (row.stage == Stage::sent && is_new(view.done, row.done)) row.stage = Stage::carried_out;
  if (row.stage == Stage::carried_out) settle(row, view, now);
  if (row.stage == Stage::done || now - row.since < options_.patience) return;
  const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(options_.patience).count();
  const std::string state = view.online ? state_words(options_.slot, view) : "it is offline";
  fail(row, row.stage == Stage::sent ? fmt::format("no answer within {} s; {}", seconds, state)
                                     : fmt::format("not operational within {} s; {}", seconds, state));
}

std::vector<sparkplug::EdgeNodeId> RollOut::turn(const See& see, Time now) {
  for (auto& row : rows_) {
    if (is_under_way(row.stage)) look(row, see(row.machine), now);
  }
  std::vector<sparkplug::EdgeNodeId> begun;
  if (std::ranges::any_of(rows_, [](const Row& row) { return is_under_way(row.stage); })) return begun;
  for (auto& row : rows_) {
    if (stopped_ || begun.size() >= options_.at_most) break;
    if (row.stage != Stage::waiting) continue;
    const auto view = see(row.machine);
    auto no = obstacle(view, options_.slot, options_.command);
    if (!no.empty()) {
      fail(row, std::move(no));
      continue;
    }
    row.stage = Stage::sent;
    row.since = now;
    row.done = view.done;
    row.refused = view.refused;
    begun.push_back(row.machine);
  }
  return begun;
}

void RollOut::sent(const sparkplug::EdgeNodeId& machine, Time now, const std::string& problem) {
  const auto row = std::ranges::find(rows_, machine, &Row::machine);
  if (row == rows_.end()) return;
  row->since = now;
  if (!problem.empty()) fail(*row, "it was not sent: " + problem);
}

}  // namespace berth::fleet
