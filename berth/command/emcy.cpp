// emcy: a device's errors in words: the present ones (1001h), earlier ones (1003h), and EMCY messages as they arrive.
#include "berth/co/emcy.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/command/values.hpp"
#include "berth/decode/emcy_words.hpp"

namespace berth::command {
namespace {

std::uint32_t number(const co::SdoValue& value) {
  std::uint32_t number = 0;
  const auto bytes = value.bytes();
  for (std::size_t i = std::min<std::size_t>(bytes.size(), 4); i-- > 0;) number = number << 8U | bytes[i];
  return number;
}

struct HistoryReply {
  Json history = Json::array();
  std::vector<std::string> lines{};
};

// Sub-index 0 is the number of entries, sub-index 1 the newest entry (CiA 301 §7.5.2.4).
rt::Task<Result<void>> read_history(co::SdoAccess& node, std::uint16_t profile, HistoryReply& told) {
  const auto count = co_await node.read(0x1003, 0);
  if (!count) co_return tl::unexpected(count.error());
  const std::uint32_t entries = number(*count) & 0xFFU;
  for (std::uint32_t sub = 1; sub <= entries; ++sub) {
    const auto entry = co_await node.read(0x1003, static_cast<std::uint8_t>(sub));
    if (!entry) co_return tl::unexpected(entry.error());
    const std::uint32_t raw = number(*entry);
    const auto code = static_cast<std::uint16_t>(raw);
    const char* const text = decode::emcy_words(code, profile);
    told.history.push_back(
        {{"sub", sub}, {"code", hex(code, 4)}, {"text", text}, {"manufacturer", hex(raw >> 16U, 4)}});
    told.lines.push_back(
        fmt::format("  1003h:{:02X}  {:04X}h  {} (manufacturer: {:04X}h)", sub, code, text, raw >> 16U));
  }
  co_return Result<void>{};
}

/// Collects the EMCY messages of a bus, or of one of its nodes, as they arrive.
class Ear final : private co::EmcyConsumer::Observer {
 public:
  Ear(Network& bus, NodeId only, std::uint16_t profile)
      : only_(only), profile_(profile), consumer_(bus.services().dispatcher, *this) {
    consumer_.hear_all();
  }
  [[nodiscard]] const Json& heard() const noexcept { return heard_; }
  [[nodiscard]] const std::vector<std::string>& lines() const noexcept { return lines_; }

 private:
  void emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept override {
    constexpr std::size_t most = 10'000;
    if ((only_.configured() && node != only_) || heard_.size() >= most) return;
    Json json;
    json["at_s"] = operate::seconds(at);
    json["node"] = node.value();
    json["code"] = hex(message.code, 4);
    const char* const text = decode::emcy_words(message.code, profile_);
    json["text"] = text;
    json["register"] = hex(message.error_register, 2);
    json["info"] = hex_bytes(message.info);
    heard_.push_back(std::move(json));
    lines_.push_back(fmt::format("{:9.3f} s  node {}  {:04X}h  {}; register: {}; info {}", operate::seconds(at),
                                 node.value(), message.code, text, decode::register_words(message.error_register),
                                 hex_bytes(message.info)));
  }
  NodeId only_;
  std::uint16_t profile_;
  Json heard_ = Json::array();
  std::vector<std::string> lines_;
  co::EmcyConsumer consumer_;
};

// The device profile is the lower word of 1000h (CiA 301 §7.5.2.1); 0: none, or it cannot be read.
rt::Task<std::uint16_t> profile_of(co::SdoAccess& node) {
  const auto type = co_await node.read(0x1000, 0);
  co_return type ? static_cast<std::uint16_t>(number(*type)) : std::uint16_t{0};
}

rt::Task<void> listen(Session& session, const NodeArgument& node, std::uint32_t seconds, Reply& reply) {
  const auto network = network_for(session, node.bus, Use::look);
  if (!network) co_return refuse(reply, 2, network.error());
  if (!node.gateways.empty()) {
    co_return refuse(reply, 2,
                     fmt::format("node {} is not heard on bus {}: its gateway {} sends its emergencies there, with the "
                                 "path in them",
                                 node.text(), (*network)->bus().name, node.gateways.front().gateway.value()),
                     fmt::format("listen to node {}", node.gateways.front().gateway.value()));
  }
  std::uint16_t profile = 0;
  if (node.node.configured() && network_for(session, node.bus, Use::send)) {
    co::NodeAccess device((*network)->services().sdo, node.node);
    profile = co_await profile_of(device);
  }
  const Ear ear(**network, node.node, profile);
  co_await rt::sleep_for(std::chrono::seconds(seconds));
  Json json;
  json["bus"] = (*network)->bus().name;
  json["listened_s"] = seconds;
  json["messages"] = ear.heard();
  auto lines = ear.lines();
  lines.push_back(fmt::format("{} in {} s", counted(ear.heard().size(), "emergency message"), seconds));
  give(reply, json, std::move(lines));
}

}  // namespace

rt::Task<void> emcy(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const bool listens = arguments.has("listen");
  const std::uint32_t seconds = arguments.number("listen", 1, 86'400, 1);
  const bool any = listens && !arguments.has("node");
  const NodeArgument node =
      any ? NodeArgument{arguments.text("bus"), NodeId(), nullptr} : node_argument(arguments, session.machine());
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  if (listens) co_return co_await listen(session, node, seconds, reply);
  const auto network = node_network(session, node, Place::beneath_too);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const std::string where = fmt::format("bus {}, SDO read", bus.bus().name);
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = bus.services().sdo.options();
  co::SdoAccess& device = objects_of(session, bus, node, how, direct);
  const auto state = co_await device.read(0x1001, 0);
  if (!state) co_return fail_with(reply, state.error(), where, "`berth scan` shows which devices answer", node.path());
  const auto bits = static_cast<std::uint8_t>(number(*state));
  const std::uint16_t profile = co_await profile_of(device);
  HistoryReply told;
  const auto read = co_await read_history(device, profile, told);
  // 1003h is optional (CiA 301 §7.5.2.4); a device without it has no history.
  const bool none = !read && read.error().code == Errc::aborted;
  if (!read && !none) co_return fail_with(reply, read.error(), where, "", node.path());
  Json json;
  json["bus"] = bus.bus().name;
  json["node"] = node.node.value();
  if (!node.gateways.empty()) json["path"] = node.text();
  json["profile"] = profile;
  json["register"] = hex(bits, 2);
  json["text"] = decode::register_words(bits);
  json["history"] = none ? Json() : told.history;
  std::vector<std::string> lines{fmt::format("node {}  1001h:00  {:02X}h  {}{}", node.text(), bits,
                                             decode::register_words(bits),
                                             profile == 0 ? "" : fmt::format("  (device profile CiA {})", profile))};
  lines.insert(lines.end(), told.lines.begin(), told.lines.end());
  if (told.lines.empty()) lines.push_back(none ? "  it keeps no history (1003h)" : "  its history (1003h) is empty");
  give(reply, json, std::move(lines));
}

}  // namespace berth::command
