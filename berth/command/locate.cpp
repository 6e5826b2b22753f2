// locate: shows the user which physical device it is.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/command/arguments.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

struct Target {
  Network* network = nullptr;
  std::optional<Identity> device;
  NodeId id;            // if configured: ask this node for its identity
  std::string problem;  // why there is no target
};

std::optional<Identity> device_of(const Network& network, const std::string& slot) {
  const auto slots = network.report();
  const auto it = std::ranges::find(slots, slot, &SlotReport::name);
  return it == slots.end() ? std::nullopt : it->device;
}

// `word` is an LSS address, else a slot, else a node-ID.
Target target_of(Session& session, const std::string& bus, const std::string& word) {
  Target target;
  if (const auto address = parse_identity(word)) {
    const auto network = network_for(session, bus, Use::send);
    if (!network) return {nullptr, {}, {}, network.error()};
    return {*network, *address, {}, {}};
  }
  const auto slot = own_slot(session, bus, word, "the NMT master there controls LSS and NMT");
  if (slot) {
    const std::string& name = slot->name;
    target.network = slot->network;
    target.device = device_of(*target.network, name);
    const auto id = text::parse_ranges(word, 1, 127);
    if (!target.device && id && id->size() == 1) target.id = NodeId(static_cast<std::uint8_t>(id->front()));
    if (!target.device && !target.id.configured()) {
      return {
          nullptr,
          {},
          {},
          fmt::format("slot {} has no device; give the LSS address of the one that you look for", text::quoted(name))};
    }
    return target;
  }
  const auto id = text::parse_ranges(word, 1, 127);
  if (!id || id->size() != 1) return {nullptr, {}, {}, slot.error() + "; or give an LSS address or a node-ID"};
  const auto network = network_for(session, bus, Use::send);
  if (!network) return {nullptr, {}, {}, network.error()};
  return {*network, {}, NodeId(static_cast<std::uint8_t>(id->front())), {}};
}

}  // namespace

rt::Task<void> locate(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const std::string word = arguments.required("target");
  const std::uint32_t seconds = arguments.number("seconds", 1, 600, 10);
  const bool anyway = arguments.text("anyway") == "1";
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const std::string bus = arguments.text("bus");
  const Target target = target_of(session, bus, word);
  if (target.network == nullptr) co_return refuse(reply, 2, target.problem);
  Network& network = *target.network;
  const auto usable = network_for(session, network.bus().name, Use::send);
  if (!usable) co_return refuse(reply, 2, usable.error());
  const std::string where = fmt::format("bus {}, {}", network.bus().name, word);
  Identity device = target.device.value_or(Identity{});
  if (!target.device) {
    const auto who = co_await places::read_identity(network.services().sdo, target.id);
    if (!who) co_return fail_with(reply, who.error(), where);
    device = *who;
  }
  const rt::Duration time = std::chrono::seconds(seconds);
  const auto shown = co_await network.locate(device, time, anyway);
  if (!shown) {
    const bool runs = shown.error().code == Errc::invalid;
    co_return fail_with(reply, shown.error(), where,
                        runs ? "stop it first (`berth nmt preop`), or give --anyway: the device runs on" : "");
  }
  Json json;
  json["bus"] = network.bus().name;
  put_address(json, device);
  if (shown->id.configured()) {
    json["id"] = shown->id.value();
  } else {
    json["id"] = nullptr;
  }
  json["seconds"] = seconds;
  give(reply, json, {fmt::format("{} flickered both of its indicators for {} s", to_string(device), seconds)});
}

}  // namespace berth::command
