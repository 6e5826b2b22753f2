// sdo probe: reads many objects of one device, one after the other, to compare the device with its description. A
// refusal by the device is an answer like any other.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/patience.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/od/data_type.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

constexpr std::size_t most_objects = 1U << 18U;

struct ProbeArguments {
  NodeArgument node;
  std::vector<ObjectRef> objects;
};

std::optional<std::uint32_t> hex_number(std::string_view text, std::uint32_t most) {
  const auto parsed = od::parse_number(fmt::format("0x{}", text));
  if (!parsed || parsed->node_id || parsed->negative || parsed->magnitude > most) return std::nullopt;
  return static_cast<std::uint32_t>(parsed->magnitude);
}

// "1000:0,1018:0-4": index and sub-indices in hex.
void read_objects(Arguments& arguments, const std::string& text, std::vector<ObjectRef>& into) {
  std::string_view rest = text;
  while (!rest.empty()) {
    const auto comma = rest.find(',');
    const std::string_view item = rest.substr(0, comma);
    rest = comma == std::string_view::npos ? std::string_view{} : rest.substr(comma + 1);
    const auto colon = item.find(':');
    const std::string_view subs = colon == std::string_view::npos ? std::string_view("0") : item.substr(colon + 1);
    const auto dash = subs.find('-');
    const auto index = hex_number(item.substr(0, colon), 0xFFFF);
    const auto first = hex_number(subs.substr(0, dash), 0xFF);
    const auto last = dash == std::string_view::npos ? first : hex_number(subs.substr(dash + 1), 0xFF);
    if (!index || !first || !last || *first > *last) {
      return arguments.wrong(fmt::format("objects: {} is not like 1018:0-4, in hex", text::quoted(item.substr(0, 30))));
    }
    if (into.size() + *last - *first >= most_objects) return arguments.wrong("objects: too many");
    for (std::uint32_t sub = *first; sub <= *last; ++sub) {
      into.push_back({static_cast<std::uint16_t>(*index), static_cast<std::uint8_t>(sub)});
    }
  }
}

ProbeArguments probe_arguments(Arguments& arguments, const design::Machine& machine) {
  ProbeArguments probe;
  probe.node = node_argument(arguments, machine);
  read_objects(arguments, arguments.required("objects"), probe.objects);
  return probe;
}

Json json_of(ObjectRef ref, const Result<co::SdoValue>& answer) {
  Json json;
  json["index"] = hex(ref.index, 4);
  json["sub"] = ref.sub;
  if (answer) {
    std::string bytes;
    for (const std::uint8_t byte : answer->bytes()) bytes += fmt::format("{:02X}", byte);
    json["bytes"] = bytes;
  } else if (answer.error().code == Errc::aborted) {
    json["abort_code"] = hex(answer.error().detail);
  } else {
    json["failure"] = answer.error().text;
  }
  return json;
}

}  // namespace

rt::Task<void> sdo_probe(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const ProbeArguments probe = probe_arguments(arguments, session.machine());
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = node_network(session, probe.node, Place::beneath_too);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const NodeId node = probe.node.node;
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = bus.services().sdo.options();
  co::SdoAccess& device = objects_of(session, bus, probe.node, how, direct);
  Json json;
  json["bus"] = bus.bus().name;
  json["node"] = node.value();
  json["objects"] = Json::array();
  std::size_t read = 0;
  Patience patience;
  for (const ObjectRef ref : probe.objects) {
    const auto answer = co_await device.read(ref.index, ref.sub);
    if (patience.over(answer)) co_return fail_silent(reply, answer.error(), bus, probe.node);
    if (answer) ++read;
    json["objects"].push_back(json_of(ref, answer));
  }
  give(reply, json,
       {fmt::format("node {}: {} of {} read", node.value(), read, counted(probe.objects.size(), "object"))});
}

}  // namespace berth::command
