#include "berth/document/device_page.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/words.hpp"
#include "berth/command/values.hpp"
#include "berth/document/html.hpp"
#include "berth/od/notation.hpp"

namespace berth::document {
namespace {

std::string type_text(const design::Slot& slot) {
  const std::string type = to_string(slot.spec.type);
  const std::string& name = !slot.device.empty() ? slot.device : slot.eds;
  return name.empty() ? type : fmt::format("{} ({})", name, type);
}

command::KnownObject known(const od::Description& description, const od::Object& object, const od::SubObject& sub) {
  const ObjectRef ref{object.index, sub.sub};
  return {.ref = ref,
          .name = std::string(description.name(sub)),
          .type = sub.type,
          .described = &sub,
          .limits = description.limits(sub),
          .meaning = description.meaning(ref)};
}

std::string limits_text(const od::Description& description, const od::SubObject& sub) {
  const auto* const limits = description.limits(sub);
  if (limits == nullptr) return {};
  const auto text = [&](const od::Literal& value) {
    if (value.kind != od::Literal::Kind::number) return std::string();
    return od::is_signed(sub.type) ? fmt::format("{}", static_cast<std::int64_t>(value.raw))
                                   : fmt::format("{}", value.raw);
  };
  return fmt::format("{} to {}", text(limits->low), text(limits->high));
}

std::string unit_of(const command::Note& note) {
  if (note.unit.empty() || note.scale == 1) return note.unit;
  return fmt::format("{} {}", note.scale, note.unit);
}

// The note's text, and the names of its values and bits. The unit has its own column.
std::string words_of(command::Note note) {
  note.unit.clear();
  return command::line_of(note);
}

std::string objects_table(const DescribedSlot& device) {
  const design::Slot& slot = *device.slot;
  const auto& description = *slot.description;
  const od::Values defaults(slot.description, slot.spec.id);
  Table table({"object", "name", "type", "access", "default", "range", "in PDOs", "unit", "note"});
  for (const auto& object : description.objects()) {
    for (const auto& sub : description.subs(object)) {
      const auto each = known(description, object, sub);
      const std::string whole(description.name(object));
      const bool part = object.count > 1 && each.name != whole;
      const auto bytes = defaults.bytes(each.ref);
      const command::Note note = device.notes ? device.notes->of(each.ref) : command::Note();
      table.cell(od::write_object(each.ref))
          .cell(part ? whole + ": " + each.name : whole)
          .cell(od::name(sub.type))
          .cell(od::name(sub.access))
          .cell(sub.has_default && bytes.size() <= 64 ? command::value_text(each, bytes) : "")
          .cell(limits_text(description, sub))
          .cell(sub.mappable ? "yes" : "")
          .cell(unit_of(note))
          .cell(words_of(note))
          .end_row();
    }
  }
  return table.made();
}

}  // namespace

DevicePages::DevicePages(const std::vector<DescribedSlot>& slots) {
  for (const auto& each : slots) {
    if (!each.slot->description) continue;
    const bool told =
        std::ranges::any_of(first_, [&](const auto* f) { return f->slot->description == each.slot->description; });
    if (!told) first_.push_back(&each);
  }
}

std::string DevicePages::link(const design::Slot& slot) const {
  for (std::size_t i = 0; i < first_.size(); ++i) {
    if (first_[i]->slot->description == slot.description)
      return fmt::format("<a href=\"device-{}.html\">{}</a>", i + 1, markup(type_text(slot)));
  }
  return markup(type_text(slot));
}

std::vector<DocumentFile> DevicePages::pages() const {
  std::vector<DocumentFile> all;
  for (std::size_t i = 0; i < first_.size(); ++i) {
    const std::string body = "<p>The objects of the device description. Defaults with $NODEID are those of node " +
                             std::to_string(first_[i]->slot->spec.id.value()) + ".</p>\n" + objects_table(*first_[i]);
    all.push_back({fmt::format("device-{}.html", i + 1), page(type_text(*first_[i]->slot), body)});
  }
  return all;
}

std::string differences(const DescribedSlot& slot) {
  if (!slot.values) return "<p>Its description is not known (<code>eds =</code>).</p>\n";
  const auto& description = slot.values->description();
  const od::Values defaults(slot.slot->description, slot.slot->spec.id);
  Table table({"object", "name", "default", "configured"});
  for (const auto& object : description.objects()) {
    for (const auto& sub : description.subs(object)) {
      const auto each = known(description, object, sub);
      const auto before = defaults.bytes(each.ref);
      const auto now = slot.values->bytes(each.ref);
      if (std::ranges::equal(before, now)) continue;
      table.cell(od::write_object(each.ref))
          .cell(each.name)
          .cell(command::value_text(each, before))
          .cell(command::value_text(each, now))
          .end_row();
    }
  }
  const std::string made = table.made();
  return made.empty() ? "<p>Nothing.</p>\n" : made;
}

}  // namespace berth::document
