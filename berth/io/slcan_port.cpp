#include "berth/io/slcan_port.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/epoll.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>

#include "berth/io/deliveries.hpp"
#include "berth/io/slcan_codec.hpp"
#include "berth/io/slcan_queue.hpp"
#include "berth/io/slcan_setup.hpp"
#include "berth/io/stream.hpp"
#include "berth/rt/later.hpp"

namespace berth::io {

using namespace std::chrono_literals;

namespace {

constexpr rt::Duration quiet_time = 300ms;   // an adapter that is silent for so long never answers
constexpr rt::Duration answer_time = 1s;     // for the answer to a command or a frame
constexpr rt::Duration refused_pause = 2ms;  // before a refused frame is sent again
constexpr rt::Duration flags_period = 1s;
constexpr rt::Duration reopen_pause = 500ms;
constexpr std::size_t most_waiting = 1U << 16U;
constexpr std::size_t events_kept = 8192;  // more than one read can bring

struct Speed {
  std::uint32_t bits;
  speed_t name;
};
constexpr Speed speeds[] = {{9600, B9600},      {19200, B19200},     {38400, B38400},     {57600, B57600},
                            {115200, B115200},  {230400, B230400},   {460800, B460800},   {500000, B500000},
                            {921600, B921600},  {1000000, B1000000}, {2000000, B2000000}, {3000000, B3000000},
                            {4000000, B4000000}};

struct Device {
  std::string path;
  speed_t speed = B115200;
};

std::optional<Device> parse_device(const std::string& address) {
  const auto at = address.rfind('@');
  Device device{address.substr(0, at)};
  if (device.path.empty()) return std::nullopt;
  if (at == std::string::npos) return device;
  std::uint32_t bits = 0;
  const char* const end = address.data() + address.size();
  const auto [last, error] = std::from_chars(address.data() + at + 1, end, bits);
  const auto* const known = std::ranges::find(speeds, bits, &Speed::bits);
  if (error != std::errc{} || last != end || known == std::end(speeds)) return std::nullopt;
  device.speed = known->name;
  return device;
}

std::string shown(std::string_view bytes) {
  std::string text(bytes.substr(0, 40));
  std::ranges::replace_if(
      text, [](char c) { return c < ' ' || c > '~'; }, '?');
  return text;
}

// Opens a raw, locked line. Negative: `why` says why not.
int open_line(const Device& device, std::string& why) {
  const int fd = ::open(device.path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    why = errno == ENOENT   ? "no such device: is the adapter plugged in?"
          : errno == EACCES ? "not permitted: your user must be in the device's group (dialout)"
          : errno == EBUSY  ? "another program uses it"
                            : std::strerror(errno);
    return -1;
  }
  termios line{};
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0) {
    why = "another program uses it";
  } else if (::tcgetattr(fd, &line) != 0) {
    why = "no serial line";
  } else {
    ::cfmakeraw(&line);
    line.c_cflag |= CLOCAL | CREAD;
    line.c_cc[VMIN] = 1;
    line.c_cc[VTIME] = 0;
    ::cfsetspeed(&line, device.speed);
    if (::tcsetattr(fd, TCSANOW, &line) == 0) {
      ::ioctl(fd, TIOCEXCL);
      ::tcflush(fd, TCIOFLUSH);
      return fd;
    }
    why = std::strerror(errno);
  }
  ::close(fd);
  return -1;
}

}  // namespace

/// Reads lines between jobs, and delivers what they say, one per job.
class SlcanPort::Impl final : private Watcher {
 public:
  Impl(Loop& loop, Device device, const SlcanOptions& options)
      : loop_(&loop), device_(std::move(device)), options_(options), bit_rate_(options.bit_rate) {}
  ~Impl() {
    if (!stream_ || state_ == State::down) return;
    stream_->put("C\r");  // the adapter must not fill a line that nobody reads
    stream_->flush();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // Opens the port the first time, and waits until it is up. Empty: it is up.
  std::optional<std::string> open_now() {
    begin();
    const auto end = std::chrono::steady_clock::now() + options_.timeout;
    while (state_ != State::up && state_ != State::down) {
      const auto now = std::chrono::steady_clock::now();
      if (now >= end) {
        lost("the adapter does not answer");
        break;
      }
      const auto left = std::chrono::ceil<std::chrono::milliseconds>(std::min<rt::Duration>(end - now, patience_));
      pollfd wait{stream_->descriptor(), POLLIN, 0};
      if (stream_->waiting() > 0) wait.events = POLLIN | POLLOUT;
      const int n = ::poll(&wait, 1, static_cast<int>(left.count()));
      if (n > 0) ready(static_cast<std::uint32_t>(wait.revents));  // epoll's bits are poll's
      if (n == 0) expire();
    }
    if (state_ != State::up) return faults_.what;
    deliveries_.clear();
    return std::nullopt;
  }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept {
    if (state_ != State::up || (frame.fd && options_.data_bit_rate == 0)) return can::Queued::closed;
    if (options_.listen_only) return can::Queued::listen_only;
    if (queue_.size() >= queue_depth) return can::Queued::full;
    queue_.push(frame, tag);
    pump_.post();
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept {
    if (tag == 0) return;
    queue_.withdraw(tag, asked_ == Asked::frame);
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
    deliveries_.listen(listener, accept);
  }
  [[nodiscard]] can::Status status() const noexcept {
    can::Status s;
    s.bit_rate = bit_rate_;
    s.queued = static_cast<std::uint16_t>(queue_.size());
    s.errors = errors_;
    s.lost = lost_;
    s.listen_only = options_.listen_only;
    s.up = state_ == State::up;
    s.knows_sent = setup_.confirms() == Confirms::events;
    return s;
  }
  bool restart(std::uint32_t bit_rate) noexcept {
    if (slcan_rate(bit_rate).empty()) return false;
    bit_rate_ = bit_rate;
    drop();
    if (state_ != State::down) set_up();
    return true;
  }
  [[nodiscard]] const LineFaults& faults() const noexcept { return faults_; }
  [[nodiscard]] const SlcanSetup& setup() const noexcept { return setup_; }
  [[nodiscard]] std::uint8_t flags() const noexcept { return flags_.last; }

 private:
  enum class State : std::uint8_t { down, setting_up, up };
  enum class Asked : std::uint8_t { nothing, frame, flags };
  /// The adapter's status flags.
  struct Flags {
    std::uint8_t last = 0;
    bool asks = false;
    rt::Time due{};
  };
  [[nodiscard]] rt::Executor& executor() const noexcept { return loop_->executor(); }
  void wait_for(rt::Duration time) noexcept {
    patience_ = time;
    timer_.arm(time);
  }

  // ---- setup ----

  void begin() noexcept {
    std::string why;
    const int fd = open_line(device_, why);
    if (fd < 0) return lost(why);
    reader_.reset();
    Watcher& self = *this;
    stream_.emplace(*loop_, fd, Stream::Kind::line, self, most_waiting);
    set_up();
  }

  void set_up() noexcept {
    state_ = State::setting_up;
    say(setup_.begin(bit_rate_, options_));
    wait_for(quiet_time);
  }

  void advance(const SlcanSetup::Turn& turn) noexcept {
    if (!turn.failure.empty()) return lost(turn.failure);
    if (!turn.say.empty()) say(turn.say);
    if (!turn.up) return wait_for(answer_time);
    if (!stream_) return;
    state_ = State::up;
    asked_ = Asked::nothing;
    flags_.due = executor().now() + flags_period;
    flags_.asks = setup_.confirms() != Confirms::nothing;
    deliveries_.changed(status(), executor().now());
    wait_for(flags_period);
  }

  // ---- the line ----

  void say(std::string_view text) noexcept {
    if (!stream_->put(text) || !stream_->flush()) lost("the adapter accepts no data");
  }

  void ready(std::uint32_t events) noexcept override {
    if (!stream_) return;
    if ((events & EPOLLOUT) != 0) {
      stream_->flush();
      pump_.post();
    }
    std::array<char, 8192> buffer;
    const auto bytes = stream_->get(buffer);
    if (!bytes.empty()) {
      reader_.add(bytes);
      while (stream_) {
        const auto line = reader_.next();
        if (!line) break;
        heard(*line);
      }
    }
    if (stream_ && stream_->gone()) lost("unplugged");
  }

  void heard(const SlcanReader::Line& line) {
    using Kind = SlcanLine::Kind;
    const auto parsed = line.broken ? SlcanLine{} : parse_slcan(line.text);
    if (state_ != State::up) {
      if (const auto turn = setup_.hear(parsed)) advance(*turn);
      return;
    }
    switch (parsed.kind) {
      case Kind::frame:
        if (deliveries_.size() >= events_kept) {
          ++lost_;
        } else {
          deliveries_.received(parsed.frame, executor().now());
        }
        return;
      case Kind::confirmed: return sent(queue_.reported(parsed.frame));
      case Kind::done:
      case Kind::taken:
      case Kind::refused: return answered(parsed.kind);
      case Kind::flags: return take_flags(parsed.number);
      case Kind::version:
      case Kind::serial: return;
      case Kind::text:
      case Kind::garbage: break;
    }
    ++lost_;
    faults_ = {faults_.count + 1, line.at, fmt::format("not a line of an adapter: {}", shown(line.text))};
  }

  // ---- own frames ----

  void pump() noexcept {
    if (stream_ && state_ == State::up && asked_ == Asked::nothing) ask_flags();
    while (stream_ && state_ == State::up && asked_ == Asked::nothing && !queue_.none_waits() &&
           stream_->waiting() == 0) {
      if (retry_at_ && executor().now() < *retry_at_) return;
      retry_at_.reset();
      say(write_slcan(queue_.first()));
      if (!stream_) return;
      if (setup_.confirms() == Confirms::nothing) {
        sent(queue_.gone());
        continue;
      }
      asked_ = Asked::frame;
      asked_at_ = executor().now();
      wait_for(answer_time);
    }
  }

  void answered(SlcanLine::Kind kind) noexcept {
    const bool refused = kind == SlcanLine::Kind::refused;
    if (asked_ == Asked::flags) {
      if (refused) flags_.asks = false;
      asked_ = Asked::nothing;
    } else if (asked_ == Asked::frame) {
      asked_ = Asked::nothing;
      if (refused) {
        ++errors_;
        if (queue_.refused()) {  // usually because the adapter's queue is full
          retry_at_ = executor().now() + refused_pause;
          wait_for(refused_pause);
        }
      } else if (setup_.confirms() == Confirms::events && kind == SlcanLine::Kind::done) {
        queue_.taken();
      } else {
        sent(queue_.gone());
      }
    }
    pump();
  }

  void sent(std::uint32_t tag) noexcept {
    if (tag != 0) deliveries_.sent(tag, executor().now());
  }

  void take_flags(std::uint8_t flags) noexcept {
    if (asked_ == Asked::flags) asked_ = Asked::nothing;
    flags_.last = flags;
    if ((flags & (slcan_flag::receive_full | slcan_flag::transmit_full | slcan_flag::overrun)) != 0) ++lost_;
    if ((flags & slcan_flag::bus_error) != 0) ++errors_;
    pump();
  }

  // ---- time ----

  void expire() noexcept {
    const rt::Time now = executor().now();
    switch (state_) {
      case State::down: return begin();
      case State::setting_up: return advance(setup_.silence());
      case State::up: break;
    }
    if (asked_ != Asked::nothing && now >= asked_at_ + answer_time) {
      // The answer, or the frame, was lost on the line.
      if (asked_ == Asked::frame) {
        ++errors_;
        queue_.gone();
      }
      asked_ = Asked::nothing;
    }
    wait_for(asked_ != Asked::nothing ? answer_time : retry_at_ ? refused_pause : flags_period);
    pump();
  }

  void ask_flags() noexcept {
    const rt::Time now = executor().now();
    if (!flags_.asks || now < flags_.due) return;
    flags_.due = now + flags_period;
    asked_ = Asked::flags;
    asked_at_ = now;
    wait_for(answer_time);
    say("F\r");
  }

  void drop() noexcept {
    queue_.clear();
    asked_ = Asked::nothing;
    retry_at_.reset();
  }

  void lost(const std::string& why) noexcept {
    const bool was_up = state_ == State::up;
    if (was_up && reader_.kept() > 0) ++lost_;  // a line was broken off
    state_ = State::down;
    faults_ = {faults_.count + 1, faults_.at, why};
    drop();
    stream_.reset();
    wait_for(reopen_pause);
    if (was_up) deliveries_.changed(status(), executor().now());
  }

  Loop* loop_;
  Device device_;
  SlcanOptions options_;
  std::uint32_t bit_rate_;
  std::optional<Stream> stream_;
  SlcanReader reader_;
  State state_ = State::down;
  SlcanSetup setup_;
  Flags flags_;
  Asked asked_ = Asked::nothing;
  rt::Time asked_at_{};
  std::optional<rt::Time> retry_at_;
  rt::Duration patience_{0};
  rt::Later<Impl, &Impl::expire> timer_{*this, loop_->executor()};
  rt::Later<Impl, &Impl::pump> pump_{*this, loop_->executor()};
  Deliveries deliveries_{loop_->executor()};
  SlcanQueue queue_;
  std::uint32_t errors_ = 0;
  std::uint32_t lost_ = 0;
  LineFaults faults_;
};

tl::expected<std::unique_ptr<SlcanPort>, std::string> SlcanPort::open(Loop& loop, const std::string& address,
                                                                      const SlcanOptions& options) {
  const std::string name = "slcan:" + address;
  auto device = parse_device(address);
  if (!device) {
    return tl::unexpected(name +
                          ": write slcan:DEVICE or slcan:DEVICE@SPEED, such as slcan:/dev/ttyUSB0@115200 (speeds: "
                          "9600 to 4000000)");
  }
  if (options.bit_rate != 0 && slcan_rate(options.bit_rate).empty()) {
    return tl::unexpected(
        fmt::format("{}: an adapter cannot be set to {} bit/s; use 10, 20, 50, 100, 125, 250, 500, 800 or 1000 kbit/s",
                    name, options.bit_rate));
  }
  auto impl = std::make_unique<Impl>(loop, std::move(*device), options);
  if (const auto why = impl->open_now()) return tl::unexpected(fmt::format("{}: {}", name, *why));
  return std::unique_ptr<SlcanPort>(new SlcanPort(std::move(impl)));
}

SlcanPort::SlcanPort(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
SlcanPort::~SlcanPort() = default;
can::Queued SlcanPort::send(const can::Frame& frame, std::uint32_t tag) noexcept { return impl_->send(frame, tag); }
void SlcanPort::withdraw(std::uint32_t tag) noexcept { impl_->withdraw(tag); }
void SlcanPort::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  impl_->listen(listener, accept);
}
can::Status SlcanPort::status() const noexcept { return impl_->status(); }
bool SlcanPort::restart(std::uint32_t bit_rate) noexcept { return impl_->restart(bit_rate); }
const LineFaults& SlcanPort::faults() const noexcept { return impl_->faults(); }
Confirms SlcanPort::confirms() const noexcept { return impl_->setup().confirms(); }
const std::string& SlcanPort::version() const noexcept { return impl_->setup().version(); }
std::uint8_t SlcanPort::flags() const noexcept { return impl_->flags(); }

}  // namespace berth::io
