// What concerns several objects at once: value lists, PDOs that exist without a section, counts and duties.
#include <fmt/format.h>

#include <algorithm>

#include "berth/eds/info.hpp"
#include "berth/eds/objects.hpp"

namespace berth::eds {
namespace {

using Severity = Finding::Severity;

constexpr std::uint16_t most_pdos = 512;
constexpr unsigned most_mapped = 64;  ///< entries of a mapping parameter (CiA 301 §7.5.2.36)
constexpr std::uint32_t pdo_invalid = 0x8000'0000;

constexpr unsigned predefined_pdos = 4;

std::size_t count(const od::Description& description, std::uint16_t first) {
  std::size_t found = 0;
  for (const od::Object& each : description.objects()) {
    if (each.index >= first && each.index < first + most_pdos) ++found;
  }
  return found;
}

}  // namespace

void ObjectReader::value_list(const Group& group) {
  const Section& section = *group.values;
  if (!given(group.keys, Key::compact_sub_obj)) {
    context_.warn(section, nullptr, "the object has no CompactSubObj; the values are taken all the same");
  }
  numbered(section, "NrOfEntries", [&](std::uint32_t sub, const Entry& entry) {
    const ObjectRef ref{group.index, static_cast<std::uint8_t>(sub)};
    const auto known = sub <= 0xFF ? builder_.spec_of(ref) : std::nullopt;
    if (!known) {
      context_.warn(section, &entry, "there is no such sub-index; left out");
      return;
    }
    auto value = literal(section, &entry, known->type);
    if (!value || !afford(&section, 0, value->bytes.size())) return;
    check_limits(section, &entry, *known, *value);
    const auto set = [ref](const Parameter& each) { return each.object == ref; };
    const auto first = static_cast<std::ptrdiff_t>(parameters_of_group_);
    if (known->initial.present() && std::none_of(parameters_.begin() + first, parameters_.end(), set)) {
      defaults_.push_back({ref, known->type, known->initial, group.main == nullptr ? 0 : group.main->line});
    }
    builder_.initial(ref, *value);
    parameters_.push_back({ref, known->type, std::move(*value), entry.line});
  });
}

void ObjectReader::denotation_list(const Group& group) {
  numbered(*group.denotations, "NrOfEntries", [&](std::uint32_t sub, const Entry& entry) {
    if (sub > 0xFF || !builder_.has(ObjectRef{group.index, static_cast<std::uint8_t>(sub)})) {
      context_.warn(*group.denotations, &entry, "there is no such sub-index; left out");
      return;
    }
    denotations_.push_back({{group.index, static_cast<std::uint8_t>(sub)}, context_.text(&entry)});
  });
}

void ObjectReader::links(const Group& group) {
  ObjectLinks made{group.index, {}};
  numbered(*group.links, "ObjectLinks", [&](std::uint32_t, const Entry& entry) {
    const auto index = context_.number(*group.links, &entry, 0xFFFF, Severity::warning);
    if (index) made.links.push_back(static_cast<std::uint16_t>(*index));
  });
  object_links_.push_back(std::move(made));
}

/// [DeviceInfo] CompactPDO: PDOs without sections exist with these sub-indices of the communication record.
void ObjectReader::compact_pdos() {
  if (device_.compact_pdo == 0) return;
  for (unsigned number = 0; number < device_.rpdos; ++number) {
    compact_pdo(static_cast<std::uint16_t>(0x1400 + number), static_cast<std::uint16_t>(0x1600 + number), number, true);
  }
  for (unsigned number = 0; number < device_.tpdos; ++number) {
    compact_pdo(static_cast<std::uint16_t>(0x1800 + number), static_cast<std::uint16_t>(0x1A00 + number), number,
                false);
  }
}

void ObjectReader::compact_pdo(std::uint16_t communication, std::uint16_t mapping, unsigned number, bool receive) {
  using od::DataType;
  using od::Literal;
  struct Item {
    const char* name;
    DataType type;
  };
  constexpr std::array<Item, 6> items{{{"COB-ID", DataType::unsigned32},
                                       {"Transmission type", DataType::unsigned8},
                                       {"Inhibit time", DataType::unsigned16},
                                       {"Reserved", DataType::unsigned8},
                                       {"Event timer", DataType::unsigned16},
                                       {"SYNC start value", DataType::unsigned8}}};
  if (!builder_.has(communication)) {
    builder_.object(communication, od::ObjectCode::record,
                    receive ? "RPDO communication parameter" : "TPDO communication parameter",
                    DataType::pdo_communication);
    for (std::size_t i = 0; i < items.size(); ++i) {
      if (((device_.compact_pdo >> i) & 1U) == 0) continue;
      Literal initial;
      if (i == 0) {
        const std::uint32_t base = (receive ? 0x200U : 0x180U) + 0x100U * number;
        initial = number < predefined_pdos ? Literal::node_id_plus(base) : Literal::number(pdo_invalid);
        // A DCF switches off the PDOs that it does not describe (CiA 306 §5.3).
        if (dcf_) {
          const ObjectRef cob_id{communication, 1};
          if (initial.kind == Literal::Kind::node_id_plus) {
            defaults_.push_back({cob_id, DataType::unsigned32, initial});
            initial.raw |= pdo_invalid;
          }
          parameters_.push_back({cob_id, DataType::unsigned32, initial});
        }
      }
      add(communication,
          {.sub = static_cast<std::uint8_t>(i + 1),
           .name = items[i].name,
           .type = items[i].type,
           .initial = std::move(initial)},
          nullptr);
    }
  }
  if (builder_.has(mapping)) return;
  builder_.object(mapping, od::ObjectCode::record, receive ? "RPDO mapping parameter" : "TPDO mapping parameter",
                  DataType::pdo_mapping);
  const auto writable = device_.granularity == 0 ? od::Access::ro : od::Access::rw;
  add(mapping,
      {.sub = 0,
       .name = "Number of mapped objects",
       .type = DataType::unsigned8,
       .access = writable,
       .initial = Literal::number(0)},
      nullptr);
  for (unsigned sub = 1; sub <= most_mapped; ++sub) {
    scratch_ = fmt::format("Application object {}", sub);
    add(mapping,
        {.sub = static_cast<std::uint8_t>(sub), .name = scratch_, .type = DataType::unsigned32, .access = writable},
        nullptr);
  }
}

void ObjectReader::check_pdo_counts(const od::Description& description) {
  const Section* const section = context_.document().find("DeviceInfo");
  if (section == nullptr) return;
  struct Check {
    const char* key;
    std::uint16_t promised;
    std::uint16_t first;
  };
  for (const Check& each : {Check{"NrOfRXPDO", device_.rpdos, 0x1400}, Check{"NrOfTXPDO", device_.tpdos, 0x1800}}) {
    const std::size_t present = count(description, each.first);
    const Entry* const entry = context_.document().find(*section, each.key);
    if (present == each.promised || entry == nullptr) continue;
    context_.tell(Severity::note, *section, entry,
                  fmt::format("{} PDOs are promised, {} communication records stand there", each.promised, present));
  }
}

void ObjectReader::check_mandatory(const od::Description& description) {
  if (sections_.empty()) return;
  for (const std::uint16_t index : {std::uint16_t{0x1000}, std::uint16_t{0x1001}, std::uint16_t{0x1018}}) {
    if (description.find(index) != nullptr) continue;
    context_.report().add(Severity::warning, 0, 0, fmt::format("[{:04X}]", index),
                          "the object is mandatory (CiA 301) and not there");
  }
}

}  // namespace berth::eds
