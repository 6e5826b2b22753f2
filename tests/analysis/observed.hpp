/// Random machines on the simulated bus, and how late their messages really are there: for the test that no message is
/// ever later than its bound, and the bench that prints how close they come.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
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
};

inline Machine random_machine(Random& random) {
  Machine m;
  m.line.bit_rate = rates[pick(random, 0, rates.size() - 1)];
  const std::size_t senders = pick(random, 1, 8);
  for (std::size_t i = 0; i < senders; ++i) m.line.senders.push_back({"n" + std::to_string(i), random.chance(400'000)});
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
  return m;
}

class Node final : public can::Listener {
 public:
  Node(sim::World& world, sim::Bus& bus, const Sender& sender, std::vector<rt::Duration>& latest)
      : port_(bus.attach({.name = sender.name,
                          .queue = sender.fifo ? sim::TxOrder::in_order : sim::TxOrder::priority,
                          .queue_depth = 4096})),
        world_(world),
        latest_(latest) {
    port_->listen(this, {});
  }
  void queue(const can::Frame& frame, std::size_t message, rt::Time event) {
    events_.push_back({message, event});
    if (port_->send(frame, static_cast<std::uint32_t>(events_.size())) != can::Queued::yes) ++refused_;
  }
  void received(const can::Frame&, rt::Time) noexcept override {}
  void sent(std::uint32_t tag, rt::Time at) noexcept override {
    const auto& [message, event] = events_[tag - 1];
    latest_[message] = std::max(latest_[message], at - event);
    ++ended_;
  }
  void changed(const can::Status&, rt::Time) noexcept override {}
  /// Each frame that it queued was sent.
  [[nodiscard]] bool sent_all() const noexcept { return refused_ == 0 && ended_ == events_.size(); }

 private:
  std::unique_ptr<sim::Controller> port_;
  sim::World& world_;
  std::vector<rt::Duration>& latest_;
  std::vector<std::pair<std::size_t, rt::Time>> events_;
  std::size_t ended_ = 0;
  std::size_t refused_ = 0;
};

// The longest time from an event to its frame's end that was seen of each message; empty: a frame was never sent.
inline std::vector<rt::Duration> observe(const Machine& machine, Random& random, rt::Duration length) {
  sim::World world(random.between(1, 1'000'000));
  sim::Bus& bus = world.add_bus("bus", machine.line.bit_rate);
  std::vector<rt::Duration> latest(machine.line.messages.size());
  std::vector<std::unique_ptr<Node>> nodes;
  for (const Sender& sender : machine.line.senders) nodes.push_back(std::make_unique<Node>(world, bus, sender, latest));
  const auto listener = bus.attach({.name = "acknowledges"});
  world.run_for(rt::Duration(20 * (1'000'000'000 / machine.line.bit_rate)));
  const rt::Time begin = world.now();
  for (std::size_t i = 0; i < machine.line.messages.size(); ++i) {
    const Message& m = machine.line.messages[i];
    const bool late_first = random.chance(500'000);  // then as soon as it may: the burst that jitter makes
    bool first = true;
    for (rt::Duration at = machine.begins[i]; at < length; at += m.period) {
      const auto most = static_cast<std::uint64_t>(m.jitter.count());
      auto jitter = rt::Duration(static_cast<std::int64_t>(random.between(0, most)));
      if (late_first) jitter = first ? m.jitter : 0ns;
      first = false;
      can::Frame frame;
      frame.id = m.key & ~can::extended_flag;
      frame.extended = (m.key & can::extended_flag) != 0;
      frame.size = static_cast<std::uint8_t>(m.data_bytes);
      for (unsigned b = 0; b < m.data_bytes; ++b) frame.data[b] = random.chance(700'000) ? 0x00 : 0x3C;
      const rt::Time event = begin + at;
      world.at(event + jitter, [&node = *nodes[m.sender], frame, i, event] { node.queue(frame, i, event); });
    }
  }
  world.run_for(3 * length);
  if (!std::ranges::all_of(nodes, [](const auto& node) { return node->sent_all(); })) latest.clear();
  return latest;
}

// Of one machine, each message: what was seen, and what the analysis bounds it by; highest priority first.
struct Seen {
  rt::Duration latest{};
  std::optional<rt::Duration> bound{};
};
inline std::vector<Seen> by_priority(const Machine& machine, Random& random) {
  const Result result = analyze(machine.line);
  rt::Duration longest{};
  for (const Message& m : machine.line.messages) longest = std::max(longest, m.period);
  const auto latest = observe(machine, random, 12 * longest);
  std::vector<std::size_t> order(latest.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(
      order, [&](auto a, auto b) { return precedes(machine.line.messages[a].key, machine.line.messages[b].key); });
  std::vector<Seen> seen;
  for (const std::size_t i : order) seen.push_back({latest[i], result.responses[i].worst});
  return seen;
}

}  // namespace berth::analysis::observed
