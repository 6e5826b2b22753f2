// Who is NMT master (docs/flying-master.md): the frames by hand, the state table, and all that can happen to two, three
// and four masters with a few lost frames, crashes, false alarms and a bus that is cut and joined again.
#include "berth/manager/flying_negotiation.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

using namespace berth;
using namespace berth::manager;
using namespace std::chrono_literals;
using State = FlyingNegotiation::State;
using Service = FlyingService;

namespace {

constexpr FlyingOptions options_of(std::uint8_t priority, std::uint8_t node) {
  return {.own = {priority, NodeId(node)}, .timing = {}};
}
constexpr rt::Time at(rt::Duration time) { return rt::Time(time); }

FlyingMessage claim(std::uint8_t priority, std::uint8_t node) {
  return {Service::active_master, {priority, NodeId(node)}};
}
FlyingMessage just(Service service) { return {service, {}}; }

// Priority 1, node 5, in each state; the active master of the standby ones is node 3, priority 1.
FlyingNegotiation in(State state) {
  FlyingNegotiation rules;
  if (state == State::off) return rules;
  rules.begin(options_of(1, 5), at(0ms));
  if (state == State::waiting) return rules;
  if (state == State::standby || state == State::checking) {
    static_cast<void>(rules.received(claim(1, 3), at(0ms)));
    if (state == State::checking) static_cast<void>(rules.due(rules.deadline()));
    return rules;
  }
  static_cast<void>(rules.due(at(500ms)));
  if (state == State::detecting) return rules;
  static_cast<void>(rules.received(just(Service::negotiation), at(500ms)));
  if (state == State::negotiating) return rules;
  static_cast<void>(rules.due(rules.deadline()));
  if (state == State::claiming) return rules;
  rules.claimed(at(3s));
  return rules;
}

}  // namespace

// CiA 302-2: 071h names priority and node-ID, the others are empty.
TEST(FlyingNegotiation, FramesAreThoseOfTheStandard) {
  EXPECT_EQ(can::to_string(to_frame(claim(2, 0x7F))), "071#027F");
  EXPECT_EQ(can::to_string(to_frame(just(Service::negotiation))), "072#");
  EXPECT_EQ(can::to_string(to_frame(just(Service::detect_active))), "073#");
  EXPECT_EQ(can::to_string(to_frame(just(Service::capable))), "074#");
  EXPECT_EQ(can::to_string(to_frame(just(Service::detect_capable))), "075#");
  EXPECT_EQ(can::to_string(to_frame(just(Service::force_negotiation))), "076#");
  EXPECT_EQ(parse_flying(can::Frame::base(0x71, {0, 1})), claim(0, 1));
  for (std::uint32_t id = 0x72; id <= 0x76; ++id) {
    EXPECT_EQ(parse_flying(can::Frame::base(id, {})), just(static_cast<Service>(id)));
    EXPECT_FALSE(parse_flying(can::Frame::base(id, {0})));
  }
  const auto none = {can::Frame::base(0x70, {}),        can::Frame::base(0x77, {}),
                     can::Frame::base(0x71, {}),        can::Frame::base(0x71, {0}),
                     can::Frame::base(0x71, {0, 1, 0}), can::Frame::base(0x71, {0, 0}),
                     can::Frame::base(0x71, {0, 128}),  can::Frame::request(0x73, 0)};
  for (const auto& frame : none) EXPECT_FALSE(parse_flying(frame)) << can::to_string(frame);
}

TEST(FlyingNegotiation, DefaultsAreThoseOfTheStandard) {
  const FlyingTiming timing;
  EXPECT_EQ(timing.detection, 100ms);
  EXPECT_EQ(timing.delay, 500ms);
  EXPECT_EQ(timing.slot_of({0, NodeId(1)}), 10ms);
  EXPECT_EQ(timing.slot_of({1, NodeId(5)}), 1550ms);
  EXPECT_EQ(timing.slot_of({2, NodeId(127)}), 4270ms);
  EXPECT_EQ(timing.cycle_of(NodeId(1)), 4010ms);
  EXPECT_EQ(timing.cycle_of(NodeId(127)), 5270ms);
  EXPECT_TRUE(timing.sound());
  EXPECT_FALSE((FlyingTiming{.priority_slot = 1270ms}).sound());
  EXPECT_FALSE((FlyingTiming{.detection = 0ms}).sound());
}

// State by state: what comes, what is sent, where it leads.
TEST(FlyingNegotiation, StateTable) {
  struct Row {
    State from;
    FlyingMessage heard;
    std::optional<Service> sent;
    State to;
  };
  const auto better = claim(0, 9), equal_low = claim(1, 3), equal_high = claim(1, 9), worse = claim(2, 1);
  using enum Service;
  const std::vector<Row> rows{
      {State::off, better, {}, State::off},
      {State::off, just(detect_capable), {}, State::off},
      {State::off, just(negotiation), {}, State::off},
      {State::waiting, better, {}, State::standby},
      {State::waiting, equal_low, {}, State::standby},
      {State::waiting, equal_high, {}, State::standby},
      {State::waiting, worse, {}, State::waiting},
      {State::waiting, just(negotiation), {}, State::negotiating},
      {State::waiting, just(detect_active), {}, State::waiting},
      {State::waiting, just(force_negotiation), {}, State::waiting},
      {State::waiting, just(detect_capable), capable, State::waiting},
      {State::detecting, better, {}, State::standby},
      {State::detecting, equal_low, {}, State::standby},
      {State::detecting, equal_high, {}, State::standby},
      {State::detecting, worse, force_negotiation, State::waiting},
      {State::detecting, just(negotiation), {}, State::negotiating},
      {State::detecting, just(detect_active), {}, State::detecting},
      {State::detecting, just(force_negotiation), {}, State::detecting},
      {State::negotiating, better, {}, State::standby},
      {State::negotiating, equal_low, {}, State::standby},
      {State::negotiating, equal_high, {}, State::standby},
      {State::negotiating, worse, force_negotiation, State::waiting},
      {State::negotiating, just(negotiation), {}, State::negotiating},
      {State::negotiating, just(force_negotiation), {}, State::waiting},
      {State::claiming, better, {}, State::standby},
      {State::claiming, equal_low, {}, State::standby},
      {State::claiming, equal_high, {}, State::claiming},
      {State::claiming, worse, {}, State::claiming},
      {State::claiming, just(negotiation), {}, State::claiming},
      {State::claiming, just(force_negotiation), {}, State::waiting},
      {State::claiming, just(detect_capable), capable, State::claiming},
      {State::master, better, {}, State::standby},
      {State::master, equal_low, {}, State::standby},
      {State::master, equal_high, active_master, State::master},
      {State::master, worse, active_master, State::master},
      {State::master, just(negotiation), active_master, State::master},
      {State::master, just(detect_active), active_master, State::master},
      {State::master, just(detect_capable), capable, State::master},
      {State::master, just(capable), {}, State::master},
      {State::master, just(force_negotiation), {}, State::waiting},
      {State::standby, better, {}, State::standby},
      {State::standby, equal_high, {}, State::standby},
      {State::standby, worse, {}, State::standby},
      {State::standby, just(negotiation), {}, State::negotiating},
      {State::standby, just(detect_active), {}, State::standby},
      {State::standby, just(detect_capable), capable, State::standby},
      {State::standby, just(force_negotiation), {}, State::standby},
      {State::checking, better, {}, State::standby},
      {State::checking, worse, force_negotiation, State::waiting},
      {State::checking, just(negotiation), {}, State::negotiating},
      {State::checking, just(force_negotiation), {}, State::checking},
  };
  for (const auto& row : rows) {
    auto rules = in(row.from);
    ASSERT_EQ(rules.state(), row.from);
    const auto step = rules.received(row.heard, at(60s));
    const std::string what = std::string(name(row.from)) + " hears " + can::to_string(to_frame(row.heard));
    EXPECT_EQ(step.send, row.sent) << what;
    EXPECT_EQ(name(rules.state()), std::string(name(row.to))) << what;
    EXPECT_FALSE(step.reset_all) << what;
  }
}

TEST(FlyingNegotiation, TimesAndLosses) {
  struct Row {
    State from;
    std::optional<Service> sent;
    State to;
    rt::Duration again;
  };
  using enum Service;
  for (const auto& row : std::vector<Row>{{State::waiting, detect_active, State::detecting, 100ms},
                                          {State::negotiating, active_master, State::claiming, 100ms},
                                          {State::claiming, active_master, State::claiming, 100ms},
                                          {State::master, force_negotiation, State::master, 4050ms},
                                          {State::standby, detect_active, State::checking, 100ms},
                                          {State::checking, negotiation, State::negotiating, 1550ms}}) {
    auto rules = in(row.from);
    const rt::Time now = rules.deadline();
    const auto step = rules.due(now);
    EXPECT_EQ(step.send, row.sent) << name(row.from);
    EXPECT_EQ(rules.state(), row.to) << name(row.from);
    EXPECT_EQ(rules.deadline() - now, row.again) << name(row.from);
  }
  for (const State state : {State::standby, State::checking}) {
    auto rules = in(state);
    EXPECT_EQ(rules.active()->node, NodeId(3));
    EXPECT_EQ(rules.lost(at(9s)).send, negotiation);
    EXPECT_EQ(rules.deadline(), at(9s + 1550ms));
    EXPECT_FALSE(rules.active());
  }
  auto standby = in(State::standby);
  EXPECT_FALSE(standby.booted(NodeId(4), at(9s)).send);
  EXPECT_EQ(standby.booted(NodeId(3), at(9s)).send, negotiation);
  auto master = in(State::master);
  EXPECT_EQ(master.booted(NodeId(3), at(9s)).send, active_master);
  EXPECT_FALSE(master.lost(at(9s)).send);
  // An NMT command of another node: at once, and at most once in the detection time.
  EXPECT_EQ(master.commanded(at(10s)).send, force_negotiation);
  EXPECT_EQ(master.deadline(), at(14050ms));
  EXPECT_FALSE(master.commanded(at(10099ms)).send);
  EXPECT_EQ(master.commanded(at(10100ms)).send, force_negotiation);
  EXPECT_FALSE(standby.commanded(at(10s)).send);
  EXPECT_EQ(master.active()->node, NodeId(5));
}

// Cold: nobody answers, all nodes are reset once, and then it is negotiated.
TEST(FlyingNegotiation, ColdStartResetsAllOnce) {
  FlyingNegotiation rules;
  rules.begin(options_of(1, 5), at(0ms));
  static_cast<void>(rules.due(at(500ms)));
  const auto reset = rules.due(at(600ms));
  EXPECT_TRUE(reset.reset_all);
  EXPECT_FALSE(reset.send);
  rules.end();
  rules.begin(options_of(1, 5), at(700ms));
  EXPECT_EQ(rules.due(at(1200ms)).send, Service::detect_active);
  const auto step = rules.due(at(1300ms));
  EXPECT_EQ(step.send, Service::negotiation);
  EXPECT_FALSE(step.reset_all);
  static_cast<void>(rules.due(at(2850ms)));
  rules.claimed(at(2851ms));
  ASSERT_TRUE(rules.is_master());
  EXPECT_FALSE(rules.took_over());

  // Forced to negotiate again, its slaves run.
  static_cast<void>(rules.received(just(Service::force_negotiation), at(9s)));
  static_cast<void>(rules.due(at(9500ms)));
  EXPECT_EQ(rules.due(at(9600ms)).send, Service::negotiation);
  static_cast<void>(rules.due(rules.deadline()));
  rules.claimed(at(12s));
  EXPECT_TRUE(rules.took_over());

  rules.power_off();
  rules.begin(options_of(1, 5), at(20s));
  static_cast<void>(rules.due(at(20500ms)));
  EXPECT_TRUE(rules.due(at(20600ms)).reset_all);
}

TEST(FlyingNegotiation, ColdStartResetsNobodyWhereSlavesAreKeptAlive) {
  FlyingNegotiation rules;
  auto options = options_of(1, 5);
  options.resets_when_cold = false;
  rules.begin(options, at(0ms));
  static_cast<void>(rules.due(at(500ms)));
  EXPECT_EQ(rules.due(at(600ms)).send, Service::negotiation);
  static_cast<void>(rules.due(rules.deadline()));
  rules.claimed(at(3s));
  EXPECT_TRUE(rules.took_over());
}

// ---- everything that can happen -------------------------------------------------------------------------------------

namespace {

// Gives each choice of a run, one run after the other, until there is none left.
class Oracle {
 public:
  std::size_t choose(std::size_t options) {
    if (options <= 1) return 0;
    if (place_ == path_.size()) path_.push_back({0, options});
    return path_[place_++].first;
  }
  // The same run once more.
  void again() { place_ = 0; }
  bool next() {
    place_ = 0;
    while (!path_.empty() && path_.back().first + 1 == path_.back().second) path_.pop_back();
    if (path_.empty()) return false;
    ++path_.back().first;
    return true;
  }

 private:
  std::vector<std::pair<std::size_t, std::size_t>> path_;  // choice, number of options
  std::size_t place_ = 0;
};

struct Faults {
  unsigned lost_frames = 0;  // a receiver does not get a frame
  unsigned crashes = 0;      // power off, and on again later or never
  unsigned alarms = 0;       // a standby master believes that the active one is gone
  unsigned cuts = 0;         // the bus is cut in two, and joined later
};

constexpr auto heartbeat_time = 300ms;
constexpr auto boot_time = 50ms;
constexpr auto power_off_time = 2s;
constexpr auto cut_time = 9s;
constexpr auto last_fault = 10s;  // a cycle and more after the first negotiation: then all repeats itself

class Model {
 public:
  Model(Oracle& oracle, const std::vector<std::uint8_t>& priorities, Faults faults,
        const std::vector<rt::Duration>& starts, bool tells)
      : oracle_(oracle), faults_(faults), tells_(tells) {
    for (std::size_t i = 0; i < priorities.size(); ++i) {
      Node node;
      node.options = options_of(priorities[i], static_cast<std::uint8_t>(i + 1));
      node.boots = at(starts[oracle_.choose(i == 0 ? 1 : starts.size())]);
      nodes_.push_back(node);
    }
    const FlyingTiming timing;
    const auto last = NodeId(static_cast<std::uint8_t>(nodes_.size()));
    const rt::Duration cycle = timing.cycle_of(last);
    // Both are active from when they hear each other until the next 076 of one of them; a 076 that one misses is
    // followed by the other's.
    two_masters_ = cycle + 100ms;
    // Nobody: supervision, or asking; then once more from the delay on, because a better one comes in the middle.
    no_master_ = FlyingNegotiation::quiet_cycles * cycle + heartbeat_time + 4 * (timing.delay + timing.detection) +
                 2 * timing.slot_of({2, last});
  }

  // Empty: all went well.
  std::string run() {
    while (problem_.empty()) {
      const rt::Time next = next_event();
      if (next > quiet_since_ + no_master_ + 2 * two_masters_) break;
      now_ = next;
      judge();
      act();
      deliver();
      interfere();
      deliver();
    }
    if (problem_.empty()) judge_end();
    return problem_.empty() ? "" : problem_ + story_;
  }
  [[nodiscard]] std::size_t masters() const {
    return static_cast<std::size_t>(std::ranges::count_if(nodes_, [](auto& n) { return n.rules.is_master(); }));
  }

 private:
  struct Node {
    FlyingOptions options;
    FlyingNegotiation rules;
    rt::Time boots = rt::never;
    rt::Time misses = rt::never;  // supervision of the active master ends
    bool on = false;
    int segment = 0;
  };

  [[nodiscard]] rt::Time next_event() const {
    rt::Time next = join_;
    for (const auto& node : nodes_) next = std::min({next, node.boots, node.misses, node.rules.deadline()});
    return next;
  }

  void act() {
    if (join_ <= now_) {
      join_ = rt::never;
      for (auto& node : nodes_) node.segment = 0;
      disturbed("joined");
      return;
    }
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      Node& node = nodes_[i];
      if (node.boots <= now_) {
        node.boots = rt::never;
        node.on = true;
        node.rules.begin(node.options, now_);
        say(i, "boots");
        for (const std::size_t other : hearers(i)) {
          if (!loses(other)) carry_out(other, nodes_[other].rules.booted(NodeId(number(i)), now_));
        }
        return;
      }
      if (node.misses <= now_) {
        node.misses = rt::never;
        say(i, "misses its master");
        return carry_out(i, node.rules.lost(now_));
      }
      if (node.rules.deadline() <= now_) return carry_out(i, node.rules.due(now_));
    }
  }

  // At each event something may happen beside it, as long as there is a fault left.
  void interfere() {
    const bool none_left = faults_.crashes + faults_.alarms + faults_.cuts == 0;
    if (none_left || now_ > at(last_fault)) return;
    std::vector<std::function<void()>> choices{[] {}};
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      if (faults_.crashes > 0 && nodes_[i].on) {
        choices.emplace_back([this, i] { crash(i, true); });
        choices.emplace_back([this, i] { crash(i, false); });
      }
      const bool stands_by = nodes_[i].rules.state() == State::standby;
      if (faults_.alarms > 0 && stands_by) choices.emplace_back([this, i] { alarm(i); });
    }
    if (faults_.cuts > 0 && join_ == rt::never) {
      for (std::size_t i = 0; i + 1 < nodes_.size(); ++i) choices.emplace_back([this, i] { cut(i); });
    }
    choices[oracle_.choose(choices.size())]();
  }
  void crash(std::size_t i, bool returns) {
    --faults_.crashes;
    Node& node = nodes_[i];
    node.on = false;
    node.rules.power_off();
    node.misses = rt::never;
    node.boots = returns ? now_ + power_off_time : rt::never;
    disturbed(returns ? "loses power for a while" : "loses power", i);
  }
  void alarm(std::size_t i) {
    --faults_.alarms;
    disturbed("takes its master for lost", i);
    carry_out(i, nodes_[i].rules.lost(now_));
  }
  void cut(std::size_t last) {
    --faults_.cuts;
    for (std::size_t i = 0; i < nodes_.size(); ++i) nodes_[i].segment = i <= last ? 0 : 1;
    join_ = now_ + cut_time;
    disturbed("cut behind", last);
  }

  void carry_out(std::size_t i, const FlyingNegotiation::Step& step) {
    watch(i);
    if (step.reset_all) return reset_all(i);
    if (step.send) queue_.push_back({i, {*step.send, nodes_[i].options.own}});
  }
  // One frame after the other, each to all that hear it.
  void deliver() {
    while (!queue_.empty()) {
      const auto [i, message] = queue_.front();
      queue_.pop_front();
      const auto others = hearers(i);
      if (!nodes_[i].on || others.empty()) continue;  // alone there is no acknowledge
      if (tells_) say(i, can::to_string(to_frame(message)));
      const bool claims = message.service == Service::active_master;
      if (claims) nodes_[i].rules.claimed(now_);
      watch(i);
      for (const std::size_t other : others) {
        if (!loses(other)) carry_out(other, nodes_[other].rules.received(message, now_));
      }
    }
  }
  void reset_all(std::size_t i) {
    say(i, "resets all");
    std::vector<std::size_t> hit = hearers(i);
    hit.push_back(i);
    for (const std::size_t each : hit) {
      if (each != i && loses(each)) continue;
      nodes_[each].rules.end();
      nodes_[each].misses = rt::never;
      nodes_[each].boots = now_ + boot_time;
    }
  }
  // The heartbeat of the active master, as its supervisor hears it.
  void watch(std::size_t i) {
    Node& node = nodes_[i];
    const auto active = node.rules.active();
    const bool other = active && active->node != node.options.own.node;
    const bool heard = other && hears(i, active->node.value() - 1U);
    if (!other || heard) {
      node.misses = rt::never;
    } else if (node.misses == rt::never) {
      node.misses = now_ + heartbeat_time;
    }
  }
  void watch_all() {
    for (std::size_t i = 0; i < nodes_.size(); ++i) watch(i);
  }

  [[nodiscard]] bool hears(std::size_t i, std::size_t other) const {
    return nodes_[i].on && nodes_[other].on && nodes_[i].segment == nodes_[other].segment;
  }
  [[nodiscard]] std::vector<std::size_t> hearers(std::size_t i) const {
    std::vector<std::size_t> all;
    for (std::size_t other = 0; other < nodes_.size(); ++other) {
      if (other != i && hears(i, other)) all.push_back(other);
    }
    return all;
  }
  bool loses(std::size_t i) {
    if (faults_.lost_frames == 0 || now_ > at(last_fault) || oracle_.choose(2) == 0) return false;
    --faults_.lost_frames;
    disturbed("does not hear that", i);
    return true;
  }

  // What holds at every instant: never two active masters that hear each other, nor none, for longer than allowed.
  void judge() {
    for (int segment = 0; segment < 2; ++segment) {
      std::size_t masters = 0, candidates = 0;
      for (const auto& node : nodes_) {
        if (!node.on || node.segment != segment) continue;
        ++candidates;
        if (node.rules.is_master()) ++masters;
      }
      auto& two = two_since_[static_cast<std::size_t>(segment)];
      auto& none = none_since_[static_cast<std::size_t>(segment)];
      if (masters < 2) two = now_;
      if (masters > 0 || candidates < 2) none = now_;
      if (now_ - std::max(two, quiet_since_) > two_masters_) problem_ = "two active masters";
      if (now_ - std::max(none, quiet_since_) > no_master_) problem_ = "no active master";
    }
  }
  // Long after the last fault: one master, of the best priority that is there, and all know it.
  void judge_end() {
    std::uint8_t best = 255;
    std::size_t on = 0;
    for (const auto& node : nodes_) {
      if (!node.on) continue;
      ++on;
      best = std::min(best, node.options.own.priority);
    }
    if (on < 2) return;  // nobody acknowledges the one
    if (masters() != 1) {
      problem_ = std::to_string(masters()) + " active masters at the end";
      return;
    }
    const auto master = std::ranges::find_if(nodes_, [](auto& node) { return node.rules.is_master(); });
    if (master->options.own.priority != best) problem_ = "the active master is not of the best priority";
    for (const auto& node : nodes_) {
      if (node.on && node.rules.active() != master->options.own) problem_ = "not all know the active master";
    }
  }

  void disturbed(const char* what, std::size_t i = 0) {
    quiet_since_ = now_;
    say(i, what);
    watch_all();
  }
  void say(std::size_t i, std::string_view what) {
    if (!tells_) return;
    story_ += "\n" + std::to_string(now_.time_since_epoch() / 1ms) + " ms: node " + std::to_string(number(i)) + ": " +
              std::string(what);
  }
  static std::uint8_t number(std::size_t i) { return static_cast<std::uint8_t>(i + 1); }

  Oracle& oracle_;
  Faults faults_;
  std::deque<std::pair<std::size_t, FlyingMessage>> queue_;
  std::vector<Node> nodes_;
  rt::Time now_{};
  rt::Time join_ = rt::never;
  rt::Time quiet_since_{};  // no fault since
  std::array<rt::Time, 2> two_since_{}, none_since_{};
  rt::Duration two_masters_{}, no_master_{};
  std::string problem_, story_;
  bool tells_;
};

std::size_t explore(const std::vector<std::uint8_t>& priorities, Faults faults,
                    const std::vector<rt::Duration>& starts) {
  Oracle oracle;
  std::size_t runs = 0;
  do {
    const bool good = Model(oracle, priorities, faults, starts, false).run().empty();
    if (!good) {
      oracle.again();
      ADD_FAILURE() << "run " << runs << ": " << Model(oracle, priorities, faults, starts, true).run();
      break;
    }
    ++runs;
  } while (oracle.next());
  return runs;
}

}  // namespace

// Each of the first fault's kinds alone and beside another one; who starts when is among the choices.
TEST(FlyingNegotiationModel, TwoMasters) {
  std::size_t runs = 0;
  for (const auto& priorities : std::vector<std::vector<std::uint8_t>>{{1, 1}, {0, 1}, {1, 0}, {2, 0}, {0, 2}}) {
    runs += explore(priorities, {.lost_frames = 2}, {0ms, 40ms, 300ms, 599ms, 650ms, 1300ms, 5s});
    runs += explore(priorities, {.lost_frames = 1, .crashes = 1}, {0ms, 650ms});
    runs += explore(priorities, {.lost_frames = 1, .cuts = 1}, {0ms, 650ms});
    runs += explore(priorities, {.lost_frames = 1, .alarms = 1}, {0ms, 650ms});
  }
  EXPECT_GT(runs, 5'000U);
}

TEST(FlyingNegotiationModel, ThreeMasters) {
  std::size_t runs = 0;
  for (const auto& priorities : std::vector<std::vector<std::uint8_t>>{{1, 1, 1}, {2, 1, 0}, {1, 0, 0}}) {
    runs += explore(priorities, {.lost_frames = 1}, {0ms, 300ms, 650ms});
    runs += explore(priorities, {.crashes = 1}, {0ms, 300ms, 650ms});
    runs += explore(priorities, {.lost_frames = 1, .cuts = 1}, {0ms});
    runs += explore(priorities, {.lost_frames = 1, .alarms = 1}, {0ms});
  }
  EXPECT_GT(runs, 5'000U);
}

TEST(FlyingNegotiationModel, FourMasters) {
  std::size_t runs = 0;
  for (const auto& priorities : std::vector<std::vector<std::uint8_t>>{{1, 1, 1, 1}, {2, 1, 1, 0}}) {
    runs += explore(priorities, {.lost_frames = 1}, {0ms, 650ms});
    runs += explore(priorities, {.crashes = 1}, {0ms, 650ms});
    runs += explore(priorities, {.cuts = 1}, {0ms});
    runs += explore(priorities, {.alarms = 1}, {0ms});
  }
  EXPECT_GT(runs, 500U);
}
