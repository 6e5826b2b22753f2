/// A primary host that counts which values of one machine have come: each value of a device once, however often.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "berth/mqtt/client.hpp"
#include "berth/sparkplug/payload.hpp"
#include "berth/sparkplug/topic.hpp"

namespace berth::bench {

class Ear final : private mqtt::Handler {
 public:
  static constexpr const char* host = "ear";  ///< its host ID
  /// `metric`: of each device, whose values are counted.
  Ear(const mqtt::Where& where, sparkplug::EdgeNodeId machine, std::string metric);
  Ear(const Ear&) = delete;
  Ear& operator=(const Ear&) = delete;

  struct Heard {
    std::size_t births = 0;       ///< of the machine
    std::size_t values = 0;       ///< different ones
    std::size_t messages = 0;     ///< with data of devices
    std::uint64_t bytes = 0;      ///< payloads of these
    std::uint64_t told_lost = 0;  ///< what the machine says that it could not keep
  };
  [[nodiscard]] Heard heard() const;

 private:
  std::optional<mqtt::Will> connecting() noexcept override;
  void connected(const mqtt::Connected& connected) noexcept override;
  void disconnected(const mqtt::Disconnected&) noexcept override {}
  void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept override;
  void published(mqtt::MessageId) noexcept override {}
  void unpublished(mqtt::MessageId, std::string_view) noexcept override {}
  [[nodiscard]] std::vector<std::uint8_t> state(bool online) const;
  void take(const sparkplug::Topic& topic, const sparkplug::Payload& payload);

  std::string metric_;
  mutable std::mutex mutex_;
  Heard heard_;
  std::uint64_t since_ = 0;                     // of this connection, UTC
  std::map<std::string, std::uint64_t> alias_;  // of the metric, by device
  std::set<std::pair<std::string, std::uint64_t>> values_;
  std::unique_ptr<mqtt::Thread> thread_;
  std::unique_ptr<mqtt::Client> client_;
};

}  // namespace berth::bench
