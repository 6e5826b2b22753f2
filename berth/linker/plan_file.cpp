#include "berth/linker/plan_file.hpp"

#include <fmt/format.h>

#include <array>

#include "berth/base/words.hpp"
#include "berth/od/notation.hpp"
#include "berth/od/pdo_objects.hpp"
#include "berth/text/toml.hpp"

namespace berth::linker {
namespace {

using text::Limits;
using text::Table;

constexpr std::int64_t format_now = 1;
constexpr std::array<std::string_view, 2> directions{"input", "output"};
constexpr Limits pdo_numbers{1, od::most_pdos};
constexpr Limits base_ids{1, 0x7FF};
constexpr Limits sides{0, 8};

template <class Range, class Text>
std::string joined(const Range& range, const Text& text) {
  std::string made;
  for (const auto& each : range) made += (made.empty() ? "" : ", ") + text(each);
  return made;
}

std::optional<ObjectRef> read_object(Table& table, std::string_view key, const std::string& word) {
  const auto object = od::read_object(word);
  if (object && object->sub) return ObjectRef{object->index, *object->sub};
  table.error(key, fmt::format("{} is not an object", berth::quoted(word)), "such as \"A100h:01\"");
  return std::nullopt;
}

EarlierVariable read_variable(Table& table) {
  EarlierVariable made;
  if (table.require("slot", "its device")) made.node = table.string("slot").value_or("");
  if (table.require("name", "its name")) made.name = table.string("name").value_or("");
  if (table.require("direction", "input or output")) made.input = table.word("direction", directions).value_or(0) == 0;
  if (table.require("type", "its data type")) {
    const auto word = table.string("type").value_or("");
    const auto type = od::data_type(word);
    if (!type) table.error("type", fmt::format("{} is not a data type", berth::quoted(word)), "such as \"UNSIGNED16\"");
    made.type = type.value_or(od::DataType::none);
  }
  if (table.require("object", "index and sub-index")) {
    const auto word = table.string("object");
    if (word) made.object = read_object(table, "object", *word).value_or(ObjectRef{});
  }
  table.finish();
  return made;
}

void read_receivers(Table& table, EarlierPdo& pdo) {
  const auto names = table.strings("receivers").value_or(std::vector<std::string>{});
  const auto rpdos = table.integers("rpdos", pdo_numbers).value_or(std::vector<std::int64_t>{});
  if (names.size() != rpdos.size()) {
    return table.error("rpdos", "not as many as receivers", "one RPDO number for each receiver");
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    pdo.receivers.emplace_back(names[i], static_cast<std::uint16_t>(rpdos[i]));
  }
}

EarlierPdo read_pdo(Table& table) {
  EarlierPdo made;
  if (table.require("producer", "its device")) made.producer = table.string("producer").value_or("");
  if (table.require("tpdo", "1 to 512")) {
    made.tpdo = static_cast<std::uint16_t>(table.integer("tpdo", pdo_numbers).value_or(1));
  }
  if (table.require("can_id", "its CAN-ID")) {
    made.can_id = static_cast<std::uint16_t>(table.integer("can_id", base_ids).value_or(1));
  }
  made.mpdo = table.boolean("mpdo").value_or(false);
  made.transmission = static_cast<TransmissionType>(table.integer("transmission", {0, 255}).value_or(at_change));
  if (table.require("objects", "what it carries")) {
    for (const auto& word : table.strings("objects").value_or(std::vector<std::string>{})) {
      if (const auto object = read_object(table, "objects", word)) made.objects.push_back(*object);
    }
  }
  read_receivers(table, made);
  table.finish();
  return made;
}

std::optional<ObjectRef> object_of(Table& table, std::string_view key) {
  if (!table.require(key, "index and sub-index")) return std::nullopt;
  const auto word = table.string(key);
  return word ? read_object(table, key, *word) : std::nullopt;
}

EarlierRoute read_route(Table& table) {
  EarlierRoute made;
  if (table.require("gateway", "its slot on the bus above")) made.gateway = table.string("gateway").value_or("");
  if (table.require("producer", "its device")) made.producer = table.string("producer").value_or("");
  if (table.require("row", "1 to 254"))
    made.row = static_cast<std::uint8_t>(table.integer("row", {1, 254}).value_or(1));
  made.from = static_cast<std::uint8_t>(table.integer("from", sides).value_or(0));
  made.to = static_cast<std::uint8_t>(table.integer("to", sides).value_or(0));
  made.object = object_of(table, "object").value_or(ObjectRef{});
  made.source = object_of(table, "source").value_or(ObjectRef{});
  made.target = object_of(table, "target").value_or(ObjectRef{});
  table.finish();
  return made;
}

}  // namespace

std::string write(const Earlier& plan) {
  std::string text = fmt::format(
      "# Made by berth link: which objects are in which PDO, so that they stay there. Keep it beside the machine "
      "file.\n"
      "format = {}\n",
      format_now);
  for (const EarlierVariable& each : plan.variables) {
    text += fmt::format("\n[[variable]]\nslot = {}\nname = {}\ntype = {}\ndirection = {}\nobject = {}\n",
                        berth::quoted(each.node), berth::quoted(each.name), berth::quoted(od::name(each.type)),
                        berth::quoted(each.input ? directions[0] : directions[1]),
                        berth::quoted(od::write_object(each.object)));
  }
  for (const EarlierPdo& each : plan.pdos) {
    text += fmt::format("\n[[pdo]]\nproducer = {}\ntpdo = {}\ncan_id = 0x{:03X}\n{}transmission = {}\nobjects = [{}]\n",
                        berth::quoted(each.producer), each.tpdo, each.can_id, each.mpdo ? "mpdo = true\n" : "",
                        each.transmission,
                        joined(each.objects, [](ObjectRef o) { return berth::quoted(od::write_object(o)); }));
    text += fmt::format("receivers = [{}]\nrpdos = [{}]\n",
                        joined(each.receivers, [](const auto& r) { return berth::quoted(r.first); }),
                        joined(each.receivers, [](const auto& r) { return std::to_string(r.second); }));
  }
  for (const EarlierRoute& each : plan.routes) {
    text += fmt::format(
        "\n[[route]]\ngateway = {}\nrow = {}\nproducer = {}\nobject = {}\nfrom = {}\nsource = {}\nto = {}\ntarget = "
        "{}\n",
        berth::quoted(each.gateway), each.row, berth::quoted(each.producer),
        berth::quoted(od::write_object(each.object)), each.from, berth::quoted(od::write_object(each.source)), each.to,
        berth::quoted(od::write_object(each.target)));
  }
  return text;
}

std::optional<Earlier> read_plan(std::string_view text, const std::string& file, Findings& findings) {
  const auto root = text::parse_toml(text, file, findings);
  if (!root) return std::nullopt;
  const auto before = findings.size();
  Table table(*root, "", file, findings);
  Earlier made;
  if (table.require("format", "this file was not made by berth link")) {
    (void)table.integer("format", {format_now, format_now});
  }
  for (auto& each : table.tables("variable")) made.variables.push_back(read_variable(each));
  for (auto& each : table.tables("pdo")) made.pdos.push_back(read_pdo(each));
  for (auto& each : table.tables("route")) made.routes.push_back(read_route(each));
  table.finish();
  for (std::size_t i = before; i < findings.size(); ++i) {
    if (findings[i].severity == Finding::Severity::error) return std::nullopt;
  }
  return made;
}

}  // namespace berth::linker
