// A thousand machines at one Mosquitto, and a host that sees them, each in a process of its own: births, an ordinary
// minute, a broker that is killed, half of the machines behind a cable that is cut, an hour without the broker.
//
//   bench_fleet_scale [--nodes N] [--queue N]
//
// What a machine says was said by a simulated one (line.hpp); the machines here have no buses. Half of them reach the
// broker through the cable.
#include <fmt/format.h>
#include <poll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <charconv>
#include <climits>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "bench/tools/broker.hpp"
#include "bench/tools/cable.hpp"
#include "bench/tools/child.hpp"
#include "bench/tools/ear.hpp"
#include "bench/tools/figures.hpp"
#include "bench/tools/line.hpp"
#include "berth/fleet/edge.hpp"
#include "berth/fleet/settings.hpp"
#include "berth/fleet/watch.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr unsigned slots_of_a_machine = 20;
constexpr const char* group = "berth";  // as a machine file without [mqtt] has it
constexpr auto change_every = 10s;      // each machine changes one value
using Steady = std::chrono::steady_clock;

double seconds_since(Steady::time_point begin) { return std::chrono::duration<double>(Steady::now() - begin).count(); }

std::string own_path() {
  std::array<char, PATH_MAX> path{};
  const auto size = ::readlink("/proc/self/exe", path.data(), path.size() - 1);
  return {path.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
}

unsigned number(const char* text) {
  unsigned value = 0;
  std::from_chars(text, text + std::strlen(text), value);
  return value;
}

// ---- the host's process

/// What the host knows. A machine is complete when it and all its devices are online and nothing is in doubt.
struct Seen {
  unsigned known = 0;
  unsigned complete = 0;
  unsigned offline = 0;
};

Seen look(const fleet::Watch& watch) {
  Seen seen;
  watch.look([&](const sparkplug::Fleet& fleet) {
    for (const auto& [id, node] : fleet.nodes()) {
      ++seen.known;
      if (!node.self.online) ++seen.offline;
      const auto born = std::ranges::count(node.devices, true, &sparkplug::FleetDevice::online);
      if (node.self.online && !node.in_doubt && born == slots_of_a_machine) ++seen.complete;
    }
  });
  return seen;
}

/// Says what it sees whenever that has changed, until its standard input ends.
int run_host(std::uint16_t port) {
  const auto thread = fleet::Thread::start().value();
  const fleet::SystemClock clock;
  fleet::WatchOptions options;
  options.connection.where = {false, "127.0.0.1", port};
  options.connection.client_id = "bench-host";
  options.host = "bench";
  options.groups = {group};
  const auto watch = fleet::Watch::start(*thread, std::move(options), clock, Random(3)).value();
  std::string told;
  for (;;) {
    pollfd waits{0, POLLIN, 0};
    constexpr int between_looks = 50;  // ms
    if (::poll(&waits, 1, between_looks) != 0) return 0;
    const auto seen = look(*watch);
    const auto line = fmt::format("{} {} {}\n", seen.known, seen.complete, seen.offline);
    if (line == told) continue;
    told = line;
    fmt::print("{}", line);
    std::fflush(stdout);
  }
}

class Host {
 public:
  explicit Host(const mqtt::Where& where) : child_({own_path(), "--host", std::to_string(where.port)}) {}
  /// Seconds since `begin` until it sees what is wanted; empty: it did not within the limit.
  template <class So>
  [[nodiscard]] std::optional<double> until(Steady::time_point begin, double limit, So so) {
    while (seconds_since(begin) < limit) {
      // What it said until now is not what it sees now.
      auto line = child_.hear(0ms);
      if (!line && so(seen_)) return seconds_since(begin);
      if (!line) line = child_.hear(100ms);
      if (line) std::sscanf(line->c_str(), "%u %u %u", &seen_.known, &seen_.complete, &seen_.offline);
    }
    return std::nullopt;
  }
  [[nodiscard]] const bench::Child& process() const noexcept { return child_; }
  [[nodiscard]] const Seen& seen() const noexcept { return seen_; }

 private:
  bench::Child child_;
  Seen seen_;
};

// ---- the machines

/// Machine time: this computer's, and what was skipped.
class SkippingClock final : public fleet::Clock {
 public:
  [[nodiscard]] sparkplug::Now now() const noexcept override {
    auto now = fleet::SystemClock().now();
    now.utc.ms += static_cast<std::uint64_t>(skipped_.load().count());
    return now;
  }
  void skip(std::chrono::milliseconds time) { skipped_ = skipped_.load() + time; }

 private:
  std::atomic<std::chrono::milliseconds> skipped_{0ms};
};

class Machine {
 public:
  Machine(fleet::Thread& thread, const bench::FirstWords& words, const fleet::Clock& clock, fleet::EdgeOptions options,
          Random random)
      : clock_(&clock) {
    for (fleet::News news : words.news) {
      if (!news.device.empty()) devices_.push_back(news.device);
      static_cast<void>(link_.news.put(news));
    }
    auto edge = fleet::Edge::start(thread, std::move(options), link_, clock, random);
    if (!edge) {
      fmt::print(stderr, "{}\n", edge.error());
      std::exit(1);
    }
    edge_ = std::move(*edge);
  }

  /// False: the queue is full.
  bool set(std::size_t device, std::uint32_t value) {
    fleet::News news{.device = devices_[device % devices_.size()],
                     .metric = bench::Line::signal,
                     .value = std::uint64_t{value},
                     .at = clock_->now().utc};
    const bool taken = link_.news.put(news);
    edge_->wake();
    return taken;
  }
  [[nodiscard]] std::size_t devices() const noexcept { return devices_.size(); }

 private:
  const fleet::Clock* clock_;
  fleet::Link link_;
  std::vector<std::string> devices_;
  std::unique_ptr<fleet::Edge> edge_;
};

fleet::EdgeOptions options_of(const bench::FirstWords& words, const std::string& name, std::uint16_t port,
                              const std::string& file = {}) {
  auto machine = words.machine;
  machine.name = name;
  return fleet::edge_options(machine, fmt::format("mqtt://127.0.0.1:{}", port), file).value();
}

/// Changes a value of each machine in turn, on a thread of its own.
class Plant {
 public:
  explicit Plant(const std::vector<std::unique_ptr<Machine>>& machines)
      : thread_([this, &machines] { run(machines); }) {}
  ~Plant() {
    over_ = true;
    thread_.join();
  }
  Plant(const Plant&) = delete;
  Plant& operator=(const Plant&) = delete;

 private:
  void run(const std::vector<std::unique_ptr<Machine>>& machines) {
    const auto pause = std::chrono::duration_cast<Steady::duration>(change_every) / machines.size();
    auto next = Steady::now();
    for (std::uint32_t turn = 2; !over_; ++turn) {
      for (std::size_t i = 0; i < machines.size() && !over_; ++i) {
        machines[i]->set(turn, turn);
        next += pause;
        std::this_thread::sleep_until(next);
      }
    }
  }
  std::atomic<bool> over_{false};
  std::thread thread_;
};

// ---- the phases

class Bench {
 public:
  Bench(unsigned nodes, unsigned queue)
      : nodes_(nodes),
        words_(bench::first_words(slots_of_a_machine)),
        broker_(queue),
        cable_({own_path(), "--cable", std::to_string(broker_.where().port)}),
        gauge_(broker_.where()) {
    const auto port = cable_.hear(5s);
    cable_port_ = static_cast<std::uint16_t>(number(port.value_or("0").c_str()));
  }

  void run() {
    births();
    plant_ = std::make_unique<Plant>(machines_);
    ordinary_minute();
    new_host();
    broker_killed();
    cable_cut();
    plant_.reset();
    end_all();
    an_hour_away();
  }
  [[nodiscard]] const std::vector<bench::Figure>& figures() const noexcept { return figures_; }

 private:
  struct Costs {
    double machines = 0, broker = 0, host = 0;
    Costs operator-(const Costs& o) const { return {machines - o.machines, broker - o.broker, host - o.host}; }
  };
  [[nodiscard]] Costs costs() const {
    return {bench::own_cpu_seconds(), broker_.process().cpu_seconds(), host_ ? host_->process().cpu_seconds() : 0};
  }
  void add(std::string name, std::string measured) { figures_.push_back({std::move(name), std::move(measured)}); }
  void add_time(const std::string& name, std::optional<double> seconds, std::optional<double> aim = {}) {
    if (!seconds) {
      const auto& seen = host_->seen();
      figures_.push_back(
          {name,
           fmt::format("did not come: {} known, {} complete, {} offline", seen.known, seen.complete, seen.offline),
           aim ? "<= " + bench::grouped(*aim) : "", false});
    } else if (aim) {
      figures_.push_back(bench::at_most(name, *seconds, *aim, "s"));
    } else {
      add(name, fmt::format("{:.1f} s", *seconds));
    }
  }
  void add_costs(const std::string& name, const Costs& spent) {
    add(name,
        fmt::format("{:.2f} s machines, {:.2f} s broker, {:.2f} s host", spent.machines, spent.broker, spent.host));
  }
  std::optional<double> until_complete(Steady::time_point begin, double limit) {
    return host_->until(begin, limit, [this](const Seen& seen) { return seen.complete == nodes_; });
  }

  void births() {
    host_ = std::make_unique<Host>(broker_.where());
    std::this_thread::sleep_for(2s);
    const auto before = costs();
    const auto bytes = gauge_.read();
    const auto begin = Steady::now();
    for (unsigned i = 1; i <= nodes_; ++i) {
      const auto port = i % 2 == 0 ? cable_port_ : broker_.where().port;
      machines_.push_back(std::make_unique<Machine>(
          *thread_, words_, clock_, options_of(words_, fmt::format("line-{}", i), port), random_.fork()));
    }
    const auto took = until_complete(begin, 300);
    const auto spent = costs() - before;
    std::this_thread::sleep_for(3s);
    const auto now = gauge_.read();
    add_time(fmt::format("births of {} machines: first connect to host knows all", nodes_), took, 30);
    add_costs("processor time for these", spent);
    add("to the broker for these, MQTT", traffic(now.packets_in - bytes.packets_in, now.bytes_in - bytes.bytes_in));
    add("messages that the broker threw away meanwhile", fmt::format("{:.0f}", now.dropped));
  }

  static std::string traffic(double packets, double bytes) {
    return fmt::format("{} packets, {} bytes", bench::grouped(packets), bench::grouped(bytes));
  }

  void ordinary_minute() {
    std::this_thread::sleep_for(10s);
    const auto before = costs();
    const auto from = gauge_.read();
    const auto begin = Steady::now();
    std::this_thread::sleep_for(60s);
    const double passed = seconds_since(begin);
    const auto spent = costs() - before;
    const auto to = gauge_.read();
    const double seconds = std::chrono::duration<double>(to.at - from.at).count();
    const double in = (to.packets_in - from.packets_in) / seconds, in_bytes = (to.bytes_in - from.bytes_in) / seconds;
    const double out = (to.packets_out - from.packets_out) / seconds;
    const double out_bytes = (to.bytes_out - from.bytes_out) / seconds;
    const auto rate = [](double packets, double bytes) {
      return fmt::format("{} packets/s, {} bytes/s", bench::grouped(packets), bench::grouped(bytes));
    };
    add("each machine changes a value every 10 s: to the broker", rate(in, in_bytes));
    add("from the broker, to machines and the host", rate(out, out_bytes));
    add("to the broker, a machine and hour", traffic(in * 3600 / nodes_, in_bytes * 3600 / nodes_));
    const auto percent = [&](double cpu) { return 100 * cpu / passed; };
    add("processor, of one", fmt::format("{:.1f} % machines, {:.1f} % broker, {:.1f} % host", percent(spent.machines),
                                         percent(spent.broker), percent(spent.host)));
    figures_.push_back(bench::at_most("most memory of the host", host_->process().peak_mib(), 64, "MiB"));
    add("most memory of the broker", fmt::format("{:.1f} MiB", broker_.process().peak_mib()));
  }

  void new_host() {
    host_.reset();
    std::this_thread::sleep_for(2s);
    const auto before = costs();
    const auto begin = Steady::now();
    host_ = std::make_unique<Host>(broker_.where());
    add_time("a host that starts anew knows all machines after", until_complete(begin, 120));
    add_costs("processor time for this", costs() - before);
    figures_.push_back(bench::at_most("its most memory", host_->process().peak_mib(), 64, "MiB"));
  }

  void broker_killed() {
    constexpr auto away = 10s;
    broker_.kill();
    std::this_thread::sleep_for(away);
    const auto before = costs();
    const auto begin = Steady::now();
    broker_.start();
    add_time(fmt::format("broker killed, and started {} s later: until all machines are complete", away / 1s),
             until_complete(begin, 300));
    add_costs("processor time for this", costs() - before);
  }

  void cable_cut() {
    const unsigned half = nodes_ / 2;
    auto begin = Steady::now();
    cable_.say("cut");
    add_time("half of the machines cut off: until the host knows all of these",
             host_->until(begin, 300, [&](const Seen& seen) { return seen.offline >= half; }));
    begin = Steady::now();
    cable_.say("mend");
    add_time("the cable mended: until all machines are complete", until_complete(begin, 300));
  }

  void end_all() {
    const auto begin = Steady::now();
    machines_.clear();
    add_time("the machines end, one after the other: until the host knows all",
             host_->until(begin, 300, [&](const Seen& seen) { return seen.offline == nodes_; }));
    host_.reset();
  }

  template <class So>
  static bool wait(double limit, So so) {
    const auto begin = Steady::now();
    while (!so() && seconds_since(begin) < limit) std::this_thread::sleep_for(10ms);
    return so();
  }

  // One machine. Its hour is skipped: its clock runs ahead. What comes after is in real time.
  void an_hour_away() {
    constexpr unsigned hour = 3600;
    bench::Ear ear(broker_.where(), {group, "away"}, bench::Line::signal);
    SkippingClock clock;
    const auto file = broker_.folder() + "/away.db.mqtt";
    auto options = options_of(words_, "away", broker_.where().port, file);
    options.primary_host = bench::Ear::host;
    Machine machine(*thread_, words_, clock, std::move(options), random_.fork());
    std::size_t made = machine.devices();  // the births have a value each
    if (!wait(60, [&] { return ear.heard().values == made; }))
      return add("an hour without the broker", "did not begin");
    broker_.kill();
    const auto births = ear.heard().births;
    std::uint32_t value = 1;
    const auto all_change = [&] {
      ++value;
      for (std::size_t device = 0; device < machine.devices(); ++device, ++made)
        while (!machine.set(device, value)) std::this_thread::sleep_for(1ms);
    };
    for (unsigned i = 0; i < hour; ++i) {
      clock.skip(1s);
      all_change();
    }
    const auto away = made - machine.devices();
    std::this_thread::sleep_for(2s);
    const auto kept_bytes = std::filesystem::file_size(file);
    broker_.start();
    if (!wait(120, [&] { return ear.heard().births > births; }))
      return add("an hour without the broker", "no birth came");
    const auto before = ear.heard();
    const auto begin = Steady::now();
    auto next = begin;
    // The values go on changing.
    const bool all = wait(900, [&] {
      if (Steady::now() >= next) {
        next += 1s;
        all_change();
      }
      return ear.heard().values >= made - machine.devices();
    });
    const auto heard = ear.heard();
    add("an hour without the broker, 20 values change every second: kept",
        fmt::format("{} of {}, {:.1f} MiB in a file", bench::grouped(static_cast<double>(away - heard.told_lost)),
                    bench::grouped(static_cast<double>(away)), static_cast<double>(kept_bytes) / (1024 * 1024)));
    add("lost, as the machine says", fmt::format("{}", heard.told_lost));
    add("time to catch up, from the first birth on", all ? fmt::format("{:.1f} s", seconds_since(begin)) : "did not");
    add("messages of devices meanwhile, payload",
        fmt::format("{} messages, {} bytes", bench::grouped(static_cast<double>(heard.messages - before.messages)),
                    bench::grouped(static_cast<double>(heard.bytes - before.bytes))));
  }

  unsigned nodes_;
  bench::FirstWords words_;
  bench::Mosquitto broker_;
  bench::Child cable_;
  std::uint16_t cable_port_ = 0;
  bench::Gauge gauge_;
  fleet::SystemClock clock_;
  Random random_{4};
  std::unique_ptr<fleet::Thread> thread_ = std::move(fleet::Thread::start().value());
  std::unique_ptr<Host> host_;
  std::vector<std::unique_ptr<Machine>> machines_;
  std::unique_ptr<Plant> plant_;
  std::vector<bench::Figure> figures_;
};

bool raise_limit(unsigned nodes) {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);
  return limit.rlim_cur >= 6UL * nodes + 100;
}

}  // namespace

int main(int argc, char** argv) {
  unsigned nodes = 1000, queue = 0;
  for (int i = 1; i + 1 < argc; i += 2) {
    const unsigned value = number(argv[i + 1]);
    if (std::strcmp(argv[i], "--host") == 0) return run_host(static_cast<std::uint16_t>(value));
    if (std::strcmp(argv[i], "--cable") == 0) return bench::run_cable(static_cast<std::uint16_t>(value));
    if (std::strcmp(argv[i], "--nodes") == 0) nodes = value;
    if (std::strcmp(argv[i], "--queue") == 0) queue = value;
  }
  if (bench::Mosquitto::program().empty()) {
    fmt::print("mosquitto is missing\n");
    return 0;
  }
  if (nodes < 2 || !raise_limit(nodes)) {
    fmt::print(stderr, "{} machines need {} descriptors: ulimit -Hn\n", nodes, 6 * nodes + 100);
    return 1;
  }
  Bench bench(nodes, queue);
  bench.run();
  bench::print_figures(fmt::format("{} machines of {} devices at one Mosquitto, its max_queued_messages {}", nodes,
                                   slots_of_a_machine, queue),
                       bench.figures());
  return 0;
}
