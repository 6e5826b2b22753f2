// ./run kill [--all] [--scenario NAME] [--point K [--again J]]: stops Berth at every point of a binding, starts it
// again, and stops it again while it recovers. Prints how many points were tried and how many recovered.
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <cstdio>
#include <cstring>

#include "tests/harness/kill_run.hpp"
#include "tests/harness/take_over_run.hpp"
#include "berth/harness/tree_world.hpp"

using namespace berth;
using namespace berth::harness;

namespace {

struct Options {
  std::optional<int> scenario;
  std::optional<std::uint64_t> point;
  std::optional<std::uint64_t> again;
  std::uint64_t pairs = 120;  // second kills tried for each scenario, about; 0 = every pair
  unsigned workers = 2;
  bool show = false;
};

struct Point {
  PointKind kind = PointKind::disk;
  Death death;
};

constexpr std::array<store::Loss, 5> losses{store::Loss::none, store::Loss::all, store::Loss::some,
                                            store::Loss::all_torn_last, store::Loss::none_torn_last};

bool is_memory(PointKind k) { return k == PointKind::memory_begin || k == PointKind::memory_end; }

Death vary(Death death, std::uint64_t n) {
  death.loss = losses[n % losses.size()];
  death.restart_late = n / losses.size() % 2 == 1;
  return death;
}

// The other things that can happen at a frame: it is lost, or a device loses power at it. Of the two devices that are
// bound one has it at this frame, the other at the next of its kind; where devices stay away both have power losses at
// all of them.
void add_frame_points(std::vector<Point>& points, Scenario scenario, PointKind kind, std::uint64_t k) {
  const bool departs = KillWorld::departs(scenario);
  const std::string other = KillWorld::has(scenario, "d3") && !departs ? "d3" : "d2";
  const std::string one = k / 2 % 2 == 0 ? "d1" : other;
  Death death;
  death.at = k;
  if (kind == PointKind::send_before && !departs) {
    death.loses = one;
    points.push_back({PointKind::lost_by_device, death});
  }
  if (kind == PointKind::receive_before && !departs) {
    death.loses = plant::master_name;
    points.push_back({PointKind::lost_by_berth, death});
  }
  const bool here = kind == PointKind::send_after || kind == PointKind::receive_after;
  if (!departs || !here) return;
  for (const auto* const device : {"d1", "d2"}) {
    Death off;
    off.at = k;
    off.off = device;
    off.victim = k % 3 == 0 ? Victim::both : Victim::device;
    points.push_back({PointKind::device_off, off});
  }
}

// A device's memory: of its node-ID and its parameters, or of its programs.
struct Memory {
  const char* device;
  bool program = false;
};

Death torn_at(const Memory& memory, std::uint64_t byte) {
  Death death;
  death.torn = byte;
  death.torn_device = memory.device;
  death.torn_program = memory.program;
  death.victim = byte % 2 == 0 ? Victim::device : Victim::both;
  return death;
}

// How many bytes an undisturbed run writes there: the power cut at each of them happens, and at none behind them.
std::uint64_t bytes_written(Scenario scenario, const Memory& memory) {
  const auto happens = [&](std::uint64_t byte) {
    KillWorld probe(scenario);
    return probe.live(torn_at(memory, byte)).struck;
  };
  std::uint64_t beyond = 1;
  while (happens(beyond - 1)) beyond *= 2;
  std::uint64_t bytes = beyond / 2;  // the cut at `bytes` - 1 happens, that at `beyond` - 1 does not
  while (beyond - bytes > 1) {
    const std::uint64_t middle = bytes + (beyond - bytes) / 2;
    (happens(middle - 1) ? bytes : beyond) = middle;
  }
  return bytes;
}

// What Berth and the devices do there.
void add_bus_points(std::vector<Point>& points, Scenario scenario, const Life& whole) {
  for (std::uint64_t k = 0; k < whole.trace.size(); ++k) {
    Death death;
    death.at = k;
    if (!KillWorld::departs(scenario)) points.push_back({whole.trace[k], death});
    add_frame_points(points, scenario, whole.trace[k], k);
    if (!is_memory(whole.trace[k])) continue;
    for (const auto victim : {Victim::device, Victim::both}) {
      death.victim = victim;
      points.push_back({whole.trace[k], death});
    }
  }
}

void add_torn_points(std::vector<Point>& points, Scenario scenario) {
  for (const Memory memory : {Memory{"d1"}, Memory{"d2"}, Memory{"d3"}, Memory{"x"}, Memory{"d1", true}}) {
    const bool departing = KillWorld::departs(scenario) && std::strcmp(memory.device, "d3") == 0;
    if (!KillWorld::has(scenario, memory.device) || departing) continue;
    if (memory.program && scenario != Scenario::programmed) continue;
    const std::uint64_t bytes = bytes_written(scenario, memory);
    for (std::uint64_t byte = 0; byte < bytes; ++byte)
      points.push_back({PointKind::memory_torn, torn_at(memory, byte)});
  }
}

// Every point of an undisturbed run, in a fixed order: their places in it are what --point means.
std::vector<Point> points_of(Scenario scenario) {
  KillWorld world(scenario);
  const Life whole = world.live({});
  const std::string wrong = whole.failure.empty() ? world.check() : whole.failure;
  if (!wrong.empty()) {
    std::printf("%s: the undisturbed run fails: %s\n%s\n", name(scenario), wrong.c_str(), world.log().c_str());
    std::exit(1);
  }
  std::vector<Point> points;
  if (scenario != Scenario::first) add_bus_points(points, scenario, whole);
  for (std::uint64_t k = 0; !KillWorld::departs(scenario) && k < whole.disk_steps; ++k) {
    Death death;
    death.disk = k;
    points.push_back({PointKind::disk, death});
  }
  if (scenario != Scenario::first) add_torn_points(points, scenario);
  for (std::uint64_t n = 0; n < points.size(); ++n) points[n].death = vary(points[n].death, n);
  return points;
}

struct Tried {
  std::string failure;
  std::string log;
  std::uint64_t recovery_points = 0;  // of the life after the first death: the axe's,
  std::uint64_t recovery_steps = 0;   // and the disk's
  std::optional<PointKind> again_kind;
};

// One point, and perhaps a second kill at point `again` of the life that follows.
Tried attempt(Scenario scenario, const Point& point, std::optional<std::uint64_t> again, std::uint64_t axe_points) {
  Tried tried;
  KillWorld world(scenario);
  const auto finish = [&](const std::string& failure) {
    tried.failure = failure;
    if (!failure.empty()) tried.log = world.log();
    return tried;
  };
  const Life first = world.live(point.death);
  if (!first.struck) return finish("the point was not reached");
  if (!first.failure.empty()) return finish("before the kill: " + first.failure);
  Life last = first;
  if (first.died) {
    Death second;
    if (again && *again < axe_points) second.at = *again;
    if (again && *again >= axe_points) second.disk = *again - axe_points;
    if (again) second = vary(second, *again);
    last = world.live(second);
    tried.recovery_points = last.trace.size();
    tried.recovery_steps = last.disk_steps;
    if (second.at && *second.at < last.trace.size()) tried.again_kind = last.trace[*second.at];
    if (second.disk && last.died) tried.again_kind = PointKind::disk;
    if (last.died) {
      if (!last.failure.empty()) return finish("while recovering: " + last.failure);
      last = world.live({});
    }
  }
  if (last.died) return finish("died without being killed");
  if (!last.failure.empty()) return finish(last.failure);
  return finish(world.check());
}

struct Tally {
  std::array<std::uint64_t, point_kinds> tried{}, recovered{}, twice{}, twice_recovered{};
  void add(const Tally& o) {
    for (int k = 0; k < point_kinds; ++k) {
      tried[k] += o.tried[k];
      recovered[k] += o.recovered[k];
      twice[k] += o.twice[k];
      twice_recovered[k] += o.twice_recovered[k];
    }
  }
};

void say_failure(Scenario scenario, std::uint64_t k, std::optional<std::uint64_t> j, PointKind kind, const Tried& tried,
                 bool show) {
  std::printf("FAILED: scenario %s, point %llu (%s)", name(scenario), static_cast<unsigned long long>(k), name(kind));
  if (j) std::printf(", again at %llu", static_cast<unsigned long long>(*j));
  std::printf(": %s\n  replay: ./run kill --scenario %s --point %llu", tried.failure.c_str(), name(scenario),
              static_cast<unsigned long long>(k));
  if (j) std::printf(" --again %llu", static_cast<unsigned long long>(*j));
  std::printf(" --show\n");
  if (show) std::printf("%s\n", tried.log.c_str());
  std::fflush(stdout);
}

// Pairs are spread evenly over all points and their recoveries: every so many-th is tried. How many there are, some of
// the recoveries tell.
std::uint64_t stride_of(const Options& o, Scenario scenario, const std::vector<Point>& points) {
  constexpr std::uint64_t samples = 10;
  if (o.pairs == 0 || o.point) return 1;
  std::uint64_t sampled = 0;
  for (std::uint64_t n = 0; n < samples; ++n) {
    const Tried tried = attempt(scenario, points[(2 * n + 1) * points.size() / (2 * samples)], std::nullopt, 0);
    sampled += tried.recovery_points + tried.recovery_steps;
  }
  return std::max<std::uint64_t>(1, points.size() * sampled / samples / o.pairs);
}

Tally work(const Options& o, Scenario scenario, const std::vector<Point>& points, std::uint64_t stride, unsigned worker,
           unsigned workers) {
  Tally tally;
  std::uint64_t skip = stride / 2;
  for (std::uint64_t k = 0; k < points.size(); ++k) {
    const Point& point = points[k];
    const auto kind = static_cast<std::size_t>(point.kind);
    const bool mine = k % workers == worker && (!o.point || *o.point == k);
    if (!mine) continue;
    const Tried once = attempt(scenario, point, std::nullopt, 0);
    const std::uint64_t axe_points = once.recovery_points;
    if (!o.again) {
      ++tally.tried[kind];
      if (once.failure.empty())
        ++tally.recovered[kind];
      else
        say_failure(scenario, k, std::nullopt, point.kind, once, o.show);
      if (o.point) return tally;
    }
    // The recovery's own points: what Berth does, and the steps of its disk.
    const std::uint64_t most = axe_points + once.recovery_steps;
    std::uint64_t j = o.again.value_or(skip);
    for (; j < most; j += stride) {
      const Tried tried = attempt(scenario, point, j, axe_points);
      if (tried.again_kind || !tried.failure.empty()) {
        const auto again = static_cast<std::size_t>(tried.again_kind.value_or(PointKind::disk));
        ++tally.twice[again];
        if (tried.failure.empty())
          ++tally.twice_recovered[again];
        else
          say_failure(scenario, k, j, point.kind, tried, o.show);
      }
      if (o.again) return tally;
    }
    skip = j - most;
  }
  return tally;
}

// ---- the standby takes over -----------------------------------------------------------------------------------------

const char* const take_over_name = "take-over";

std::vector<PointKind> take_over_points() {
  TakeOverRun whole(small_image(older_program), small_image(wanted_program));
  const std::string wrong = whole.go({});
  if (wrong.empty()) return whole.trace();
  std::printf("%s: the undisturbed run fails: %s\n%s\n", take_over_name, wrong.c_str(), whole.log().c_str());
  std::exit(1);
}

Tally work_take_over(const Options& o, const std::vector<PointKind>& points, unsigned worker, unsigned workers) {
  Tally tally;
  for (std::uint64_t k = 0; k < points.size(); ++k) {
    const bool mine = k % workers == worker && (!o.point || *o.point == k);
    if (!mine) continue;
    TakeOverRun run(small_image(older_program), small_image(wanted_program));
    const std::string wrong = run.go(k);
    const auto kind = static_cast<std::size_t>(points[k]);
    ++tally.tried[kind];
    tally.recovered[kind] += wrong.empty() ? 1U : 0U;
    if (wrong.empty()) continue;
    std::printf("FAILED: scenario %s, point %llu (%s): %s\n  replay: ./run kill --scenario %s --point %llu --show\n",
                take_over_name, static_cast<unsigned long long>(k), name(points[k]), wrong.c_str(), take_over_name,
                static_cast<unsigned long long>(k));
    if (o.show) std::printf("%s\n", run.log().c_str());
    std::fflush(stdout);
  }
  return tally;
}

// ---- a bus beneath a gateway ----------------------------------------------------------------------------------------

const char* const levels_name = "levels";
const char* const levels_gateway = "bus1 gateway";
constexpr std::uint64_t levels_seed = 1;

// At each point of Berth's port: Berth dies there (even), the gateway loses its power there (odd).
std::vector<PointKind> levels_points() {
  TreeWorld whole(two_levels(levels_seed));
  whole.begin();
  if (!whole.settle()) {
    std::printf("%s: the undisturbed run fails: %s\n%s\n", levels_name, whole.failure().c_str(), whole.log().c_str());
    std::exit(1);
  }
  std::vector<PointKind> points;
  for (const auto kind : whole.trace()) points.insert(points.end(), {kind, PointKind::device_off});
  return points;
}

Tally work_levels(const Options& o, const std::vector<PointKind>& points, unsigned worker, unsigned workers) {
  Tally tally;
  // Odd: both kinds come in turn.
  const std::uint64_t stride = o.pairs == 0 || o.point ? 1 : points.size() / (2 * o.pairs) | 1U;
  for (std::uint64_t k = o.point.value_or(0); k < points.size(); k += stride) {
    if (k / stride % workers != worker) continue;
    TreeWorld world(two_levels(levels_seed));
    const bool power = points[k] == PointKind::device_off;
    const std::string wrong = power ? world.cut_power_at(k / 2, levels_gateway) : world.kill_at(k / 2);
    const auto kind = static_cast<std::size_t>(points[k]);
    ++tally.tried[kind];
    tally.recovered[kind] += wrong.empty() ? 1U : 0U;
    if (!wrong.empty()) {
      std::printf("FAILED: scenario %s, point %llu (%s): %s\n  replay: ./run kill --scenario %s --point %llu --show\n",
                  levels_name, static_cast<unsigned long long>(k), name(points[k]), wrong.c_str(), levels_name,
                  static_cast<unsigned long long>(k));
      if (o.show) std::printf("%s\n", world.log().c_str());
      std::fflush(stdout);
    }
    if (o.point) break;
  }
  return tally;
}

// ---- all of it ------------------------------------------------------------------------------------------------------

template <class Work>
Tally side_by_side(const Options& o, const Work& work) {
  if (o.workers == 1) return work(0U, 1U);
  std::vector<int> pipes;
  for (unsigned w = 0; w < o.workers; ++w) {
    int ends[2];
    if (pipe(ends) != 0) std::abort();
    std::fflush(stdout);
    if (fork() == 0) {
      const Tally tally = work(w, o.workers);
      const bool written = write(ends[1], &tally, sizeof tally) == static_cast<ssize_t>(sizeof tally);
      std::fflush(stdout);
      _exit(written ? 0 : 3);
    }
    close(ends[1]);
    pipes.push_back(ends[0]);
  }
  Tally total;
  for (const int end : pipes) {
    Tally part;
    if (read(end, &part, sizeof part) == static_cast<ssize_t>(sizeof part)) {
      total.add(part);
    } else {
      std::printf("FAILED: a worker died\n");
      ++total.tried[0];
    }
    close(end);
  }
  while (wait(nullptr) > 0) {
  }
  return total;
}

bool print_table(const Tally& t) {
  std::printf("%-26s%10s%12s%16s%12s\n", "stopped at", "tried", "recovered", "stopped again", "recovered");
  Tally sum;
  for (int k = 0; k < point_kinds; ++k) {
    std::printf("%-26s%10llu%12llu%16llu%12llu\n", name(static_cast<PointKind>(k)),
                static_cast<unsigned long long>(t.tried[k]), static_cast<unsigned long long>(t.recovered[k]),
                static_cast<unsigned long long>(t.twice[k]), static_cast<unsigned long long>(t.twice_recovered[k]));
    sum.tried[0] += t.tried[k];
    sum.recovered[0] += t.recovered[k];
    sum.twice[0] += t.twice[k];
    sum.twice_recovered[0] += t.twice_recovered[k];
  }
  std::printf("%-26s%10llu%12llu%16llu%12llu\n", "all", static_cast<unsigned long long>(sum.tried[0]),
              static_cast<unsigned long long>(sum.recovered[0]), static_cast<unsigned long long>(sum.twice[0]),
              static_cast<unsigned long long>(sum.twice_recovered[0]));
  return sum.tried[0] + sum.twice[0] > 0 && sum.tried[0] == sum.recovered[0] && sum.twice[0] == sum.twice_recovered[0];
}

std::optional<int> scenario_named(const char* text) {
  if (std::strcmp(take_over_name, text) == 0) return scenarios;
  if (std::strcmp(levels_name, text) == 0) return scenarios + 1;
  for (int s = 0; s < scenarios; ++s) {
    if (std::strcmp(name(static_cast<Scenario>(s)), text) == 0) return s;
  }
  return std::nullopt;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  bool good = true;
  for (int i = 1; i < argc; ++i) {
    const char* const next = i + 1 < argc ? argv[i + 1] : "";
    const auto number = [&] { return ++i < argc ? std::strtoull(next, nullptr, 0) : 0ULL; };
    if (std::strcmp(argv[i], "--all") == 0)
      o.pairs = 0;
    else if (std::strcmp(argv[i], "--pairs") == 0)
      o.pairs = number();
    else if (std::strcmp(argv[i], "--point") == 0)
      o.point = number();
    else if (std::strcmp(argv[i], "--again") == 0)
      o.again = number();
    else if (std::strcmp(argv[i], "--workers") == 0)
      o.workers = std::max(1U, static_cast<unsigned>(number()));
    else if (std::strcmp(argv[i], "--show") == 0)
      o.show = true;
    else if (std::strcmp(argv[i], "--scenario") == 0) {
      o.scenario = scenario_named(next);
      good = good && o.scenario;
      ++i;
    } else {
      good = false;
    }
  }
  good = good && (!o.point || o.scenario) && (!o.again || o.point);
  if (!good) {
    std::fprintf(stderr,
                 "usage: kill [--all | --pairs N] [--workers N] [--show] [--scenario NAME [--point K [--again J]]]\n");
    return 2;
  }
  if (o.point) o.workers = 1;
  Tally total;
  for (int s = 0; s < scenarios; ++s) {
    if (o.scenario && *o.scenario != s) continue;
    const auto scenario = static_cast<Scenario>(s);
    const std::vector<Point> points = points_of(scenario);
    std::printf("%s: %zu points\n", name(scenario), points.size());
    const std::uint64_t stride = stride_of(o, scenario, points);
    total.add(side_by_side(o, [&](unsigned w, unsigned n) { return work(o, scenario, points, stride, w, n); }));
  }
  if (!o.scenario || *o.scenario == scenarios) {
    const auto points = take_over_points();
    std::printf("%s: %zu points\n", take_over_name, points.size());
    total.add(side_by_side(o, [&](unsigned w, unsigned n) { return work_take_over(o, points, w, n); }));
  }
  if (!o.scenario || *o.scenario == scenarios + 1) {
    const auto points = levels_points();
    std::printf("%s: %zu points\n", levels_name, points.size());
    total.add(side_by_side(o, [&](unsigned w, unsigned n) { return work_levels(o, points, w, n); }));
  }
  return print_table(total) ? 0 : 1;
}
