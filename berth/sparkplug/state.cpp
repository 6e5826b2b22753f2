#include "berth/sparkplug/state.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

namespace berth::sparkplug {
namespace {

constexpr std::size_t longest_state = 4096;
constexpr double latest_ms = 9.0e15;  // whole numbers are exact in a double up to here

/// Milliseconds; some hosts' JSON writers make a floating-point number of them.
std::optional<std::uint64_t> milliseconds(const nlohmann::json& number) {
  if (number.is_number_unsigned()) return number.get<std::uint64_t>();
  if (!number.is_number_float()) return std::nullopt;
  const auto value = number.get<double>();
  if (!(value >= 0) || value > latest_ms || std::trunc(value) != value) return std::nullopt;
  return static_cast<std::uint64_t>(value);
}

}  // namespace

Bytes encode_state(const HostState& state) {
  const auto text = std::string(R"({"online":)") + (state.online ? "true" : "false") + R"(,"timestamp":)" +
                    std::to_string(state.at.ms) + "}";
  return {text.begin(), text.end()};
}

Result<HostState> decode_state(std::span<const std::uint8_t> bytes) {
  if (bytes.size() > longest_state) return fail(Errc::invalid, "the STATE message is longer than is read");
  const auto json = nlohmann::json::parse(bytes.begin(), bytes.end(), nullptr, false);
  if (!json.is_object()) return fail(Errc::invalid, "the STATE message is no JSON object");
  const auto online = json.find("online");
  if (online == json.end() || !online->is_boolean()) {
    return fail(Errc::invalid, "the STATE message has no boolean \"online\"");
  }
  const auto timestamp = json.find("timestamp");
  const auto at = timestamp == json.end() ? std::nullopt : milliseconds(*timestamp);
  if (!at) return fail(Errc::invalid, "the STATE message has no \"timestamp\" of whole milliseconds");
  return HostState{online->get<bool>(), Utc{*at}};
}

PrimaryHost::Heard PrimaryHost::take(const HostState& state) noexcept {
  if (last_ && state.at < *last_) return Heard::older;
  last_ = state.at;
  online_ = state.online;
  return state.online ? Heard::online : Heard::offline;
}

}  // namespace berth::sparkplug
