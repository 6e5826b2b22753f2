#include "berth/multilevel/carried.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/co/sdo.hpp"
#include "berth/multilevel/objects.hpp"

namespace berth::multilevel {
namespace {

constexpr std::uint32_t emcy_base = 0x80, answer_base = 0x580, request_base = 0x600;

using co::sdo::Ccs;

Ccs specifier_of(std::uint8_t first) noexcept { return static_cast<Ccs>(co::sdo::specifier(first)); }

constexpr std::uint8_t aborted = 0x80;  // no segment of a block has this: its number would be 0
constexpr std::uint8_t end_of_blocks = 0xC1, end_mask = 0xE3;

// The node of a base frame with a default identifier; empty: another frame.
std::optional<NodeId> node_of(const can::Frame& frame, std::uint32_t base) noexcept {
  if (frame.extended || frame.remote || frame.id <= base || frame.id > base + 127) return std::nullopt;
  return NodeId(static_cast<std::uint8_t>(frame.id - base));
}

}  // namespace

std::optional<Path> Carried::about(const can::Frame& frame) {
  if (node_of(frame, emcy_base)) return emergency(frame);
  const auto client = node_of(frame, request_base);
  const auto node = client ? client : node_of(frame, answer_base);
  if (!node || !gateways_.test(node->value()) || frame.size != 8) return std::nullopt;
  Channel& channel = channels_[*node];
  if (frame.data[0] == aborted) channel.in_blocks = false;
  if (client) request(*client, channel, frame);
  return channel.now;
}

std::optional<Path> Carried::emergency(const can::Frame& frame) const {
  const auto node = node_of(frame, emcy_base);
  if (frame.size != 8 || !gateways_.test(node->value())) return std::nullopt;
  co::Emcy message{.code = load_le<std::uint16_t>(frame.data.data()), .error_register = frame.data[2]};
  std::copy_n(frame.data.begin() + 3, message.info.size(), message.info.begin());
  const auto reading = read_emcy(layout_, *node, message);
  if (reading.garbled || reading.path.size() < 2) return std::nullopt;
  Path path;
  for (const NodeId each : reading.path) path.gateways.push_back({each});
  path.gateways.pop_back();
  path.node = reading.path.back();
  return path;
}

void Carried::request(NodeId node, Channel& channel, const can::Frame& frame) {
  const std::uint8_t first = frame.data[0];
  const Path at{.node = node};
  if (channel.in_blocks) {
    channel.in_blocks = (first & end_mask) != end_of_blocks;
    return;
  }
  switch (specifier_of(first)) {
    case Ccs::download: begin_download(node, channel, frame); break;
    case Ccs::download_segment: segment(node, channel, frame); break;
    case Ccs::upload: channel.now = access(channel.gateway, at, co::sdo::multiplexer(frame), std::nullopt); break;
    case Ccs::block_upload:
      if ((first & 3U) == 0) channel.now = access(channel.gateway, at, co::sdo::multiplexer(frame), std::nullopt);
      break;
    case Ccs::block_download:
      if ((first & 1U) != 0) break;
      channel.now = access(channel.gateway, at, co::sdo::multiplexer(frame), std::span<const std::uint8_t>());
      channel.in_blocks = true;
      break;
    default: break;
  }
}

void Carried::begin_download(NodeId node, Channel& channel, const can::Frame& frame) {
  const std::uint8_t first = frame.data[0];
  const bool expedited = (first & 2U) != 0, sized = (first & 1U) != 0;
  const std::size_t bytes = !expedited ? 0 : sized ? 4U - (first >> 2U & 3U) : 4U;
  channel.object = co::sdo::multiplexer(frame);
  channel.bytes = 0;
  channel.now = access(channel.gateway, {.node = node}, channel.object, std::span(frame.data).subspan(4, bytes));
}

// Short values may be sent this way too. Repeated segments are not distinguished: a value of four bytes has one.
void Carried::segment(NodeId node, Channel& channel, const can::Frame& frame) {
  const std::uint8_t first = frame.data[0];
  const std::size_t bytes = co::sdo::segment_bytes - (first >> 1U & 7U);
  for (std::size_t i = 0; i < bytes && channel.bytes + i < channel.data.size(); ++i)
    channel.data[channel.bytes + i] = frame.data[1 + i];
  channel.bytes = std::min(channel.bytes + bytes, channel.data.size() + 1);
  const bool last = (first & 1U) != 0;
  if (!last || channel.bytes > channel.data.size()) return;
  const auto value = std::span<const std::uint8_t>(channel.data).first(channel.bytes);
  const auto path = access(channel.gateway, {.node = node}, channel.object, value);
  if (path) channel.now = path;
}

// `at` is the gateway's own node. Empty: the object is none of the three.
std::optional<Path> Carried::access(Gateway& gateway, const Path& at, ObjectRef object, Data data) {
  if (!SdoGatewayObjects::contain(object)) return std::nullopt;
  const unsigned offset = object.index - SdoGatewayObjects::first_index;
  const auto number = static_cast<std::uint8_t>(1 + offset / 4);
  Port& port = gateway.ports[number - 1U];
  Path below = at;
  below.gateways.push_back({at.node, number});
  const auto objects = SdoGatewayObjects::of(number);
  if (object.index == objects.node.index && data && data->size() == 1) {
    port.node = NodeId::make((*data)[0]).value_or(NodeId());
    port.last.reset();
  }
  if (!port.node.configured()) return std::nullopt;
  below.node = port.node;
  if (object.index == objects.data.index) {
    if (data) {
      port.bytes = std::min(data->size(), port.data.size());
      std::copy_n(data->begin(), port.bytes, port.data.begin());
    }
    return port.last ? port.last : below;
  }
  if (object.index == objects.command.index && data && data->size() == 4) {
    port.last = command(port, below, *data);
    return port.last;
  }
  return below;
}

// The command goes to a node beneath, which may be a gateway.
std::optional<Path> Carried::command(Port& port, const Path& at, std::span<const std::uint8_t> value) {
  const ObjectRef object{load_le<std::uint16_t>(value.data() + 1), value[3]};
  if (!SdoGatewayObjects::contain(object)) return at;
  auto& deeper = port.beneath[at.node];
  if (deeper == nullptr) {
    if (levels_ == most_levels) return at;
    ++levels_;
    deeper = std::make_unique<Gateway>();
  }
  const Ccs specifier = specifier_of(value[0]);
  const bool reads = specifier == Ccs::upload || specifier == Ccs::block_upload;
  const Data data = reads ? Data() : Data(std::span(port.data).first(port.bytes));
  const auto path = access(*deeper, at, object, data);
  return path ? path : at;
}

}  // namespace berth::multilevel
