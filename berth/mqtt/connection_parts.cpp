#include "berth/mqtt/connection_parts.hpp"

#include <fmt/format.h>
#include <mosquitto.h>
#include <mqtt_protocol.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <mutex>
#include <string_view>
#include <utility>

#include "berth/base/words.hpp"

namespace berth::mqtt {
namespace {

// Acknowledgements that may wait for a broker that does not read: libmosquitto keeps them without a bound.
constexpr unsigned most_owed = 1000;
constexpr std::size_t piece = std::size_t{64} << 10U;  // bytes that are read at once

std::once_flag library_ready;  // libmosquitto's own state is the process's

/// libmosquitto ignores SIGPIPE for the whole process; that is for the program to decide. The clients' thread blocks
/// the signal, so that it does not miss this.
class KeptSigpipe {
 public:
  KeptSigpipe() noexcept { ::sigaction(SIGPIPE, nullptr, &before_); }
  ~KeptSigpipe() { ::sigaction(SIGPIPE, &before_, nullptr); }
  KeptSigpipe(const KeptSigpipe&) = delete;
  KeptSigpipe& operator=(const KeptSigpipe&) = delete;

 private:
  struct sigaction before_ {};
};

/// Properties of one packet.
class Properties {
 public:
  Properties() = default;
  ~Properties() { mosquitto_property_free_all(&all_); }
  Properties(const Properties&) = delete;
  Properties& operator=(const Properties&) = delete;
  void add(int id, std::uint32_t value) noexcept { mosquitto_property_add_int32(&all_, id, value); }
  [[nodiscard]] const mosquitto_property* get() const noexcept { return all_; }

 private:
  mosquitto_property* all_ = nullptr;
};

Cause not_mqtt() { return {Why::protocol, "what came is not MQTT: look whether this is a broker's port"}; }

Cause own_fault(int result) {
  return {Why::own_computer, fmt::format("this computer cannot begin a connection: {}", mosquitto_strerror(result))};
}

// MQTT 3.1.1 §3.4
std::string puback(std::uint16_t id) {
  return {'\x40', '\x02', static_cast<char>(id >> 8U), static_cast<char>(id & 0xFFU)};
}

Cause of_flaw(Gate::Flaw flaw) {
  if (flaw == Gate::Flaw::malformed) return not_mqtt();
  return {Why::packet_too_large, "the broker sends a packet that is larger than this client takes"};
}

}  // namespace

Connection::Connection(Ear& ear, std::unique_ptr<Line> line, bool v5, std::size_t most_incoming) noexcept
    : ear_(&ear), line_(std::move(line)), gate_(v5, most_incoming), v5_(v5) {}

Connection::~Connection() {
  if (client_ != nullptr) mosquitto_destroy(client_);
  if (inner_ >= 0) ::close(inner_);
}

tl::expected<std::unique_ptr<Connection>, Cause> Connection::open(const Options& options, Version version,
                                                                  const std::string& address, std::shared_ptr<Tls> tls,
                                                                  Ear& ear) {
  auto line = Line::open(address, options.where.port, std::move(tls));
  if (!line) return tl::unexpected(std::move(line.error()));
  return std::unique_ptr<Connection>(
      new Connection(ear, std::move(*line), version == Version::v5, options.limits.incoming));
}

std::optional<Cause> Connection::set_up(const Options& options, const std::optional<Will>& will, const Login& login) {
  std::call_once(library_ready, [] { mosquitto_lib_init(); });
  {
    const KeptSigpipe kept;
    client_ = mosquitto_new(options.client_id.c_str(), true, this);
  }
  if (client_ == nullptr)
    return errno == ENOMEM ? of_system_error(ENOMEM)
                           : Cause{Why::client_id_refused, "the client-ID is not in UTF-8: choose another"};
  mosquitto_int_option(client_, MOSQ_OPT_PROTOCOL_VERSION, v5_ ? MQTT_PROTOCOL_V5 : MQTT_PROTOCOL_V311);
  mosquitto_threaded_set(client_, true);  // it writes when `say` tells it to, and not before
  int result = MOSQ_ERR_SUCCESS;
  if (!login.user.empty()) result = mosquitto_username_pw_set(client_, login.user.c_str(), login.password.c_str());
  if (result != MOSQ_ERR_SUCCESS) return Cause{Why::bad_login, "the user's name is too long or not in UTF-8"};
  if (will)
    result = mosquitto_will_set(client_, will->topic.c_str(), static_cast<int>(will->payload.size()),
                                will->payload.data(), static_cast<int>(will->qos), will->retain);
  if (result != MOSQ_ERR_SUCCESS)
    return Cause{Why::protocol, fmt::format("the will cannot be sent: {}", mosquitto_strerror(result))};
  set_callbacks();
  return std::nullopt;
}

// Only the blocking call takes properties. Refused for its port, it keeps them, and the other call uses them
// (test_mqtt:WireConnect.AClientOfMqtt5SaysWhatItTakes).
std::optional<Cause> Connection::ask(const Options& options, const std::optional<Will>& will, const Login& login,
                                     const Dock& dock) {
  if (auto wrong = set_up(options, will, login)) return wrong;
  constexpr const char* host = "127.0.0.1";
  const int keep_alive = static_cast<int>(options.keep_alive.count());
  if (v5_) {
    Properties properties;
    properties.add(MQTT_PROP_MAXIMUM_PACKET_SIZE, static_cast<std::uint32_t>(options.limits.incoming));
    mosquitto_connect_bind_v5(client_, host, -1, keep_alive, nullptr, properties.get());
  }
  errno = 0;
  const int result = mosquitto_connect_async(client_, host, dock.port(), keep_alive);
  if (result == MOSQ_ERR_ERRNO && errno != 0) return of_system_error(errno);
  if (result != MOSQ_ERR_SUCCESS) return own_fault(result);
  inner_ = dock.replace(mosquitto_socket(client_));
  if (inner_ < 0) return of_system_error(errno);
  return std::nullopt;
}

void Connection::set_callbacks() noexcept {
  mosquitto_connect_v5_callback_set(client_, on_connect);
  mosquitto_disconnect_v5_callback_set(client_, on_disconnect);
  mosquitto_subscribe_callback_set(client_, [](mosquitto*, void* self, int, int count, const int* codes) {
    static_cast<Connection*>(self)->ear_->subscribed(std::span(codes, static_cast<std::size_t>(count)));
  });
  mosquitto_publish_v5_callback_set(client_,
                                    [](mosquitto*, void* self, int packet, int code, const mosquitto_property*) {
                                      static_cast<Connection*>(self)->ear_->out(packet, static_cast<unsigned>(code));
                                    });
  mosquitto_message_callback_set(client_, [](mosquitto*, void* self, const mosquitto_message* message) {
    auto& connection = *static_cast<Connection*>(self);
    if (message->qos > 0) ++connection.owed_;
    const std::span payload(static_cast<const std::uint8_t*>(message->payload),
                            static_cast<std::size_t>(message->payloadlen));
    connection.ear_->message(message->topic, payload, message->retain);
  });
}

void Connection::on_connect(mosquitto*, void* self, int code, int flags, const mqtt5__property* properties) {
  auto& connection = *static_cast<Connection*>(self);
  if (code != 0) {
    const auto reason = static_cast<unsigned>(code);
    connection.told_ = connection.v5_ ? of_reason_code(reason) : of_return_code(reason);
    return;
  }
  connection.answered_ = true;
  Granted granted{.session_present = (flags & 1) != 0};
  mosquitto_property_read_int32(properties, MQTT_PROP_MAXIMUM_PACKET_SIZE, &granted.largest_packet, false);
  mosquitto_property_read_int16(properties, MQTT_PROP_RECEIVE_MAXIMUM, &granted.unacknowledged, false);
  connection.ear_->granted(granted);
}

// Codes below 128 are libmosquitto's own results, which `judge` gets too.
void Connection::on_disconnect(mosquitto*, void* self, int code, const mqtt5__property*) {
  auto& connection = *static_cast<Connection*>(self);
  if (code >= 128 && !connection.told_) connection.told_ = of_reason_code(static_cast<unsigned>(code));
}

std::uint32_t Connection::events() const noexcept {
  const bool waits_for_broker = owed_ > most_owed && line_->is_writing();
  return waits_for_broker ? std::uint32_t{EPOLLOUT} : line_->events();
}

bool Connection::is_writing() const noexcept {
  return line_->is_writing() || (has_asked() && mosquitto_want_write(client_));
}

std::optional<Cause> Connection::ready() noexcept {
  if (auto cause = line_->go_on()) return has_asked() && !parting_ ? why_not(*cause) : closed(*cause);
  if (!has_asked()) return std::nullopt;
  if (parting_) return part();
  if (auto cause = hear()) return cause;
  return say();
}

std::optional<Cause> Connection::tick() noexcept {
  if (parting_) return std::nullopt;
  return judge(mosquitto_loop_misc(client_));
}

// One piece: other clients of the thread have their turn before the next.
std::optional<Cause> Connection::hear() noexcept {
  std::array<char, piece> buffer;
  const auto got = line_->read(buffer);
  if (!got) return closed(got.error());
  if (*got == 0) return std::nullopt;
  gate_.put(std::string_view(buffer.data(), *got));
  for (;;) {
    const auto packet = gate_.next();
    if (!packet) return of_flaw(packet.error());
    if (!*packet) return std::nullopt;
    if (auto cause = take_in(**packet)) return cause;
  }
}

// CONNACK is the first packet, and comes once. A broker of 3.1.1 refuses MQTT 5 with a CONNACK of its own kind.
std::optional<Cause> Connection::take_in(const Incoming& packet) noexcept {
  const bool is_connack = packet.type == PacketType::connack;
  if (is_connack == answered_) return not_mqtt();
  if (is_connack && v5_ && packet.body.size() == 2) return of_return_code(static_cast<unsigned char>(packet.body[1]));
  if (packet.skipped) {
    ear_->skipped();
    if (packet.id != 0) acknowledgements_ += puback(packet.id);
    return std::nullopt;
  }
  std::string_view rest = packet.whole;
  while (!rest.empty()) {
    const auto sent = ::send(inner_, rest.data(), rest.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno != EAGAIN && errno != EINTR) return judge(MOSQ_ERR_CONN_LOST);
    if (sent > 0) rest.remove_prefix(static_cast<std::size_t>(sent));
    if (auto cause = judge(mosquitto_loop_read(client_, 1))) return cause;
  }
  return std::nullopt;
}

std::optional<Cause> Connection::say() noexcept {
  std::array<char, piece> buffer;
  while (has_asked() && !line_->is_writing() && !finished_) {
    if (mosquitto_want_write(client_)) {
      const int result = mosquitto_loop_write(client_, 1);
      if (!parting_) {
        if (auto cause = judge(result)) return cause;
      }
    }
    const auto got = ::recv(inner_, buffer.data(), buffer.size(), 0);
    if (got > 0) {
      auto cause = line_->write(std::string_view(buffer.data(), static_cast<std::size_t>(got)));
      if (cause) return why_not(*cause);
      continue;
    }
    if (got < 0 && (acknowledgements_.empty() || mosquitto_want_write(client_))) break;
    if (got < 0) {  // between two packets of libmosquitto's
      if (auto cause = line_->write(std::exchange(acknowledgements_, {}))) return why_not(*cause);
      continue;
    }
    finished_ = true;  // libmosquitto has closed its end behind DISCONNECT
    line_->finish();
  }
  if (!line_->is_writing()) owed_ = 0;
  return std::nullopt;
}

// If something came meanwhile and was not read, closing would reset the connection, and the broker could lose what was
// sent last. So all is read, to the broker's end.
std::optional<Cause> Connection::part() noexcept {
  if (auto cause = say()) return Cause{Why::ended, cause->words};
  std::array<char, piece> rest;
  for (;;) {
    const auto got = line_->read(rest);
    if (!got) return Cause{Why::ended, "this client ended the connection"};
    if (*got == 0) return std::nullopt;
  }
}

// Writing failed. What the broker said before may tell why: DISCONNECT, or an alert of TLS after it refused this
// client's certificate.
Cause Connection::why_not(const Cause& cause) noexcept {
  constexpr int pieces = 16;
  for (int i = 0; i < pieces && !parting_; ++i) {
    if (auto said = hear()) return *said;
  }
  return closed(cause);
}

// The line knows how it was closed, and not what that means.
Cause Connection::closed(const Cause& cause) const {
  return told_ ? *told_ : cause.why == Why::closed ? of_close(answered_) : cause;
}

std::optional<Cause> Connection::judge(int result) const {
  if (told_) return told_;
  switch (result) {
    case MOSQ_ERR_SUCCESS: break;
    case MOSQ_ERR_KEEPALIVE:
      return Cause{Why::keep_alive, "the broker was silent for longer than the keep-alive time: look whether it hangs"};
    case MOSQ_ERR_PROTOCOL:
    case MOSQ_ERR_MALFORMED_PACKET:
    case MOSQ_ERR_MALFORMED_UTF8: return not_mqtt();
    case MOSQ_ERR_NOMEM: return of_system_error(ENOMEM);
    default: return of_close(answered_);
  }
  return mosquitto_socket(client_) >= 0 ? std::nullopt : std::optional(of_close(answered_));
}

std::optional<Cause> Connection::subscribe(const std::vector<std::string>& filters, Qos qos) noexcept {
  std::vector<char*> all;
  for (const std::string& filter : filters) {
    const int result = mosquitto_sub_topic_check(filter.c_str());
    if (result != MOSQ_ERR_SUCCESS)
      return Cause{Why::refused_otherwise,
                   fmt::format("{} is no topic filter: {}", berth::quoted(filter), mosquitto_strerror(result))};
    all.push_back(const_cast<char*>(filter.c_str()));  // libmosquitto's type; it only reads them
  }
  return judge(mosquitto_subscribe_multiple(client_, nullptr, static_cast<int>(all.size()), all.data(),
                                            static_cast<int>(qos), 0, nullptr));
}

tl::expected<void, std::string> Connection::publish(const Message& message, int& packet) noexcept {
  const int result =
      mosquitto_publish_v5(client_, &packet, message.topic.c_str(), static_cast<int>(message.payload.size()),
                           message.payload.data(), static_cast<int>(message.qos), message.retain, nullptr);
  switch (result) {
    case MOSQ_ERR_SUCCESS: return {};
    case MOSQ_ERR_QOS_NOT_SUPPORTED: return tl::unexpected(of_reason_code(MQTT_RC_QOS_NOT_SUPPORTED).words);
    case MOSQ_ERR_OVERSIZE_PACKET: return tl::unexpected(of_reason_code(MQTT_RC_PACKET_TOO_LARGE).words);
    default: return tl::unexpected(std::string(mosquitto_strerror(result)));
  }
}

void Connection::disconnect(Parting parting) noexcept {
  parting_ = true;
  const bool with_will = v5_ && parting == Parting::with_will;
  mosquitto_disconnect_v5(client_, with_will ? MQTT_RC_DISCONNECT_WITH_WILL_MSG : 0, nullptr);
}

}  // namespace berth::mqtt
