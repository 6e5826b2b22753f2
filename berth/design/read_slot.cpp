// The keys of a `[[slot]]` that need nothing else of the machine file: node-IDs, name, type, probe, assignment.
#include <fmt/format.h>

#include <array>

#include "berth/design/read_parts.hpp"
#include "berth/od/notation.hpp"

namespace berth::design {
namespace {

using std::string_view;
using text::Table;

constexpr std::array<string_view, 3> assign_words{"lss", "fixed", "recipe"};
constexpr std::uint8_t product_unasked = 2;  // a bit of `places::SlotAsks::unasked`

void read_probe_object(Table& table, const std::string& word, places::Probe& probe) {
  const auto object = od::read_object(word);
  const bool good = object && object->index != 0;
  if (!good) {
    return table.error("object", object ? "there is no object 0000h" : object.error().why, "such as \"6000h:01\"");
  }
  probe.index = object->index;
  probe.sub = object->sub.value_or(0);
}

}  // namespace

void read_probe(Table& table, places::SlotSpec& spec, bool says_how) {
  auto entry = table.table("probe");
  const bool by_probe = spec.when_ambiguous == places::WhenAmbiguous::probe;
  if (!entry) {
    if (by_probe && !table.has("probe")) {
      table.error("when_ambiguous", "the slot has no probe", "write probe = { object = \"6000h:01\", value = 1 }");
    }
    return;
  }
  if (!says_how) spec.when_ambiguous = places::WhenAmbiguous::probe;
  places::Probe probe;
  if (entry->require("object", "such as \"6000h:01\"")) {
    const auto text = entry->string("object");
    if (text) read_probe_object(*entry, *text, probe);
  }
  if (entry->require("value", "what the object has in this place")) probe.value = entry->u32("value").value_or(0);
  probe.mask = entry->u32("mask").value_or(probe.mask);
  if (probe.mask == 0) entry->error("mask", "the mask has no bit set", "leave the key out, or set the bits");
  if ((probe.value & ~probe.mask) != 0) {
    entry->error("value", "it has bits that are not in the mask", "no device could show it");
  }
  entry->finish();
  spec.probe = probe;
}

std::vector<unsigned> read_ids(Table& table, Slot& slot) {
  slot.of_range = table.has("ids");
  if (slot.of_range && table.has("id")) table.error("ids", "id and ids exclude each other", "keep one of them");
  if (!slot.of_range) {
    if (!table.require("id", "give the slot a node-ID, 1 to 127")) return {};
    const auto value = table.get("id");
    if (value->kind == text::Value::Kind::integer && (value->integer < 1 || value->integer > 127)) {
      table.error("id", fmt::format("{} is not a node-ID", value->integer), "use 1 to 127");
      return {};
    }
    const auto id = table.integer("id", node_ids);
    return id ? std::vector<unsigned>{static_cast<unsigned>(*id)} : std::vector<unsigned>{};
  }
  const auto text = table.string("ids");
  if (!text) return {};
  const auto ids = text::parse_ranges(*text, 1, 127);
  if (!ids) {
    table.error("ids", fmt::format("{} is not a list of node-IDs", text::quoted(*text)),
                "write ascending ranges within 1 to 127, such as \"1..60\" or \"1..9, 20\"");
  }
  return ids.value_or(std::vector<unsigned>{});
}

std::string read_name(Table& table, bool of_range) {
  if (!table.require("name", of_range ? "such as \"pump {id}\"" : "give the slot a name")) return {};
  const auto name = table.string("name");
  if (!name) return {};
  const bool varies = name->find("{id}") != std::string::npos;
  if (!good_name(*name)) {
    table.error("name", "this is not a name", name_fix);
  } else if (of_range && !varies) {
    table.error("name", "every slot of a range needs a name of its own", "put {id} into it: \"pump {id}\"");
  } else if (!of_range && varies) {
    table.error("name", "{id} has no meaning here", "use ids = \"…\" for several slots");
  }
  return *name;
}

void read_type_table(Table& table, places::SlotSpec& spec) {
  auto type = table.table("type");
  if (!type) return;
  if (type->require("vendor", "vendor-ID, 1018h:01")) spec.type.vendor = type->u32("vendor").value_or(0);
  if (!type->has("product")) spec.asks.unasked = product_unasked;
  spec.type.product = type->u32("product").value_or(0);
  spec.revision = type->u32("revision");
  type->finish();
}

void read_any(Table& table, places::SlotSpec& spec) {
  constexpr std::array<string_view, 1> words{"any"};
  static_cast<void>(table.word("type", words));
  spec.type = {};
  spec.asks.unasked = any_type;
  spec.revision.reset();
}

std::uint32_t described_type(const Slot& slot) {
  const bool any = slot.spec.asks.unasked == any_type && slot.description != nullptr;
  const auto* const type = any ? slot.description->find(ObjectRef{0x1000, 0}) : nullptr;
  return type == nullptr ? 0 : static_cast<std::uint32_t>(slot.description->default_of(*type).raw);
}

void read_assign(Table& table, places::SlotSpec& spec) {
  const bool any = spec.asks.unasked == any_type;
  if (any) spec.assign = places::Assign::fixed;
  read_word(table, "assign", assign_words, spec.assign);
  if (!any || spec.assign == places::Assign::fixed) return;
  table.error("assign", "a device of any type is known by its node-ID alone",
              "write assign = \"fixed\", or type = { vendor = …, product = … }");
}

}  // namespace berth::design
