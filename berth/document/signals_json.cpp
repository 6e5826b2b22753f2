#include "berth/document/signals_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "berth/can/frame.hpp"
#include "berth/document/bus_signals.hpp"
#include "berth/od/notation.hpp"

namespace berth::document {
namespace {

using Json = nlohmann::ordered_json;

const char* type_of(const Signal& signal) noexcept {
  if (signal.type == od::DataType::boolean) return "boolean";
  if (od::is_real(signal.type)) return "real";
  return od::is_signed(signal.type) ? "signed" : "unsigned";
}

Json json_of(const Signal& signal) {
  Json json{{"name", signal.name}, {"at", signal.at}, {"bits", signal.bits}, {"type", type_of(signal)}};
  if (signal.object.index != 0) json["object"] = od::write_object(signal.object);
  const od::Meaning& meaning = signal.meaning;
  if (!meaning.unit.empty()) json["unit"] = meaning.unit;
  if (meaning.number != 1 || meaning.exponent != 0)
    json["factor"] = static_cast<double>(meaning.number) * std::pow(10.0, meaning.exponent);
  if (!meaning.values.empty()) {
    for (const auto& value : meaning.values) json["values"].push_back({{"raw", value.raw}, {"name", value.name}});
  }
  return json;
}

Json json_of(const Message& message) {
  Json json{{"id", message.key & can::extended_mask},
            {"ext", (message.key & can::extended_flag) != 0},
            {"name", message.name},
            {"sender", message.sender},
            {"signals", Json::array()}};
  for (const auto& signal : message.signals) json["signals"].push_back(json_of(signal));
  return json;
}

}  // namespace

std::string signals_json(const design::Machine& machine, const traffic::LinkPlan* links) {
  const auto slots = configured_slots(machine, links);
  Json buses = Json::array();
  for (const auto* const bus : machine.all_buses()) {
    Json messages = Json::array();
    for (const auto& message : signals_of(*bus, slots).messages) {
      if (!message.signals.empty()) messages.push_back(json_of(message));
    }
    buses.push_back({{"bus", bus->name}, {"messages", std::move(messages)}});
  }
  return Json{{"buses", std::move(buses)}}.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace berth::document
