#include "berth/multilevel/routing_objects.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "berth/base/bytes.hpp"
#include "berth/device/dictionary.hpp"

namespace berth::multilevel {
namespace {

using od::DataType;

constexpr std::array place_types{DataType::unsigned8, DataType::unsigned16, DataType::unsigned32, DataType::unsigned64};
constexpr std::uint16_t first_places = 0x5F20;
constexpr std::uint8_t stopped_kinds = 0x03, every_bit = 0x80;

std::uint32_t end(std::uint8_t side, ObjectRef object) noexcept {
  return static_cast<std::uint32_t>(object.index) << 16U | static_cast<std::uint32_t>(object.sub) << 8U | side;
}
ObjectRef object(std::uint32_t end) noexcept {
  return {static_cast<std::uint16_t>(end >> 16U), static_cast<std::uint8_t>(end >> 8U)};
}

void add_array(od::DescriptionBuilder& builder, std::uint16_t index, const char* name, DataType type, std::uint8_t size,
               od::SubSpec spec = {}) {
  builder.object(index, od::ObjectCode::array, name, type);
  for (unsigned sub = 1; sub <= size; ++sub) {
    spec.sub = static_cast<std::uint8_t>(sub);
    spec.name = name;
    spec.type = type;
    if (!spec.initial.present()) spec.initial = od::Literal::number(0);
    builder.sub(index, spec);
  }
}

Signal row(const od::Values& values, std::uint8_t sub, const RouteEntry& entry, std::size_t bytes) {
  using Objects = RoutingObjects;
  Signal signal;
  signal.name = "signal " + std::to_string(sub);
  signal.from = entry.from;
  signal.to = entry.to;
  signal.source = entry.source;
  signal.target = entry.target;
  signal.modes = values.get_or<std::uint32_t>({Objects::modes, sub}, signal.modes);
  signal.budget = std::chrono::microseconds(values.get_or<std::uint32_t>({Objects::budgets, sub}, 0U));
  signal.freshness = std::chrono::milliseconds(values.get_or<std::uint16_t>({Objects::freshness, sub}, 0));
  const auto stopped = values.get_or<std::uint8_t>({Objects::stopped, sub}, 0);
  signal.every = (stopped & every_bit) != 0;
  signal.stopped = static_cast<Signal::Stopped>(std::min(stopped & stopped_kinds, 2));
  if (signal.stopped != Signal::Stopped::substitute) return signal;
  std::array<std::uint8_t, 8> substitute{};
  store_le(substitute.data(), values.get_or<std::uint64_t>({Objects::substitute, sub}, std::uint64_t{0}));
  signal.substitute.assign(substitute.begin(), substitute.begin() + static_cast<std::ptrdiff_t>(bytes));
  return signal;
}

}  // namespace

std::uint64_t RouteEntry::raw() const noexcept {
  return static_cast<std::uint64_t>(end(to, target)) << 32U | end(from, source);
}

RouteEntry RouteEntry::of(std::uint64_t raw) noexcept {
  const auto low = static_cast<std::uint32_t>(raw), high = static_cast<std::uint32_t>(raw >> 32U);
  return {static_cast<std::uint8_t>(low), static_cast<std::uint8_t>(high), object(low), object(high)};
}

std::optional<std::uint16_t> signal_places(unsigned bytes) noexcept {
  for (std::size_t i = 0; i < place_types.size(); ++i) {
    if (bytes == 1U << i) return static_cast<std::uint16_t>(first_places + i);
  }
  return std::nullopt;
}

void add_routing_objects(od::DescriptionBuilder& builder, std::uint8_t rows) {
  using Objects = RoutingObjects;
  builder.variable(Objects::mode, {.name = "Signal mode",
                                   .type = DataType::unsigned8,
                                   .initial = od::Literal::number(0),
                                   .high = od::Literal::number(31)});
  add_array(builder, Objects::routes, "Signal route", DataType::unsigned64, rows);
  builder.sub(Objects::routes, {.sub = 0,
                                .name = "Signal routes that count",
                                .type = DataType::unsigned8,
                                .initial = od::Literal::number(0),
                                .high = od::Literal::number(rows)});
  add_array(builder, Objects::budgets, "Signal delay budget", DataType::unsigned32, rows);
  add_array(builder, Objects::freshness, "Signal freshness", DataType::unsigned16, rows);
  add_array(builder, Objects::stopped, "Signal when stopped", DataType::unsigned8, rows);
  add_array(builder, Objects::modes, "Signal modes", DataType::unsigned32, rows,
            {.initial = od::Literal::number(0xFFFF'FFFF)});
  add_array(builder, Objects::substitute, "Signal substitute", DataType::unsigned64, rows);
}

void add_signal_places(od::DescriptionBuilder& builder, std::uint8_t places, unsigned pdos) {
  constexpr std::array names{"Signals of 8 bits", "Signals of 16 bits", "Signals of 32 bits", "Signals of 64 bits"};
  for (std::size_t i = 0; i < place_types.size(); ++i) {
    add_array(builder, static_cast<std::uint16_t>(first_places + i), names.at(i), place_types.at(i), places,
              {.mappable = true});
  }
  for (unsigned number = 1; number <= pdos; ++number) {
    device::add_tpdo(builder, number, {});
    device::add_rpdo(builder, number, {});
    for (const unsigned communication : {0x1800U, 0x1400U}) {  // none is valid before it is given a CAN-ID
      const ObjectRef id{static_cast<std::uint16_t>(communication + number - 1), 1};
      auto cob_id = builder.spec_of(id)->initial;
      cob_id.raw |= 0x8000'0000U;
      builder.initial(id, cob_id);
    }
  }
}

std::vector<Signal> read_routes(const od::Values& upstream) {
  std::vector<Signal> table;
  const auto rows = upstream.get_or<std::uint8_t>({RoutingObjects::routes, 0}, std::uint8_t{0});
  for (unsigned sub = 1; sub <= rows; ++sub) {
    const auto at = static_cast<std::uint8_t>(sub);
    const auto raw = upstream.get_or<std::uint64_t>({RoutingObjects::routes, at}, std::uint64_t{0});
    if (raw == 0) continue;
    const auto entry = RouteEntry::of(raw);
    // Only the sizes of the signal places are known here; the table deals with those of other objects.
    std::size_t bytes = 8;
    for (const unsigned size : {1U, 2U, 4U}) {
      if (signal_places(size) == entry.target.index) bytes = size;
    }
    table.push_back(row(upstream, at, entry, bytes));
  }
  return table;
}

}  // namespace berth::multilevel
