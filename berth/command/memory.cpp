// store, restore: parameters in a device's non-volatile memory (1010h, 1011h).
#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>

#include "berth/co/sdo_client.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

/// CiA 301 §7.5.2.13 and .14: the signature written to the sub-index of a group.
struct Service {
  std::uint16_t index;
  std::array<std::uint8_t, 4> signature;
  const char* done;
};
constexpr Service saves{0x1010, {'s', 'a', 'v', 'e'}, "stored"};
constexpr Service loads{0x1011, {'l', 'o', 'a', 'd'}, "restored: in use after a reset (`berth nmt reset-node`)"};

// The sub-index of a group of parameters.
std::uint8_t group_of(Arguments& arguments) {
  const std::string word = arguments.text("group");
  if (word.empty() || word == "all") return 1;
  if (word == "communication") return 2;
  if (word == "application") return 3;
  const auto parsed = text::parse_ranges(word, 1, 127);
  if (parsed && parsed->size() == 1) return static_cast<std::uint8_t>(parsed->front());
  arguments.wrong(
      fmt::format("{} is not a group of parameters; use all, communication, application, or a sub-index from 4 to 127 "
                  "that the maker describes",
                  text::quoted(word)));
  return 1;
}

std::string group_name(std::uint8_t group) {
  switch (group) {
    case 1: return "all parameters";
    case 2: return "communication parameters";
    case 3: return "application parameters";
    default: return fmt::format("group {}", group);
  }
}

}  // namespace

rt::Task<void> device_memory(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const NodeArgument node = node_argument(arguments, session.machine());
  const std::uint8_t group = group_of(arguments);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = node_network(session, node, Place::beneath_too);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const Service& service = request.verb == "store" ? saves : loads;
  co::SdoOptions options = bus.services().sdo.options();
  options.timeout = bus.bus().timing.save_timeout;
  options.retries = 0;  // no answer for long: the device may be writing its memory, so the command is not repeated
  std::optional<co::NodeAccess> direct;
  co::SdoAccess& device = objects_of(session, bus, node, options, direct);
  const std::span<const std::uint8_t> signature(service.signature);
  const auto written = co_await device.write(service.index, group, signature);
  if (!written) {
    const char* const longer = node.gateways.empty()
                                   ? "a longer save_timeout in the machine file may help"
                                   : "is it on its bus? Its gateway waits only for its own SDO time-out";
    co_return fail_with(reply, written.error(), fmt::format("bus {}, {}", bus.bus().name, request.verb),
                        written.error().code == Errc::timeout ? longer : "", node.path());
  }
  Json json;
  json["bus"] = bus.bus().name;
  json["node"] = node.node.value();
  if (!node.gateways.empty()) json["path"] = node.text();
  json["index"] = hex(service.index, 4);
  json["sub"] = group;
  give(reply, json,
       {fmt::format("node {}  {}  {} {}", node.text(), od::write_object({service.index, group}), group_name(group),
                    service.done)});
}

}  // namespace berth::command
