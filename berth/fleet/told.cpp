#include "berth/fleet/told.hpp"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

namespace berth::fleet {
namespace {

bool same_emcy(const std::optional<operate::EmcyReport>& a, const std::optional<operate::EmcyReport>& b) noexcept {
  return a.has_value() == b.has_value() && (!a || (a->code == b->code && a->error_register == b->error_register));
}

}  // namespace

bool has_moved(const ToldValue& told, const SignalTable::State& now, const Signal& signal) noexcept {
  if (told.known != now.known) return true;
  if (signal.type == od::DataType::visible_string) return told.text != now.text;
  if (told.raw == now.raw) return false;
  const double distance = std::abs(signal.number(now.raw) - signal.number(told.raw));
  return !(distance < signal.wanted.deadband);  // NaN has moved
}

// When it was heard last, and since when it is so, no metric has: each heartbeat would be a change.
bool same(const operate::SlotReport& a, const operate::SlotReport& b) noexcept {
  return a.state == b.state && a.device == b.device && a.reason == b.reason && a.boot == b.boot && a.nmt == b.nmt &&
         same_emcy(a.emcy, b.emcy);
}

std::optional<std::vector<std::uint8_t>> bytes_in(const std::string& json) {
  const auto object = nlohmann::json::parse(json, nullptr, false);
  if (!object.is_object() || !object.contains("bytes") || !object["bytes"].is_string()) return std::nullopt;
  const auto& text = object["bytes"].get_ref<const std::string&>();
  std::vector<std::uint8_t> bytes;
  for (std::size_t at = 0; at < text.size(); at += 3) {
    std::uint8_t byte = 0;
    const char* const begin = text.data() + at;
    const char* const end = text.data() + std::min(at + 2, text.size());
    const auto [last, bad] = std::from_chars(begin, end, byte, 16);
    if (bad != std::errc{} || last != begin + 2) return std::nullopt;
    bytes.push_back(byte);
  }
  return bytes;
}

}  // namespace berth::fleet
