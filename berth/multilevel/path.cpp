#include "berth/multilevel/path.hpp"

#include <charconv>

namespace berth::multilevel {
namespace {

std::optional<unsigned> number(std::string_view text) {
  unsigned value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<NodeId> node_id(std::string_view text) {
  const auto value = number(text);
  if (!value || *value < 1 || *value > 127) return std::nullopt;
  return NodeId(static_cast<std::uint8_t>(*value));
}

std::optional<Hop> hop(std::string_view text) {
  Hop made;
  const auto dot = text.find('.');
  if (dot != std::string_view::npos) {
    const auto port = number(text.substr(dot + 1));
    if (!port || *port < 1 || *port > most_ports) return std::nullopt;
    made.port = static_cast<std::uint8_t>(*port);
  }
  const auto gateway = node_id(text.substr(0, dot));
  if (!gateway) return std::nullopt;
  made.gateway = *gateway;
  return made;
}

}  // namespace

std::optional<Path> parse_path(std::string_view text) {
  Path path;
  for (auto slash = text.find('/'); slash != std::string_view::npos; slash = text.find('/')) {
    const auto next = hop(text.substr(0, slash));
    if (!next) return std::nullopt;
    path.gateways.push_back(*next);
    text.remove_prefix(slash + 1);
  }
  const auto node = node_id(text);
  if (!node) return std::nullopt;
  path.node = *node;
  return path;
}

std::string to_string(const Hop& hop) {
  const auto gateway = std::to_string(hop.gateway.value());
  return hop.port == 1 ? gateway : gateway + "." + std::to_string(hop.port);
}

std::string to_string(const Path& path) {
  std::string text;
  for (const auto& each : path.gateways) text += to_string(each) + "/";
  return text + std::to_string(path.node.value());
}

}  // namespace berth::multilevel
