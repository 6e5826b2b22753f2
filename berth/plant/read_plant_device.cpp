// The properties in a `[[device]]` of a plant file, key by key: docs/plant-file.md.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>

#include "berth/od/notation.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/plant/plant_words.hpp"
#include "berth/text/reach.hpp"
#include "berth/text/toml.hpp"

#include "berth/plant/read_plant_parts.hpp"

namespace berth::plant {
namespace {

using namespace std::chrono_literals;
using std::string_view;
using text::Limits;
using text::Table;
using text::Value;

std::optional<ObjectRef> read_object(Table& table, string_view key) {
  const auto text = table.string(key);
  if (!text) return std::nullopt;
  const auto object = od::read_object(*text);
  const bool own = object && object->index >= 0x2000;
  if (own) return object->ref();
  table.error(key,
              object ? fmt::format("{} is not an object of a maker's own", text::quoted(*text)) : object.error().why,
              "write one from 2000h on, such as \"2000h:00\"");
  return std::nullopt;
}

// A text is its bytes in their order; "0x…" is a number of `size` bytes.
void read_signature(Table& table, PlantSignature& signature) {
  const auto size = table.u32("size", {1, 8});
  const auto text = table.string("value").value_or("");
  if (text.starts_with("0x")) {
    const char* end = text.data() + text.size();
    const auto read = std::from_chars(text.data() + 2, end, signature.value, 16);
    signature.size = static_cast<std::uint8_t>(size.value_or(4));
    const bool fits = signature.size == 8 || signature.value >> (8U * signature.size) == 0;
    if (text.size() > 2 && read.ec == std::errc() && read.ptr == end && fits) return;
  } else if (!text.empty() && text.size() <= 8 && size.value_or(text.size()) == text.size()) {
    signature.size = static_cast<std::uint8_t>(text.size());
    for (std::size_t i = 0; i < text.size(); ++i) {
      signature.value |= std::uint64_t{static_cast<unsigned char>(text[i])} << (8 * i);
    }
    return;
  }
  table.error("value", fmt::format("{} is not a signature of 1 to 8 bytes", text::quoted(text)),
              "write a text such as \"save\", or a number such as \"0x1234\" with its size");
}

void read_node_id_object(Table& table, PlantDevice& device) {
  device.node_id_object.object = read_object(table, "node_id_object");
  auto entry = table.table("node_id_signature");
  if (!entry) return;
  if (!table.has("node_id_object")) {
    table.error("node_id_signature", "there is no object to sign for", "add node_id_object = \"2000h:00\"");
  }
  PlantSignature signature;
  if (entry->require("object", "such as \"2001h:00\"")) {
    signature.object = read_object(*entry, "object").value_or(ObjectRef{});
  }
  if (entry->require("value", "such as \"save\" or \"0x1234\"")) read_signature(*entry, signature);
  entry->finish();
  if (device.node_id_object.object && device.node_id_object.object->index == signature.object.index) {
    table.error("node_id_signature", "this is the node-ID's own object", "name another");
  }
  device.node_id_object.signature = signature;
}

void read_node_id(Table& table, PlantDevice& device) {
  const auto id = table.integer("node_id", node_id_or_blank);
  if (id && *id > 127 && *id != NodeId::unconfigured_value) {
    table.error("node_id", fmt::format("{} is not a node-ID", *id), "use 1 to 127, or 255 for none");
  } else if (id) {
    device.node_id = NodeId(static_cast<std::uint8_t>(*id));
  }
  device.source = device.node_id.configured() ? NodeIdSource::nonvolatile : NodeIdSource::blank;
  const auto source = table.word("source", source_words);
  if (source) device.source = static_cast<NodeIdSource>(*source);
  if (device.source == NodeIdSource::blank && device.node_id.configured()) {
    table.error("source", "a blank device has no node-ID", "leave node_id out, or use \"nonvolatile\"");
  }
  if (device.source > NodeIdSource::nonvolatile && !device.node_id.configured()) {
    table.error("source", fmt::format("{} gives no node-ID here", text::quoted(source_words[*source])),
                "add node_id = 1 to 127");
  }
}

void read_speaks(Table& table, PlantDevice& device) {
  const auto words = table.strings("speaks");
  if (!words) return;
  device.speaks = {};
  for (const auto& word : *words) {
    const auto known = std::ranges::find(speaks_words, word);
    if (known != speaks_words.end()) {
      device.speaks.add(static_cast<Speaks>(known - speaks_words.begin()));
    } else {
      const auto near = text::closest(word, speaks_words);
      table.error("speaks", fmt::format("{} is not a service", text::quoted(word)),
                  near.empty() ? fmt::format("use some of {}", fmt::join(speaks_words, ", "))
                               : fmt::format("did you mean {}?", text::quoted(near)));
    }
  }
}

void read_habits(Table& table, PlantDevice& device) {
  const auto words = table.strings("habits");
  if (!words) return;
  for (const auto& word : *words) {
    const auto known = std::ranges::find(habit_words, word);
    if (known == habit_words.end()) {
      const auto near = text::closest(word, habit_words);
      table.error("habits", fmt::format("{} is not a stack with known habits", text::quoted(word)),
                  near.empty() ? fmt::format("use one of {}", fmt::join(habit_words, ", "))
                               : fmt::format("did you mean {}?", text::quoted(near)));
    } else if (device.lss.habit) {
      table.error("habits", "a device has one stack", fmt::format("keep one of {}", fmt::join(habit_words, ", ")));
    } else {
      device.lss.habit = static_cast<Habit>(known - habit_words.begin());
    }
  }
  if (!device.lss.habit) return;
  if (!table.has("speaks")) device.speaks = {Speaks::fastscan};
  if (!device.speaks.has(Speaks::fastscan)) {
    table.error("habits", fmt::format("a {} device speaks Fastscan", name(*device.lss.habit)),
                "leave out speaks, or add \"fastscan\" to it");
  }
}

void read_lss(Table& table, PlantDevice& device) {
  for (const auto& word : table.strings("lss_without").value_or(std::vector<std::string>())) {
    const auto known = std::ranges::find(lackable_words, word);
    if (known != lackable_words.end()) {
      device.lss.without.add(static_cast<lss::Lackable>(known - lackable_words.begin()));
      continue;
    }
    const auto near = text::closest(word, lackable_words);
    table.error("lss_without", fmt::format("{} is not a service that a device may lack", text::quoted(word)),
                !near.empty()        ? fmt::format("did you mean {}?", text::quoted(near))
                : word == "fastscan" ? "leave \"fastscan\" out of speaks"
                                     : fmt::format("use some of {}", fmt::join(lackable_words, ", ")));
  }
  device.lss.refuses_store = table.word("lss_store", lss_store_words).value_or(0) == 1;
  device.lss.short_answers = table.boolean("short_answers").value_or(false);
  const char* const key = table.has("lss_without") ? "lss_without"
                          : table.has("lss_store") ? "lss_store"
                                                   : "short_answers";
  if (table.has(key) && !device.speaks.has(Speaks::lss))
    table.error(key, "the device speaks no LSS", "add \"lss\" to speaks, or leave this out");
}

void read_oddities(Table& table, PlantDevice& device) {
  PlantOddities& odd = device.does.odd;
  for (const auto& word : table.strings("identity_changes").value_or(std::vector<std::string>())) {
    const auto known = std::ranges::find(identity_words, word);
    if (known != identity_words.end()) {
      odd.changing = static_cast<std::uint8_t>(odd.changing | 1U << (known - identity_words.begin()));
    } else {
      table.error("identity_changes", fmt::format("{} is not part of the identity object", text::quoted(word)),
                  fmt::format("use some of {}", fmt::join(identity_words, ", ")));
    }
  }
  odd.sdo_serial = table.u32("sdo_serial");
  odd.identity_only_pre_operational = table.boolean("identity_only_pre_operational").value_or(false);
  if (const auto word = table.word("resets_at_heartbeat", reset_words))
    odd.resets = static_cast<ResetsAtHeartbeat>(*word);
  odd.heartbeat_sent = table.duration("heartbeat_sent", 0s, 65535ms).value_or(0s);
}

void read_response(Table& table, PlantDevice& device) {
  auto& response = device.response;
  const Value* value = table.get("response");
  if (value == nullptr) return;
  if (value->kind != Value::Kind::table) {
    if (const auto both = table.duration("response", 0s, 1h)) response.min = response.max = *both;
    return;
  }
  auto entry = table.table("response");
  if (entry->require("min", "the shortest time")) response.min = entry->duration("min", 0s, 1h).value_or(response.min);
  if (entry->require("max", "the longest time")) response.max = entry->duration("max", 0s, 1h).value_or(response.max);
  if (response.max < response.min) entry->error("max", "the longest time is shorter than the shortest", "swap them");
  response.outlier_ppm = entry->u32("outlier_ppm", {0, 1'000'000}).value_or(0);
  response.outlier = entry->duration("outlier", 0s, 1h).value_or(0s);
  if (entry->has("outlier") != entry->has("outlier_ppm")) {
    entry->error("", "outlier and outlier_ppm belong together", "give both: how long, and how many in a million");
  }
  entry->finish();
}

void read_times(Table& table, PlantDevice& device) {
  device.boot = table.duration("boot", 0s, 1h).value_or(device.boot);
  device.reset = table.duration("reset", 0s, 1h).value_or(device.reset);
  device.storing.time = table.duration("store", 0s, 1h).value_or(device.storing.time);
  device.heartbeat = table.duration("heartbeat", 0s, 65535ms).value_or(device.heartbeat);
  if (device.heartbeat % 1ms != 0ns)
    table.error("heartbeat", "heartbeat is a whole number of milliseconds", "round it");
}

void read_script(Table& table, const text::Reach& reach, PlantDevice& device) {
  device.does.script.file = table.string("script").value_or("");
  if (!device.does.script.file.empty()) device.does.script.path = reach.path(table, "script", device.does.script.file);
  if (table.has("script") && device.does.script.file.empty() && table.string("script")) {
    table.error("script", "the file name is empty", "name a Lua file");
  }
}

// Paper 3's number (docs/multilevel.md). With `eds`, the description has it.
void read_hardware(Table& table, PlantDevice& device) {
  device.does.hardware = table.u32("hardware", {1, 0xFFFF'FFFF}).value_or(0);
  if (device.does.hardware != 0 && table.has("eds"))
    table.error("hardware", "its dictionary is the description's", "give 5F01h a value there, or leave eds out");
}

// CiA 302-2: 1F80h bit 5, 1F90h:03, 1F81h. Its dictionary is made for it.
void read_master(Table& table, PlantDevice& device) {
  auto entry = table.table("master");
  if (!entry) return;
  PlantMaster master;
  master.flying = entry->boolean("flying").value_or(true);
  if (!master.flying) {
    master.most = static_cast<std::uint8_t>(entry->u32("most", {1, 127}).value_or(master.most));
  } else if (const auto priority = entry->integer("priority", {0, 2}))
    master.priority = static_cast<std::uint8_t>(*priority);
  if (master.flying && entry->require("slaves", "the node-IDs of its network list, such as \"1..5\"")) {
    const auto text = entry->string("slaves").value_or("");
    const auto slaves = text::parse_ranges(text, 1, 127);
    if (slaves) master.slaves = *slaves;
    if (!slaves && !text.empty())
      entry->error("slaves", fmt::format("{} are not node-IDs", text::quoted(text)), "write \"1..5\"");
  }
  if (master.flying) master.keep_alive = entry->boolean("keep_alive").value_or(true);
  entry->finish();
  const bool described = table.has("eds") || table.has("script") || table.has("node_id_object");
  if (described) table.error("master", "its dictionary is made for it", "leave eds, script and node_id_object out");
  if (!device.node_id.configured()) table.error("master", "a master has a node-ID", "give it a node_id");
  // The whole network list is written through the master's own sub-indices of 1F22h and 1F81h.
  if (!master.flying && device.node_id.configured() && device.node_id.value() > master.most) {
    entry->error("most",
                 fmt::format("its own node-ID {} is above the highest that its network list has ({})",
                             device.node_id.value(), master.most),
                 fmt::format("write most = {} or more, or give it a lower node_id", device.node_id.value()));
  }
  if (device.heartbeat == 0s) device.heartbeat = 500ms;  // the other devices must hear that it is there
  device.does.master = std::move(master);
}

PlantVariable read_variable(Table& table) {
  PlantVariable variable;
  if (table.require("name", "give the variable a name")) variable.name = table.string("name").value_or("");
  if (table.has("name") && variable.name.empty()) table.error("name", "the name is empty", "give the variable a name");
  if (table.require("type", "such as \"UNSIGNED16\"")) {
    const auto type = table.string("type").value_or("");
    variable.type = od::data_type(type).value_or(od::DataType::none);
    if (od::bit_length(variable.type) == 0) {
      table.error("type", fmt::format("{} is not a data type of a network variable", text::quoted(type)),
                  "such as \"BOOLEAN\", \"UNSIGNED16\" or \"REAL32\"");
    }
  }
  if (table.require("object", "its place, such as \"A100h:01\"")) {
    variable.object = read_object(table, "object").value_or(ObjectRef{});
  }
  table.finish();
  return variable;
}

void read_variables(Table& table, PlantDevice& device) {
  for (auto& entry : table.tables("variables")) device.does.variables.push_back(read_variable(entry));
  if (!device.does.variables.empty() && !table.has("eds")) {
    table.error("variables", "the device has no description that says where variables can be",
                "add eds = \"FILE\" with [DynamicChannels]");
  }
}

void read_programs(Table& table, const text::Reach& reach, PlantDevice& device) {
  if (!table.has("programs")) return;
  auto entry = table.table("programs");
  if (!entry) return;
  auto& p = device.storing.programs;
  p.count = entry->u32("count", {1, 254}).value_or(1);
  p.size = entry->u32("size", {1, 1U << 24U}).value_or(p.size);
  p.images = entry->u32("images", {1, 2}).value_or(p.images);
  p.sector = entry->u32("sector", {64, 1U << 20U}).value_or(p.sector);
  p.erase = entry->duration("erase", 0s, 1min).value_or(p.erase);
  p.write = entry->duration("write", 0s, 1s).value_or(p.write);
  p.checked = entry->boolean("checked").value_or(true);
  p.loaded = entry->string("loaded").value_or("");
  if (!p.loaded.empty()) p.loaded_path = reach.path(*entry, "loaded", p.loaded);
  constexpr std::uint64_t most = std::uint64_t{1} << 28U;
  if (std::uint64_t{p.count} * p.images * (p.size + p.sector) > most) {
    entry->error("size", "the programs take more than 256 MiB of memory", "give it fewer or shorter ones");
    p.count = 0;
  }
  entry->finish();
}

void read_controller(Table& table, PlantDevice& device) {
  device.bitrate = table.u32("bitrate", bit_rates).value_or(0);
  device.storing.deaf = table.boolean("deaf_while_storing").value_or(false);
  device.storing.power_cycle_after = table.boolean("power_cycle_after_store").value_or(false);
  device.storing.needs_first_save = table.boolean("needs_first_save").value_or(false);
  if (const auto queue = table.word("queue", queue_words)) device.controller.queue = static_cast<QueueKind>(*queue);
  if (const auto depth = table.u32("rx_depth", {1, 1024})) device.controller.rx_depth = *depth;
  device.controller.bus_off_recovery = table.duration("bus_off_recovery", 0s, 1h).value_or(0s);
  device.controller.repeat_ppm = table.u32("repeat_ppm", {0, 1'000'000}).value_or(0);
  device.controller.extended_frames = table.boolean("extended_frames").value_or(true);
  if (const auto drift = table.integer("drift_ppm", {-100'000, 100'000})) {
    device.controller.drift_ppm = static_cast<std::int32_t>(*drift);
  }
}

}  // namespace

void read_traits(Table& table, const text::Reach& reach, PlantDevice& device) {
  read_node_id(table, device);
  read_node_id_object(table, device);
  read_speaks(table, device);
  read_habits(table, device);
  read_lss(table, device);
  read_response(table, device);
  read_times(table, device);
  read_oddities(table, device);
  read_script(table, reach, device);
  read_master(table, device);
  read_hardware(table, device);
  read_variables(table, device);
  read_programs(table, reach, device);
  read_controller(table, device);
}

}  // namespace berth::plant
