#include "berth/io/socketcand_port.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/epoll.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <optional>
#include <vector>

#include "berth/io/deliveries.hpp"
#include "berth/io/socketcand_protocol.hpp"
#include "berth/io/stream.hpp"
#include "berth/rt/later.hpp"

namespace berth::io {

using namespace std::chrono_literals;

namespace {

constexpr rt::Duration handshake_time = 3s;  // from the beginning of a connection to raw mode
constexpr rt::Duration tick_time = 1s;
constexpr rt::Duration idle_time = 2s;  // without a message to the server; then it is asked
constexpr rt::Duration echo_time = 5s;  // for an echo
constexpr rt::Duration least_pause = 250ms;
constexpr rt::Duration most_pause = 4s;
constexpr std::size_t most_unsent = 1U << 18U;
constexpr std::size_t messages_kept = 8192;  // more than one read can bring

}  // namespace

/// Reads bytes between jobs, and delivers what they say, one per job.
class SocketcandPort::Impl final : private Watcher {
 public:
  Impl(Loop& loop, std::vector<SocketAddress> addresses, std::string bus, const SocketcandOptions& options)
      : loop_(&loop), addresses_(std::move(addresses)), bus_(std::move(bus)), options_(options) {}
  ~Impl() = default;

  // Makes the first connection and waits for it; tries every address. Empty: it stands.
  std::optional<std::string> connect_now() {
    for (std::size_t i = 0; i < addresses_.size(); ++i) {
      begin();
      wait();
      if (state_ == State::up) {
        deliveries_.clear();
        return std::nullopt;
      }
    }
    return faults_.what;
  }
  void begin() noexcept {
    const auto& address = addresses_[next_++ % addresses_.size()];
    const int fd = begin_connect(address);
    if (fd < 0) return lost(std::strerror(errno));
    reader_ = {};
    known_faults_ = 0;
    Watcher& self = *this;
    stream_.emplace(*loop_, fd, Stream::Kind::socket, self, most_unsent);
    state_ = State::connecting;
    timer_.arm(handshake_time);
  }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept {
    if (state_ != State::up || !socketcand_can_say(frame)) return can::Queued::closed;
    if (options_.listen_only) return can::Queued::listen_only;
    if (given_.size() >= queue_depth) return can::Queued::full;
    std::string text;
    append_send(text, frame);
    ask(text, tag);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept {
    if (tag == 0) return;
    for (auto& g : given_) {
      if (g.tag == tag) g.tag = 0;
    }
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
    deliveries_.listen(listener, accept);
  }
  [[nodiscard]] can::Status status() const noexcept {
    can::Status s;
    s.bit_rate = options_.bit_rate;
    s.bit_rate_is_label = s.bit_rate != 0;
    s.queued = static_cast<std::uint16_t>(given_.size());
    s.errors = errors_;
    s.lost = lost_;
    s.listen_only = options_.listen_only;
    s.up = state_ == State::up;
    return s;
  }
  bool restart(std::uint32_t bit_rate) noexcept { return bit_rate != 0 && bit_rate == options_.bit_rate; }
  [[nodiscard]] const LineFaults& faults() const noexcept { return faults_; }
  [[nodiscard]] unsigned connections() const noexcept { return connections_; }

 private:
  enum class State : std::uint8_t { down, connecting, greeting, opening, switching, up };
  struct Given {
    std::uint32_t tag = 0;
    rt::Time at{};
  };
  [[nodiscard]] rt::Executor& executor() const noexcept { return loop_->executor(); }

  void wait() {
    const auto end = std::chrono::steady_clock::now() + options_.timeout;
    while (state_ != State::up && state_ != State::down) {
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
      pollfd wait{stream_->descriptor(), POLLIN, 0};
      if (stream_->waiting() > 0) wait.events = POLLIN | POLLOUT;
      const int n = left.count() <= 0 ? 0 : ::poll(&wait, 1, static_cast<int>(left.count()));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return lost("the server does not answer");
      ready(static_cast<std::uint32_t>(wait.revents));  // epoll's bits are poll's
      flush();
    }
  }

  void ready(std::uint32_t events) noexcept override {
    if (!stream_) return;
    if (state_ == State::connecting) {
      if (const int error = connect_error(stream_->descriptor()); error != 0) return lost(std::strerror(error));
      state_ = State::greeting;
    }
    if ((events & EPOLLOUT) != 0 && !stream_->flush()) return lost("the connection is broken");
    std::array<char, 16384> buffer;
    const auto bytes = stream_->get(buffer);
    if (!bytes.empty()) {
      reader_.add(bytes);
      read_all();
    }
    if (stream_ && stream_->gone()) lost("the server has closed the connection");
  }

  void read_all() {
    while (stream_) {
      const auto element = reader_.next();
      if (reader_.faults() != known_faults_) {
        known_faults_ = reader_.faults();
        ++lost_;
        faults_ = {faults_.count + 1, reader_.fault_at(), "bytes that are not a socketcand element"};
        if (state_ != State::up) return lost("the program that listens there speaks another protocol");
      }
      if (!element) return;
      heard(*element);
    }
  }

  void heard(std::string_view element) {
    const auto notice = parse_notice(element);
    using Said = SocketcandNotice::Kind;
    if (state_ == State::up) return heard_up(notice, element);
    if (notice.kind == Said::error) return lost(fmt::format("the server says: {}", notice.text));
    if (state_ == State::greeting) {
      if (notice.kind != Said::hi) return lost("the program that listens there speaks another protocol");
      state_ = State::opening;
      return say(fmt::format("< open {} >", bus_));
    }
    if (notice.kind != Said::ok) return;  // a frame that came before
    if (state_ == State::opening) {
      state_ = State::switching;
      return say("< rawmode >");
    }
    state_ = State::up;
    ++connections_;
    pause_ = least_pause;
    deliveries_.changed(status(), executor().now());
    ask({}, 0);  // a Berth server holds frames back until the client's first message
    timer_.arm(tick_time);
  }

  void heard_up(const SocketcandNotice& notice, std::string_view element) {
    using Said = SocketcandNotice::Kind;
    const rt::Time at = executor().now();
    switch (notice.kind) {
      case Said::frame: return received(notice.frame, at);
      case Said::echo: {
        if (given_.empty()) return;
        const auto tag = given_.front().tag;
        given_.pop_front();
        if (tag != 0) deliveries_.sent(tag, at);
        return;
      }
      case Said::error:
        ++errors_;
        faults_ = {faults_.count, faults_.at, "the server says: " + notice.text};
        return;
      case Said::malformed:
        ++lost_;
        faults_ = {faults_.count + 1, reader_.fault_at(), fmt::format("no frame: < {} >", element.substr(0, 80))};
        return;
      default: return;
    }
  }

  // Sends the text, and asks for an echo after it.
  void ask(std::string_view text, std::uint32_t tag) {
    given_.push_back({tag, executor().now()});
    asked_ = executor().now();
    say(text);
    say("< echo >");
  }
  void say(std::string_view text) {
    if (!stream_ || !stream_->put(text)) return lost("the server accepts no data");
    flush_.post();
  }
  void flush() noexcept {
    if (stream_ && !stream_->flush()) lost("the connection is broken");
  }

  void received(const can::Frame& frame, rt::Time at) noexcept {
    if (deliveries_.size() >= messages_kept) {
      ++lost_;
    } else {
      deliveries_.received(frame, at);
    }
  }

  void expire() noexcept {
    const rt::Time now = executor().now();
    switch (state_) {
      case State::down: return begin();
      case State::connecting:
      case State::greeting:
      case State::opening:
      case State::switching: return lost("the server does not answer");
      case State::up: break;
    }
    if (!given_.empty() && now - given_.front().at > echo_time) return lost("the server does not answer");
    timer_.arm(tick_time);
    if (given_.empty() && now - asked_ >= idle_time) ask({}, 0);
  }

  void lost(const std::string& why) noexcept {
    const bool was_up = state_ == State::up;
    state_ = State::down;
    faults_ = {faults_.count + 1, faults_.at, why};
    given_.clear();
    stream_.reset();
    flush_.cancel();
    timer_.arm(pause_);
    pause_ = std::min(pause_ * 2, most_pause);
    if (was_up) deliveries_.changed(status(), executor().now());
  }

  Loop* loop_;
  std::vector<SocketAddress> addresses_;
  std::size_t next_ = 0;
  std::string bus_;
  SocketcandOptions options_;
  std::optional<Stream> stream_;
  ElementReader reader_;
  std::uint64_t known_faults_ = 0;
  State state_ = State::down;
  rt::Duration pause_ = least_pause;
  rt::Later<Impl, &Impl::expire> timer_{*this, loop_->executor()};
  rt::Later<Impl, &Impl::flush> flush_{*this, loop_->executor()};
  Deliveries deliveries_{loop_->executor()};
  std::deque<Given> given_;
  rt::Time asked_{};
  std::uint32_t errors_ = 0;
  std::uint32_t lost_ = 0;
  unsigned connections_ = 0;
  LineFaults faults_;
};

tl::expected<std::unique_ptr<SocketcandPort>, std::string> SocketcandPort::connect(Loop& loop,
                                                                                   const std::string& address,
                                                                                   const SocketcandOptions& options) {
  const std::string name = "socketcand://" + address;
  const auto slash = address.find('/');
  const auto where = parse_endpoint(address.substr(0, slash), socketcand_port, "");
  const auto bus = slash == std::string::npos ? std::string() : address.substr(slash + 1);
  if (!where || bus.empty() || bus.find_first_of("<>\r\n") != std::string::npos)
    return tl::unexpected(name + ": write socketcand://HOST:PORT/BUS");
  auto addresses = look_up(*where);
  if (!addresses) return tl::unexpected(name + ": " + addresses.error());
  auto impl = std::make_unique<Impl>(loop, std::move(*addresses), bus, options);
  if (options.timeout.count() <= 0) {
    impl->begin();
  } else if (const auto why = impl->connect_now()) {
    return tl::unexpected(fmt::format("{}: {}; is a socketcand server there, with a bus of this name?", name, *why));
  }
  return std::unique_ptr<SocketcandPort>(new SocketcandPort(std::move(impl)));
}

SocketcandPort::SocketcandPort(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
SocketcandPort::~SocketcandPort() = default;
can::Queued SocketcandPort::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  return impl_->send(frame, tag);
}
void SocketcandPort::withdraw(std::uint32_t tag) noexcept { impl_->withdraw(tag); }
void SocketcandPort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  impl_->listen(listener, accept);
}
can::Status SocketcandPort::status() const noexcept { return impl_->status(); }
bool SocketcandPort::restart(std::uint32_t bit_rate) noexcept { return impl_->restart(bit_rate); }
const LineFaults& SocketcandPort::faults() const noexcept { return impl_->faults(); }
unsigned SocketcandPort::connections() const noexcept { return impl_->connections(); }

}  // namespace berth::io
