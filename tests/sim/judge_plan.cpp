#include "judge_plan.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "berth/sim/world.hpp"

namespace judge {

using namespace berth;
using Kind = Act::Kind;

Frame draw_frame(Random& dice) {
  // Few identifiers, so that they collide; base and extended ones share prefixes.
  const std::uint32_t ids[] = {0x000, 0x001, 0x550, 0x7FF, 0x100};
  const std::uint32_t id = ids[dice.below(5)];
  Frame f;
  const auto kind = dice.below(4);
  f.extended = kind == 2 || kind == 3;
  f.remote = kind == 1 || (kind == 3 && dice.below(2) == 0);
  f.id = f.extended ? (id << 18U) | static_cast<std::uint32_t>(dice.below(3) * 0x1FFFF) : id;
  f.size = static_cast<std::uint8_t>(dice.below(3) == 0 ? dice.below(9) : dice.below(2));
  for (unsigned i = 0; i < 8; ++i)
    f.data[i] = static_cast<std::uint8_t>(dice.below(3) == 0 ? dice.next() : dice.below(2) * 0xFF);
  return f;
}

unsigned draw_counter(Random& dice, bool receive) {
  switch (dice.below(6)) {
    case 0: return 100 + static_cast<unsigned>(dice.below(40));
    case 1: return receive ? 127 : 255 - static_cast<unsigned>(dice.below(20));
    case 2: return static_cast<unsigned>(dice.below(10));
    default: return 0;
  }
}

Plan draw_traffic(Random& dice, std::size_t most) {
  Plan plan;
  plan.nodes.resize(dice.below(10) == 0 ? 1 : 2 + dice.below(most - 1));
  for (auto& node : plan.nodes) {
    if (dice.below(3) == 0) node = {draw_counter(dice, false), draw_counter(dice, true)};
    node.by_priority = dice.below(2) == 0;
    node.listen_only = dice.below(12) == 0;
    if (node.listen_only) node.tec = node.rec = 0;
  }
  const auto count = 1 + dice.below(6);
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto node = static_cast<int>(dice.below(plan.nodes.size()));
    const auto when = 1000 * static_cast<Time>(dice.below(3) == 0 ? dice.below(600) : dice.below(3) * 100);
    plan.acts.push_back({when, Kind::send, node, draw_frame(dice)});
    if (dice.below(3) == 0)
      plan.acts.push_back({when, Kind::send, (node + 1) % static_cast<int>(plan.nodes.size()), draw_frame(dice)});
  }
  plan.until = 1000 * static_cast<Time>(2500 + dice.below(500));
  return plan;
}

void draw_disturbances(Random& dice, Plan& plan, unsigned most) {
  for (auto left = 1 + dice.below(most); left > 0; --left) {
    const auto from = dice.below(2) == 0 ? 0 : 1000 * static_cast<Time>(dice.below(600));
    const auto bit = static_cast<int>(dice.below(4) == 0 ? dice.below(30) : dice.below(170));
    Disturbance d{from, bit, dice.below(4) == 0 ? 2 + static_cast<int>(dice.below(7)) : 1, {}};
    for (int node = 0; node < static_cast<int>(plan.nodes.size()); ++node) {
      if (dice.below(2) == 0) d.nodes.push_back(node);
    }
    if (!d.nodes.empty()) plan.disturbances.push_back(d);
  }
}

namespace {

std::string describe(const std::vector<Event>& events) {
  std::string out;
  for (const auto& e : events) {
    out += std::to_string(e.end) + (e.sent ? " sent by " : " received by ") + std::to_string(e.node) + " " +
           can::to_string(e.frame) + "\n";
  }
  return out;
}

std::string describe(const Plan& plan) {
  const char* const kinds[] = {"send", "power off", "power on", "restart", "bit", "unplug", "plug", "apart", "join"};
  std::string out;
  for (const auto& n : plan.nodes) {
    out += "node tec " + std::to_string(n.tec) + " rec " + std::to_string(n.rec) + (n.by_priority ? " priority" : "") +
           (n.listen_only ? " listen-only" : "") + " bit " + std::to_string(n.bit) + "\n";
  }
  for (const auto& a : plan.acts) {
    out += std::to_string(a.when) + " " + kinds[static_cast<int>(a.kind)] + " " + std::to_string(a.node);
    if (a.kind == Kind::send) out += " " + can::to_string(a.frame);
    if (a.kind == Kind::set_bit) out += " " + std::to_string(a.bit);
    for (const int other : a.others) out += " " + std::to_string(other);
    out += "\n";
  }
  for (const auto& d : plan.disturbances) {
    out += "disturbed from " + std::to_string(d.from) + " bit " + std::to_string(d.bit) + " to " +
           std::to_string(d.bit + d.count - 1) + " nodes";
    for (const auto n : d.nodes) out += " " + std::to_string(n);
    out += "\n";
  }
  return out;
}

/// Which segment each node is on: 0 the bus, others what was cut off.
class Cabling {
 public:
  explicit Cabling(std::size_t count) : segments_(count, 0), in_(count, true) {}
  void act(const Act& a) {
    const auto one = static_cast<std::size_t>(a.node);
    switch (a.kind) {
      case Kind::unplug:
        if (in_[one]) segments_[one] = ++made_;
        in_[one] = false;
        break;
      case Kind::plug:
        if (!in_[one]) segments_[one] = 0;
        in_[one] = true;
        break;
      case Kind::apart:
        ++made_;
        for (const int other : a.others) {
          if (in_[static_cast<std::size_t>(other)]) segments_[static_cast<std::size_t>(other)] = made_;
        }
        break;
      case Kind::join:
        for (std::size_t i = 0; i < segments_.size(); ++i) {
          if (in_[i]) segments_[i] = 0;
        }
        break;
      default: break;
    }
  }
  [[nodiscard]] int segment(int node) const { return segments_[static_cast<std::size_t>(node)]; }

 private:
  std::vector<int> segments_;
  std::vector<bool> in_;
  int made_ = 0;
};

void normalise(Result& r, Time until) {
  // The bus tells of a frame at its end, the judge knows a receiver's one bit before.
  std::erase_if(r.events, [&](const Event& e) { return e.end > until; });
  std::ranges::sort(r.events, {}, [](const Event& e) { return std::make_tuple(e.end, e.node, e.sent); });
  for (auto& [tec, rec, off] : r.counters) {
    if (off) tec = rec = 0;
  }
}

Result judged(const Plan& plan) {
  Bus bus(plan.nodes.size(), plan.fast_bit);
  for (std::size_t i = 0; i < plan.nodes.size(); ++i) {
    Node& n = bus.nodes[i];
    n.tec = plan.nodes[i].tec;
    n.rec = plan.nodes[i].rec;
    n.by_priority = plan.nodes[i].by_priority;
    n.listens_only = plan.nodes[i].listen_only;
    n.bit = plan.nodes[i].bit;
  }
  Cabling cabling(plan.nodes.size());
  for (const auto& a : plan.acts) {
    bus.at(a.when, [&](Bus& b) {
      cabling.act(a);
      switch (a.kind) {
        case Kind::send: return b.send(a.node, a.frame);
        case Kind::power_off: return b.power(a.node, false);
        case Kind::power_on: return b.power(a.node, true);
        case Kind::restart: return b.restart(a.node);
        case Kind::set_bit: return b.set_bit(a.node, a.bit);
        default: break;
      }
      for (int i = 0; i < static_cast<int>(b.nodes.size()); ++i) {
        if (b.nodes[static_cast<std::size_t>(i)].segment != cabling.segment(i)) b.move(i, cabling.segment(i));
      }
    });
  }
  for (const auto& d : plan.disturbances) {
    for (int bit = d.bit; bit < d.bit + d.count; ++bit) {
      for (const auto n : d.nodes) bus.flip(d.from, bit, n);
    }
  }
  bus.run(plan.until);
  Result r{.events = bus.events, .counters = {}, .frames = bus.frames};
  for (const auto& n : bus.nodes) r.counters.emplace_back(n.tec, n.rec, n.bus_off);
  r.errors = bus.errors;
  r.recovered = bus.recovered;
  r.whole_fd = bus.whole_fd;
  normalise(r, plan.until);
  return r;
}

struct Recorder : can::Listener {
  int node = 0;
  std::vector<Event>* events = nullptr;
  const std::vector<Act>* acts = nullptr;
  void received(const Frame& frame, rt::Time at) noexcept override {
    events->push_back({at.time_since_epoch().count(), node, false, frame});
  }
  void sent(std::uint32_t tag, rt::Time at) noexcept override {
    events->push_back({at.time_since_epoch().count(), node, true, (*acts)[tag - 1].frame});
  }
  void changed(const can::Status&, rt::Time) noexcept override {}
};

class Simulated {
 public:
  explicit Simulated(const Plan& plan)
      : plan_(&plan),
        bus_(&world_.add_bus("bus", 1'000'000, plan.fast_bit == 0 ? 0 : rate(plan.fast_bit))),
        cabling_(plan.nodes.size()),
        recorders_(plan.nodes.size()) {
    for (std::size_t i = 0; i < plan.nodes.size(); ++i) attach(i);
    // What happens at one instant happens in this order, whatever the executor does.
    std::map<Time, std::vector<std::size_t>> instants;
    for (std::size_t i = 0; i < plan.acts.size(); ++i) instants[plan.acts[i].when].push_back(i);
    for (const auto& [when, list] : instants) {
      world_.at(rt::Time(rt::Duration(when)), [this, list] {
        for (const auto i : list) act(i);
      });
    }
    for (const auto& d : plan.disturbances) {
      for (const int node : d.nodes) disturb(d, node);
    }
  }
  Result run(std::uint64_t perturbation) {
    if (perturbation != 0) world_.executor().perturb(perturbation);
    world_.run_until(rt::Time(rt::Duration(plan_->until)));
    world_.run_for(rt::Duration(1));
    for (const auto& p : ports_)
      result_.counters.emplace_back(p->errors().tec(), p->errors().rec(),
                                    p->errors().state() == sim::ErrorState::bus_off);
    result_.frames = bus_->statistics().starts;
    result_.collisions = bus_->statistics().collisions;
    result_.destroyed_fd = bus_->statistics().fd_destroyed;
    normalise(result_, plan_->until);
    return result_;
  }

 private:
  static std::uint32_t rate(Time bit) { return static_cast<std::uint32_t>(1'000'000'000 / bit); }
  void attach(std::size_t i) {
    const NodePlan& node = plan_->nodes[i];
    sim::ControllerOptions options;
    options.queue = node.by_priority ? sim::TxOrder::priority : sim::TxOrder::in_order;
    options.listen_only = node.listen_only;
    options.bit_rate = rate(node.bit);
    options.fd = plan_->fast_bit != 0;
    ports_.push_back(bus_->attach(options));
    recorders_[i].node = static_cast<int>(i);
    recorders_[i].events = &result_.events;
    recorders_[i].acts = &plan_->acts;
    const std::vector<can::IdRange> all{can::all_base, can::all_extended};
    ports_.back()->listen(&recorders_[i], all);
    ports_.back()->preset_counters(static_cast<std::uint16_t>(node.tec), static_cast<std::uint16_t>(node.rec));
  }
  void act(std::size_t index) {
    const Act& a = plan_->acts[index];
    sim::Controller& port = *ports_[static_cast<std::size_t>(a.node)];
    cabling_.act(a);
    switch (a.kind) {
      case Kind::send: static_cast<void>(port.send(a.frame, static_cast<std::uint32_t>(index + 1))); break;
      case Kind::power_off: port.power(false); break;
      case Kind::power_on: port.power(true); break;
      case Kind::restart: static_cast<void>(port.restart(port.bit_rate())); break;
      case Kind::set_bit: port.set_bit_rate(rate(a.bit)); break;
      case Kind::unplug: port.cable(false); break;
      case Kind::plug: port.cable(true); break;
      case Kind::apart: {
        std::vector<sim::Controller*> others;
        for (const int other : a.others) others.push_back(ports_[static_cast<std::size_t>(other)].get());
        bus_->split(others);
        break;
      }
      case Kind::join: bus_->join(); break;
    }
  }
  void disturb(const Disturbance& d, int node) {
    sim::Fault fault;
    fault.trigger.not_before = rt::Time(rt::Duration(d.from));
    fault.trigger.when = [this, node](const sim::FrameStart& start) {
      return cabling_.segment(start.sender) == cabling_.segment(node);
    };
    fault.where = sim::from_start(d.bit);
    fault.bits = static_cast<unsigned>(d.count);
    fault.victims.push_back(ports_[static_cast<std::size_t>(node)].get());
    bus_->inject(fault);
  }

  const Plan* plan_;
  sim::World world_;
  sim::Bus* bus_;
  Cabling cabling_;
  Result result_;
  std::vector<Recorder> recorders_;
  std::vector<std::unique_ptr<sim::Controller>> ports_;
};

}  // namespace

testing::AssertionResult agree(const Plan& plan, Result* out, std::uint64_t perturbation) {
  const Result judge = judged(plan);
  const Result bus = Simulated(plan).run(perturbation);
  if (out != nullptr) {
    *out = judge;
    out->collisions = bus.collisions;
    out->destroyed_fd = bus.destroyed_fd;
  }
  if (judge.events == bus.events && judge.counters == bus.counters) return testing::AssertionSuccess();
  auto failure = testing::AssertionFailure() << describe(plan) << "judge:\n"
                                             << describe(judge.events) << "bus:\n"
                                             << describe(bus.events);
  for (std::size_t i = 0; i < judge.counters.size(); ++i) {
    const auto& [jt, jr, jo] = judge.counters[i];
    const auto& [bt, br, bo] = bus.counters[i];
    failure << "node " << i << " judge " << jt << '/' << jr << (jo ? " off" : "") << " bus " << bt << '/' << br
            << (bo ? " off" : "") << "\n";
  }
  return failure << "starts " << judge.frames << " and " << bus.frames;
}

}  // namespace judge
