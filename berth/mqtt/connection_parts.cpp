#include "berth/mqtt/connection_parts.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/tcp.h>
#include <mosquitto.h>
#include <mqtt_protocol.h>
#include <netinet/in.h>
#include <signal.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <string_view>
#include <utility>

#include "berth/base/words.hpp"

namespace berth::mqtt {
namespace {

// Acknowledgements that may wait for a broker that does not read: libmosquitto keeps them without a bound.
constexpr unsigned most_owed = 1000;
// What TLS, and packets not told one by one (PINGRESP), add to the bytes of a packet.
constexpr std::uint64_t overhead = std::uint64_t{64} << 10U;

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

int socket_error(int fd) noexcept {
  int error = 0;
  socklen_t size = sizeof error;
  return ::getsockopt(fd, SOL_SOCKET, SO_ERROR, &error, &size) == 0 ? error : errno;
}

std::uint64_t received(int fd) noexcept {
  tcp_info info{};
  socklen_t size = sizeof info;
  return ::getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) == 0 ? info.tcpi_bytes_received : 0;
}

Cause own_fault(int result) {
  return {Why::own_computer, fmt::format("this computer cannot begin a connection: {}", mosquitto_strerror(result))};
}

ssl_st* tls_of(mosquitto* client) noexcept { return static_cast<ssl_st*>(mosquitto_ssl_get(client)); }

}  // namespace

Connection::Connection(Ear& ear, std::size_t most_incoming) noexcept : ear_(&ear), most_incoming_(most_incoming) {}

Connection::~Connection() {
  if (client_ != nullptr) mosquitto_destroy(client_);
  if (socket_ >= 0) ::close(socket_);
}

tl::expected<std::unique_ptr<Connection>, Cause> Connection::open(const Plan& plan, Ear& ear) {
  std::call_once(library_ready, [] { mosquitto_lib_init(); });
  std::unique_ptr<Connection> made(new Connection(ear, plan.options.limits.incoming));
  auto wrong = made->set_up(plan);
  if (!wrong) wrong = made->connect(plan);
  if (wrong) return tl::unexpected(std::move(*wrong));
  return made;
}

std::optional<Cause> Connection::set_up(const Plan& plan) {
  {
    const KeptSigpipe kept;
    client_ = mosquitto_new(plan.options.client_id.c_str(), true, this);
  }
  if (client_ == nullptr)
    return errno == ENOMEM ? of_system_error(ENOMEM)
                           : Cause{Why::client_id_refused, "the client-ID is not in UTF-8: choose another"};
  v5_ = plan.version == Version::v5;
  tls_ = plan.tls;
  mosquitto_int_option(client_, MOSQ_OPT_PROTOCOL_VERSION, v5_ ? MQTT_PROTOCOL_V5 : MQTT_PROTOCOL_V311);
  mosquitto_int_option(client_, MOSQ_OPT_TCP_NODELAY, 1);
  if (tls_) {
    mosquitto_int_option(client_, MOSQ_OPT_SSL_CTX_WITH_DEFAULTS, 0);
    mosquitto_void_option(client_, MOSQ_OPT_SSL_CTX, tls_->context());
  }
  int result = MOSQ_ERR_SUCCESS;
  if (!plan.login.user.empty())
    result = mosquitto_username_pw_set(client_, plan.login.user.c_str(), plan.login.password.c_str());
  if (result != MOSQ_ERR_SUCCESS) return Cause{Why::bad_login, "the user's name is too long or not in UTF-8"};
  if (plan.will)
    result = mosquitto_will_set(client_, plan.will->topic.c_str(), static_cast<int>(plan.will->payload.size()),
                                plan.will->payload.data(), static_cast<int>(plan.will->qos), plan.will->retain);
  if (result != MOSQ_ERR_SUCCESS)
    return Cause{Why::protocol, fmt::format("the will cannot be sent: {}", mosquitto_strerror(result))};
  set_callbacks();
  return std::nullopt;
}

// Only the blocking call takes properties. Refused for its port, it keeps them, and the other call uses them
// (test_mqtt:WireConnect.AClientOfMqtt5SaysWhatItTakes).
std::optional<Cause> Connection::connect(const Plan& plan) {
  const int keep_alive = static_cast<int>(plan.options.keep_alive.count());
  if (v5_) {
    Properties properties;
    properties.add(MQTT_PROP_MAXIMUM_PACKET_SIZE, static_cast<std::uint32_t>(most_incoming_));
    mosquitto_connect_bind_v5(client_, plan.address.c_str(), -1, keep_alive, nullptr, properties.get());
  }
  errno = 0;
  const int result = mosquitto_connect_async(client_, plan.address.c_str(), plan.options.where.port, keep_alive);
  const int error = errno;
  if (result == MOSQ_ERR_ERRNO) return of_system_error(error);
  if (result != MOSQ_ERR_SUCCESS) return own_fault(result);
  socket_ = ::fcntl(mosquitto_socket(client_), F_DUPFD_CLOEXEC, 0);
  if (socket_ < 0) return of_system_error(errno);
  tell(tls_of(client_), news_);
  return std::nullopt;
}

void Connection::set_callbacks() noexcept {
  mosquitto_connect_v5_callback_set(client_, on_connect);
  mosquitto_subscribe_v5_callback_set(client_, on_subscribe);
  mosquitto_disconnect_v5_callback_set(client_, on_disconnect);
  mosquitto_log_callback_set(client_, on_log);
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
    // A broker of 3.1.1 refuses MQTT 5 with its own return code, which libmosquitto translates.
    const auto reason = static_cast<unsigned>(code);
    connection.told_ = connection.v5_ && reason >= 128 ? of_reason_code(reason) : of_return_code(reason);
    return;
  }
  connection.answered_ = true;
  Granted granted{.session_present = (flags & 1) != 0};
  mosquitto_property_read_int32(properties, MQTT_PROP_MAXIMUM_PACKET_SIZE, &granted.largest_packet, false);
  mosquitto_property_read_int16(properties, MQTT_PROP_RECEIVE_MAXIMUM, &granted.unacknowledged, false);
  connection.ear_->granted(granted);
}

void Connection::on_subscribe(mosquitto*, void* self, int, int count, const int* codes, const mqtt5__property*) {
  static_cast<Connection*>(self)->ear_->subscribed(std::span(codes, static_cast<std::size_t>(count)));
}

// Codes below 128 are libmosquitto's own results, which `judge` gets too.
void Connection::on_disconnect(mosquitto*, void* self, int code, const mqtt5__property*) {
  auto& connection = *static_cast<Connection*>(self);
  if (code >= 128 && !connection.told_) connection.told_ = of_reason_code(static_cast<unsigned>(code));
}

void Connection::on_log(mosquitto*, void* self, int level, const char* text) {
  auto& connection = *static_cast<Connection*>(self);
  const std::string_view line(text);
  if (level == MOSQ_LOG_ERR) connection.note(line);
  // "Client ID received PUBLISH (...)": one for each packet that came, when it is whole.
  if (level == MOSQ_LOG_DEBUG && line.find("eceived ") != std::string_view::npos)
    connection.whole_ = received(connection.socket_);
}

// "OpenSSL Error[0]: error:0A00010B:SSL routines::wrong version number"
void Connection::note(std::string_view line) {
  const auto behind = line.rfind("::");
  last_error_ = behind == std::string_view::npos ? line : line.substr(behind + 2);
}

std::uint32_t Connection::events() const noexcept {
  constexpr std::uint32_t in = EPOLLIN | EPOLLRDHUP;
  if (!reached_) return EPOLLOUT;
  if (parting_) return is_writing() ? in | EPOLLOUT : in;
  const bool writes = is_writing();
  if (writes && owed_ > most_owed) return EPOLLOUT;
  return writes ? in | EPOLLOUT : in;
}

bool Connection::is_writing() const noexcept {
  const ssl_st* const tls = tls_of(client_);
  return is_shaking_hands(tls) ? wants_to_write(tls) : mosquitto_want_write(client_);
}

bool Connection::has_asked() const noexcept { return reached_ && !is_shaking_hands(tls_of(client_)); }

std::optional<Cause> Connection::reached() noexcept {
  if (const int error = socket_error(socket_); error != 0) return of_system_error(error);
  reached_ = true;
  return std::nullopt;
}

std::optional<Cause> Connection::ready(std::uint32_t events) noexcept {
  if (!reached_) {
    if (auto failed = reached()) return failed;
  }
  if (parting_) return part(events);
  int result = MOSQ_ERR_SUCCESS;
  errno = 0;
  if ((events & ~std::uint32_t{EPOLLOUT}) != 0 || is_shaking_hands(tls_of(client_)))
    result = mosquitto_loop_read(client_, 1);
  if (result == MOSQ_ERR_SUCCESS && is_writing()) {
    errno = 0;
    result = mosquitto_loop_write(client_, 1);
  }
  const int error = errno;
  if (!is_writing()) owed_ = 0;
  return judge(result, error, events);
}

std::optional<Cause> Connection::tick() noexcept {
  if (parting_ || !reached_) return std::nullopt;
  return judge(mosquitto_loop_misc(client_), 0, 0);
}

// A packet that goes on and on is memory that libmosquitto sets aside without asking.
bool Connection::is_flooded() const noexcept {
  return received(socket_) - whole_ > most_incoming_ + most_incoming_ / 8 + overhead;
}

std::optional<Cause> Connection::judge(int result, int error, std::uint32_t events) {
  if (told_) return told_;
  if (news_.verification != 0) return of_verification(tls_->host(), news_.verification);
  if (news_.alert != 0 && (result != MOSQ_ERR_SUCCESS || mosquitto_socket(client_) < 0)) return of_alert(news_.alert);
  const bool shaking = is_shaking_hands(tls_of(client_));
  switch (result) {
    case MOSQ_ERR_SUCCESS: break;
    case MOSQ_ERR_TLS: return of_tls(last_error_);
    case MOSQ_ERR_KEEPALIVE:
      return Cause{Why::keep_alive, "the broker was silent for longer than the keep-alive time: look whether it hangs"};
    case MOSQ_ERR_PROTOCOL:
    case MOSQ_ERR_MALFORMED_PACKET:
    case MOSQ_ERR_MALFORMED_UTF8:
      return Cause{Why::protocol, "what came is not MQTT: look whether this is a broker's port"};
    case MOSQ_ERR_NOMEM: return of_system_error(ENOMEM);
    case MOSQ_ERR_ERRNO:
      if (tls_ && !last_error_.empty()) return of_tls(last_error_);
      return error == 0 || error == ECONNRESET || error == EPIPE ? of_close(answered_) : of_system_error(error);
    default: return of_close(answered_);
  }
  if (mosquitto_socket(client_) < 0) return of_close(answered_);
  if (shaking && (events & (EPOLLHUP | EPOLLERR)) != 0) return of_tls(last_error_);
  if (is_flooded())
    return Cause{Why::packet_too_large, "the broker sends a packet that is larger than this client takes"};
  return std::nullopt;
}

std::optional<Cause> Connection::subscribe(const std::vector<std::string>& filters, Qos qos) noexcept {
  std::vector<char*> all;
  for (const std::string& filter : filters) {
    const int result = mosquitto_sub_topic_check(filter.c_str());
    if (result != MOSQ_ERR_SUCCESS)
      return Cause{Why::refused_otherwise,
                   fmt::format("{} is no topic filter: {}", quoted(filter), mosquitto_strerror(result))};
    all.push_back(const_cast<char*>(filter.c_str()));  // libmosquitto's type; it only reads them
  }
  const int result = mosquitto_subscribe_multiple(client_, nullptr, static_cast<int>(all.size()), all.data(),
                                                  static_cast<int>(qos), 0, nullptr);
  return judge(result, errno, 0);
}

tl::expected<void, std::string> Connection::publish(const Message& message, int& packet) noexcept {
  const int result =
      mosquitto_publish_v5(client_, &packet, message.topic.c_str(), static_cast<int>(message.payload.size()),
                           message.payload.data(), static_cast<int>(message.qos), message.retain, nullptr);
  switch (result) {
    case MOSQ_ERR_SUCCESS:
    // The connection is broken: `ready` will say so, and all that is on its way is handed back.
    case MOSQ_ERR_CONN_LOST:
    case MOSQ_ERR_NO_CONN:
    case MOSQ_ERR_TLS:
    case MOSQ_ERR_ERRNO: return {};
    case MOSQ_ERR_QOS_NOT_SUPPORTED: return tl::unexpected(of_reason_code(MQTT_RC_QOS_NOT_SUPPORTED).words);
    case MOSQ_ERR_OVERSIZE_PACKET: return tl::unexpected(of_reason_code(MQTT_RC_PACKET_TOO_LARGE).words);
    default: return tl::unexpected(std::string(mosquitto_strerror(result)));
  }
}

void Connection::disconnect(Parting parting) noexcept {
  parting_ = true;
  const bool with_will = v5_ && parting == Parting::with_will;
  mosquitto_disconnect_v5(client_, with_will ? MQTT_RC_DISCONNECT_WITH_WILL_MSG : 0, nullptr);
  if (mosquitto_socket(client_) < 0) ::shutdown(socket_, SHUT_WR);
}

// libmosquitto closes its socket behind DISCONNECT. If something came meanwhile and was not read, that would reset the
// connection, and the broker could lose what was sent last. So ours is read to the broker's end.
std::optional<Cause> Connection::part(std::uint32_t events) noexcept {
  if (mosquitto_socket(client_) >= 0) {
    if ((events & EPOLLOUT) != 0) mosquitto_loop_write(client_, 1);
    if (mosquitto_socket(client_) >= 0 && (events & EPOLLIN) != 0) mosquitto_loop_read(client_, 1);
    if (mosquitto_socket(client_) >= 0 && (events & (EPOLLHUP | EPOLLERR)) == 0) return std::nullopt;
    ::shutdown(socket_, SHUT_WR);
  }
  std::array<char, 4096> rest{};
  for (;;) {
    const auto got = ::recv(socket_, rest.data(), rest.size(), MSG_DONTWAIT);
    if (got > 0 || (got < 0 && errno == EINTR)) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return std::nullopt;
    return Cause{Why::ended, "this client ended the connection"};
  }
}

}  // namespace berth::mqtt
