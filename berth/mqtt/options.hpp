/// What a client is to do, and its bounds.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/mqtt/backoff.hpp"
#include "berth/mqtt/where.hpp"

namespace berth::mqtt {

enum class Version : std::uint8_t {
  v5,        ///< MQTT 5.0
  v3_1_1,    ///< MQTT 3.1.1
  automatic  ///< 5; then 3.1.1 if the broker refuses 5, or ends the connection without an answer
};

/// Quality of service (MQTT 5.0 §4.3). 2 is not offered.
enum class Qos : std::uint8_t { at_most_once = 0, at_least_once = 1 };

/// Files in PEM. They are read again before a connection when they have changed.
struct TlsFiles {
  std::string authorities{};  ///< certificates of the CAs that are trusted; empty: those of the system
  std::string certificate{};  ///< of this client, with its chain; empty: none
  std::string key{};          ///< of `certificate`, without a passphrase; not readable for all users
  friend bool operator==(const TlsFiles&, const TlsFiles&) = default;
};

struct Limits {
  /// Bytes of an incoming packet. By MQTT 5 the broker is told (Maximum Packet Size, §3.1.2.11.4) and sends none that
  /// are larger; by 3.1.1 a larger message is dropped and counted.
  std::size_t incoming = std::size_t{256} << 10U;
  /// Messages and bytes (topic and payload) that wait to be sent or acknowledged. Messages that `may` be sent get three
  /// quarters of it.
  std::size_t outgoing_messages = 1024;
  std::size_t outgoing_bytes = std::size_t{1} << 20U;
  std::size_t subscriptions = 64;
  unsigned unacknowledged = 16;  ///< QoS 1 messages on their way at once, 1 to 20; fewer if the broker says so
};

struct Options {
  Where where{};
  std::string client_id{};  ///< 1 to 65535 bytes; one that no other client of the broker has
  Version version = Version::automatic;
  std::string login_file{};                   ///< see login.hpp; read again before each connection; empty: no user
  TlsFiles tls{};                             ///< for mqtts://
  std::vector<std::string> subscriptions{};   ///< topic filters (MQTT 5.0 §4.7); made before `Handler::connected`
  Qos subscription_qos = Qos::at_least_once;  ///< at most, of messages from the broker
  std::chrono::seconds keep_alive{30};        ///< 5 to 65535: a dead connection is noticed within twice this time
  Milliseconds answer_within{10'000};         ///< for the whole way to a connection, subscriptions included
  Milliseconds farewell{2'000};               ///< for what is still to be sent when the client ends
  Pauses pauses{};
  Limits limits{};
};

/// What is wrong with the options, in words; empty: nothing.
[[nodiscard]] std::string complaint(const Options& options);

}  // namespace berth::mqtt
