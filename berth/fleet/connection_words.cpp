#include "berth/fleet/connection_words.hpp"

namespace berth::fleet {

std::optional<std::string> ConnectionWords::connected(const std::string& where, Steady now) {
  connected_at_ = now;
  if (short_lives_ >= most_short_lives) return std::nullopt;
  return "connected to " + where;
}

// A broker that is away for a night is one line.
std::optional<std::string> ConnectionWords::lost(const mqtt::Disconnected& over, Steady now) {
  if (over.why == mqtt::Why::ended) return std::nullopt;
  if (over.was_connected) short_lives_ = now - connected_at_ >= short_life ? 0 : short_lives_ + 1;
  const bool known = over.was_connected ? short_lives_ > most_short_lives : told_ == over.words;
  if (known) return std::nullopt;
  told_ = over.words;
  std::string words = over.words + "; Berth tries again, and keeps what changes";
  const bool twice = over.why == mqtt::Why::taken_over || short_lives_ == most_short_lives;
  if (twice) words += "; perhaps this machine runs twice: give one of them another node = in [mqtt]";
  return words;
}

}  // namespace berth::fleet
