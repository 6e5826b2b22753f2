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
      name_(std::move(name)),
      patience_until_(house.executor().now() + house.options->patience) {}

Client::~Client() {
  if (port_) port_->listen(nullptr, {});
}

void Client::greet() {
  say("< hi >");
  arm(patience_until_);
}

// ---- the connection ----

void Client::say(std::string_view bytes) {
  if (over_ || (leaving_ && stream_.gone())) return;
  if (!stream_.put(bytes)) {
    end(stream_.too_slow() ? "too slow: it does not take what it asked for" : "gone");
    return;
  }
  if (!flush_.ready()) house_->executor().post(flush_);
}

void Client::flush() noexcept {
  if (!over_ && !leaving_ && !stream_.flush()) end("gone");
}

// It has hung up; the frames that it gave are sent first, if the bus takes them, as the kernel would do.
void Client::leave() {
  if (over_) return;
  if (!port_ || (!pending_ && on_the_way_.empty())) return end("left");
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
    // Unread bytes at the close would make the system reset the connection, and the last word would be lost.
    std::array<char, 4096> unread{};
    for (int i = 0; i < 16 && !stream_.get(unread).empty();) ++i;
  }
  stream_.close();
  flush_.cancel();
  clock_.cancel();
  if (house_->options->tell) house_->options->tell(fmt::format("{}: {}", name_, why));
  house_->executor().post(*house_->reaper);
}

void Client::ready(std::uint32_t events) noexcept {
  if (over_) return;
  if ((events & EPOLLOUT) != 0 && !stream_.flush()) return end("gone");
  if (stream_.held()) {
    if ((events & (EPOLLHUP | EPOLLERR)) != 0) return end("gone");
    if ((events & EPOLLRDHUP) != 0) {
      stream_.hung_up();
      leave();
    }
    return;
  }
  std::array<char, 4096> buffer;  // so much at a time, that no other has to wait long
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

// Elements, as long as the bus takes what they say.
void Client::work() {
  while (!over_ && !stalled()) {
    const auto element = reader_.next();
    if (reader_.faults() > 0) {
      ++house_->counters->misbehaved;
      end(fmt::format("sent something that is no socketcand element, at byte {}", reader_.fault_at()), unknown_command);
      return;
    }
    if (!element) break;
    act(*element);
  }
  if (!over_ && !stream_.gone()) stream_.hold(stalled());
}

// The bus may have room again.
void Client::go_on() {
  if (pending_ && hand_over(*pending_)) pending_.reset();
  if (!over_ && (stream_.held() || leaving_) && !stalled()) work();
}

// ---- time ----

void Client::arm(rt::Time when) noexcept {
  if (!clock_.timed() || clock_.due() > when) house_->executor().at(when, clock_);
}

void Client::tick() noexcept {
  const rt::Time now = house_->executor().now();
  if (!port_) {
    if (now >= patience_until_) return end("no < open > in time");
    return arm(patience_until_);
  }
  if (leaving_ && now >= *leaving_ + linger) return end("left");
  if (quiet_until_ && now >= *quiet_until_) release();
  if (restart_at_ && now >= *restart_at_) {
    restart_at_.reset();
    port_->restart(port_->status().bit_rate);
  }
  answer_echoes(now);
  run_jobs(now);
  run_subscriptions(now);
  tell_statistics(now);
  if (!over_) go_on();
  if (over_) return;
  if (quiet_until_) arm(*quiet_until_);
  if (restart_at_) arm(*restart_at_);
  if (leaving_) arm(*leaving_ + linger);
  if (!echoes_.empty()) arm(echoes_.front().deadline);
}

// ---- what the client says ----

void Client::act(std::string_view element) {
  const auto command = io::parse_command(element);
  switch (mode_) {
    case Mode::no_bus: return act_without_bus(command);
    case Mode::bcm:
    case Mode::raw:
    case Mode::control: return act_on_bus(command);
  }
}

void Client::act_without_bus(const Command& command) {
  switch (command.kind) {
    case Kind::open: return open(command.bus);
    case Kind::configure:
      ++house_->counters->misbehaved;
      return end("wanted to set a bus's bit timing", fmt::format("< error configuring interface {} >", command.bus));
    default: return say(unknown_command);
  }
}

void Client::open(const std::string& bus) {
  std::string why;
  port_ = (*house_->factory)(bus, why);
  if (!port_) return end(fmt::format("wanted the bus \"{}\": {}", shown(bus), why), "< error could not open bus >");
  bus_ = bus;
  if (house_->options->tell) house_->options->tell(fmt::format("{}: on bus {}", name_, shown(bus_)));
  enter(Mode::bcm);
}

void Client::enter(Mode mode) {
  release();
  mode_ = mode;
  jobs_.clear();
  subscriptions_.clear();
  statistics_every_ = rt::Duration{0};
  filter();
  say("< ok >");
  if (mode != Mode::raw || over_) return;
  flush();
  quiet_until_ = house_->executor().now() + quiet_after_ok;
  arm(*quiet_until_);
}

// What the node hears.
void Client::filter() {
  if (mode_ == Mode::raw) return port_->listen(this, everything);
  std::vector<can::IdRange> keys;
  for (const auto& s : subscriptions_) keys.push_back(can::only(s.key));
  port_->listen(this, keys);
}

void Client::act_on_bus(const Command& command) {
  static constexpr std::pair<Kind, Mode> modes[] = {
      {Kind::raw_mode, Mode::raw}, {Kind::bcm_mode, Mode::bcm}, {Kind::control_mode, Mode::control}};
  for (const auto& [kind, mode] : modes) {
    if (command.kind == kind) return mode == mode_ ? say(unknown_command) : enter(mode);
  }
  switch (command.kind) {
    case Kind::echo:
      echoes_.push_back({last_tag_, house_->executor().now() + echo_wait});
      answer_echoes(house_->executor().now());
      if (!echoes_.empty()) arm(echoes_.front().deadline);
      return;
    case Kind::malformed: return malformed();
    case Kind::send:
      if (mode_ != Mode::control) return give(command.frame);
      break;
    case Kind::statistics:
      if (mode_ != Mode::control) break;
      statistics_every_ = command.interval.count() == 0 ? command.interval : std::max(command.interval, least_interval);
      statistics_due_ = house_->executor().now() + statistics_every_;
      if (statistics_every_.count() > 0) arm(statistics_due_);
      return;
    case Kind::add:
    case Kind::update:
    case Kind::remove:
    case Kind::filter:
    case Kind::subscribe:
    case Kind::unsubscribe:
      if (mode_ == Mode::bcm) return act_bcm(command);
      break;
    default: break;
  }
  say(unknown_command);
}

// ---- frames from the client ----

void Client::give(const can::Frame& frame) {
  if (!hand_over(frame)) pending_ = frame;
}

// False: no room now.
bool Client::hand_over(const can::Frame& frame) {
  const auto queued = port_->send(frame, last_tag_ + 1);
  switch (queued) {
    case can::Queued::yes:
      if (on_the_way_.size() >= most_on_the_way) on_the_way_.erase(on_the_way_.begin());  // a port that drops frames
      on_the_way_.push_back({++last_tag_, frame.size});
      if (last_tag_ == 0xFFFF'FFFEU) last_tag_ = 0;
      ++house_->counters->frames_in;
      return true;
    case can::Queued::full:
      // A `sent` says when there is room; should it not come, the clock.
      arm(house_->executor().now() + echo_wait);
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
  const auto it = std::ranges::find(on_the_way_, tag, &OnTheWay::tag);
  if (over_ || it == on_the_way_.end()) return;
  ++frames_out_;
  bytes_out_ += it->size;
  on_the_way_.erase(it);
  answer_echoes(at);
  if (!over_) go_on();
  if (over_ || !leaving_) return;
  leaving_ = at;
  if (stream_.gone()) leave();
}

void Client::answer_echoes(rt::Time now) {
  while (!echoes_.empty() && !over_) {
    const auto& echo = echoes_.front();
    const bool done = std::ranges::none_of(on_the_way_, [&](const OnTheWay& f) { return f.tag <= echo.after; });
    if (!done && now < echo.deadline) return;
    if (!done) std::erase_if(on_the_way_, [&](const OnTheWay& f) { return f.tag <= echo.after; });
    echoes_.pop_front();
    say("< echo >");
  }
}

void Client::changed(const can::Status& status, rt::Time at) noexcept {
  if (over_) return;
  if (status.bus_off || !status.up) on_the_way_.clear();
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
  ++frames_in_;
  bytes_in_ += frame.size;
  if (mode_ == Mode::raw) return tell_frame(frame, at);
  const auto it = std::ranges::find(subscriptions_, frame.key(), &Subscription::key);
  if (mode_ == Mode::bcm && it != subscriptions_.end()) hear(*it, frame, at);
}

void Client::tell_frame(const can::Frame& frame, rt::Time at) {
  std::string text;
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(at.time_since_epoch());
  io::append_frame(text, frame, house_->epoch + since, mode_ == Mode::bcm);
  ++house_->counters->frames_out;
  if (!quiet_until_) return say(text);
  later_ += text;
  if (later_.size() > house_->options->most_waiting / 2) release();
}

void Client::release() {
  quiet_until_.reset();
  if (later_.empty()) return;
  const std::string text = std::move(later_);
  later_.clear();
  say(text);
}

// ---- BCM mode ----

void Client::act_bcm(const Command& command) {
  const auto key = command.frame.key();
  const auto job = std::ranges::find(jobs_, key, [](const BcmJob& j) { return j.frame.key(); });
  switch (command.kind) {
    case Kind::add: return add_job(command);
    case Kind::update:
      if (job != jobs_.end()) job->frame = command.frame;
      return;
    case Kind::remove:
      if (job != jobs_.end()) jobs_.erase(job);
      return;
    case Kind::filter:
    case Kind::subscribe: return subscribe(command);
    default: std::erase_if(subscriptions_, [&](const Subscription& s) { return s.key == key; }); return filter();
  }
}

void Client::add_job(const Command& command) {
  const auto key = command.frame.key();
  std::erase_if(jobs_, [&](const BcmJob& j) { return j.frame.key() == key; });
  if (jobs_.size() >= most_jobs) return malformed();
  BcmJob job{command.frame, command.interval};
  if (job.interval.count() > 0) job.interval = std::max(job.interval, least_interval);
  job.due = house_->executor().now() + job.interval;
  jobs_.push_back(job);
  if (job.interval.count() > 0) arm(job.due);
  give(command.frame);
}

// A frame that finds no room is not sent at that turn: the next comes.
void Client::run_jobs(rt::Time now) {
  for (auto& job : jobs_) {
    if (job.interval.count() == 0) continue;
    if (now >= job.due) {
      if (!pending_) hand_over(job.frame);
      job.due += job.interval;
      if (job.due <= now) job.due = now + job.interval;
    }
    arm(job.due);
  }
}

void Client::subscribe(const Command& command) {
  const auto key = command.frame.key();
  std::erase_if(subscriptions_, [&](const Subscription& s) { return s.key == key; });
  if (subscriptions_.size() >= most_jobs) return malformed();
  Subscription s;
  s.key = key;
  s.always = command.kind == Kind::subscribe;
  s.interval = command.interval;
  for (std::size_t i = 0; i < command.frame.size; ++i) s.mask[i] = command.frame.data[i];
  subscriptions_.push_back(s);
  filter();
}

void Client::hear(Subscription& s, const can::Frame& frame, rt::Time at) {
  if (s.heard && !s.always) {
    bool differs = false;
    for (std::size_t i = 0; i < 8; ++i) {
      const unsigned was = i < s.last.size ? s.last.data[i] : 0U;
      const unsigned is = i < frame.size ? frame.data[i] : 0U;
      differs = differs || ((was ^ is) & s.mask[i]) != 0;
    }
    if (!differs) return;
  }
  s.last = frame;
  s.last_at = at;
  if (s.heard && at < s.told + s.interval) {
    s.waits = true;
    return arm(s.told + s.interval);
  }
  s.heard = true;
  s.told = at;
  tell_frame(frame, at);
}

void Client::run_subscriptions(rt::Time now) {
  for (auto& s : subscriptions_) {
    if (!s.waits) continue;
    if (now < s.told + s.interval) {
      arm(s.told + s.interval);
      continue;
    }
    s.waits = false;
    s.told = now;
    tell_frame(s.last, s.last_at);
    if (over_) return;
  }
}

void Client::tell_statistics(rt::Time now) {
  if (mode_ != Mode::control || statistics_every_.count() == 0) return;
  if (now >= statistics_due_) {
    say(fmt::format("< stat {} {} {} {} >", bytes_in_, frames_in_, bytes_out_, frames_out_));
    statistics_due_ = now + statistics_every_;
  }
  if (!over_) arm(statistics_due_);
}

}  // namespace berth::serve
