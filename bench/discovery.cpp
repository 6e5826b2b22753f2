// What Berth's planners take on unmodified CiA 305 Fastscan slaves and on slaves with feedback, against bit-by-bit
// Fastscan with its full window: same slaves, same latencies, in the time of the simulated bus. And one device that is
// plugged into a running network.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/world.hpp"
#include "berth/base/random.hpp"
#include "berth/can/length.hpp"
#include "berth/co/nmt.hpp"
#include "berth/discovery/auto.hpp"
#include "berth/lss/master.hpp"

using namespace berth;
using namespace std::chrono_literals;
using discovery::Method;

namespace {

constexpr std::uint32_t bit_rate = 125'000;
constexpr TypeCode type{0x0135'5341, 0x0447'0003};
constexpr std::uint32_t revision = 0x0002'0006;
constexpr unsigned slaves = 30;
constexpr rt::Duration window = 10ms;

struct Giver final : discovery::Assigner {
  NodeId assign(const LssAddress&, bool) noexcept override { return NodeId(next++); }
  std::uint8_t next = 100 - slaves;
};

/// What may differ from case to case.
struct Case {
  std::vector<std::uint32_t> serials;
  plant::Speaks speaks = plant::Speaks::fastscan;
  bool revision_known = true;
  bool store = false;
  rt::Duration inhibit{0};
  std::uint64_t seed = 1;
};

struct Outcome {
  rt::Duration time{};
  std::uint64_t frames = 0;
  unsigned bound = 0;
};

plant::PlantFile plant_of(const Case& c) {
  plant::PlantFile file;
  file.seed = c.seed;
  file.buses.push_back({bench::bus_name, 0});
  for (std::size_t i = 0; i < c.serials.size(); ++i) {
    plant::PlantDevice d;
    d.name = "d" + std::to_string(i + 1);
    d.bus = bench::bus_name;
    d.address = {type.vendor, type.product, revision, c.serials[i]};
    d.speaks = {c.speaks};
    d.response = {.min = 200us, .max = 2ms};
    d.reset = 5ms;
    d.storing.time = 100ms;
    file.devices.push_back(d);
  }
  return file;
}

std::vector<std::uint32_t> consecutive() {
  std::vector<std::uint32_t> list;
  for (std::uint32_t i = 0; i < slaves; ++i) list.push_back(0x1A2B'3C00 + i);
  return list;
}
std::vector<std::uint32_t> random_serials(std::uint64_t seed, unsigned count = slaves) {
  Random random(seed * 7919);
  std::vector<std::uint32_t> list;
  while (list.size() < count) {
    const auto serial = static_cast<std::uint32_t>(random.next());
    if (std::ranges::find(list, serial) == list.end()) list.push_back(serial);
  }
  return list;
}
// Thirty serial numbers with `halves` distinct upper halves.
std::vector<std::uint32_t> in_halves(unsigned halves) {
  Random random(halves);
  std::vector<std::uint32_t> upper = random_serials(halves, halves);
  std::vector<std::uint32_t> list;
  for (unsigned i = 0; i < slaves; ++i) {
    list.push_back((upper[i % halves] & 0xFFFF'0000U) | static_cast<std::uint32_t>(random.below(0x10000)));
  }
  return list;
}

class Frames final : public can::Tap {
 public:
  explicit Frames(sim::Bus& bus) : bus_(bus) { bus.add_tap(*this); }
  ~Frames() { bus_.remove_tap(*this); }
  Frames(const Frames&) = delete;
  Frames& operator=(const Frames&) = delete;
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    last = at;
    ++count;
    if (on_frame) on_frame(frame);
  }
  std::uint64_t count = 0;
  rt::Time last{};
  std::function<void(const can::Frame&)> on_frame;

 private:
  sim::Bus& bus_;
};

/// From the first request until the last node-ID was given and the search is over.
Outcome thirty(Method method, const Case& c) {
  const auto world = bench::start(plant_of(c), bit_rate);
  auto port = world->attach_master(bench::bus_name);
  can::Dispatcher dispatcher(world->executor(), *port);
  lss::Master lss(dispatcher);
  lss::MasterOptions lss_options;
  lss_options.inhibit = c.inhibit;
  lss.set_options(lss_options);
  world->sim().run_for(1s);
  Giver giver;
  discovery::Options options;
  options.window = window;
  options.inhibit = c.inhibit;
  options.assigner = &giver;
  options.store = c.store;
  discovery::Known known;
  known.kinds = {{type, c.revision_known ? std::optional(revision) : std::nullopt}};
  const auto planner = discovery::make(method, {dispatcher, lss});
  Frames frames(*world->bus(bench::bus_name));
  const auto began = world->sim().now();
  rt::Time ended{};
  struct Job {
    static rt::Task<void> find(discovery::Discovery& planner, const discovery::Known& known,
                               const discovery::Options& options, rt::Executor& executor, rt::Time& ended) {
      const auto report = co_await planner.find(known, options);
      if (report.has_value()) ended = executor.now();
    }
  };
  auto task = Job::find(*planner, known, options, world->executor(), ended);
  const bool done = bench::run(world->sim(), std::move(task), 10min);
  const auto count = frames.count;
  world->sim().run_for(100ms);
  Outcome outcome{.time = ended - began, .frames = count};
  for (const auto& d : world->devices()) outcome.bound += d->device().node_id().configured() ? 1U : 0U;
  if (!done || outcome.bound != c.serials.size()) {
    std::fprintf(stderr, "bench discovery: %s bound %u of %zu\n", std::string(name(method)).c_str(), outcome.bound,
                 c.serials.size());
    std::exit(1);
  }
  return outcome;
}

// ---- one device on a running network ----------------------------------------------------------------------------

/// Nodes whose PDOs are spread evenly over their period.
class Traffic {
 public:
  Traffic(plant::World& world, double load, Random random) : world_(world) {
    if (load <= 0) return;
    for (unsigned i = 0; i < slaves; ++i) ports_.push_back(world.attach_master(bench::bus_name));
    const double bits = 116;  // of an 8-byte frame with random data, on average, with the space behind it
    gap_ = rt::Duration(static_cast<std::int64_t>(bits / bit_rate / load * 1e9));
    random_ = random;
    world_.sim().after(rt::Duration(static_cast<std::int64_t>(random_.below(static_cast<std::uint64_t>(gap_.count())))),
                       [this] { send(); });
  }

 private:
  void send() {
    const unsigned node = next_++ % slaves;
    std::array<std::uint8_t, 8> data{};
    for (auto& byte : data) byte = static_cast<std::uint8_t>(random_.next());
    ports_[node]->send(can::Frame::base(0x181 + node, data), 0);
    world_.sim().after(gap_, [this] { send(); });
  }
  plant::World& world_;
  std::vector<std::unique_ptr<sim::Controller>> ports_;
  rt::Duration gap_{};
  Random random_{0};
  unsigned next_ = 0;
};

struct Join {
  plant::Speaks speaks = plant::Speaks::fastscan;
  Method method = Method::planner_fastscan;
  bool listed = false;
  double load = 0;
  bool fresh = false;  // the planner has never heard a device answer
};
constexpr unsigned before = 2;  // devices that the planner has bound on this network before

/// From when the device can answer LSS to when its NMT start is on the bus.
rt::Duration join(const Join& how, std::uint64_t seed) {
  const Case c{.serials = random_serials(seed, before + 1), .speaks = how.speaks, .seed = seed};
  plant::PlantFile file = plant_of(c);
  file.devices.back().boot = 5s;
  const auto world = bench::start(file, bit_rate);
  auto port = world->attach_master(bench::bus_name);
  can::Dispatcher dispatcher(world->executor(), *port);
  lss::Master lss(dispatcher);
  Traffic traffic(*world, how.load, Random(seed));
  Giver giver;
  discovery::Options options;
  options.window = window;
  options.assigner = &giver;
  discovery::Known known;
  known.kinds = {{type, revision}};
  for (std::uint32_t i = 0; i < slaves; ++i) known.registered.push_back({type.vendor, type.product, revision, i});
  auto planner = discovery::make(how.method, {dispatcher, lss});
  Frames frames(*world->bus(bench::bus_name));
  std::optional<rt::Time> started;
  frames.on_frame = [&](const can::Frame& f) {
    const bool boot_up = !f.extended && f.id > 0x700 && f.id < 0x780 && f.size == 1 && f.data[0] == 0;
    const bool start = !f.extended && f.id == 0 && f.size == 2 && f.data[0] == 1;
    if (boot_up) {
      const std::array<std::uint8_t, 2> data{1, static_cast<std::uint8_t>(f.id & 0x7FU)};
      dispatcher.send(can::Frame::base(0, data));
    }
    if (start && !started) started = frames.last;
  };
  struct Job {
    static rt::Task<void> find(discovery::Discovery& planner, const discovery::Known& known,
                               const discovery::Options& options) {
      co_await planner.find(known, options);
    }
  };
  world->sim().run_for(100ms);
  if (!bench::run(world->sim(), Job::find(*planner, known, options), 3s)) std::exit(1);
  if (how.fresh) planner = discovery::make(how.method, {dispatcher, lss});
  if (how.listed) known.expected = {{type.vendor, type.product, revision, c.serials.back()}};
  // It has booted, and answers from now on.
  const auto able = rt::Time{} + 5s;
  world->sim().run_for(able - world->sim().now());
  started.reset();
  rt::Scope scope(world->executor());
  scope.spawn(Job::find(*planner, known, options));
  if (!world->sim().run_until([&] { return started.has_value(); }, 10s)) {
    std::fprintf(stderr, "bench discovery: seed %llu was not started\n", static_cast<unsigned long long>(seed));
    std::exit(1);
  }
  world->sim().run_until([&] { return scope.running() == 0; }, 10s);
  return *started - able;
}

std::string ratio(const Outcome& slow, const Outcome& quick) {
  return fmt::format("{:.1f}x", static_cast<double>(slow.time.count()) / static_cast<double>(quick.time.count()));
}

void scans(std::vector<bench::Figure>& figures) {
  struct Row {
    const char* what;
    Case c;
    double aim;
  };
  const std::vector<Row> rows{
      {"random serial numbers", {.serials = random_serials(1)}, 8},
      {"consecutive serial numbers", {.serials = consecutive()}, 25},
      {"random, revision unknown", {.serials = random_serials(1), .revision_known = false}, 0},
      {"consecutive, revision unknown", {.serials = consecutive(), .revision_known = false}, 0},
      {"random, store of 100 ms", {.serials = random_serials(1), .store = true}, 0},
      {"consecutive, store of 100 ms", {.serials = consecutive(), .store = true}, 0},
      {"random, 1 ms inhibit", {.serials = random_serials(1), .inhibit = 1ms}, 0},
      {"consecutive, 1 ms inhibit", {.serials = consecutive(), .inhibit = 1ms}, 0},
  };
  std::vector<std::vector<std::string>> cells;
  for (const Row& row : rows) {
    const Outcome bits = thirty(Method::fastscan, row.c);
    const Outcome planner = thirty(Method::planner_fastscan, row.c);
    cells.push_back({row.what, bench::time_text(bits.time), fmt::format("{}", bits.frames),
                     bench::time_text(planner.time), fmt::format("{}", planner.frames), ratio(bits, planner)});
    if (row.aim > 0) {
      const double times = static_cast<double>(bits.time.count()) / static_cast<double>(planner.time.count());
      figures.push_back(bench::at_least(std::string("planner-fastscan, ") + row.what, times, row.aim, "x"));
    }
  }
  bench::print_columns("30 unmodified Fastscan slaves, type and revision known, 0.2 to 2 ms, 125 kbit/s",
                       {"", "fastscan, 10 ms", "frames", "planner-fastscan", "frames", ""}, cells);
}

void feedback(std::vector<bench::Figure>& figures) {
  std::vector<std::vector<std::string>> cells;
  for (const unsigned halves : {1U, 2U, 5U, 10U, 30U}) {
    const Case c{.serials = in_halves(halves), .speaks = plant::Speaks::feedback_29};
    const Outcome planner = thirty(Method::planner_feedback, c);
    const double bound = 12 + 3 * halves + 7 * slaves;
    const double times = static_cast<double>(planner.frames) / bound;
    cells.push_back({fmt::format("{}", halves), fmt::format("{}", planner.frames), fmt::format("{}", bound),
                     fmt::format("{:.2f}", times), bench::time_text(planner.time)});
    figures.push_back(bench::at_most(fmt::format("feedback, {} upper halves", halves), times, 1.5, "x"));
  }
  bench::print_columns("30 slaves with 29-bit feedback, type and revision known, 125 kbit/s",
                       {"upper halves", "frames", "12 + 3h + 7 x 30", "", "time"}, cells);
}

void joins(std::vector<bench::Figure>& figures, unsigned seeds) {
  struct Row {
    const char* what;
    Join how;
    std::array<double, 3> aims;
  };
  const std::vector<Row> rows{
      {"feedback", {plant::Speaks::feedback_29, Method::planner_feedback}, {75, 100, 150}},
      {"plain Fastscan", {plant::Speaks::fastscan, Method::planner_feedback}, {160, 200, 300}},
      {"a listed spare", {plant::Speaks::fastscan, Method::planner_feedback, true}, {75, 100, 150}},
      {"feedback, nothing learnt", {plant::Speaks::feedback_29, Method::planner_feedback, false, 0, true}, {}},
      {"plain, nothing learnt", {plant::Speaks::fastscan, Method::planner_feedback, false, 0, true}, {}},
      {"spare, nothing learnt", {plant::Speaks::fastscan, Method::planner_feedback, true, 0, true}, {}},
  };
  constexpr std::array<double, 3> loads{0, 0.3, 0.6};
  std::vector<std::vector<std::string>> cells;
  for (const Row& row : rows) {
    for (std::size_t l = 0; l < loads.size(); ++l) {
      Join how = row.how;
      how.load = loads[l];
      rt::Duration worst{0};
      rt::Duration sum{0};
      for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        const auto time = join(how, seed);
        worst = std::max(worst, time);
        sum += time;
      }
      const double ms = static_cast<double>(worst.count()) / 1e6;
      cells.push_back({row.what, fmt::format("{:.0f} %", loads[l] * 100), bench::time_text(sum / seeds),
                       bench::time_text(worst), row.aims[l] > 0 ? fmt::format("{:.0f} ms", row.aims[l]) : ""});
      if (row.aims[l] <= 0) continue;
      figures.push_back(
          bench::at_most(fmt::format("{}, {:.0f} % load", row.what, loads[l] * 100), ms, row.aims[l], "ms"));
    }
  }
  bench::print_columns(fmt::format("One device, able to answer LSS until its NMT start, {} seeds, 125 kbit/s; its own "
                                   "reset takes 5 ms of it. Without the wait for the next poll. The planner has "
                                   "bound {} devices before, where it has learnt anything",
                                   seeds, before),
                       {"", "load", "mean", "worst", "aim"}, cells);
  // S4.20: one 51h of 123 bits when nobody answers.
  std::vector<std::vector<std::string>> polls;
  for (const auto period : {100ms, 250ms, 500ms, 1000ms, 5000ms}) {
    const double load = 123.0 / bit_rate / (static_cast<double>(period.count()) / 1e3) * 100;
    polls.push_back({bench::time_text(period), bench::time_text(period / 2), bench::time_text(period),
                     fmt::format("{:.3f} %", load)});
  }
  bench::print_columns("Polls for new devices: what is to be added, and the load of each scheme's question",
                       {"every", "wait, mean", "wait, worst", "load"}, polls);
}

}  // namespace

int main(int argc, char** argv) {
  const unsigned seeds = argc > 1 ? static_cast<unsigned>(std::atoi(argv[1])) : 1000;
  std::vector<bench::Figure> figures;
  scans(figures);
  feedback(figures);
  joins(figures, std::max(seeds, 1U));
  bench::print_figures("discovery", figures);
  return std::ranges::any_of(figures, [](const auto& f) { return f.met && !*f.met; }) ? 1 : 0;
}
