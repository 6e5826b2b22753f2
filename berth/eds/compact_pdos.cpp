#include "berth/eds/compact_pdos.hpp"

#include <fmt/format.h>

#include <array>

namespace berth::eds {
namespace {

constexpr unsigned predefined_pdos = 4;

}  // namespace

void CompactPdos::add_sub(std::uint16_t index, const od::SubSpec& spec) {
  if (budget_.afford(nullptr, 1, spec.name.size() + spec.initial.bytes.size())) builder_.sub(index, spec);
}

void CompactPdos::add_all() {
  if (device_.compact_pdo == 0) return;
  for (unsigned number = 1; number <= device_.rpdos; ++number) add(od::PdoKind::rpdo, number);
  for (unsigned number = 1; number <= device_.tpdos; ++number) add(od::PdoKind::tpdo, number);
}

void CompactPdos::add(od::PdoKind kind, unsigned number) {
  const bool receive = kind == od::PdoKind::rpdo;
  const auto communication = od::communication_index(kind, number);
  const auto mapping = od::mapping_index(kind, number);
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
        const std::uint32_t base = (receive ? 0x200U : 0x180U) + 0x100U * (number - 1);
        initial = number <= predefined_pdos ? Literal::node_id_plus(base) : Literal::number(od::CobId::invalid_bit);
        // A DCF switches off the PDOs that it does not describe (CiA 306 §5.3).
        if (dcf_) {
          const ObjectRef cob_id{communication, 1};
          if (initial.kind == Literal::Kind::node_id_plus) {
            values_.defaults.push_back({cob_id, DataType::unsigned32, initial});
            initial.raw |= od::CobId::invalid_bit;
          }
          values_.parameters.push_back({cob_id, DataType::unsigned32, initial});
        }
      }
      add_sub(communication, {.sub = static_cast<std::uint8_t>(i + 1),
                              .name = items[i].name,
                              .type = items[i].type,
                              .initial = std::move(initial)});
    }
  }
  if (builder_.has(mapping)) return;
  builder_.object(mapping, od::ObjectCode::record, receive ? "RPDO mapping parameter" : "TPDO mapping parameter",
                  DataType::pdo_mapping);
  const auto writable = device_.granularity == 0 ? od::Access::ro : od::Access::rw;
  add_sub(mapping, {.sub = 0,
                    .name = "Number of mapped objects",
                    .type = DataType::unsigned8,
                    .access = writable,
                    .initial = Literal::number(0)});
  for (unsigned sub = 1; sub <= od::most_pdo_entries; ++sub) {
    const auto name = fmt::format("Application object {}", sub);
    add_sub(mapping,
            {.sub = static_cast<std::uint8_t>(sub), .name = name, .type = DataType::unsigned32, .access = writable});
  }
}

}  // namespace berth::eds
