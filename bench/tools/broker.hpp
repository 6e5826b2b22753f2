/// Debian's Mosquitto as a bench starts it, and what it counts.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "bench/tools/child.hpp"
#include "berth/mqtt/client.hpp"

namespace berth::bench {

/// On a free port of 127.0.0.1, with nothing kept on the disk.
class Mosquitto {
 public:
  /// Empty: it is not installed. It is for administrators, whose folders others do not search.
  [[nodiscard]] static std::string program();
  /// `queue`: its max_queued_messages, for one client; 0: as many as there are. Ends this process if it does not start.
  explicit Mosquitto(unsigned queue);
  ~Mosquitto();
  Mosquitto(const Mosquitto&) = delete;
  Mosquitto& operator=(const Mosquitto&) = delete;

  void start();
  /// As a computer that loses its power.
  void kill();
  [[nodiscard]] mqtt::Where where() const { return {false, "127.0.0.1", port_}; }
  [[nodiscard]] const std::string& folder() const noexcept { return folder_; }
  [[nodiscard]] const Child& process() const noexcept { return *process_; }

 private:
  std::string folder_;
  std::uint16_t port_;
  std::unique_ptr<Child> process_;
};

/// Reads the broker's own counters ($SYS), which it publishes every second.
class Gauge final : private mqtt::Handler {
 public:
  explicit Gauge(const mqtt::Where& where);
  ~Gauge() = default;
  Gauge(const Gauge&) = delete;
  Gauge& operator=(const Gauge&) = delete;

  struct Reading {
    std::chrono::steady_clock::time_point at{};
    double packets_in = 0, packets_out = 0, bytes_in = 0, bytes_out = 0, dropped = 0;
  };
  /// The newest. What the gauge itself gets is not in it.
  [[nodiscard]] Reading read() const;

 private:
  std::optional<mqtt::Will> connecting() noexcept override { return std::nullopt; }
  void connected(const mqtt::Connected&) noexcept override {}
  void disconnected(const mqtt::Disconnected&) noexcept override {}
  void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept override;
  void published(mqtt::MessageId) noexcept override {}
  void unpublished(mqtt::MessageId, std::string_view) noexcept override {}

  mutable std::mutex mutex_;
  Reading reading_;
  double own_packets_ = 0, own_bytes_ = 0;
  std::unique_ptr<mqtt::Thread> thread_;
  std::unique_ptr<mqtt::Client> client_;
};

}  // namespace berth::bench
