#include "berth/multilevel/emcy_layout.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"

namespace berth::multilevel {
namespace {

constexpr std::size_t exit_at = 3, port_at = 1, signal_at = 2;

bool is_node_id(std::uint8_t byte) noexcept { return byte >= 1 && byte <= 127; }

}  // namespace

std::string_view name(EmcyLayout layout) noexcept {
  switch (layout) {
    case EmcyLayout::source: return "figure 7";
    case EmcyLayout::source_and_exit: return "figure 8";
    default: return "figure 9";
  }
}

EmcyReading read_emcy(EmcyLayout layout, NodeId heard_from, const co::Emcy& message) {
  EmcyReading reading{.path = {heard_from}, .code = message.code, .error_register = message.error_register};
  const auto info = std::span(message.info);
  bool ended = false;
  for (const std::uint8_t byte : info.first(sub_nets(layout))) {
    if (byte == 0) {
      ended = true;
    } else if (ended || !is_node_id(byte)) {
      reading.garbled = true;
      break;
    } else {
      reading.path.push_back(NodeId(byte));
    }
  }
  if (has_exit(layout)) reading.exiting = load_le<std::uint16_t>(message.info.data() + exit_at);
  if (layout == EmcyLayout::complete) {
    reading.port = message.info[port_at];
    reading.signal = message.info[signal_at];
  }
  return reading;
}

std::string path_text(const std::vector<NodeId>& path) {
  std::string text;
  for (const NodeId node : path) text += (text.empty() ? "" : "/") + std::to_string(node.value());
  return text;
}

std::array<std::uint8_t, 5> emcy_info(EmcyLayout layout, const EmcyDetails& details) noexcept {
  std::array<std::uint8_t, 5> info{};
  if (has_exit(layout)) store_le(info.data() + exit_at, details.exiting);
  if (layout == EmcyLayout::complete) {
    info[port_at] = details.port;
    info[signal_at] = details.signal;
  }
  return info;
}

bool insert_sub_net(EmcyLayout layout, co::Emcy& message, NodeId node) noexcept {
  const auto count = static_cast<std::ptrdiff_t>(sub_nets(layout));
  const auto first = message.info.begin();
  const bool fits = *(first + count - 1) == 0;
  std::copy_backward(first, first + count - 1, first + count);
  *first = node.value();
  return fits;
}

co::Emcy routed(const co::Emcy& message, NodeId node, std::uint16_t network, std::uint8_t own_register) noexcept {
  co::Emcy made{.code = routed_code, .error_register = own_register, .info = message.info};
  if (message.code == routed_code) return made;
  store_le(made.info.data(), network);
  made.info[2] = node.value();
  store_le(made.info.data() + 3, message.code);
  return made;
}

std::optional<RoutedOrigin> read_routed(const co::Emcy& message) noexcept {
  if (message.code != routed_code) return std::nullopt;
  return RoutedOrigin{load_le<std::uint16_t>(message.info.data()), message.info[2],
                      load_le<std::uint16_t>(message.info.data() + 3)};
}

const char* gateway_code_text(std::uint16_t code) noexcept {
  switch (code) {
    case gateway_code::mandatory_bus_failed: return "a mandatory bus beneath has not booted";
    case gateway_code::optional_bus_failed: return "a bus beneath has booted in part";
    case gateway_code::emcy_lost: return "emergencies from beneath were lost: too many at once";
    case gateway_code::too_deep: return "an emergency from a level that its layout cannot show";
    case gateway_code::signal_late: return "a signal was handed on too late";
    case gateway_code::route_wrong: return "a row of the routing objects is wrong, and left out";
    default: return nullptr;
  }
}

}  // namespace berth::multilevel
