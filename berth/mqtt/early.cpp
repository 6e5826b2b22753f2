#include "berth/mqtt/early.hpp"

#include <utility>

#include "berth/mqtt/client.hpp"

namespace berth::mqtt {

bool Early::keep(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) {
  const std::size_t size = topic.size() + payload.size();
  if (size > most_ - bytes_) return false;
  bytes_ += size;
  all_.push_back({std::string(topic), {payload.begin(), payload.end()}, retained});
  return true;
}

void Early::tell(Handler& handler) noexcept {
  for (const Kept& kept : std::exchange(all_, {})) handler.message(kept.topic, kept.payload, kept.retained);
  bytes_ = 0;
}

void Early::clear() noexcept {
  all_.clear();
  bytes_ = 0;
}

}  // namespace berth::mqtt
