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
#include <deque>
#include <optional>

#include "berth/io/deliveries.hpp"
#include "berth/io/slcan_codec.hpp"
#include "berth/io/stream.hpp"
#include "berth/rt/later.hpp"

namespace berth::io {

using namespace std::chrono_literals;

namespace {

constexpr rt::Duration quiet_time = 300ms;   // an adapter that says nothing for so long says nothing ever
constexpr rt::Duration answer_time = 1s;     // to a command or a frame
constexpr rt::Duration refused_pause = 2ms;  // before a refused frame is given again
constexpr unsigned most_tries = 500;
constexpr rt::Duration flags_period = 1s;
constexpr rt::Duration reopen_pause = 500ms;
constexpr std::size_t most_waiting = 1U << 16U;
constexpr std::size_t most_flying = 256;
constexpr std::size_t events_kept = 8192;  // more than one reading can bring

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

// A raw line, locked; negative and `why` in words.
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

/// Lines are taken between jobs; what they say is delivered one per job.
class SlcanPort::Impl final : private Watcher {
 public:
  Impl(Loop& loop, Device device, const SlcanOptions& options)
      : loop_(&loop), device_(std::move(device)), options_(options), bit_rate_(options.bit_rate) {}
  ~Impl() {
    if (!stream_ || state_ == State::down) return;
    stream_->put("C\r");  // the adapter shall not fill a line that is not read
    stream_->flush();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  // The first time, waited for. Empty: it is up.
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
    if (waiting_.size() + flying_.size() >= queue_depth) return can::Queued::full;
    waiting_.push_back({frame, tag});
    pump_.post();
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept {
    if (tag == 0) return;
    const auto first = waiting_.begin() + (asked_ == Asked::frame ? 1 : 0);
    waiting_.erase(std::remove_if(first, waiting_.end(), [tag](const Waiting& w) { return w.tag == tag; }),
                   waiting_.end());
    for (auto* const queue : {&waiting_, &flying_}) {
      for (auto& w : *queue) {
        if (w.tag == tag) w.tag = 0;
      }
    }
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
    deliveries_.listen(listener, accept);
  }
  [[nodiscard]] can::Status status() const noexcept {
    can::Status s;
    s.bit_rate = bit_rate_;
    s.queued = static_cast<std::uint16_t>(waiting_.size() + flying_.size());
    s.errors = errors_;
    s.lost = lost_;
    s.listen_only = options_.listen_only;
    s.up = state_ == State::up;
    s.knows_sent = confirms_ == Confirms::events;
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
  [[nodiscard]] Confirms confirms() const noexcept { return confirms_; }
  [[nodiscard]] const std::string& version() const noexcept { return version_; }
  [[nodiscard]] std::uint8_t flags() const noexcept { return flags_; }

 private:
  enum class State : std::uint8_t { down, meeting, leading, up };
  enum class Asked : std::uint8_t { nothing, frame, flags };
  struct Waiting {
    can::Frame frame;
    std::uint32_t tag = 0;
    unsigned tries = 0;
  };
  /// A command of the setup; what to say when the adapter refuses it, nothing: it may.
  struct Step {
    std::string command;
    std::string refusal;
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

  // The first C may be the end of a line that was broken off.
  void set_up() noexcept {
    state_ = State::meeting;
    confirms_ = Confirms::nothing;
    answers_ = 0;
    say("C\rC\rV\r");
    wait_for(quiet_time);
  }

  // Known now: does it answer?
  void lead() noexcept {
    state_ = State::leading;
    steps_.clear();
    if (bit_rate_ != 0) steps_.push_back({slcan_rate(bit_rate_), fmt::format("it refuses {} bit/s", bit_rate_)});
    if (options_.data_bit_rate != 0) {
      steps_.push_back({fmt::format("Y{}\r", options_.data_bit_rate / 1'000'000),
                        fmt::format("it refuses {} bit/s in the data phase", options_.data_bit_rate)});
    }
    if (answers_ == 0) {
      steps_.push_back({options_.listen_only ? "M1\r" : "M0\r", {}});
      steps_.push_back({"O\r", {}});
      for (const auto& step : steps_) say(step.command);
      return come_up();
    }
    steps_.push_back({"z0003\r", {}});  // frames received and frames sent are reported
    steps_.push_back({options_.listen_only ? "L\r" : "O\r",
                      options_.listen_only ? "it cannot listen only" : "it does not open its channel"});
    say(steps_.front().command);
    wait_for(answer_time);
  }

  void led(bool refused) noexcept {
    const Step step = steps_.front();
    steps_.pop_front();
    if (refused && !step.refusal.empty()) return lost("the adapter: " + step.refusal);
    if (step.command[0] == 'z') confirms_ = refused ? Confirms::answers : Confirms::events;
    if (steps_.empty()) return come_up();
    say(steps_.front().command);
    wait_for(answer_time);
  }

  void come_up() noexcept {
    state_ = State::up;
    asked_ = Asked::nothing;
    flags_due_ = executor().now() + flags_period;
    asks_flags_ = confirms_ != Confirms::nothing;
    deliveries_.changed(status(), executor().now());
    wait_for(flags_period);
  }

  // ---- the line ----

  void say(std::string_view text) noexcept {
    if (!stream_->put(text) || !stream_->flush()) lost("the adapter takes nothing");
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
    if (state_ != State::up) return met(parsed);
    switch (parsed.kind) {
      case Kind::frame: return received(parsed.frame);
      case Kind::confirmed: return confirm(parsed.frame);
      case Kind::done:
      case Kind::taken:
      case Kind::refused: return answered(parsed.kind);
      case Kind::flags: return take_flags(parsed.number);
      case Kind::version:
      case Kind::serial: return;
      case Kind::text:
      case Kind::garbage: break;
    }
    fault(line.at, fmt::format("no line of an adapter: {}", shown(line.text)));
  }

  // While it is set up: frames of the channel as it was before are dropped.
  void met(const SlcanLine& line) noexcept {
    using Kind = SlcanLine::Kind;
    const bool answer = line.kind == Kind::done || line.kind == Kind::refused;
    if (state_ == State::leading) {
      if (answer) led(line.kind == Kind::refused);
      return;
    }
    if (answer) ++answers_;
    if (line.kind == Kind::version || line.kind == Kind::text) version_ = line.text;
    // Two answers to C, and one to V.
    if (line.kind == Kind::version || line.kind == Kind::text || answers_ == 3) lead();
  }

  static std::string shown(std::string_view bytes) {
    std::string text(bytes.substr(0, 40));
    std::ranges::replace_if(
        text, [](char c) { return c < ' ' || c > '~'; }, '?');
    return text;
  }

  void fault(std::uint64_t at, const std::string& what) {
    ++lost_;
    faults_ = {faults_.count + 1, at, what};
  }

  // ---- own frames ----

  void pump() noexcept {
    if (stream_ && state_ == State::up && asked_ == Asked::nothing) ask_flags();
    while (stream_ && state_ == State::up && asked_ == Asked::nothing && !waiting_.empty() && stream_->waiting() == 0) {
      if (retry_at_ && executor().now() < *retry_at_) return;
      retry_at_.reset();
      say(write_slcan(waiting_.front().frame));
      if (!stream_) return;
      if (confirms_ == Confirms::nothing) {
        done(waiting_);
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
      if (refused) asks_flags_ = false;
      asked_ = Asked::nothing;
    } else if (asked_ == Asked::frame) {
      asked_ = Asked::nothing;
      if (refused) {
        again();
      } else if (confirms_ == Confirms::events && kind == SlcanLine::Kind::done) {
        if (flying_.size() >= most_flying) flying_.pop_front();
        flying_.push_back(waiting_.front());
        waiting_.pop_front();
      } else {
        done(waiting_);
      }
    }
    pump();
  }

  // Its queue is full, mostly.
  void again() noexcept {
    ++errors_;
    if (++waiting_.front().tries >= most_tries) {
      waiting_.pop_front();
      return;
    }
    retry_at_ = executor().now() + refused_pause;
    wait_for(refused_pause);
  }

  void done(std::deque<Waiting>& queue) {
    const auto tag = queue.front().tag;
    queue.pop_front();
    if (tag != 0) deliveries_.sent(tag, executor().now());
  }

  void confirm(const can::Frame& frame) noexcept {
    const auto it = std::ranges::find(flying_, frame, &Waiting::frame);
    if (it == flying_.end()) return;
    const auto tag = it->tag;
    flying_.erase(it);
    if (tag != 0) deliveries_.sent(tag, executor().now());
  }

  void take_flags(std::uint8_t flags) noexcept {
    if (asked_ == Asked::flags) asked_ = Asked::nothing;
    flags_ = flags;
    if ((flags & (slcan_flag::receive_full | slcan_flag::transmit_full | slcan_flag::overrun)) != 0) ++lost_;
    if ((flags & slcan_flag::bus_error) != 0) ++errors_;
    pump();
  }

  // ---- time ----

  void expire() noexcept {
    const rt::Time now = executor().now();
    switch (state_) {
      case State::down: return begin();
      case State::meeting: return lead();
      case State::leading: return lost("the adapter does not answer");
      case State::up: break;
    }
    if (asked_ != Asked::nothing && now >= asked_at_ + answer_time) {
      // The answer, or the frame, was lost on the line.
      if (asked_ == Asked::frame) {
        ++errors_;
        waiting_.pop_front();
      }
      asked_ = Asked::nothing;
    }
    wait_for(asked_ != Asked::nothing ? answer_time : retry_at_ ? refused_pause : flags_period);
    pump();
  }

  void ask_flags() noexcept {
    const rt::Time now = executor().now();
    if (!asks_flags_ || now < flags_due_) return;
    flags_due_ = now + flags_period;
    asked_ = Asked::flags;
    asked_at_ = now;
    wait_for(answer_time);
    say("F\r");
  }

  void drop() noexcept {
    waiting_.clear();
    flying_.clear();
    asked_ = Asked::nothing;
    retry_at_.reset();
  }

  void lost(const std::string& why) noexcept {
    const bool was_up = state_ == State::up;
    if (was_up && reader_.kept() > 0) ++lost_;  // in the middle of a line
    state_ = State::down;
    faults_ = {faults_.count + 1, faults_.at, why};
    drop();
    stream_.reset();
    wait_for(reopen_pause);
    if (was_up) deliveries_.changed(status(), executor().now());
  }

  void received(const can::Frame& frame) noexcept {
    if (deliveries_.size() >= events_kept) {
      ++lost_;
    } else {
      deliveries_.received(frame, executor().now());
    }
  }

  Loop* loop_;
  Device device_;
  SlcanOptions options_;
  std::uint32_t bit_rate_;
  std::optional<Stream> stream_;
  SlcanReader reader_;
  State state_ = State::down;
  Confirms confirms_ = Confirms::nothing;
  unsigned answers_ = 0;  // to C, C and V
  std::deque<Step> steps_;
  std::string version_;
  std::uint8_t flags_ = 0;
  bool asks_flags_ = false;
  rt::Time flags_due_{};
  Asked asked_ = Asked::nothing;
  rt::Time asked_at_{};
  std::optional<rt::Time> retry_at_;
  rt::Duration patience_{0};
  rt::Later<Impl, &Impl::expire> timer_{*this, loop_->executor()};
  rt::Later<Impl, &Impl::pump> pump_{*this, loop_->executor()};
  Deliveries deliveries_{loop_->executor()};
  std::deque<Waiting> waiting_;  // the first is the one asked about
  std::deque<Waiting> flying_;   // taken by the adapter, not yet acknowledged
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
        fmt::format("{}: no adapter is given {} bit/s; use 10, 20, 50, 100, 125, 250, 500, 800 or 1000 "
                    "kbit/s",
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
Confirms SlcanPort::confirms() const noexcept { return impl_->confirms(); }
const std::string& SlcanPort::version() const noexcept { return impl_->version(); }
std::uint8_t SlcanPort::flags() const noexcept { return impl_->flags(); }

}  // namespace berth::io
