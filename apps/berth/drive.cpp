#include "drive.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

#include "ask.hpp"
#include "berth/text/printable.hpp"
#include "gateway.hpp"

namespace berth::cli {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// ---- Screen ----

Screen::Screen(operate::Session& session, bool live, bool quiet) : session_(&session), live_(live), quiet_(quiet) {}

void Screen::line(const std::string& text) {
  dirty_ = true;
  if (quiet_) return;
  if (live_) {
    waiting_.push_back(text);
  } else {
    print_line(text);
  }
}

namespace {

// As many characters as fit, so that a line of the table is one line of the terminal.
std::string cut(const std::string& text, std::size_t width) {
  std::size_t shown = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool begins = (static_cast<unsigned char>(text[i]) & 0xC0U) != 0x80U;
    if (begins && shown++ == width) return text.substr(0, i);
  }
  return text;
}

std::size_t terminal_width() {
  winsize size{};
  return ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

}  // namespace

void Screen::keep() {
  refresh(true);
  drawn_ = 0;
  live_ = false;
}

void Screen::refresh(bool now) {
  if (!live_ || quiet_) return;
  const auto since = Clock::now() - last_;
  if (!now && since < (dirty_ ? 100ms : 1000ms)) return;
  last_ = Clock::now();
  dirty_ = false;
  const std::size_t width = terminal_width();
  std::string text = drawn_ > 0 ? fmt::format("\x1b[{}A\r\x1b[J", drawn_) : "";
  for (const auto& line : waiting_) text += text::printable(line) + "\n";
  waiting_.clear();
  std::vector<std::string> table{"", fmt::format("{}  {:.1f} s on the bus  Ctrl-C ends it", session_->machine().name,
                                                 operate::seconds(session_->executor().now()))};
  std::ranges::move(operate::to_table(session_->slots()), std::back_inserter(table));
  for (const auto& line : table) text += cut(text::printable(line), width) + "\n";
  drawn_ = table.size();
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);
}

// ---- Ending ----

Ending::Ending(Rig& rig, std::string until) : rig_(&rig), until_(std::move(until)) {
  for (const auto& bus : rig.machine().buses) {
    quiet_ = std::max(quiet_, bus.timing.heartbeat_timeout + 2 * bus.timing.probe_period);
  }
  rt::Duration boot{0};
  for (const auto& device : rig.plant().devices) boot = std::max(boot, device.boot);
  quiet_ += boot;
  // What failed is tried again when the whole bus is asked anew: every 8 looks, and the asking takes its time.
  patience_ = quiet_;
  for (const auto& bus : rig.machine().buses) patience_ = std::max(patience_, quiet_ + 10 * bus.timing.probe_period);
  limit_ = 10min;
  for (const auto& event : rig.plant().events) limit_ += event.delay + event.duration;
  milestone("start");
}

// A device that finds no place is found again and again; that is no change.
// Only the event's own bus is looked at: a machine of a hundred buses has a hundred times the events.
void Ending::event(const operate::Event& event) {
  look_ = true;
  const auto* const network = rig_->session().network(event.bus);
  if (network == nullptr) return;
  auto slots = network->occupancy();
  auto& known = now_[event.bus];
  if (slots == known) return;
  known = std::move(slots);
  changed_ = rig_->world().executor().now();
}

void Ending::milestone(const std::string& name) {
  const rt::Time now = rig_->world().executor().now();
  changed_ = now;
  for (const auto& event : rig_->plant().events) {
    if (plant::name(event.after) == name) due_ = std::max(due_, now + event.delay + event.duration);
  }
  if (name != "operational") return;
  first_.clear();
  for (const auto& network : rig_->session().networks()) first_[network->bus().name] = network->occupancy();
}

bool Ending::plan_over() const { return rig_->world().executor().now() >= due_; }

bool Ending::replaced() const {
  if (first_.empty() || !rig_->session().operational()) return false;
  return std::ranges::any_of(rig_->session().networks(), [this](const auto& network) {
    const auto stays = [](const auto& now, const auto& first) { return !now.device || now.device == first.device; };
    return !std::ranges::equal(network->occupancy(), first_.at(network->bus().name), stays);
  });
}

bool Ending::reached() {
  if (until_.empty() || !look_) return false;
  const bool replacing = until_ == "replaced";
  if (replacing && !plan_over()) return false;
  look_ = false;
  return replacing ? replaced() : rig_->session().operational();
}

bool Ending::hopeless() { return !until_.empty() && rig_->shut_out(); }

bool Ending::settled() {
  const rt::Time now = rig_->world().executor().now();
  const rt::Time still_since = std::max(changed_, due_);
  if (now < still_since + quiet_ || !rig_->session().idle()) return false;
  if (now < still_since + patience_ && !rig_->session().operational()) return false;
  const auto slots = rig_->session().slots();
  return std::ranges::none_of(slots, [](const auto& s) {
    return s.state == places::SlotState::binding || s.state == places::SlotState::configuring ||
           s.state == places::SlotState::unknown;
  });
}

// ---- driving ----

namespace {

Ended drive_fast(Rig& rig, Ending& ending, Interrupt& interrupt, rt::Duration limit) {
  Ended how = Ended::timeout;
  unsigned looks = 0;
  const auto over = [&] {
    if (++looks % 256 == 0 && interrupt.came()) {
      how = Ended::interrupted;
    } else if (ending.reached()) {
      how = Ended::reached;
    } else if (ending.settled()) {
      how = Ended::settled;
    }
    return how != Ended::timeout;
  };
  rig.world().sim().run_until(over, limit);
  return how;
}

class Pacer {
 public:
  Pacer(Rig& rig, Ending& ending, Screen& screen, Interrupt& interrupt, operate::ControlServer* server, Asker* asker,
        io::Loop* loop, rt::Time end)
      : rig_(rig),
        ending_(ending),
        screen_(screen),
        interrupt_(interrupt),
        server_(server),
        asker_(asker),
        loop_(loop),
        end_(end) {}

  Ended run() {
    rig_.world().sim().run_paced(rt::never, [this](rt::Time target) { return wait(target); });
    return how_;
  }

 private:
  [[nodiscard]] rt::Time clock() const { return loop_ != nullptr ? loop_->clock() : began_ + (Clock::now() - real_); }

  // Sleeps until the world may be at `target`, or something came in. A time in the past ends the run.
  rt::Time wait(rt::Time target) {
    for (;;) {
      if (over()) return rt::Time::min();
      screen_.refresh();
      const rt::Time now = std::max(clock(), rig_.world().executor().now());
      const bool behind = target <= now;
      if (behind && Clock::now() - polled_ < 2ms) return now;
      const auto left = behind ? rt::Duration{0} : std::min<rt::Duration>(target - now, 50ms);
      const bool came_in = poll_for(left);
      if (server_ != nullptr) server_->serve();
      if (asker_ != nullptr) asker_->serve();
      if (came_in || behind) return std::max(clock(), rig_.world().executor().now());
    }
  }

  bool over() {
    if (interrupt_.came()) {
      how_ = Ended::interrupted;
    } else if (ending_.reached() || rig_.dry_run_over()) {
      how_ = Ended::reached;
    } else if (rig_.world().executor().now() >= end_ || ending_.hopeless()) {
      how_ = Ended::timeout;
    } else {
      return false;
    }
    return true;
  }

  bool poll_for(rt::Duration left) {
    descriptors_.clear();
    descriptors_.push_back({interrupt_.descriptor(), POLLIN, 0});
    if (server_ != nullptr) server_->fill(descriptors_);
    if (asker_ != nullptr) asker_->fill(descriptors_);
    if (loop_ != nullptr) descriptors_.push_back({loop_->descriptor(), POLLIN, 0});
    const auto whole = std::chrono::duration_cast<std::chrono::seconds>(left);
    const timespec time{static_cast<time_t>(whole.count()), static_cast<long>((left - whole).count())};
    const int ready = ::ppoll(descriptors_.data(), descriptors_.size(), &time, nullptr);
    polled_ = Clock::now();
    if (loop_ != nullptr && ready > 0) loop_->poll();
    return ready > 0;
  }

  Rig& rig_;
  Ending& ending_;
  Screen& screen_;
  Interrupt& interrupt_;
  operate::ControlServer* server_;
  Asker* asker_;
  io::Loop* loop_;  // null: nothing hangs on one
  rt::Time end_;
  rt::Time began_ = rig_.world().executor().now();
  Clock::time_point real_ = Clock::now();
  Clock::time_point polled_{};
  std::vector<pollfd> descriptors_;
  Ended how_ = Ended::interrupted;
};

}  // namespace

tl::expected<Ended, Failure> drive(Rig& rig, Ending& ending, Screen& screen, const Options& options,
                                   const DriveOptions& how) {
  Interrupt& interrupt = rig.interrupt();
  std::unique_ptr<operate::ControlServer> server;
  if (!how.control.empty()) {
    auto listening = operate::ControlServer::listen(how.control, rig.session());
    if (!listening) return tl::unexpected(failure(Exit::failed, listening.error()));
    server = std::move(*listening);
  }
  std::unique_ptr<GatewayHost> gateway;
  if (how.paced && !options.gateway.empty()) {
    auto host =
        GatewayHost::listen(rig, options.gateway, {options.gateway_commands, options.gateway_commands && options.yes},
                            [&](const std::string& t) { screen.line(t); });
    if (!host) return tl::unexpected(host.error());
    gateway = std::move(*host);
    screen.line("CiA 309-3 gateway at " + gateway->where());
  }
  io::Loop* const loop = gateway ? &gateway->loop() : rig.loop();
  std::unique_ptr<Asker> asker;
  if (how.paced && !options.json && someone_types()) {
    asker = std::make_unique<Asker>(rig.session(), [&](const std::string& line) { screen.line(line); });
  }
  rig.session().on_event([&](const operate::Event& event) {
    ending.event(event);
    screen.line(operate::to_line(event));
    if (asker) asker->event(event);
  });
  rig.session().on_milestone([&](const std::string& name) {
    ending.milestone(name);
    for (const auto after : {plant::After::discovered, plant::After::bound, plant::After::operational}) {
      if (plant::name(after) == name) rig.world().milestone(after);
    }
  });
  rig.world().start();
  rig.session().start();
  if (options.dry_run && how.paced) {
    constexpr rt::Duration longest = 10s;
    const rt::Time end = rig.world().executor().now() + options.timeout.value_or(longest);
    return Pacer(rig, ending, screen, interrupt, nullptr, nullptr, rig.loop(), end).run();
  }
  if (!how.paced) return drive_fast(rig, ending, interrupt, options.timeout.value_or(ending.limit()));
  const rt::Time end = options.timeout ? rig.world().executor().now() + *options.timeout : rt::never;
  const Ended ended = Pacer(rig, ending, screen, interrupt, server.get(), asker.get(), loop, end).run();
  screen.refresh(true);
  if (asker) rig.session().on_event({});
  return ended;
}

}  // namespace berth::cli
