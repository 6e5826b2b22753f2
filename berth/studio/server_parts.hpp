// The server's thread: its connections, and the messages to them. Boost.Asio and Boost.Beast are only in the sources
// that include this.
#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/http/vector_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/studio/doors.hpp"
#include "berth/studio/link.hpp"
#include "berth/studio/mirror.hpp"
#include "berth/studio/search.hpp"
#include "berth/studio/tls.hpp"
#include "berth/studio/wire.hpp"

namespace berth::studio {

namespace asio = boost::asio;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using Text = std::shared_ptr<const std::string>;
using Parser = http::request_parser<http::string_body>;

inline constexpr std::size_t most_clients = 16;
inline constexpr std::uint32_t longest_header = 8 * 1024;
inline constexpr std::chrono::seconds request_time{10};  ///< for a whole request; the same for a TLS handshake
inline constexpr std::chrono::seconds farewell_time{2};  ///< for the end of TLS
inline constexpr std::chrono::seconds file_time{60};     ///< for a trace file that a page sends
inline constexpr std::chrono::seconds idle_time{60};     ///< of a WebSocket that does not answer pings
inline constexpr std::chrono::milliseconds batch_period{40};
inline constexpr std::size_t most_in_batch = 8192;                   ///< frames
inline constexpr std::size_t most_behind = std::size_t{4} << 20U;    ///< bytes; then changes become one snapshot
inline constexpr std::size_t most_waiting = std::size_t{32} << 20U;  ///< bytes; then the client is disconnected
inline constexpr unsigned most_asked = 8;                            ///< unanswered requests of one client

class Hall;

/// One connection; destroyed when nothing waits for it any more.
class Client : public std::enable_shared_from_this<Client> {
 public:
  explicit Client(Hall& hall, std::uint64_t number) : hall_(&hall), number_(number) {}
  virtual ~Client() = default;
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  [[nodiscard]] std::uint64_t number() const noexcept { return number_; }
  virtual void change(const Text&) {}             ///< for all clients
  virtual void answer(const Answer& answer) = 0;  ///< for this client
  virtual void tick(bool /*rates*/) {}            ///< every `batch_period`
  /// Whether it may be closed when all places are taken and another client comes.
  enum class Hold : std::uint8_t {
    idle,      ///< between two requests: browsers keep unused connections open
    stranger,  ///< it has not shown a token yet
    stays
  };
  [[nodiscard]] virtual Hold hold() const { return Hold::stays; }
  virtual void close() = 0;

 protected:
  [[nodiscard]] Hall& hall() const noexcept { return *hall_; }

 private:
  Hall* hall_;
  std::uint64_t number_;
};

/// Frames, error frames and load of each bus in the last second.
class Rates {
 public:
  explicit Rates(const Link& link, const Mirror& mirror)
      : link_(&link), ring_(&link.ring), mirror_(&mirror), counted_(link.ring.next()) {}
  void tick(std::chrono::steady_clock::time_point now);
  [[nodiscard]] std::string json(std::uint64_t left_out, double time_s) const;
  /// Of each bus, since the server began.
  [[nodiscard]] std::span<const Traffic> traffic() const noexcept { return traffic_; }

 private:
  struct Bus {
    std::uint64_t frames = 0, bits = 0, errors = 0;  // errors: ever, when the second began
    double per_s = 0, load = 0, errors_per_s = 0;
  };
  [[nodiscard]] std::uint64_t errors(std::size_t bus) const noexcept;

  const Link* link_;
  const FrameRing* ring_;
  const Mirror* mirror_;
  std::uint64_t counted_;
  std::vector<Bus> buses_;
  std::vector<Traffic> traffic_;
  std::chrono::steady_clock::time_point since_{};
};

/// The server's side of the metrics: a scrape gets what the executor told last, so that it never waits for it.
class Scrape {
 public:
  /// Both must outlive this.
  Scrape(const Mirror& mirror, const Rates& rates);
  void take(std::shared_ptr<const Figures> figures);
  [[nodiscard]] std::string page(Exposition exposition) const;

 private:
  const Mirror* mirror_;
  const Rates* rates_;
  double start_s_;
  std::shared_ptr<const Figures> figures_;  // null: none came yet
  std::chrono::steady_clock::time_point taken_{};
};

/// Everything in the server's thread.
class Hall {
 public:
  /// `tls` null: plain HTTP.
  Hall(int listener, bool ipv6, std::uint16_t port, std::unique_ptr<Tls> tls, Tokens tokens, Mirror mirror, Link& link);
  void run();
  void stop();  ///< any thread

  [[nodiscard]] const Tokens& tokens() const noexcept { return tokens_; }
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
  [[nodiscard]] Tls* tls() const noexcept { return tls_.get(); }
  /// `Host` and `Origin` name this server: by its loopback names, or by a name in its certificate.
  [[nodiscard]] bool is_own_host(std::string_view host) const;
  [[nodiscard]] bool is_own_origin(std::string_view origin) const;
  [[nodiscard]] const Mirror& mirror() const noexcept { return mirror_; }
  [[nodiscard]] const FrameRing& ring() const noexcept { return link_->ring; }
  [[nodiscard]] const Rates& rates() const noexcept { return rates_; }
  [[nodiscard]] asio::io_context& context() noexcept { return context_; }
  [[nodiscard]] std::string snapshot(command::Role role) const;
  /// The executor's time, in seconds.
  [[nodiscard]] double time_s() const noexcept;
  /// False: the executor has too many orders.
  [[nodiscard]] bool order(Order order);
  /// Whether a trace file is being received or read: one at a time, because it needs memory.
  [[nodiscard]] bool& has_file() noexcept { return has_file_; }
  void enter(const std::shared_ptr<Client>& client);
  void leave(const Client& client);
  [[nodiscard]] std::uint64_t next_number() noexcept { return ++numbers_; }
  friend std::string metrics_of(const Hall& hall, Exposition exposition) { return hall.scrape_.page(exposition); }

 private:
  void accept();
  void accepted(asio::ip::tcp::socket socket);
  [[nodiscard]] bool make_room();
  void listen_for_news();
  void take_news();
  void tick();
  void give_gone();

  asio::io_context context_{1};
  asio::ip::tcp::acceptor acceptor_;
  asio::posix::stream_descriptor bell_;
  asio::steady_timer timer_;
  std::uint16_t port_;
  std::unique_ptr<Tls> tls_;
  Tokens tokens_;
  Mirror mirror_;
  Link* link_;
  Rates rates_;
  Scrape scrape_;
  std::map<std::uint64_t, std::shared_ptr<Client>> clients_;
  std::deque<std::uint64_t> gone_;  // left clients that the executor was not informed of yet
  std::uint64_t numbers_ = 0;
  unsigned ticks_ = 0;
  bool has_file_ = false;
};

/// The page of `GET /metrics`.
[[nodiscard]] std::string metrics_of(const Hall& hall, Exposition exposition);
/// A new connection, by HTTP at first; with TLS, after its handshake.
[[nodiscard]] std::shared_ptr<Client> greet(Hall& hall, Wire wire);
/// One client too many: answers so if possible, and closes.
void turn_away(const Hall& hall, asio::ip::tcp::socket socket);
/// A connection whose request for a WebSocket was accepted.
[[nodiscard]] std::shared_ptr<Client> upgrade(Hall& hall, Wire wire, http::request<http::string_body> request,
                                              command::Role role);

}  // namespace berth::studio
