#include "berth/serve/client.hpp"

#include <fmt/format.h>
#include <sys/epoll.h>
#include <sys/socket.h>

#include <algorithm>

namespace berth::serve {

using Command = io::SocketcandCommand;
using Kind = Command::Kind;

namespace {

constexpr std::string_view unknown_command = "< error unknown command >";
constexpr can::IdRange everything[] = {can::all_base, can::all_extended};

std::string shown(const std::string& name) {
  constexpr std::size_t longest = 64;
  return name.size() > longest ? name.substr(0, longest) + "..." : name;
}

}  // namespace

Client::Client(House& house, int fd, std::string name)
    : house_(&house),
      stream_(*house.loop, fd, io::Stream::Kind::socket, *this, house.options->most_waiting),
      name_(std::move(name)) {}

Client::~Client() {
  if (port_) port_->listen(nullptr, {});
}

void Client::greet() {
  io::Seat::Sitter& sitter = *this;
  seat_.emplace(*house_->seats, sitter, std::string(io::without_port(name_)));
  say("< hi >");
}

void Client::seat_lost(io::Seat::End how) noexcept {
  ++house_->counters->silent;
  end(house_->seats->why(how));
}

// ---- the connection ----

void Client::say(std::string_view bytes) {
  if (over_ || (leaving_ && stream_.gone())) return;
  if (!stream_.put(bytes)) {
    end(stream_.too_slow() ? "too slow: it does not read what it asked for" : "gone");
    return;
  }
  if (!flush_.ready()) house_->executor().post(flush_);
}

void Client::flush() noexcept {
  if (over_ || stream_.gone()) return;
  const bool good = stream_.flush();
  if (seat_) seat_->output(stream_.taken(), stream_.waiting());
  if (!good && !leaving_) end("gone");
}

// The client has hung up. Its frames are still sent if the bus takes them, as the kernel would do.
void Client::leave() {
  if (over_) return;
  if (!port_ || outbox_.empty()) return end("left");
  if (!leaving_) leaving_ = house_->executor().now();
  arm(*leaving_ + linger);
}

void Client::end(const std::string& why, std::string_view last_word) {
  if (over_) return;
  over_ = true;
  if (stream_.too_slow()) ++house_->counters->too_slow;
  if (!stream_.gone()) {
    stream_.put(last_word);
    stream_.flush();
    ::shutdown(stream_.descriptor(), SHUT_WR);
    // If bytes are unread at the close, the system resets the connection and the last message is lost.
    std::array<char, 4096> unread{};
    for (int i = 0; i < 16 && !stream_.get(unread).empty();) ++i;
  }
  stream_.close();
  flush_.cancel();
  clock_.cancel();
  if (seat_) seat_->leave();
  (*house_->tell)(fmt::format("{}: {}", name_, why));
  house_->executor().post(*house_->reaper);
}

void Client::ready(std::uint32_t events) noexcept {
  if (over_) return;
  if ((events & EPOLLOUT) != 0) {
    flush();
    if (over_ || stream_.gone()) return end("gone");
  }
  if (stream_.held()) {
    if ((events & (EPOLLHUP | EPOLLERR)) != 0) return end("gone");
    if ((events & EPOLLRDHUP) != 0) {
      stream_.hung_up();
      leave();
    }
    return;
  }
  std::array<char, 4096> buffer;  // small pieces, so that other clients need not wait long
  const auto bytes = stream_.get(buffer);
  if (!bytes.empty()) {
    reader_.add(bytes);
    release();
    work();
  }
  if (over_ || !stream_.gone()) return;
  stream_.close();
  leave();
}

// Handles elements as long as the bus takes their frames.
void Client::work() {
  while (!over_ && !outbox_.stalled()) {
    const auto element = reader_.next();
    if (reader_.faults() > 0) {
      ++house_->counters->misbehaved;
      end(fmt::format("sent something that is not a socketcand element, at byte {}", reader_.fault_at()),
          unknown_command);
      return;
    }
    if (!element) break;
    const auto command = io::parse_command(*element);
    mode_ == Mode::no_bus ? act_without_bus(command) : act_on_bus(command);
    if (mode_ != Mode::no_bus && seat_) seat_->whole_request();
  }
  if (over_ || stream_.gone()) return;
  stream_.hold(outbox_.stalled());
  if (seat_) seat_->begun(!stream_.held() && reader_.kept() > 0);  // if held, the bus causes the delay
}

// The bus may have room again.
void Client::go_on() {
  if (outbox_.kept() && hand_over(*outbox_.kept())) outbox_.drop_kept();
  if (!over_ && (stream_.held() || leaving_) && !outbox_.stalled()) work();
}

// ---- time ----

void Client::arm(rt::Time when) noexcept {
  if (!clock_.timed() || clock_.due() > when) house_->executor().at(when, clock_);
}

void Client::tick() noexcept {
  const rt::Time now = house_->executor().now();
  if (!port_) return;
  if (leaving_ && now >= *leaving_ + linger) return end("left");
  if (quiet_until_ && now >= *quiet_until_) release();
  if (restart_at_ && now >= *restart_at_) {
    restart_at_.reset();
    port_->restart(port_->status().bit_rate);
  }
  answer_echoes(now);
  broadcasts_.run(now, !outbox_.kept());
  if (mode_ == Mode::control) {
    if (const auto text = statistics_.tell(now)) say(*text);
    if (!over_ && statistics_.due()) arm(*statistics_.due());
  }
  if (!over_) go_on();
  if (over_) return;
  if (quiet_until_) arm(*quiet_until_);
  if (restart_at_) arm(*restart_at_);
  if (leaving_) arm(*leaving_ + linger);
  if (outbox_.echo_deadline()) arm(*outbox_.echo_deadline());
}

// ---- requests of the client ----

void Client::act_without_bus(const Command& command) {
  if (command.kind == Kind::configure) {
    ++house_->counters->misbehaved;
    return end("wanted to set a bus's bit timing", fmt::format("< error configuring interface {} >", command.bus));
  }
  if (command.kind != Kind::open) return say(unknown_command);
  std::string why;
  port_ = (*house_->factory)(command.bus, why);
  if (!port_) {
    return end(fmt::format("wanted the bus \"{}\": {}", shown(command.bus), why), "< error could not open bus >");
  }
  bus_ = command.bus;
  (*house_->tell)(fmt::format("{}: on bus {}", name_, shown(bus_)));
  enter(Mode::bcm);
}

void Client::enter(Mode mode) {
  release();
  mode_ = mode;
  broadcasts_.clear();
  statistics_.tell_every(rt::Duration{0}, house_->executor().now());
  filter();
  say("< ok >");
  if (mode != Mode::raw || over_) return;
  flush();
  quiet_until_ = house_->executor().now() + quiet_after_ok;
  arm(*quiet_until_);
}

// Sets which frames this client receives.
void Client::filter() {
  if (mode_ == Mode::raw) return port_->listen(this, everything);
  port_->listen(this, broadcasts_.keys());
}

void Client::act_on_bus(const Command& command) {
  static constexpr std::pair<Kind, Mode> modes[] = {
      {Kind::raw_mode, Mode::raw}, {Kind::bcm_mode, Mode::bcm}, {Kind::control_mode, Mode::control}};
  for (const auto& [kind, mode] : modes) {
    if (command.kind == kind) return mode == mode_ ? say(unknown_command) : enter(mode);
  }
  switch (command.kind) {
    case Kind::echo:
      outbox_.ask_echo(house_->executor().now());
      answer_echoes(house_->executor().now());
      if (outbox_.echo_deadline()) arm(*outbox_.echo_deadline());
      return;
    case Kind::malformed: ++house_->counters->malformed; return;
    case Kind::send:
      if (mode_ != Mode::control) return give(command.frame);
      break;
    case Kind::statistics:
      if (mode_ != Mode::control) break;
      statistics_.tell_every(command.interval, house_->executor().now());
      if (statistics_.due()) arm(*statistics_.due());
      return;
    case Kind::add:
    case Kind::update:
    case Kind::remove:
    case Kind::filter:
    case Kind::subscribe:
    case Kind::unsubscribe:
      if (mode_ != Mode::bcm) break;
      if (!broadcasts_.act(command, house_->executor().now())) ++house_->counters->malformed;
      return;
    default: break;
  }
  say(unknown_command);
}

// ---- frames from the client ----

void Client::give(const can::Frame& frame) {
  if (!hand_over(frame)) outbox_.keep(frame);
}

// False: no room now.
bool Client::hand_over(const can::Frame& frame) {
  const auto queued = outbox_.send(*port_, frame);
  switch (queued) {
    case can::Queued::yes: ++house_->counters->frames_in; return true;
    case can::Queued::full:
      // `sent` reports room in the queue; if it does not come, the timer does.
      arm(house_->executor().now() + Outbox::echo_wait);
      return false;
    case can::Queued::bus_off:
    case can::Queued::listen_only:
    case can::Queued::closed: break;
  }
  ++house_->counters->not_sent;
  const char* const why = queued == can::Queued::bus_off       ? "bus-off"
                          : queued == can::Queued::listen_only ? "listening only"
                                                               : "bus is down";
  say(fmt::format("< error could not send frame: {} >", why));
  return true;
}

void Client::sent(std::uint32_t tag, rt::Time at) noexcept {
  if (over_) return;
  const auto size = outbox_.sent(tag);
  if (!size) return;
  statistics_.sent(*size);
  answer_echoes(at);
  if (!over_) go_on();
  if (over_ || !leaving_) return;
  leaving_ = at;
  if (stream_.gone()) leave();
}

void Client::answer_echoes(rt::Time now) {
  while (!over_ && outbox_.take_echo(now)) say("< echo >");
}

void Client::changed(const can::Status& status, rt::Time at) noexcept {
  if (over_) return;
  if (status.bus_off || !status.up) outbox_.lose();
  if (status.bus_off && !restart_at_) {
    restart_at_ = at + bus_off_pause;
    arm(*restart_at_);
  }
  answer_echoes(at);
  if (!over_) go_on();
}

// ---- frames to the client ----

void Client::received(const can::Frame& frame, rt::Time at) noexcept {
  if (over_) return;
  if (!io::socketcand_can_say(frame)) {
    ++house_->counters->unspeakable;
    return;
  }
  statistics_.received(frame.size);
  if (mode_ == Mode::raw) tell_frame(frame, at);
  if (mode_ == Mode::bcm) broadcasts_.hear(frame, at);
}

bool Client::tell_frame(const can::Frame& frame, rt::Time at) {
  std::string text;
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(at.time_since_epoch());
  io::append_frame(text, frame, house_->epoch + since, mode_ == Mode::bcm);
  ++house_->counters->frames_out;
  if (!quiet_until_) {
    say(text);
    return !over_;
  }
  later_ += text;
  if (later_.size() > house_->options->most_waiting / 2) release();
  return !over_;
}

void Client::release() {
  quiet_until_.reset();
  if (later_.empty()) return;
  const std::string text = std::move(later_);
  later_.clear();
  say(text);
}

// ---- statistics ----

void BusStatistics::tell_every(rt::Duration interval, rt::Time now) noexcept {
  every_ = interval.count() == 0 ? interval : std::max(interval, BroadcastManager::least_interval);
  due_ = now + every_;
}

std::optional<rt::Time> BusStatistics::due() const noexcept {
  return every_.count() == 0 ? std::nullopt : std::optional(due_);
}

std::optional<std::string> BusStatistics::tell(rt::Time now) {
  if (every_.count() == 0 || now < due_) return std::nullopt;
  due_ = now + every_;
  return fmt::format("< stat {} {} {} {} >", bytes_in_, frames_in_, bytes_out_, frames_out_);
}

}  // namespace berth::serve
