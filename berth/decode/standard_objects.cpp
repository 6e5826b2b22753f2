#include "berth/decode/standard_objects.hpp"

#include <fmt/format.h>

#include <string_view>

namespace berth::decode {
namespace {

using od::DataType;

struct Var {
  std::uint16_t index;
  std::string_view name;
  DataType type;
};
constexpr Var variables[]{
    {0x1000, "Device type", DataType::unsigned32},
    {0x1001, "Error register", DataType::unsigned8},
    {0x1002, "Manufacturer status register", DataType::unsigned32},
    {0x1005, "COB-ID SYNC message", DataType::unsigned32},
    {0x1006, "Communication cycle period", DataType::unsigned32},
    {0x1007, "Synchronous window length", DataType::unsigned32},
    {0x1008, "Manufacturer device name", DataType::visible_string},
    {0x1009, "Manufacturer hardware version", DataType::visible_string},
    {0x100A, "Manufacturer software version", DataType::visible_string},
    {0x100C, "Guard time", DataType::unsigned16},
    {0x100D, "Life time factor", DataType::unsigned8},
    {0x1012, "COB-ID time stamp object", DataType::unsigned32},
    {0x1013, "High resolution time stamp", DataType::unsigned32},
    {0x1014, "COB-ID EMCY", DataType::unsigned32},
    {0x1015, "Inhibit time EMCY", DataType::unsigned16},
    {0x1017, "Producer heartbeat time", DataType::unsigned16},
    {0x1019, "Synchronous counter overflow value", DataType::unsigned8},
    {0x1021, "Store EDS", DataType::domain},
    {0x1022, "Store format", DataType::unsigned16},
};

struct List {
  std::uint16_t first, last;
  std::string_view name;
  DataType type;                  // of sub-indices 1 and above
  std::string_view subs[6] = {};  // their names, if they have any
};
constexpr List lists[]{
    {0x1003, 0x1003, "Pre-defined error field", DataType::unsigned32},
    {0x1010, 0x1010, "Store parameters", DataType::unsigned32, {"All", "Communication", "Application", "Manufacturer"}},
    {0x1011,
     0x1011,
     "Restore default parameters",
     DataType::unsigned32,
     {"All", "Communication", "Application", "Manufacturer"}},
    {0x1016, 0x1016, "Consumer heartbeat time", DataType::unsigned32},
    {0x1018,
     0x1018,
     "Identity object",
     DataType::unsigned32,
     {"Vendor-ID", "Product code", "Revision number", "Serial number"}},
    {0x1020, 0x1020, "Verify configuration", DataType::unsigned32, {"Configuration date", "Configuration time"}},
    {0x1028, 0x1028, "Emergency consumer", DataType::unsigned32},
    {0x1029, 0x1029, "Error behaviour", DataType::unsigned8, {"Communication error"}},
    {0x1200,
     0x127F,
     "SDO server parameter",
     DataType::unsigned32,
     {"COB-ID client to server", "COB-ID server to client"}},
    {0x1280,
     0x12FF,
     "SDO client parameter",
     DataType::unsigned32,
     {"COB-ID client to server", "COB-ID server to client"}},
    {0x1400,
     0x15FF,
     "RPDO communication parameter",
     DataType::none,
     {"COB-ID", "Transmission type", "Inhibit time", "", "Event timer"}},
    {0x1600, 0x17FF, "RPDO mapping parameter", DataType::unsigned32},
    {0x1800,
     0x19FF,
     "TPDO communication parameter",
     DataType::none,
     {"COB-ID", "Transmission type", "Inhibit time", "", "Event timer", "SYNC start value"}},
    {0x1A00, 0x1BFF, "TPDO mapping parameter", DataType::unsigned32},
};

// Each sub-index of 1400h.. and 1800h.. has a type of its own.
DataType of_pdo(std::uint8_t sub) {
  switch (sub) {
    case 1: return DataType::unsigned32;
    case 3:
    case 5: return DataType::unsigned16;
    default: return DataType::unsigned8;
  }
}

}  // namespace

StandardObject standard_object(ObjectRef ref) {
  for (const Var& var : variables) {
    if (var.index == ref.index && ref.sub == 0) return {std::string(var.name), var.type};
  }
  for (const List& list : lists) {
    if (ref.index < list.first || ref.index > list.last) continue;
    std::string name(list.name);
    if (list.last > list.first) name += fmt::format(" {}", ref.index - list.first + 1);
    if (ref.sub == 0) return {name + ".Number of entries", DataType::unsigned8};
    const std::string_view sub = ref.sub <= std::size(list.subs) ? list.subs[ref.sub - 1] : std::string_view();
    name += sub.empty() ? fmt::format(".{}", ref.sub) : fmt::format(".{}", sub);
    return {name, list.type == DataType::none ? of_pdo(ref.sub) : list.type};
  }
  return {};
}

const od::Description& standard_names() {
  static const std::shared_ptr<const od::Description> made = [] {
    od::DescriptionBuilder builder;
    for (const Var& var : variables) builder.variable(var.index, {.name = var.name, .type = var.type});
    for (const List& list : lists) {
      if (list.last > list.first) continue;
      builder.object(list.first, od::ObjectCode::record, list.name);
      builder.sub(list.first, {.sub = 0, .name = "Number of entries", .type = DataType::unsigned8});
      for (std::size_t i = 0; i < std::size(list.subs); ++i) {
        if (list.subs[i].empty()) continue;
        builder.sub(list.first, {.sub = static_cast<std::uint8_t>(i + 1), .name = list.subs[i], .type = list.type});
      }
    }
    return builder.build();
  }();
  return *made;
}

}  // namespace berth::decode
