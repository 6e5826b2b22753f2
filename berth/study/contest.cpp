#include "berth/study/contest.hpp"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>
#include <thread>

#include "berth/discovery/auto.hpp"
#include "berth/research/negotiation_frames.hpp"
#include "berth/study/verdict.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;
using discovery::Method;
using plant::Speaks;

constexpr auto limit = 30min;        // in bus time; the slowest cell takes some minutes
constexpr auto boots_within = 50ms;  // reset 5 ms, and the boot-up messages of all

/// Node-IDs 1, 2, 3, ... in the order of finding.
class Ascending final : public discovery::Assigner {
 public:
  NodeId assign(const LssAddress&, bool) noexcept override { return next(); }
  NodeId next() noexcept { return next_ > most ? NodeId() : NodeId(static_cast<std::uint8_t>(next_++)); }

 private:
  static constexpr unsigned most = 126;  // 127 is the master's
  unsigned next_ = 1;
};

/// The methods that configure a device while they have it selected.
bool assigns_at_once(Method method) noexcept {
  using enum Method;
  return method != rand && method != and_protocol && method != planner_rand;
}

std::vector<discovery::Kind> kinds_of(const plant::PlantFile& plant) {
  std::vector<discovery::Kind> kinds;
  for (const auto& device : plant.devices) {
    const discovery::Kind kind{device.address.type(), std::nullopt};
    if (std::ranges::find(kinds, kind) == kinds.end()) kinds.push_back(kind);
  }
  return kinds;
}

/// A master that finds all devices and gives each a node-ID.
class Commissioner {
 public:
  Commissioner(Stage& stage, Method method, const plant::PlantFile& plant)
      : lss_(stage.master()), discovery_(discovery::make(method, {stage.master(), lss_})) {
    if (is_planner(method) || method == Method::identify) known_.kinds = kinds_of(plant);
    if (assigns_at_once(method)) options_.assigner = &ids_;
    for (const auto& device : plant.devices) real_.insert(device.address);
  }

  rt::Task<void> run() {
    auto report = co_await discovery_->find(known_, options_);
    if (!report) {
      trouble = describe(report.error());
      co_return;
    }
    if (report->end != discovery::Report::End::complete) trouble = discovery::name(report->end);
    std::set<LssAddress> found;
    bool bound = false;
    for (const auto& device : report->found) {
      if (real_.contains(device.address)) found.insert(device.address);
      if (device.assigned.configured()) given.push_back({device.address, device.assigned});
      if (device.assigned.configured()) continue;
      const auto selected = co_await lss_.switch_selective(device.address);
      if (!selected) continue;
      const NodeId id = ids_.next();
      const auto configured = co_await lss_.configure_node_id(id);
      if (!configured) trouble = "a device did not take its node-ID";
      if (configured) given.push_back({device.address, id});
      co_await lss_.switch_global(lss::State::waiting);
      bound = true;
    }
    if (!bound) co_await lss_.switch_global(lss::State::waiting);
    found_count = static_cast<unsigned>(found.size());
    done = true;
  }

  unsigned found_count = 0;
  bool done = false;
  std::string trouble;
  std::vector<places::Assignment> given;

 private:
  lss::Master lss_;
  Ascending ids_;
  std::unique_ptr<discovery::Discovery> discovery_;
  discovery::Known known_;
  discovery::Options options_;
  std::set<LssAddress> real_;
};

Trial with_master(Method method, const Cast& cast, std::uint32_t bit_rate) {
  const auto plant = plant_of(cast);
  Stage stage(plant, bit_rate);
  stage.settle();
  stage.bus().reset_statistics();
  const auto began = stage.now();
  Commissioner master(stage, method, plant);
  const bool ended = stage.run(master.run(), limit);
  const auto over = stage.now();
  stage.run_until_quiet(boots_within, 10s);
  Trial t;
  t.bus_time = std::max(over, stage.last_frame()) - began;
  t.frames = stage.bus().statistics().frames;
  t.bits = stage.bus().statistics().bits;
  t.found = master.found_count;
  t.bound = stage.bound();
  t.trouble = ended ? master.trouble : "not over after half an hour";
  t.wrong = differences(stage, master.given, Hold::active);
  return t;
}

/// Notes the devices that were heard to have a node-ID.
class Announced final : public can::Tap {
 public:
  explicit Announced(sim::Bus& bus) : bus_(&bus) { bus.add_tap(*this); }
  ~Announced() { bus_->remove_tap(*this); }
  Announced(const Announced&) = delete;
  Announced& operator=(const Announced&) = delete;
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    if (first == rt::Time{}) first = at;
    const auto message = research::decode_negotiation(frame);
    if (message && message->kind == research::NegotiationMessage::Kind::used) ids.insert(message->node);
  }
  rt::Time first{};
  std::set<NodeId> ids;

 private:
  sim::Bus* bus_;
};

Trial without_master(const Cast& cast, std::uint32_t bit_rate) {
  Stage stage(plant_of(cast), bit_rate);
  Announced heard(stage.bus());
  unsigned bound = 0;
  for (rt::Duration time{0}; bound < cast.devices && time < 10min; time += 5ms) {
    stage.settle(5ms);
    bound = stage.bound();
  }
  Trial t;
  t.bus_time = stage.now() - heard.first;
  t.frames = stage.bus().statistics().frames;
  t.bits = stage.bus().statistics().bits;
  t.found = static_cast<unsigned>(heard.ids.size());
  t.bound = bound;
  if (bound < cast.devices) t.trouble = "not settled after ten minutes";
  return t;
}

void run(Cell& c, const Contest& contest) {
  c.found = c.bound = c.devices;
  for (unsigned seed = 1; seed <= contest.seeds; ++seed) {
    const auto t = trial(c, contest.response, seed);
    c.bus_time += t.bus_time;
    c.frames += t.frames;
    c.bits += t.bits;
    c.worst = std::max(c.worst, t.bus_time);
    c.found = std::min(c.found, t.found);
    c.bound = std::min(c.bound, t.bound);
    if (!t.trouble.empty()) c.trouble = t.trouble;
    c.wrong.insert(c.wrong.end(), t.wrong.begin(), t.wrong.end());
  }
  const unsigned n = std::max(1U, contest.seeds);
  c.bus_time /= n;
  c.frames = (c.frames + n / 2) / n;
  c.bits = (c.bits + n / 2) / n;
}

}  // namespace

std::vector<Contestant> contestants() {
  using enum Method;
  return {rand,     and_protocol, fastscan,     feedback_29,      feedback_11,
          identify, std::nullopt, planner_rand, planner_fastscan, planner_feedback};
}

std::string_view name(const Contestant& contestant) noexcept {
  return contestant ? discovery::name(*contestant) : std::string_view("negotiation");
}

std::optional<Contestant> contestant(std::string_view wanted) noexcept {
  for (const auto& each : contestants()) {
    if (name(each) == wanted) return each;
  }
  return std::nullopt;
}

plant::SpeaksSet speaks(const Contestant& contestant) noexcept {
  if (!contestant) return {Speaks::negotiation};
  switch (*contestant) {
    case Method::rand:
    case Method::planner_rand: return {Speaks::lss, Speaks::rand};
    case Method::and_protocol: return {Speaks::lss, Speaks::and_protocol};
    case Method::fastscan:
    case Method::planner_fastscan: return {Speaks::fastscan};
    case Method::feedback_29:
    case Method::planner_feedback: return {Speaks::feedback_29};
    case Method::feedback_11: return {Speaks::feedback_11};
    case Method::identify: break;
  }
  return {Speaks::lss};
}

bool is_planner(const Contestant& contestant) noexcept {
  using enum Method;
  return contestant == planner_rand || contestant == planner_fastscan || contestant == planner_feedback;
}

Trial trial(const Contestant& method, const Cast& cast, std::uint32_t bit_rate) {
  return method ? with_master(*method, cast, bit_rate) : without_master(cast, bit_rate);
}

Trial trial(const Cell& cell, const plant::Latency& response, std::uint64_t seed) {
  const Cast cast{.devices = cell.devices,
                  .serials = cell.serials,
                  .speaks = speaks(cell.method),
                  .response = response,
                  .seed = seed};
  return trial(cell.method, cast, cell.bit_rate);
}

std::vector<Cell> cells_of(const Contest& contest) {
  std::vector<Cell> cells;
  for (const auto& method : contest.methods) {
    for (const auto devices : contest.devices) {
      for (const auto rate : contest.bit_rates) {
        for (const auto serials : contest.serials)
          cells.push_back({.method = method, .devices = devices, .bit_rate = rate, .serials = serials});
      }
    }
  }
  return cells;
}

std::vector<Cell> compare(const Contest& contest, unsigned threads,
                          const std::function<void(std::size_t done, std::size_t all)>& progress) {
  std::vector<Cell> cells = cells_of(contest);
  std::atomic<std::size_t> next = 0;
  std::size_t done = 0;
  std::mutex guard;
  // The largest first, so that the threads end together.
  std::vector<std::size_t> order(cells.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, std::greater{}, [&](std::size_t i) { return cells[i].devices; });
  const auto work = [&] {
    for (auto i = next++; i < order.size(); i = next++) {
      run(cells[order[i]], contest);
      const std::scoped_lock lock(guard);
      ++done;
      if (progress) progress(done, cells.size());
    }
  };
  std::vector<std::jthread> helpers;
  for (unsigned i = 1; i < threads; ++i) helpers.emplace_back(work);
  work();
  helpers.clear();
  return cells;
}

}  // namespace berth::study
