#include "berth/command/slot_status.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/stored.hpp"
#include "berth/manager/configuration.hpp"
#include "berth/operate/slot_rows.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

constexpr std::size_t last_ones = 5;  // of the events, and of the lines of the history

std::string ago(rt::Time now, rt::Time then) {
  return fmt::format("{:.1f} s ago", std::chrono::duration<double>(std::max(rt::Duration{}, now - then)).count());
}

/// Builds the reply: facts in JSON, and a labelled line for each.
class Facts {
 public:
  Facts(const SlotReport& slot, std::optional<rt::Time> now)
      : slot_(slot), now_(now), json_(Json::parse(operate::to_json(slot))) {}

  void state() {
    std::string line =
        fmt::format("{}/{}, node-ID {}: {}", slot_.bus, slot_.name, slot_.id.value(), places::name(slot_.state));
    if (now_) line += fmt::format(", since {:.3f} s ({})", operate::seconds(slot_.since), ago(*now_, slot_.since));
    lines_.push_back(line);
    if (!slot_.reason.empty()) add("reason", slot_.reason);
  }
  void device() {
    if (slot_.device) put_address(json_, *slot_.device);
    add("device", slot_.device ? to_string(*slot_.device) : "none is bound");
    if (slot_.unasked == 0) add("type wanted", to_string(slot_.type));
  }
  void boot_up() {
    if (slot_.boot == manager::BootStatus::booted) return;
    json_["boot_text"] = manager::text(slot_.boot);
    std::string line = fmt::format("{}: {}", manager::letter(slot_.boot), manager::text(slot_.boot));
    // A reason with advice is more specific than the advice for the letter.
    const bool advised = slot_.reason.find("; ") != std::string::npos;
    if (!manager::is_ready(slot_.boot) && !advised) line += fmt::format("; {}", manager::advice(slot_.boot));
    add("boot-up", line);
  }
  void error_control() {
    if (!slot_.nmt) return;
    std::string line = berth::name(*slot_.nmt);
    if (slot_.heard && now_) line += ", heard " + ago(*now_, *slot_.heard);
    add("NMT state", line);
  }
  void emcy() {
    if (!slot_.emcy) return;
    std::string line = operate::emcy_cell(*slot_.emcy) + " " + slot_.emcy->text;
    if (now_) line += ", " + ago(*now_, slot_.emcy->at);
    add("EMCY", line);
  }
  void configuration(places::SlotStore& store, const std::string& machine) {
    const auto records = store.load(machine);
    if (!records) return;
    const places::SlotName name{machine, slot_.bus, slot_.name};
    const auto record = std::ranges::find(*records, name, &places::SlotRecord::name);
    if (record == records->end() || !record->configured) return;
    const auto& done = *record->configured;
    const manager::ConfigurationDate date{done.days, done.ms};
    json_["configuration"]["stage"] = places::name(done.stage);
    if (date.valid()) json_["configuration"]["date"] = manager::to_string(date);
    add("configuration", fmt::format("{}{}", places::name(done.stage),
                                     date.valid() ? ", date (1020h) " + manager::to_string(date) : ""));
  }
  void says(const DeviceWords& device) {
    const std::array<std::tuple<const char*, const char*, const std::string*>, 3> all{
        {{"device_name", "device name", &device.name},
         {"hardware_version", "hardware", &device.hardware},
         {"software_version", "software", &device.software}}};
    for (const auto& [key, label, text] : all) {
      if (text->empty()) continue;
      json_[key] = *text;
      add(label, *text);
    }
  }
  void events(const operate::Report& report) {
    std::vector<const operate::Event*> mine;
    for (const auto& event : report.events) {
      if (event.bus == slot_.bus && event.slot == slot_.name) mine.push_back(&event);
    }
    json_["events"] = Json::array();
    for (std::size_t i = mine.size() - std::min(mine.size(), last_ones); i < mine.size(); ++i) {
      json_["events"].push_back(Json::parse(operate::to_json(*mine[i])));
      add("event", fmt::format("{:9.3f} s  {}", operate::seconds(mine[i]->at), mine[i]->text));
    }
  }
  void history(places::SlotStore& store, const design::Machine& machine) {
    Reply told;
    tell_history(store, machine, {"history", {{"slot", slot_.bus + "/" + slot_.name}}}, told);
    if (told.status != 0) return;  // the gateway's own master keeps that history
    const Json all = Json::parse(told.json).at("history");
    json_["history"] = Json::array();
    for (std::size_t i = all.size() - std::min(all.size(), last_ones); i < all.size(); ++i) {
      json_["history"].push_back(all[i]);
      std::string line = told.lines[i];
      leave_out(line, "  " + slot_.bus + "/" + slot_.name);
      if (slot_.device) leave_out(line, "  " + to_string(*slot_.device));
      add("history", line);
    }
  }
  void give_to(Reply& reply) { give(reply, json_, std::move(lines_)); }

 private:
  // Removes what other lines say already.
  static void leave_out(std::string& line, const std::string& words) {
    const auto at = line.find(words);
    if (at != std::string::npos) line.erase(at, words.size());
  }
  // A label equal to the last line's is not repeated.
  void add(const std::string& label, const std::string& words) {
    constexpr std::size_t width = 15;
    constexpr std::size_t columns = 80;
    for (const auto& part : text::wrapped(words, columns - width)) {
      lines_.push_back(text::padded(label == last_ ? "" : label, width) + part);
      last_ = label;
    }
  }

  const SlotReport& slot_;
  std::optional<rt::Time> now_;
  Json json_;
  std::vector<std::string> lines_;
  std::string last_;
};

}  // namespace

Checked<const design::Slot*> wanted_slot(const design::Machine& machine, const Request& request) {
  Arguments arguments(request);
  const std::string word = arguments.text("slot");
  const auto node = find_node(machine, arguments.text("bus"), word);
  if (!node) return tl::unexpected(node.error());
  const auto bus = known_bus_of(machine, *node);
  if (!bus) return tl::unexpected(bus.error());
  if (const auto* const slot = machine.slot((*bus)->name, node->node)) return slot;
  return tl::unexpected(fmt::format("bus {} has no slot {}", (*bus)->name, text::quoted(word)));
}

void tell_slot(const operate::Report& report, const SlotReport& slot, const DeviceWords& says,
               const design::Machine& machine, places::SlotStore& store, std::optional<rt::Time> now, Reply& reply) {
  Facts facts(slot, now);
  facts.state();
  facts.device();
  facts.boot_up();
  facts.error_control();
  facts.emcy();
  facts.configuration(store, machine.name);
  facts.says(says);
  facts.events(report);
  facts.history(store, machine);
  facts.give_to(reply);
  reply.status = slot.state == places::SlotState::operational ? 0 : 1;
}

namespace {

constexpr std::array<std::pair<std::uint16_t, std::string DeviceWords::*>, 3> own_words{
    {{0x1008, &DeviceWords::name}, {0x1009, &DeviceWords::hardware}, {0x100A, &DeviceWords::software}}};

// Objects that the device does not have, or does not answer for, are left out.
rt::Task<void> ask_device(Session& session, const design::Slot& slot, DeviceWords& says) {
  const std::string word = slot.spec.name.bus + "/" + slot.spec.name.name;
  const auto node = find_node(session.machine(), {}, word);
  if (!node) co_return;
  const auto network = node_network(session, *node, Place::beneath_too);
  if (!network) co_return;
  const co::SdoOptions options = (*network)->services().sdo.options();
  std::optional<co::NodeAccess> direct;
  co::SdoAccess& device = objects_of(session, **network, *node, options, direct);
  for (const auto& [index, into] : own_words) {
    const auto value = co_await device.read(index, 0);
    if (!value && value.error().code != Errc::aborted) co_return;
    if (value) says.*into = std::string(value->bytes().begin(), value->bytes().end());
  }
}

}  // namespace

rt::Task<void> slot_status(Session& session, const Request& request, Reply& reply) {
  const auto slot = wanted_slot(session.machine(), request);
  if (!slot) co_return refuse(reply, 2, slot.error());
  const auto is_it = [&](const SlotReport& s) {
    return s.bus == (*slot)->spec.name.bus && s.name == (*slot)->spec.name.name;
  };
  DeviceWords says;
  const auto before = session.slots();
  const auto at = std::ranges::find_if(before, is_it);
  const bool runs = at != before.end() && at->state == places::SlotState::operational;
  if (runs) co_await ask_device(session, **slot, says);
  const operate::Report now = session.report();
  const auto found = std::ranges::find_if(now.slots, is_it);
  if (found == now.slots.end()) co_return refuse(reply, 2, "this process does not run the bus of that slot");
  tell_slot(now, *found, says, session.machine(), session.store(), session.executor().now(), reply);
}

}  // namespace berth::command
