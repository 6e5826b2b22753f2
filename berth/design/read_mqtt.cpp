// `[mqtt]` and `publish` of a slot: docs/machine-file.md.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>

#include "berth/design/read_parts.hpp"
#include "berth/text/quantity.hpp"

namespace berth::design {
namespace {

using namespace std::chrono_literals;
using std::string_view;
using text::Table;

constexpr std::array<string_view, 3> version_words{"auto", "5", "3.1.1"};  // as MqttVersion
// Values are compared ten times a second.
constexpr Duration least_every = 100ms;
constexpr Duration most_every = 24h;
// Each poll is an SDO transfer: two frames at least.
constexpr Duration least_poll = 1s;
constexpr std::size_t most_published = 1000;  // of a slot
constexpr text::Limits backlog_bytes{65'536, std::int64_t{4} << 30U};

// A group, node or device at a broker (Sparkplug 3.0 §4.1): no separator or wildcard of MQTT.
bool is_topic_word(string_view name) noexcept {
  const auto bad = [](char c) {
    return c == '+' || c == '/' || c == '#' || std::iscntrl(static_cast<unsigned char>(c));
  };
  return !name.empty() && name.size() <= 1000 && std::ranges::none_of(name, bad);
}
constexpr const char* topic_fix = "use 1 to 1000 characters without +, / and #";

void read_topic_word(Table& table, string_view key, std::string& into) {
  const auto word = table.string(key);
  if (!word) return;
  if (!is_topic_word(*word))
    table.error(key, fmt::format("{} cannot be part of a topic", text::quoted(*word)), topic_fix);
  into = *word;
}

void read_deadband(Table& table, Publish& publish) {
  const auto* const value = table.get("deadband");
  if (value == nullptr) return;
  const bool whole = value->kind == text::Value::Kind::integer;
  const double number = whole ? static_cast<double>(value->integer) : value->real;
  const bool good = (whole || value->kind == text::Value::Kind::real) && std::isfinite(number) && number >= 0;
  if (!good) return table.error("deadband", "this is not a number from 0 on", "such as 0.5, in the value's unit");
  publish.deadband = number;
}

Publish read_published(Table& table) {
  Publish publish;
  publish.place = table.begin();
  if (table.require("object", "an object's name or number, or a network variable")) {
    const auto object = table.string("object");
    if (object && object->empty()) table.error("object", "the name is empty", "such as \"6401h:01\"");
    publish.object = object.value_or("");
  }
  read_deadband(table, publish);
  publish.poll = table.boolean("poll").value_or(false);
  publish.writable = table.boolean("writable").value_or(false);
  publish.every = table.duration("every", publish.poll ? least_poll : least_every, most_every).value_or(publish.every);
  publish.timeout = table.duration("timeout", least_every, most_every);
  if (publish.timeout && publish.poll && *publish.timeout <= publish.every) {
    table.error("timeout", "the value would be stale before it is read again", "use three times the time of `every`");
  }
  table.finish();
  return publish;
}

std::string lower_case(std::string word) {
  std::ranges::transform(word, word.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return word;
}

void read_file(Table& table, const text::Reach& reach, string_view key, std::string& into) {
  const auto name = table.string(key);
  if (!name) return;
  if (name->empty()) return table.error(key, "the file name is empty", "name a file, or leave the key out");
  into = reach.path(table, key, *name);
}

void read_files(Table& table, const text::Reach& reach, Mqtt& mqtt) {
  read_file(table, reach, "ca", mqtt.ca);
  read_file(table, reach, "certificate", mqtt.certificate);
  read_file(table, reach, "key", mqtt.key);
  read_file(table, reach, "login", mqtt.login);
  if (table.has("certificate") != table.has("key")) {
    table.error(table.has("key") ? "key" : "certificate", "a certificate and its key belong together", "give both");
  }
  const bool tls = mqtt.broker.starts_with("mqtts://");
  for (const char* const key : {"ca", "certificate", "key"}) {
    if (!tls && table.has(key)) return table.error(key, "mqtt:// has no TLS", "write broker = \"mqtts://…\"");
  }
}

void read_broker(Table& table, Mqtt& mqtt) {
  mqtt.broker_place = table.begin();
  if (!table.require("broker", "such as \"mqtts://broker.plant:8883\"")) return;
  mqtt.broker_place = table.place_of("broker");
  mqtt.broker = table.string("broker").value_or("");
  if (!mqtt.broker.starts_with("mqtt://") && !mqtt.broker.starts_with("mqtts://"))
    table.error("broker", "this is no address of a broker", "write mqtt://HOST:PORT, or by TLS mqtts://HOST:PORT");
}

void read_allowed(Table& table, Mqtt& mqtt) {
  const auto words = table.strings("commands");
  if (!words) return;
  for (const auto& word : *words) {
    const bool known = std::ranges::find(Mqtt::command_words, word) != Mqtt::command_words.end();
    if (!known) {
      table.error("commands", fmt::format("{} cannot be commanded by MQTT", text::quoted(word)),
                  R"(of "replace", "locate" and "nmt"; an object is allowed by writable = true in its slot's publish)");
    }
    if (known && !mqtt.commands.allow(word)) mqtt.commands.verbs.push_back(word);
  }
}

// Each slot is a device at the broker. Names there must differ in more than case.
void check_devices(Table& table, const Machine& machine) {
  std::vector<std::pair<std::string, const Slot*>> names;
  for (const auto& slot : machine.slots) {
    const auto& name = slot.spec.name.name;
    if (!name.empty() && !is_topic_word(name)) {
      table.error(
          "",
          fmt::format("the name of slot {} (line {}) cannot be part of a topic", text::quoted(name), slot.place.line),
          topic_fix);
    }
    names.emplace_back(lower_case(name), &slot);
  }
  std::ranges::sort(names, [](const auto& a, const auto& b) { return a.first < b.first; });
  const auto twin = std::ranges::adjacent_find(names, [](const auto& a, const auto& b) {
    return a.first == b.first && a.second->spec.name != b.second->spec.name;
  });
  if (twin == names.end() || twin->first.empty()) return;
  table.error(
      "",
      fmt::format("the slots {} and {} (lines {} and {}) differ in case only",
                  text::quoted(twin->second->spec.name.name), text::quoted(std::next(twin)->second->spec.name.name),
                  twin->second->place.line, std::next(twin)->second->place.line),
      "hosts at a broker may take them for one device: rename one");
}

}  // namespace

void read_publish(Table& table, Slot& slot) {
  for (auto& item : table.strings_or_tables("publish")) {
    Publish publish;
    if (item.table) {
      publish = read_published(*item.table);
    } else {
      publish.object = item.string;
      publish.place = item.place;
      if (item.string.empty()) table.error("publish", "the name is empty", "such as \"6401h:01\"");
    }
    const bool twice = std::ranges::find(slot.publish, publish.object, &Publish::object) != slot.publish.end();
    if (twice && !publish.object.empty()) {
      table.error("publish", fmt::format("{} appears twice", text::quoted(publish.object)), "publish it once");
    }
    slot.publish.push_back(std::move(publish));
  }
  if (slot.publish.size() <= most_published) return;
  table.error("publish", fmt::format("{} values are too many", slot.publish.size()),
              fmt::format("publish {} at most", most_published));
}

void read_mqtt(Machine& machine, Table& root, const text::Reach& reach) {
  auto table = root.table("mqtt");
  if (!table) return;
  Mqtt mqtt;
  mqtt.place = table->begin();
  read_broker(*table, mqtt);
  read_topic_word(*table, "group", mqtt.group);
  if (mqtt.group == "STATE") table->error("group", "\"STATE\" is the topic of hosts", "use another name");
  read_topic_word(*table, "node", mqtt.node);
  if (!table->has("node") && !machine.name.empty() && !is_topic_word(machine.name)) {
    table->error("", fmt::format("the machine's name {} cannot be part of a topic", text::quoted(machine.name)),
                 "write node = \"…\": 1 to 1000 characters without +, / and #");
  }
  read_topic_word(*table, "primary_host", mqtt.primary_host);
  read_word(*table, "version", version_words, mqtt.version);
  mqtt.client_id = table->string("client_id").value_or("");
  if (mqtt.client_id.size() > 1000 || (table->has("client_id") && mqtt.client_id.empty()))
    table->error("client_id", "this is no client-ID", "use 1 to 1000 characters, or leave the key out");
  read_files(*table, reach, mqtt);
  if (const auto bytes = table->integer("backlog", backlog_bytes)) mqtt.backlog = static_cast<std::uint64_t>(*bytes);
  read_allowed(*table, mqtt);
  check_devices(*table, machine);
  table->finish();
  machine.mqtt = std::move(mqtt);
}

}  // namespace berth::design
