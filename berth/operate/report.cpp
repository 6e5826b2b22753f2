#include "berth/operate/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace berth::operate {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const SlotReport& s) {
  Json j;
  j["bus"] = s.bus;
  j["id"] = s.id.value();
  j["name"] = s.name;
  j["type"] = fmt::format("0x{:08X}{:08X}", s.type.vendor, s.type.product);
  if (s.device) {
    j["r_sn"] = fmt::format("0x{:016X}", s.device->r_sn().value());
  } else {
    j["r_sn"] = nullptr;
  }
  j["state"] = places::name(s.state);
  j["since_s"] = seconds(s.since);
  if (!s.reason.empty()) j["reason"] = s.reason;
  return j;
}

Json json_of(const Event& e) {
  Json j;
  j["at_s"] = seconds(e.at);
  j["bus"] = e.bus;
  j["kind"] = e.kind;
  if (!e.slot.empty()) j["slot"] = e.slot;
  j["text"] = e.text;
  if (!e.slots.empty()) j["slots"] = e.slots;
  if (!e.devices.empty()) j["devices"] = e.devices;
  return j;
}

// Text from files and devices may hold bytes that are not UTF-8; they are replaced, never thrown over.
std::string dump(const Json& j, int indent) { return j.dump(indent, ' ', false, Json::error_handler_t::replace); }

}  // namespace

double seconds(rt::Time at) noexcept { return static_cast<double>(at.time_since_epoch().count()) / 1e9; }

std::string to_json(const Report& report, int indent) {
  Json j;
  j["slots"] = Json::array();
  for (const auto& s : report.slots) j["slots"].push_back(json_of(s));
  j["bus_time_s"] = Json::object();
  for (const auto& [bus, time] : report.bus_time_s) j["bus_time_s"][bus] = time;
  j["events"] = Json::array();
  for (const auto& e : report.events) j["events"].push_back(json_of(e));
  for (const auto& q : report.questions) j["questions"].push_back(json_of(q));
  return dump(j, indent);
}

std::string to_json(const Event& event) { return dump(json_of(event), -1); }
std::string to_json(const SlotReport& slot) { return dump(json_of(slot), -1); }

std::string to_line(const Event& e) {
  return fmt::format("{:9.3f} s  {}  {}{}", seconds(e.at), e.bus, e.slot.empty() ? "" : e.slot + ": ", e.text);
}

std::vector<std::string> to_table(const std::vector<SlotReport>& slots) {
  std::size_t bus = 3;
  std::size_t name = 4;
  std::size_t state = 11;  // with short names a row, but for its reason, fits a terminal of 80 columns
  for (const auto& s : slots) {
    bus = std::max(bus, s.bus.size());
    name = std::max(name, s.name.size());
    state = std::max(state, std::string_view(places::name(s.state)).size());
  }
  std::vector<std::string> lines;
  lines.push_back(fmt::format("{:<{}}  {:>3}  {:<{}}  {:<17}  {:<16}  {:<{}}  {:>9}", "bus", bus, "id", "slot", name,
                              "type", "R_SN", "state", state, "since"));
  for (const auto& s : slots) {
    lines.push_back(
        fmt::format("{:<{}}  {:>3}  {:<{}}  {:<17}  {:<16}  {:<{}}  {:>7.3f} s{}", s.bus, bus, s.id.value(), s.name,
                    name, to_string(s.type), s.device ? fmt::format("{:016X}", s.device->r_sn().value()) : "-",
                    places::name(s.state), state, seconds(s.since), s.reason.empty() ? "" : "  " + s.reason));
  }
  return lines;
}

}  // namespace berth::operate
