// One connection to a broker, from its first packet to its last: a libmosquitto client that is made for it and goes
// with it, so that nothing of an old session is sent on a new one. Internal to room `mqtt`; used by one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/mqtt/cause.hpp"
#include "berth/mqtt/client.hpp"
#include "berth/mqtt/login.hpp"
#include "berth/mqtt/message.hpp"
#include "berth/mqtt/tls.hpp"

// libmosquitto's.
struct mosquitto;
struct mqtt5__property;

namespace berth::mqtt {

/// What the broker grants in its CONNACK.
struct Granted {
  bool session_present = false;
  std::uint32_t largest_packet = 0;       ///< bytes; 0: no limit
  std::uint16_t unacknowledged = 65'535;  ///< Receive Maximum
};

/// Told within `Connection::ready`, `publish` and `tick`; must not call the connection then.
class Ear {
 public:
  virtual void granted(const Granted& granted) noexcept = 0;
  /// One code for each subscription: 0 and 1 are QoS, from 128 on it was refused.
  virtual void subscribed(std::span<const int> codes) noexcept = 0;
  virtual void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept = 0;
  /// QoS 0: it was handed to the system. QoS 1: the broker has answered; `code` as in MQTT 5.0 §3.4.2.1.
  virtual void out(int packet, unsigned code) noexcept = 0;

 protected:
  ~Ear() = default;
};

class Connection {
 public:
  struct Plan {
    const Options& options;
    Version version;  ///< not `automatic`
    const std::optional<Will>& will;
    const Login& login;
    std::string address;       ///< of the host
    std::shared_ptr<Tls> tls;  ///< null: without
  };
  /// Begins to connect.
  [[nodiscard]] static tl::expected<std::unique_ptr<Connection>, Cause> open(const Plan& plan, Ear& ear);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// TCP is connected.
  [[nodiscard]] bool has_reached() const noexcept { return reached_; }
  /// And TLS is set up: CONNECT is on its way.
  [[nodiscard]] bool has_asked() const noexcept;
  /// To be watched for `events` (epoll(7)); belongs to this object.
  [[nodiscard]] int descriptor() const noexcept { return socket_; }
  [[nodiscard]] std::uint32_t events() const noexcept;
  /// `descriptor` has these events. A cause: the connection is over.
  [[nodiscard]] std::optional<Cause> ready(std::uint32_t events) noexcept;
  /// Once a second: keep-alive.
  [[nodiscard]] std::optional<Cause> tick() noexcept;

  /// The answer is `Ear::subscribed`. A cause: the connection is over.
  [[nodiscard]] std::optional<Cause> subscribe(const std::vector<std::string>& filters, Qos qos) noexcept;
  /// `packet` is set before the ear may hear of it. The error, in words: this message cannot be sent.
  [[nodiscard]] tl::expected<void, std::string> publish(const Message& message, int& packet) noexcept;
  /// Something waits until the socket takes it.
  [[nodiscard]] bool is_writing() const noexcept;
  /// Sends DISCONNECT; `ready` then tells when the broker has closed the connection (`Why::ended`).
  void disconnect(Parting parting) noexcept;

 private:
  Connection(Ear& ear, std::size_t most_incoming) noexcept;
  [[nodiscard]] std::optional<Cause> set_up(const Plan& plan);
  [[nodiscard]] std::optional<Cause> connect(const Plan& plan);
  void set_callbacks() noexcept;
  [[nodiscard]] std::optional<Cause> reached() noexcept;
  [[nodiscard]] std::optional<Cause> judge(int result, int error, std::uint32_t events);
  [[nodiscard]] std::optional<Cause> part(std::uint32_t events) noexcept;
  [[nodiscard]] bool is_flooded() const noexcept;

  // libmosquitto's callbacks; `self` is a Connection.
  static void on_connect(mosquitto*, void* self, int code, int flags, const mqtt5__property* properties);
  static void on_subscribe(mosquitto*, void* self, int packet, int count, const int* codes,
                           const mqtt5__property* properties);
  static void on_disconnect(mosquitto*, void* self, int code, const mqtt5__property* properties);
  static void on_log(mosquitto*, void* self, int level, const char* text);
  void note(std::string_view line);

  Ear* ear_;
  mosquitto* client_ = nullptr;
  int socket_ = -1;  // of our own, of the same connection: it outlives libmosquitto's
  std::shared_ptr<Tls> tls_;
  TlsNews news_{};
  std::string last_error_{};     // libmosquitto's last line about TLS
  std::optional<Cause> told_{};  // by the broker: why it refuses or ends the connection
  bool v5_ = false;
  bool reached_ = false;   // TCP is connected
  bool answered_ = false;  // the broker has accepted the connection
  bool parting_ = false;
  std::size_t most_incoming_;
  std::uint64_t whole_ = 0;  // bytes received up to the last packet that was whole
  unsigned owed_ = 0;        // acknowledgements since the output was last empty
};

}  // namespace berth::mqtt
