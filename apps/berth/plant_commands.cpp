#include "plant_commands.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/base/words.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/values.hpp"
#include "berth/od/notation.hpp"
#include "berth/operate/report.hpp"
#include "berth/plant/plant_words.hpp"
#include "berth/text/columns.hpp"
#include "berth/text/quantity.hpp"
#include "options.hpp"
#include "ports.hpp"

namespace berth::cli {
namespace {

using command::Checked;
using command::Reply;
using command::Request;
using plant::Action;
using Json = nlohmann::ordered_json;

/// A device that the user's word may mean.
struct Meant {
  plant::SimDevice* device = nullptr;
  std::string slot;  ///< the slot that the user named, "line/left"; empty: the device's own name
};

std::string words_of(const Meant& meant) {
  if (meant.slot.empty()) return "device:" + meant.device->name();
  return fmt::format("{} (its device is {})", "slot:" + meant.slot, meant.device->name());
}

bool acts_on_device(Action action) noexcept {
  return action != Action::cut_cable && action != Action::join && action != Action::disturb &&
         action != Action::overrun;
}

// Is the device in a state that the action changes?
bool fits(Action action, const plant::SimDevice& device) noexcept {
  switch (action) {
    case Action::plug: return !device.plugged();
    case Action::unplug: return device.plugged();
    case Action::power_on: return device.plugged() && !device.powered();
    case Action::power_off:
    case Action::reset:
    case Action::deaf:
    case Action::slow:
    case Action::recover: return device.powered();
    default: return true;
  }
}

std::string why_unfit(Action action, const plant::SimDevice& device) {
  const auto& name = device.name();
  if (action == Action::plug) return name + " is plugged in already";
  if (!device.plugged()) return fmt::format("{0} is not plugged in; `berth sim plug {0}` plugs it in", name);
  if (action == Action::power_on) return name + " has power already";
  return fmt::format("{0} has no power; `berth sim power on {0}` switches it on", name);
}

class Finder {
 public:
  Finder(const RunningPlant& running, std::string bus) : running_(&running), bus_(std::move(bus)) {}

  /// Finds a device by its name, by the slot in which it sits or last sat, or by its node-ID. If several match, the
  /// only one that `action` changes.
  Checked<plant::SimDevice*> find(std::string word, Action action) {
    const bool only_device = word.starts_with("device:");
    const bool only_slot = word.starts_with("slot:");
    if (only_device || only_slot) word.erase(0, word.find(':') + 1);
    std::vector<Meant> meant;
    if (!only_slot) meant = devices_named(word);
    if (!only_device) add_of_slots(word, meant);
    if (meant.empty() && !only_slot && !only_device) meant = devices_with_node_id(word);
    if (meant.size() > 1) {
      std::vector<Meant> fitting;
      std::ranges::copy_if(meant, std::back_inserter(fitting), [&](const Meant& m) { return fits(action, *m.device); });
      if (fitting.size() == 1) meant = fitting;
    }
    if (meant.size() == 1) return meant.front().device;
    if (meant.empty()) return tl::unexpected(no_device(word, only_device));
    std::vector<std::string> candidates;
    for (const auto& one : meant) candidates.push_back(words_of(one));
    return tl::unexpected(fmt::format("{} can be {}; write which", text::quoted(word), some_of(candidates)));
  }

 private:
  [[nodiscard]] bool on_bus(plant::SimDevice& device) const { return bus_.empty() || device.bus().name() == bus_; }

  std::vector<Meant> devices_named(const std::string& word) {
    std::vector<Meant> exact;
    std::vector<Meant> like;
    for (const auto& device : running_->world->devices()) {
      if (!on_bus(*device)) continue;
      if (device->name() == word) exact.push_back({device.get(), {}});
      if (same_word(device->name(), word)) like.push_back({device.get(), {}});
    }
    return exact.empty() ? like : exact;
  }

  void add_of_slots(const std::string& word, std::vector<Meant>& meant) {
    if (running_->session == nullptr) return;
    const auto node = command::find_node(running_->session->machine(), bus_, word);
    if (!node) {
      ambiguous_ = node.error();
      return;
    }
    for (const auto& slot : running_->session->slots()) {
      const auto way = tree::way_to(running_->session->machine(), slot.bus);
      const bool is_there = node->bus.empty() || way.bus == node->bus;
      if (slot.id != node->node || way.gateways != node->gateways || !is_there) continue;
      const auto sits = slot.device ? slot.device : last_device(slot);
      if (!sits) continue;
      for (const auto& device : running_->world->devices()) {
        const auto truth = device->truth();
        if (truth.bus != slot.bus || truth.address != *sits) continue;
        const bool known = std::ranges::any_of(meant, [&](const Meant& m) { return m.device == device.get(); });
        if (!known) meant.push_back({device.get(), slot.bus + "/" + slot.name});
      }
    }
  }

  // The device that sat in the slot last, by the history.
  [[nodiscard]] std::optional<Identity> last_device(const operate::SlotReport& slot) const {
    auto& session = *running_->session;
    const auto records = session.store().load(session.machine().name);
    if (!records) return std::nullopt;
    const auto record = std::ranges::find_if(
        *records, [&](const auto& r) { return r.name.bus == slot.bus && r.name.name == slot.name; });
    if (record == records->end()) return std::nullopt;
    const auto history = session.store().history(record->slot);
    if (!history) return std::nullopt;
    const auto last =
        std::ranges::find_if(history->rbegin(), history->rend(), [](const auto& e) { return e.device.has_value(); });
    return last == history->rend() ? std::nullopt : last->device;
  }

  std::vector<Meant> devices_with_node_id(const std::string& word) {
    std::vector<Meant> meant;
    const auto number = text::parse_ranges(word, 1, 127);
    if (!number || number->size() != 1) return meant;
    for (const auto& device : running_->world->devices()) {
      const auto truth = device->truth();
      const bool same = truth.powered && truth.active.configured() && truth.active.value() == number->front();
      if (same && on_bus(*device)) meant.push_back({device.get(), {}});
    }
    return meant;
  }

  std::string no_device(const std::string& word, bool only_device) const {
    std::vector<std::string> names;
    for (const auto& device : running_->world->devices()) {
      if (on_bus(*device)) names.push_back(device->name());
    }
    if (running_->session != nullptr && !only_device) {
      const auto node = command::find_node(running_->session->machine(), bus_, word);
      const bool direct = node && node->gateways.empty();
      if (direct && running_->session->machine().slot(node->bus, node->node) != nullptr) {
        return fmt::format("no device of the plant sits in slot {}; the devices are {}", word, some_of(names));
      }
    }
    const std::vector<std::string_view> known(names.begin(), names.end());
    const auto near = text::closest(word, known);
    const std::string then =
        near.empty() ? "the devices are " + some_of(names) +
                           "; a new one is a [[device]] of the plant file, with plugged = false until it is plugged in"
                     : fmt::format("did you mean {}?", near);
    return fmt::format("no device of the plant{} is called {}; {}",
                       running_->session != nullptr && !only_device ? " and no slot" : "", text::quoted(word), then);
  }

  const RunningPlant* running_;
  std::string bus_;
  std::string ambiguous_;
};

// ---- events in words ----

bool is_number(const std::string& value) {
  return !value.empty() && value.find_first_not_of("0123456789abcdefABCDEFx_+-") == std::string::npos &&
         (std::isdigit(static_cast<unsigned char>(value.front())) != 0 || value.front() == '-');
}

// The value as a plant file writes it: numbers, true and false are bare, `nodes` is a list, all others are texts.
std::string toml_value(const std::string& key, const std::string& value) {
  if (key == "nodes") {
    std::string list;
    for (const auto& name : command::lines_of(value)) list += (list.empty() ? "" : ", ") + text::quoted(name);
    return "[" + list + "]";
  }
  const bool text = key == "device" || key == "bus" || key == "action" || key == "sender";
  return !text && (is_number(value) || value == "true" || value == "false") ? value : text::quoted(value);
}

// The reader's errors without their places: the user wrote no lines.
std::string words_of(const Findings& findings) {
  std::string words;
  for (const auto& finding : findings) {
    if (finding.severity != Finding::Severity::error) continue;
    words += fmt::format("{}{}{}{}{}{}", words.empty() ? "" : "; ", finding.key, finding.key.empty() ? "" : ": ",
                         finding.message, finding.fix.empty() ? "" : "; ", finding.fix);
  }
  return words;
}

const char* done_word(Action action) noexcept {
  switch (action) {
    case Action::plug: return "plugged in";
    case Action::unplug: return "unplugged";
    case Action::power_off: return "switched off";
    case Action::power_on: return "switched on";
    case Action::reset: return "reset";
    case Action::deaf: return "deaf";
    case Action::slow: return "slow";
    case Action::set_serial: return "given another serial number, from its next power-on";
    case Action::set_node_id: return "given another stored node-ID, from its next power-on";
    case Action::cut_cable: return "cut";
    case Action::join: return "one again";
    case Action::disturb: return "disturbed, from the next frame that fits";
    case Action::overrun: return "losing frames, from the next that fits";
    case Action::recover: return "as before: neither deaf nor slow";
  }
  return "";
}

std::string sentence(const plant::PlantEvent& event) {
  std::string words = acts_on_device(event.action) ? event.device : "bus " + event.bus;
  words += fmt::format(" is {}", done_word(event.action));
  if (!event.strike.sender.empty()) words += fmt::format(", only frames that {} sends", event.strike.sender);
  if (!acts_on_device(event.action) && !event.nodes.empty()) words += fmt::format(" ({})", some_of(event.nodes));
  if (event.duration > plant::Duration::zero()) words += " for " + text::write_duration(event.duration);
  return words;
}

Reply not_here(const RunningPlant& running) {
  std::string buses;
  if (running.session != nullptr) {
    for (const auto& bus : running.session->machine().buses) {
      buses += fmt::format("{}{} on {}", buses.empty() ? "" : ", ", bus.name, can::to_string(bus.port));
    }
  }
  return command::refusal(Exit::no, fmt::format("no bus of this machine is simulated in this process ({}): on a real "
                                                "bus a person plugs devices and switches power; nothing was done",
                                                buses));
}

/// The slot in which the device sits, or sat last; null: none.
Json slot_of(const RunningPlant& running, const plant::Truth& truth) {
  if (running.session == nullptr) return nullptr;
  for (const auto& slot : running.session->slots()) {
    if (slot.bus == truth.bus && slot.device && truth.is_or_will_be(*slot.device)) return slot.name;
  }
  return nullptr;
}

const char* what_it_is(const plant::Truth& truth) noexcept {
  if (!truth.plugged) return "not plugged in";
  return truth.powered ? name(truth.state) : "without power";
}

bool is_unplugged(const plant::World& world, const sim::Controller& node) {
  return std::ranges::any_of(world.devices(),
                             [&](const auto& device) { return !device->plugged() && &device->controller() == &node; });
}

/// Lists the pieces of each bus's cable, with the names of the nodes on each; "master" is Berth's own node.
void list_cables(const RunningPlant& running, const std::string& only, Json& json, std::vector<std::string>& lines) {
  json = Json::array();
  for (const auto& planned : running.plant->buses) {
    const sim::Bus* const bus = running.world->bus(planned.name);
    if (bus == nullptr || (!only.empty() && planned.name != only)) continue;
    Json pieces = Json::array();
    std::vector<std::string> words;
    for (const auto& piece : sim::pieces(*bus)) {
      std::vector<std::string> names;
      for (const auto* node : piece) {
        if (!is_unplugged(*running.world, *node)) names.push_back(node->name());
      }
      if (names.empty()) continue;
      words.push_back(some_of(names));
      pieces.push_back(names);
    }
    json.push_back({{"bus", planned.name}, {"pieces", pieces}});
    if (words.size() > 1) lines.push_back(fmt::format("bus {} is cut: {}", planned.name, fmt::join(words, " | ")));
  }
}

// Keeps a row within 80 columns, of which an LSS address takes 35.
constexpr std::size_t widest_name = 22;

// Cuts the middle out of a name that is too long: names often differ only at their ends ("... hall 1").
std::string fitted_name(const std::string& name, std::size_t width) {
  constexpr std::size_t end = 6;
  if (text::columns(name) <= width || width <= 2 * end) return text::cut(name, width);
  std::size_t at = name.size();
  while (at > 0 && text::columns(std::string_view(name).substr(at - 1)) <= end) --at;
  while (at < name.size() && (static_cast<unsigned char>(name[at]) & 0xC0U) == 0x80) ++at;
  return text::cut(name, width - end - 1) + "~" + name.substr(at);
}

std::string device_row(const plant::Truth& truth, std::size_t width) {
  const bool has_id = truth.powered && truth.active.configured();
  std::string row =
      fmt::format("{}  {:>3}  {:<14} {}", text::padded(fitted_name(truth.name, width), width),
                  has_id ? std::to_string(truth.active.value()) : "-", what_it_is(truth), to_string(truth.address));
  if (truth.deaf) row += "  deaf";
  if (truth.late > plant::Duration::zero()) row += "  late by " + text::write_duration(truth.late);
  return row;
}

Json device_json(const RunningPlant& running, const plant::Truth& truth) {
  const bool has_id = truth.powered && truth.active.configured();
  return {{"device", truth.name},
          {"bus", truth.bus},
          {"node_id", has_id ? Json(truth.active.value()) : Json(nullptr)},
          {"plugged", truth.plugged},
          {"powered", truth.powered},
          {"deaf", truth.deaf},
          {"late_s", operate::seconds(rt::Time(truth.late))},
          {"slot", slot_of(running, truth)},
          {"lss_address", to_string(truth.address)}};
}

// Lists the devices bus by bus, in the order of the plant file. If there is only one bus, its name is left out.
Reply list_devices(const RunningPlant& running, const std::string& bus) {
  Reply reply;
  Json all = Json::array();
  std::size_t width = 6;
  std::vector<std::string> buses;
  for (const auto& device : running.world->devices()) {
    const auto truth = device->truth();
    if (!bus.empty() && truth.bus != bus) continue;
    width = std::max(width, std::min(widest_name, text::columns(truth.name)));
    if (std::ranges::find(buses, truth.bus) == buses.end()) buses.push_back(truth.bus);
    all.push_back(device_json(running, truth));
  }
  reply.lines.push_back(fmt::format("{:<{}}  {:>3}  {:<14} {}", "device", width, "id", "is", "LSS address"));
  for (const auto& name : buses) {
    if (buses.size() > 1) reply.lines.push_back(fmt::format("bus {}:", name));
    for (const auto& device : running.world->devices()) {
      const auto truth = device->truth();
      if (truth.bus == name) reply.lines.push_back(device_row(truth, width));
    }
  }
  Json cables;
  list_cables(running, bus, cables, reply.lines);
  reply.json = Json{{"devices", all}, {"cables", cables}}.dump();
  return reply;
}

// Lets the user name a node of an event also by its slot. Returns the problem; "": none.
std::string name_nodes(Request& request, const RunningPlant& running, Action action) {
  Finder finder(running, request.arguments.contains("bus") ? request.arguments["bus"] : "");
  for (const char* const key : {"nodes", "sender"}) {
    const auto given = request.arguments.find(key);
    if (given == request.arguments.end()) continue;
    std::string names;
    for (const auto& word : command::lines_of(given->second)) {
      std::string name = word;
      if (word != plant::master_name) {
        const auto found = finder.find(word, action);
        if (!found) return found.error();
        name = (*found)->name();
      }
      names += (names.empty() ? "" : "\n") + name;
    }
    given->second = names;
  }
  return {};
}

// Adds the bus if there is only one: the user need not name it.
void complete(Request& request, const RunningPlant& running, Action action) {
  if (acts_on_device(action)) {
    request.arguments.erase("bus");
  } else if (!request.arguments.contains("bus") && running.plant->buses.size() == 1) {
    request.arguments["bus"] = running.plant->buses.front().name;
  }
}

Checked<plant::PlantEvent> event_of(const RunningPlant& running, const Request& request) {
  std::string keys;
  for (const auto& [key, value] : request.arguments) {
    if (key.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") != std::string::npos || key.empty()) {
      return tl::unexpected(text::quoted(key) + " is not a key of an event; docs/plant-file.md lists them");
    }
    keys += fmt::format("{} = {}\n", key, toml_value(key, value));
  }
  auto read = plant::read_event(keys, *running.plant);
  if (!read.event) return tl::unexpected(words_of(read.findings));
  return std::move(*read.event);
}

/// Gives a device's input a value, as its hardware would. TPDOs that map it are sent.
Reply set_object(const RunningPlant& running, plant::SimDevice& device, const Request& request) {
  const auto argument = [&](const char* key) {
    const auto given = request.arguments.find(key);
    return given == request.arguments.end() ? std::string() : given->second;
  };
  device::Device& firmware = device.device();
  const auto object = command::find_object(&firmware.values().description(), argument("object"));
  if (!object) return command::refusal(Exit::usage, object.error());
  const std::string shown = od::write_object(object->ref);
  if (object->described == nullptr) {
    return command::refusal(Exit::usage, fmt::format("{} has no object {}", device.name(), shown));
  }
  if (object->ref.index < 0x2000) {
    return command::refusal(Exit::usage,
                            fmt::format("{}: the device itself sets 1000h to 1FFFh; `berth sdo write` writes those "
                                        "that are writable, `berth sim set` sets objects from 2000h on",
                                        shown));
  }
  const auto value = command::value_bytes(*object, argument("value"), firmware.node_id(), true);
  if (!value) return command::refusal(Exit::usage, value.error());
  const auto stored = firmware.values().bytes(object->ref);
  const bool changes = !std::ranges::equal(stored, *value);
  if (const auto answer = firmware.values().set_bytes(object->ref, *value); answer != od::AbortCode::none) {
    return command::refusal(Exit::no, fmt::format("{} of {}: {}", shown, device.name(), od::text(answer)));
  }
  if (changes) firmware.services().changed(object->ref);
  Reply reply;
  const std::string said =
      fmt::format("{}: {} {} is {}", device.name(), shown, object->name, command::value_text(*object, *value));
  if (running.session != nullptr) {
    running.session->tell(device.bus().name(), operate::EventKind::step, "simulated plant: " + said);
  }
  Json json{{"action", "set"}, {"device", device.name()}, {"object", shown}};
  command::put_value(json, *object, *value);
  json["text"] = said;
  reply.json = json.dump();
  reply.lines = {said};
  return reply;
}

/// Actions inside one device, which are not events of a plant file.
Reply set_in_device(const RunningPlant& running, const std::string& bus, const Request& request) {
  const auto word = request.arguments.find("device");
  if (word == request.arguments.end()) return command::refusal(Exit::usage, "device: which one? Name it");
  const auto device = Finder(running, bus).find(word->second, Action::reset);
  if (!device) return command::refusal(Exit::usage, device.error());
  if (!(*device)->powered()) return command::refusal(Exit::no, why_unfit(Action::reset, **device));
  return set_object(running, **device, request);
}

Reply unknown_action(const std::string& word) {
  std::vector<std::string_view> words(plant::action_words.begin(), plant::action_words.end());
  words.insert(words.end(), {"set", "devices"});
  const auto near = text::closest(word, words);
  return command::refusal(Exit::usage, fmt::format("{} is not an action of a plant; {}", text::quoted(word),
                                                   near.empty() ? fmt::format("use one of {}", fmt::join(words, ", "))
                                                                : fmt::format("did you mean {}?", near)));
}

}  // namespace

Reply do_in_plant(const RunningPlant& running, const Request& given) {
  if (running.world == nullptr) return not_here(running);
  Request request = given;
  const std::string bus = request.arguments.contains("bus") ? request.arguments["bus"] : "";
  const std::string word = request.arguments["action"];
  if (!bus.empty() && running.plant->bus(bus) == nullptr) {
    std::vector<std::string> names;
    for (const auto& each : running.plant->buses) names.push_back(each.name);
    return command::refusal(
        Exit::usage, fmt::format("the plant has no bus {}; its buses are {}", text::quoted(bus), some_of(names)));
  }
  if (word == "devices") return list_devices(running, bus);
  if (word == "set") return set_in_device(running, bus, request);
  const auto known = std::ranges::find(plant::action_words, word);
  if (known == plant::action_words.end()) return unknown_action(word);
  const auto action = static_cast<Action>(known - plant::action_words.begin());
  plant::SimDevice* device = nullptr;
  if (acts_on_device(action) && request.arguments.contains("device")) {
    const auto found = Finder(running, bus).find(request.arguments["device"], action);
    if (!found) return command::refusal(Exit::usage, found.error());
    device = *found;
    request.arguments["device"] = device->name();
  }
  complete(request, running, action);
  if (const auto wrong = name_nodes(request, running, action); !wrong.empty())
    return command::refusal(Exit::usage, wrong);
  const auto event = event_of(running, request);
  if (!event) return command::refusal(Exit::usage, event.error());
  if (device != nullptr && !fits(action, *device)) return command::refusal(Exit::no, why_unfit(action, *device));
  if (!running.world->perform(*event)) {
    return command::refusal(Exit::no, fmt::format("{}: the plant has no such device, bus or node", word));
  }
  Reply reply;
  const std::string said = sentence(*event);
  if (running.session != nullptr) {
    running.session->tell(device != nullptr ? device->bus().name() : event->bus, operate::EventKind::step,
                          "simulated plant: " + said);
  }
  Json json{{"action", word}};
  json[device != nullptr ? "device" : "bus"] = device != nullptr ? device->name() : event->bus;
  json["text"] = said;
  reply.json = json.dump();
  reply.lines = {said};
  return reply;
}

}  // namespace berth::cli
