// history, and the report of a machine that no process runs: both from the slot table.
#include "berth/command/stored.hpp"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>

#include "berth/command/audit.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/command/slot_status.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/text/columns.hpp"

namespace berth::command {
namespace {

// On a real bus, the stamp is Unix time; on a simulated one, milliseconds since its world began: too small for a real
// clock.
std::string when(std::int64_t stamp_ms) {
  constexpr std::int64_t real = 1'000'000'000'000;  // September 2001
  if (stamp_ms < real) return fmt::format("{:9.3f} s", static_cast<double>(stamp_ms) / 1000);
  const auto seconds = static_cast<time_t>(stamp_ms / 1000);
  tm utc{};
  ::gmtime_r(&seconds, &utc);
  return fmt::format("{:04}-{:02}-{:02} {:02}:{:02}:{:02}Z", utc.tm_year + 1900, utc.tm_mon + 1, utc.tm_mday,
                     utc.tm_hour, utc.tm_min, utc.tm_sec);
}

struct Chosen {
  std::optional<places::SlotId> slot;
  std::map<places::SlotId, std::string> names;  // only slots of this machine
};

Checked<Chosen> chosen(places::SlotStore& store, const design::Machine& machine, const Request& request) {
  const auto records = store.load(machine.name);
  if (!records) return tl::unexpected(std::string("the slot table cannot be read: ") + records.error().text);
  Chosen made;
  for (const auto& record : *records) made.names[record.slot] = record.name.bus + "/" + record.name.name;
  const auto it = request.arguments.find("slot");
  if (it == request.arguments.end()) return made;
  const auto bus = request.arguments.find("bus");
  const auto node = find_node(machine, bus == request.arguments.end() ? "" : bus->second, it->second);
  if (!node) return tl::unexpected(node.error());
  if (!node->gateways.empty()) {
    return tl::unexpected(fmt::format(
        "{} is beneath a gateway whose own master gives the node-IDs: Berth keeps no history of it", node->text()));
  }
  std::vector<const places::SlotRecord*> found;
  for (const auto& record : *records) {
    const auto* const slot = machine.slot(record.name.bus, node->node);
    const bool named = slot != nullptr && slot->spec.name.name == record.name.name;
    if (named && (node->bus.empty() || node->bus == record.name.bus)) found.push_back(&record);
  }
  if (found.size() != 1) {
    return tl::unexpected(
        fmt::format("the machine has {} slots with node-ID {}; name one", found.size(), node->node.value()));
  }
  made.slot = found.front()->slot;
  return made;
}

}  // namespace

namespace {

// "WHO<tab>WHAT<tab>ANSWER", see berth/command/audit.hpp.
std::array<std::string, 3> parts_of(const std::string& line) {
  const auto first = line.find('\t');
  const auto second = first == std::string::npos ? first : line.find('\t', first + 1);
  if (second == std::string::npos) return {"", line, ""};
  return {line.substr(0, first), line.substr(first + 1, second - first - 1), line.substr(second + 1)};
}

void tell_audit(const std::vector<places::HistoryEntry>& entries, const design::Machine& machine, Reply& reply) {
  Json json;
  json["audit"] = Json::array();
  std::vector<std::string> lines;
  for (const auto& entry : entries) {
    if (entry.event != audit_event || entry.on.machine != machine.name) continue;
    const auto [who, what, answer] = parts_of(entry.reason);
    json["audit"].push_back({{"stamp_ms", entry.stamp_ms}, {"who", who}, {"what", what}, {"answer", answer}});
    lines.push_back(fmt::format("{}  {}  {}  {}", when(entry.stamp_ms), text::padded(who, 18), what, answer));
  }
  if (lines.empty()) lines.emplace_back("the store has no request that changed anything");
  give(reply, json, std::move(lines));
}

}  // namespace

void tell_history(places::SlotStore& store, const design::Machine& machine, const Request& request, Reply& reply) {
  const Arguments arguments(request);
  if (!arguments.good()) return refuse(reply, 2, arguments.problem());
  const auto wanted = chosen(store, machine, request);
  if (!wanted) return refuse(reply, 2, wanted.error());
  const bool audit = arguments.has("audit");
  if (audit && wanted->slot) return refuse(reply, 2, "--audit is about the machine: name no slot");
  const auto entries = store.history(wanted->slot);
  if (!entries) return fail_with(reply, entries.error(), "the history");
  if (audit) return tell_audit(*entries, machine, reply);
  Json json;
  json["history"] = Json::array();
  std::vector<std::string> lines;
  std::size_t width = 0;
  for (const auto& [slot, name] : wanted->names) {
    if (!wanted->slot || *wanted->slot == slot) width = std::max(width, text::columns(name));
  }
  for (const auto& entry : *entries) {
    if (entry.event == audit_event) continue;
    const auto name = entry.slot ? wanted->names.find(*entry.slot) : wanted->names.end();
    const bool ours =
        entry.slot ? name != wanted->names.end() : entry.on.bus.empty() || entry.on.machine == machine.name;
    if (!ours) continue;  // the line is about another machine of the same store
    const std::string where = name == wanted->names.end() ? entry.on.bus : name->second;
    Json line;
    line["stamp_ms"] = entry.stamp_ms;
    line["slot"] = name == wanted->names.end() ? "" : name->second;
    if (!entry.on.bus.empty()) line["bus"] = entry.on.bus;
    line["event"] = entry.event;
    if (entry.device) put_address(line, *entry.device);
    if (entry.id.configured()) line["id"] = entry.id.value();
    line["reason"] = entry.reason;
    json["history"].push_back(std::move(line));
    const std::string device = entry.device ? "  " + to_string(*entry.device) : "";
    const std::string id = entry.id.configured() ? fmt::format("  node-ID {}", entry.id.value()) : "";
    lines.push_back(fmt::format("{}  {}  {:<9}{}{}{}", when(entry.stamp_ms), text::padded(where, width), entry.event,
                                device, id, entry.reason.empty() ? "" : "  " + entry.reason));
  }
  if (lines.empty()) lines.emplace_back("the slot table has no events yet");
  give(reply, json, std::move(lines));
}

void tell_report(places::SlotStore& store, const design::Machine& machine, const Request& request, Reply& reply) {
  const Arguments arguments(request);
  if (!arguments.good()) return refuse(reply, 2, arguments.problem());
  const auto records = store.load(machine.name);
  if (!records) return fail_with(reply, records.error(), "the slot table");
  operate::Report report;
  for (const auto& slot : machine.slots) {
    const auto& spec = slot.spec;
    SlotReport line;
    line.bus = spec.name.bus;
    line.id = spec.id;
    line.name = spec.name.name;
    line.type = spec.type;
    line.unasked = spec.asks.unasked;
    const auto record = std::ranges::find(*records, spec.name, &places::SlotRecord::name);
    if (record != records->end()) line.device = record->device();
    line.state = line.device ? places::SlotState::unknown : places::SlotState::empty;
    report.slots.push_back(std::move(line));
  }
  if (arguments.has("slot")) {
    const auto slot = wanted_slot(machine, request);
    if (!slot) return refuse(reply, 2, slot.error());
    const auto index = static_cast<std::size_t>(*slot - machine.slots.data());  // same order in the report
    tell_slot(report, report.slots[index], {}, machine, store, std::nullopt, reply);
  } else {
    reply.json = to_json(report, -1);
    reply.lines = operate::to_table(report.slots);
  }
  reply.lines.emplace_back("this is from the slot table: no process runs the machine");
  reply.status = 1;
}

rt::Task<void> history(Session& session, const Request& request, Reply& reply) {
  tell_history(session.store(), session.machine(), request, reply);
  co_return;
}

}  // namespace berth::command
