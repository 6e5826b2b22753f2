/// A client of an MQTT broker: it connects, connects again, publishes and hears, by MQTT 5.0 or 3.1.1, over TCP or TLS.
///
///     mqtt::Options options{.where = *mqtt::parse_where("mqtts://broker.plant"), .client_id = "line-3"};
///     options.subscriptions = {"plant/line-3/command"};
///     auto client = mqtt::Client::start(thread, options, random, handler);
///     ...
///     client->publish({.connection = number, .topic = "plant/line-3/state", .payload = bytes});
///
/// Sessions are always clean (3.1.1: clean session; 5: clean start, session expiry 0): the broker keeps nothing of a
/// client that is gone, and nothing that was accepted for one connection is sent on another.
///
/// A broker's name is always verified by TLS; there is no option against it.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/mqtt/cause.hpp"
#include "berth/mqtt/message.hpp"
#include "berth/mqtt/options.hpp"
#include "berth/mqtt/thread.hpp"

namespace berth::mqtt {

struct Connected {
  ConnectionNumber connection = 0;  ///< for `Message::connection`
  bool session_present = false;     ///< the broker kept something, against what was asked
  Version version = Version::v5;
  /// Subscriptions that the broker refused, each with the reason.
  struct Refused {
    std::string filter{};
    std::string words{};
  };
  std::vector<Refused> refused{};
};

struct Disconnected {
  Why why = Why::closed;
  std::string words{};  ///< what happened, where, what to do: "mqtt://broker:1883: nothing listens at this port: ..."
  /// The pause before the next attempt; empty: there will be none.
  std::optional<Milliseconds> retry_in{};
  bool was_connected = false;
};

/// Called on the clients' thread, never at the same time for one client; must not wait, and must not destroy a client.
/// May call `Client::publish` and `Client::end`.
class Handler {
 public:
  /// The broker is reached, and CONNECT follows: the will of this connection; empty: none.
  virtual std::optional<Will> connecting() noexcept = 0;
  /// The broker has accepted the connection and answered the subscriptions. Nothing was published on it.
  virtual void connected(const Connected& connected) noexcept = 0;
  /// An attempt failed, or the connection ended; all its messages have been handed back before.
  virtual void disconnected(const Disconnected& disconnected) noexcept = 0;
  /// Between `connected` and `disconnected`. `retained`: the broker had kept it.
  virtual void message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept = 0;
  /// QoS 0: on its way. QoS 1: acknowledged by the broker.
  virtual void published(MessageId id) noexcept = 0;
  /// The other end of an accepted message: nobody knows whether the broker got it. `why` in words.
  virtual void unpublished(MessageId id, std::string_view why) noexcept = 0;

 protected:
  ~Handler() = default;
};

/// How a client ends.
enum class Parting : std::uint8_t {
  without_will,  ///< the broker drops the will
  with_will      ///< the broker publishes it (reason code 4 of MQTT 5; by 3.1.1 it drops it)
};

class Core;

class Client {
 public:
  /// The client begins to connect at once. `thread` and `handler` must outlive it; `random` must differ between
  /// machines. Errors in words: options that contradict each other, a file that cannot be read or is readable for
  /// others.
  [[nodiscard]] static tl::expected<std::unique_ptr<Client>, std::string> start(Thread& thread, Options options,
                                                                                Random random, Handler& handler);
  /// As `end(Parting::without_will)` if it has not ended, then waits for that: at most `Options::farewell`, and as long
  /// as a call of a handler takes. Afterwards the handler is not called any more.
  ~Client();
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  // From one thread at a time besides the handler's calls. None of these waits or takes a lock.

  /// Accepted: `Handler::published` or `Handler::unpublished` will be told of this number, one of them, once. Messages
  /// of one thread keep their order.
  tl::expected<MessageId, Refusal> publish(Message message) noexcept;
  /// Nothing is accepted any more. What was is still sent and acknowledged, within `Options::farewell`; then the client
  /// disconnects, and connects no more. `Handler::disconnected` is told with `Why::ended`.
  void end(Parting parting) noexcept;
  /// It has: there is no connection, and will be none.
  [[nodiscard]] bool has_ended() const noexcept;
  [[nodiscard]] Counts counts() const noexcept;

 private:
  explicit Client(std::shared_ptr<Core> core) noexcept;
  std::shared_ptr<Core> core_;
};

}  // namespace berth::mqtt
