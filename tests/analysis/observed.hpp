/// Random machines on the simulated bus, and how late their messages really are there: for the test that no message is
/// ever later than its bound, and the bench that prints how close they come.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "berth/analysis/response.hpp"
#include "berth/base/random.hpp"
#include "berth/can/frame.hpp"
#include "berth/sim/world.hpp"

namespace berth::analysis::observed {

using namespace std::chrono_literals;

inline constexpr std::array<std::uint32_t, 6> rates{10'000, 50'000, 125'000, 250'000, 500'000, 1'000'000};

inline std::size_t pick(Random& random, std::int64_t least, std::int64_t most) {
  return static_cast<std::size_t>(random.between(least, most));
}

// One machine: what is said of it, and what it does.
struct Machine {
  Line line;
  std::vector<rt::Duration> begins;  // first event of each message
  std::vector<bool> in_order = {};   // the queue of each sender, also where that is not said
};

/// One message, that sends others; and some whose inhibit time passes behind the end of the frame before.
inline void tie_together(Machine& machine, Random& random) {
  auto& messages = machine.line.messages;
  if (random.chance(300'000)) {
    Message& sync = messages[pick(random, 0, static_cast<std::int64_t>(messages.size()) - 1)];
    sync.jitter = 0ns;
    for (Message& each : messages) {
      if (&each == &sync || random.chance(500'000)) continue;
      each.after = sync.key;
      each.jitter = 0ns;
      each.period = (each.period + sync.period - 1ns) / sync.period * sync.period;
    }
  }
  for (Message& each : messages) {
    const bool sends = std::ranges::any_of(messages, [&](const auto& m) { return m.after == each.key; });
    if (each.after || sends || !random.chance(200'000)) continue;
    each.jitter = 0ns;
    each.before = each.period;
    each.frames_before = 1;
  }
}

inline Machine random_machine(Random& random) {
  Machine m;
  m.line.bit_rate = rates[pick(random, 0, rates.size() - 1)];
  const std::size_t senders = pick(random, 1, 8);
  constexpr std::array queues{Queue::priority, Queue::in_order, Queue::unknown};
  for (std::size_t i = 0; i < senders; ++i) {
    m.line.senders.push_back({"n" + std::to_string(i), queues[pick(random, 0, 2)]});
    m.in_order.push_back(m.line.senders.back().queue == Queue::in_order ||
                         (m.line.senders.back().queue == Queue::unknown && random.chance(500'000)));
  }
  const std::size_t count = pick(random, 1, 24);
  const double most_load = static_cast<double>(random.between(20, 95)) / 100;
  std::map<std::uint32_t, bool> used;
  while (m.line.messages.size() < count) {
    const bool extended = random.chance(100'000);
    std::uint32_t key = static_cast<std::uint32_t>(random.between(1, 0x7EF));
    if (extended) key = key << 18U | static_cast<std::uint32_t>(random.between(0, 0x3FFFF)) | can::extended_flag;
    if (!used.emplace(key, true).second) continue;
    Message message{.name = "m" + std::to_string(m.line.messages.size()), .key = key};
    message.sender = pick(random, 0, static_cast<std::int64_t>(senders) - 1);
    message.data_bytes = static_cast<unsigned>(random.between(0, 8));
    const auto frame = frame_time(m.line, extended, message.data_bytes);
    // Some bring far more than their share, some hardly anything.
    const double load = most_load / static_cast<double>(count) * static_cast<double>(random.between(30, 100)) / 100;
    message.period = rt::Duration(static_cast<std::int64_t>(static_cast<double>(frame.count()) / load));
    if (random.chance(500'000))
      message.jitter = message.period * static_cast<std::int64_t>(random.between(0, 150)) / 100;
    m.line.messages.push_back(message);
    const bool together = random.chance(500'000);
    m.begins.push_back(together ? 1ms
                                : 1ms + rt::Duration(static_cast<std::int64_t>(
                                            random.between(0, static_cast<std::uint64_t>(message.period.count())))));
  }
  tie_together(m, random);
  return m;
}

inline can::Frame frame_of(const Message& m, Random& random) {
  can::Frame frame;
  frame.id = m.key & ~can::extended_flag;
  frame.extended = (m.key & can::extended_flag) != 0;
  frame.size = static_cast<std::uint8_t>(m.data_bytes);
  for (unsigned b = 0; b < m.data_bytes; ++b) frame.data[b] = random.chance(700'000) ? 0x00 : 0x3C;
  return frame;
}

class Node final : public can::Listener {
 public:
  Node(sim::World& world, sim::Bus& bus, const Sender& sender, bool in_order, std::vector<rt::Duration>& latest)
      : port_(bus.attach({.name = sender.name,
                          .queue = in_order ? sim::TxOrder::in_order : sim::TxOrder::priority,
                          .queue_depth = 4096})),
        world_(world),
        latest_(latest) {
    port_->listen(this, {});
  }
  /// `told(message, queued, at)` of each frame of its own that ended, `heard(at)` of each frame of this key.
  void tell(std::function<void(std::size_t, rt::Time, rt::Time)> told) { told_ = std::move(told); }
  void hear(std::uint32_t key, std::function<void()> heard) {
    heard_ = std::move(heard);
    port_->listen(this, std::array{can::only(key)});
  }
  void queue(const can::Frame& frame, std::size_t message, rt::Time event) {
    events_.push_back({message, event, world_.now()});
    if (port_->send(frame, static_cast<std::uint32_t>(events_.size())) != can::Queued::yes) ++refused_;
  }
  void received(const can::Frame&, rt::Time) noexcept override {
    if (heard_) heard_();
  }
  void sent(std::uint32_t tag, rt::Time at) noexcept override {
    const auto [message, event, queued] = events_[tag - 1];
    latest_[message] = std::max(latest_[message], at - event);
    ++ended_;
    if (told_) told_(message, queued, at);
  }
  void changed(const can::Status&, rt::Time) noexcept override {}
  /// Each frame that it queued was sent.
  [[nodiscard]] bool sent_all() const noexcept { return refused_ == 0 && ended_ == events_.size(); }

 private:
  std::unique_ptr<sim::Controller> port_;
  sim::World& world_;
  std::vector<rt::Duration>& latest_;
  struct Event {
    std::size_t message;
    rt::Time event;
    rt::Time queued;
  };
  std::vector<Event> events_;
  std::function<void(std::size_t, rt::Time, rt::Time)> told_;
  std::function<void()> heard_;
  std::size_t ended_ = 0;
  std::size_t refused_ = 0;
};

/// The longest time from a cause to its frame's end that was seen of each message of a machine; empty: a frame was
/// never sent.
class Observed {
 public:
  Observed(const Machine& machine, Random& random, rt::Duration length)
      : machine_(machine),
        random_(random),
        world_(random.between(1, 1'000'000)),
        latest_(machine.line.messages.size()),
        length_(length) {}

  std::vector<rt::Duration> run() {
    sim::Bus& bus = world_.add_bus("bus", machine_.line.bit_rate);
    for (std::size_t i = 0; i < machine_.line.senders.size(); ++i) {
      nodes_.push_back(std::make_unique<Node>(world_, bus, machine_.line.senders[i], machine_.in_order[i], latest_));
      nodes_[i]->tell([this, i](std::size_t m, rt::Time queued, rt::Time at) { ended(i, m, queued, at); });
    }
    const auto listener = bus.attach({.name = "acknowledges"});
    world_.run_for(rt::Duration(20 * (1'000'000'000 / machine_.line.bit_rate)));
    begin_ = world_.now();
    for (std::size_t i = 0; i < machine_.line.messages.size(); ++i) schedule(i);
    world_.run_for(3 * length_);
    if (!std::ranges::all_of(nodes_, [](const auto& node) { return node->sent_all(); })) latest_.clear();
    return latest_;
  }

 private:
  void schedule(std::size_t i) {
    const Message& m = machine_.line.messages[i];
    Node& node = *nodes_[m.sender];
    if (m.after) {
      every_[i] = 0;
      node.hear(*m.after, [this, sender = m.sender] { released(sender); });
      return;
    }
    if (m.frames_before > 0) {
      world_.at(begin_ + machine_.begins[i], [this, &node, i] { send(node, i, world_.now()); });
      return;
    }
    const bool late_first = random_.chance(500'000);  // then as soon as it may: the burst that jitter makes
    bool first = true;
    for (rt::Duration at = machine_.begins[i]; at < length_; at += m.period) {
      const auto most = static_cast<std::uint64_t>(m.jitter.count());
      auto jitter = rt::Duration(static_cast<std::int64_t>(random_.between(0, most)));
      if (late_first) jitter = first ? m.jitter : 0ns;
      first = false;
      const rt::Time event = begin_ + at;
      world_.at(event + jitter, [this, &node, i, event] { send(node, i, event); });
    }
  }

  void send(Node& node, std::size_t message, rt::Time cause) {
    node.queue(frame_of(machine_.line.messages[message], random_), message, cause);
  }

  /// What this node sends at the reception of another's frame; its own counts for it, too.
  void released(std::size_t sender) {
    std::optional<std::size_t> sync;
    for (auto& [i, heard] : every_) {
      const Message& m = machine_.line.messages[i];
      if (m.sender != sender) continue;
      for (std::size_t k = 0; k < machine_.line.messages.size(); ++k) {
        if (machine_.line.messages[k].key == *m.after) sync = k;
      }
      const Message& cause = machine_.line.messages[*sync];
      const auto event = begin_ + machine_.begins[*sync] + static_cast<std::int64_t>(heard) * cause.period;
      if (heard++ % static_cast<std::uint64_t>(m.period / cause.period) == 0) send(*nodes_[sender], i, event);
    }
  }

  void ended(std::size_t node, std::size_t message, rt::Time queued, rt::Time at) {
    const Message& m = machine_.line.messages[message];
    const bool sends =
        std::ranges::any_of(machine_.line.messages, [&](const auto& each) { return each.after == m.key; });
    if (sends) released(node);
    if (m.frames_before == 0 || at - begin_ > length_) return;
    // A change just behind the frame's begin in the queue, whose time is over `before` behind the frame's end.
    world_.at(at + m.before, [this, node, message, queued] { send(*nodes_[node], message, queued); });
  }

  const Machine& machine_;
  Random& random_;
  sim::World world_;
  std::vector<rt::Duration> latest_;
  rt::Duration length_;
  rt::Time begin_{};
  std::vector<std::unique_ptr<Node>> nodes_;
  std::map<std::size_t, std::uint64_t> every_;  // messages that come after another, and how often that was heard
};

// Of one machine, each message: what was seen, and what the analysis bounds it by; highest priority first.
struct Seen {
  rt::Duration latest{};
  std::optional<rt::Duration> bound{};
};
inline std::vector<Seen> by_priority(const Machine& machine, Random& random) {
  const Result result = analyze(machine.line);
  rt::Duration longest{};
  for (const Message& m : machine.line.messages) longest = std::max(longest, m.period);
  const auto latest = Observed(machine, random, 12 * longest).run();
  std::vector<std::size_t> order(latest.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(
      order, [&](auto a, auto b) { return precedes(machine.line.messages[a].key, machine.line.messages[b].key); });
  std::vector<Seen> seen;
  for (const std::size_t i : order) seen.push_back({latest[i], result.responses[i].arrival});
  return seen;
}

}  // namespace berth::analysis::observed
