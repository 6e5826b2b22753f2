/// Messages that come before `Handler::connected` can be told: a broker may send what it has retained before it answers
/// the subscription (MQTT 5.0 §3.8.4). Internal to room `mqtt`.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace berth::mqtt {

class Handler;

class Early {
 public:
  /// `most`: bytes of topics and payloads.
  explicit Early(std::size_t most) noexcept : most_(most) {}
  /// False: there is no room for it.
  [[nodiscard]] bool keep(std::string_view topic, std::span<const std::uint8_t> payload, bool retained);
  /// Tells all of them, in their order, and keeps none.
  void tell(Handler& handler) noexcept;
  void clear() noexcept;

 private:
  struct Kept {
    std::string topic;
    std::vector<std::uint8_t> payload;
    bool retained;
  };
  std::size_t most_;
  std::size_t bytes_ = 0;
  std::vector<Kept> all_;
};

}  // namespace berth::mqtt
