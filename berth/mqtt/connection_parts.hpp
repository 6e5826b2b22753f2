// One connection to a broker, from its first packet to its last: a libmosquitto client that is made for it and goes
// with it, so that nothing of an old session is sent on a new one. Internal to room `mqtt`; used by one thread.
//
// libmosquitto makes and reads packets, and keeps the connection alive; it never sees the network. Between it and the
// broker stand `Line` (TCP, TLS) and `Gate` (what may come in), joined by a pair of sockets (`Dock`).
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
#include "berth/mqtt/dock.hpp"
#include "berth/mqtt/gate.hpp"
#include "berth/mqtt/line.hpp"
#include "berth/mqtt/login.hpp"

// libmosquitto's.
struct mosquitto;
struct mqtt5__property;  // NOLINT(bugprone-reserved-identifier): its name there

namespace berth::mqtt {

/// What the broker grants in its CONNACK.
struct Granted {
  bool session_present = false;
  std::uint32_t largest_packet = 0;       ///< bytes; 0: no limit
  std::uint16_t unacknowledged = 65'535;  ///< Receive Maximum
};

/// Told within calls of a `Connection`; must not call the connection then.
class Ear {
 public:
  virtual void granted(const Granted& granted) noexcept = 0;
  /// One code for each subscription: 0 and 1 are QoS, from 128 on it was refused.
  virtual void subscribed(std::span<const int> codes) noexcept = 0;
  virtual void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept = 0;
  /// One came that was too large to take.
  virtual void skipped() noexcept = 0;
  /// QoS 0: it is on its way. QoS 1: the broker has answered; `code` as in MQTT 5.0 §3.4.2.1.
  virtual void out(int packet, unsigned code) noexcept = 0;

 protected:
  ~Ear() = default;
};

class Connection {
 public:
  /// Begins to reach `address`, one of the host's. `version` is not `automatic`; `tls` null: without.
  [[nodiscard]] static tl::expected<std::unique_ptr<Connection>, Cause> open(const Options& options, Version version,
                                                                             const std::string& address,
                                                                             std::shared_ptr<Tls> tls, Ear& ear);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// TCP is connected.
  [[nodiscard]] bool has_reached() const noexcept { return line_->has_reached(); }
  /// And TLS is set up: `ask` can be called.
  [[nodiscard]] bool is_open() const noexcept { return line_->is_open(); }
  /// CONNECT is on its way.
  [[nodiscard]] bool has_asked() const noexcept { return client_ != nullptr; }
  /// To be watched for `events` (epoll(7)); belongs to this object.
  [[nodiscard]] int descriptor() const noexcept { return line_->descriptor(); }
  [[nodiscard]] std::uint32_t events() const noexcept;

  // All of these: a cause says that the connection is over.

  /// `descriptor` has events.
  [[nodiscard]] std::optional<Cause> ready() noexcept;
  /// CONNECT, once; the answer is `Ear::granted`. Nothing of the arguments is kept.
  [[nodiscard]] std::optional<Cause> ask(const Options& options, const std::optional<Will>& will, const Login& login,
                                         const Dock& dock);
  /// Once a second: keep-alive.
  [[nodiscard]] std::optional<Cause> tick() noexcept;
  /// The answer is `Ear::subscribed`.
  [[nodiscard]] std::optional<Cause> subscribe(const std::vector<std::string>& filters, Qos qos) noexcept;
  /// What was subscribed and published goes out, as far as the system takes it.
  [[nodiscard]] std::optional<Cause> say() noexcept;

  /// `packet` is set before the ear may hear of it. The error, in words: this message cannot be sent.
  [[nodiscard]] tl::expected<void, std::string> publish(const Message& message, int& packet) noexcept;
  /// Something waits until the system takes it.
  [[nodiscard]] bool is_writing() const noexcept;
  /// Sends DISCONNECT; `ready` then tells when the broker has closed the connection (`Why::ended`).
  void disconnect(Parting parting) noexcept;

 private:
  Connection(Ear& ear, std::unique_ptr<Line> line, bool v5, std::size_t most_incoming) noexcept;
  [[nodiscard]] std::optional<Cause> set_up(const Options& options, const std::optional<Will>& will,
                                            const Login& login);
  void set_callbacks() noexcept;
  [[nodiscard]] std::optional<Cause> hear() noexcept;
  [[nodiscard]] std::optional<Cause> take_in(const Incoming& packet) noexcept;
  [[nodiscard]] std::optional<Cause> part() noexcept;
  [[nodiscard]] std::optional<Cause> judge(int result) const;
  [[nodiscard]] Cause why_not(const Cause& cause) noexcept;
  [[nodiscard]] Cause closed(const Cause& cause) const;

  // libmosquitto's callbacks; `self` is a Connection.
  static void on_connect(mosquitto*, void* self, int code, int flags, const mqtt5__property* properties);
  static void on_disconnect(mosquitto*, void* self, int code, const mqtt5__property* properties);

  Ear* ear_;
  std::unique_ptr<Line> line_;
  Gate gate_;
  mosquitto* client_ = nullptr;  // from `ask` on
  int inner_ = -1;               // our end of the pair
  std::optional<Cause> told_{};  // by the broker: why it refuses or ends the connection
  bool v5_;
  bool answered_ = false;  // the broker has accepted the connection
  bool parting_ = false;
  bool finished_ = false;           // nothing more will be written
  std::string acknowledgements_{};  // PUBACKs of what the gate has skipped
  unsigned owed_ = 0;               // acknowledgements since the output was last empty
};

}  // namespace berth::mqtt
