// ./run faults [--from SEED] [--count N]: seeded random plants with random faults. Prints how often each fault hit each
// phase, and for a failure the plant file that replays it. Then the same for each method of discovery by itself, and
// for the negotiation: as many worlds of each as a tenth of N; `--method NAME`: N worlds of this one only ("all",
// "none"). Then worlds of programs, configurations, links and take-over, as many as a tenth of N (`--intelligence`: N
// of these only), and trees of buses beneath gateways, a two-hundredth (`--trees`: N of these only, with sister buses,
// replacements and devices of all kinds). `--waits`: N of the main job's worlds, with devices that wait for a power
// cycle, cables cut for long, and a judge of what is told; `--as-sold`: these, a third of them with devices as shops
// sell them (switches, no serial number, a part of 1018h), which the main job's worlds have by default, and the trees'
// with `--trees --as-sold`. `--plain`: without what these have more.
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include <chrono>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "berth/harness/run_world.hpp"
#include "berth/harness/tree_world.hpp"
#include "tests/harness/as_sold.hpp"
#include "tests/harness/intelligence_world.hpp"
#include "tests/harness/method_world.hpp"
#include "tests/harness/tree_as_sold.hpp"

using namespace berth;
using namespace berth::harness;

namespace {

struct Options {
  std::uint64_t from = 1;
  std::uint64_t count = 3300;
  unsigned workers = 2;
  bool show = false;
  bool brief = false;   // a failure is named and neither shrunk nor written down
  bool twins = false;   // worlds with devices of one address on several buses
  bool as_sold = true;  // a third with devices as shops sell them
  bool waits = false;   // with devices that wait for a power cycle, long cuts, and a judge of what is told
  bool main_job = true;
  std::uint64_t method_count = 200;           // worlds of each row
  int first_row = 0, last_row = method_rows;  // excluded
  std::uint64_t intelligence_count = 220;     // worlds of programs, configurations, links and take-over
  std::uint64_t trees = 12;                   // worlds of many buses
  bool mixed_trees = false;                   // with sister buses, replacements, devices of all kinds
  bool trees_as_sold = false;                 // a third of their buses with devices as shops sell them
  bool complete = true;                       // fail when a cell of the matrix has too few hits
};

constexpr unsigned fewest_hits = 15;

using Matrix = std::array<std::array<unsigned, columns>, world_fault_kinds>;
using StepMatrix = std::array<std::array<unsigned, steps>, step_kinds>;

// The run once more with its faults as explicit events and nothing drawn; true when it still fails.
bool fails(const WorldPlan& plan) { return !run_world(plan).failure.empty(); }

// Leaves out what is not needed: faults first, then strangers. A fault's place in time may move when another goes; the
// smaller plan counts when it fails too, however it fails.
WorldPlan shrink(WorldPlan plan) {
  for (std::size_t i = plan.faults.size(); i-- > 0;) {
    WorldPlan smaller = plan;
    smaller.faults.erase(smaller.faults.begin() + static_cast<std::ptrdiff_t>(i));
    if (fails(smaller)) plan = smaller;
  }
  for (std::size_t i = plan.step_faults.size(); i-- > 0;) {
    WorldPlan smaller = plan;
    smaller.step_faults.erase(smaller.step_faults.begin() + static_cast<std::ptrdiff_t>(i));
    if (fails(smaller)) plan = smaller;
  }
  if (plan.restarts) {
    WorldPlan smaller = plan;
    smaller.restarts = false;
    if (fails(smaller)) plan = smaller;
  }
  if (plan.perturbed) {
    WorldPlan smaller = plan;
    smaller.perturbed = false;
    if (fails(smaller)) plan = smaller;
  }
  for (std::size_t i = plan.machine.slots.size(); i-- > 0 && plan.machine.slots.size() > 1;) {
    if (i >= plan.plant.devices.size()) continue;
    WorldPlan smaller = plan;
    smaller.machine.slots.erase(smaller.machine.slots.begin() + static_cast<std::ptrdiff_t>(i));
    smaller.plant.devices.erase(smaller.plant.devices.begin() + static_cast<std::ptrdiff_t>(i));
    if (fails(smaller)) plan = smaller;
  }
  return plan;
}

std::string machine_text(const design::Machine& m) {
  std::ostringstream out;
  const auto ms = [](rt::Duration d) { return std::to_string(d.count() / 1'000'000) + " ms"; };
  out << "[machine]\nname = \"" << m.name << "\"\n";
  for (const auto& bus : m.buses) {
    out << "\n[bus." << bus.name << "]\nport = \"sim\"\nbitrate = " << bus.bitrate
        << "\nmaster_id = " << unsigned{bus.master.value()} << "\ndiscovery = \"" << bus.discovery << "\"\n";
  }
  const auto& timing = m.buses.front().timing;
  out << "\n[timing]\nrand_response = \"" << ms(timing.rand_response) << "\"\nboot_timeout = \""
      << ms(timing.boot_timeout) << "\"\nheartbeat_period = \"" << ms(timing.heartbeat_period)
      << "\"\nheartbeat_timeout = \"" << ms(timing.heartbeat_timeout) << "\"\nprobe_period = \""
      << ms(timing.probe_period) << "\"\nsdo_timeout = \"" << ms(timing.sdo_timeout) << "\"\nstore_timeout = \""
      << ms(timing.store_timeout) << "\"\nsave_timeout = \"" << ms(timing.save_timeout) << "\"\n";
  for (const auto& s : m.slots) {
    out << "\n[[slot]]\nbus = \"" << s.spec.name.bus << "\"\nid = " << unsigned{s.spec.id.value()} << "\nname = \""
        << s.spec.name.name << "\"\ntype = { vendor = " << s.spec.type.vendor << ", product = " << s.spec.type.product;
    if (s.spec.revision) out << ", revision = " << *s.spec.revision;
    out << " }\n";
    if (s.spec.rule == places::RevisionRule::exact) out << "revision = \"exact\"\n";
    if (!s.spec.config.empty()) out << "config = \"" << s.spec.config << "\"\n";
    if (s.spec.configuring.activate == places::Activate::reset) out << "activate = \"reset\"\n";
    if (s.spec.configuring.activate == places::Activate::power_cycle) out << "activate = \"power-cycle\"\n";
    if (s.spec.replacement == places::Replacement::automatic) out << "replacement = \"auto\"\n";
    if (s.spec.optional) out << "optional = true\n";
  }
  return out.str();
}

void report_failure(const WorldPlan& plan, const Outcome& outcome, bool show) {
  std::printf("seed %llu: %s\n", static_cast<unsigned long long>(plan.seed), outcome.failure.c_str());
  const WorldPlan small = shrink(plan);
  const Outcome again = run_world(small);
  plant::PlantFile file = small.plant;
  file.events = again.events;
  std::filesystem::create_directories("build/faults");
  const std::string stem = "build/faults/seed-" + std::to_string(plan.seed);
  std::ofstream(stem + ".toml") << machine_text(small.machine);
  std::ofstream(stem + ".plant.toml") << plant::write_plant(file,
                                                            "seed " + std::to_string(plan.seed) + ": " + again.failure);
  std::printf(
      "  shrunk: %s; %zu slots, %zu devices, %zu faults, %zu at steps\n  replay: berth up %s.toml --sim "
      "%s.plant.toml --allow-outside /\n",
      again.failure.c_str(), small.machine.slots.size(), small.plant.devices.size(), small.faults.size(),
      small.step_faults.size(), stem.c_str(), stem.c_str());
  for (const auto& f : small.step_faults)
    std::printf("    %s before \"%s\" %+.3f ms, the %u. of them\n", name(f.kind), name(aimed_steps[f.step]),
                std::chrono::duration<double, std::milli>(f.delay).count(), f.skip + 1);
  for (const auto& f : small.faults) std::printf("    %s in %s\n", name(f.kind), name(f.column));
  if (show) std::printf("%s\n", run_world(small, true).log.c_str());
}

struct Tally {
  Matrix hits{};
  StepMatrix step_hits{};
  std::uint64_t runs = 0, failures = 0, solvable = 0, differ = 0;
};

template <class Cells>
void sum(Cells& total, const Cells& part) {
  for (std::size_t row = 0; row < total.size(); ++row) {
    for (std::size_t c = 0; c < total[row].size(); ++c) total[row][c] += part[row][c];
  }
}

Tally work(const Options& o, unsigned worker) {
  Tally tally;
  for (std::uint64_t seed = o.from + worker; seed < o.from + o.count; seed += o.workers) {
    const WorldPlan plan = plan_world(seed, {.twins = o.twins, .waits = o.waits, .as_sold = o.as_sold});
    const Outcome outcome = run_world(plan);
    ++tally.runs;
    tally.solvable += plan.solvable;
    sum(tally.hits, outcome.hits);
    sum(tally.step_hits, outcome.step_hits);
    if (run_world(plan).hash != outcome.hash) {
      ++tally.differ;
      std::printf("seed %llu: two runs differ\n", static_cast<unsigned long long>(seed));
    }
    if (o.show && o.brief) std::printf("%s\n", run_world(plan, true).log.c_str());
    if (!outcome.failure.empty()) {
      ++tally.failures;
      if (o.brief) {
        std::printf("seed %llu: %s\n", static_cast<unsigned long long>(seed), outcome.failure.c_str());

      } else {
        report_failure(plan, outcome, o.show);
      }
    }
    std::fflush(stdout);
  }
  return tally;
}

struct MethodTally {
  std::array<std::array<unsigned, method_faults>, method_rows> hits{};
  std::array<std::uint64_t, method_rows> expected{}, missed{}, misled{};
  std::uint64_t runs = 0, failures = 0, differ = 0;
};

MethodTally work_methods(const Options& o, unsigned worker) {
  MethodTally tally;
  for (int row = o.first_row; row < o.last_row; ++row) {
    const auto place = static_cast<std::size_t>(row);
    for (std::uint64_t seed = o.from + worker; seed < o.from + o.method_count; seed += o.workers) {
      const auto outcome = run_method_world(row, seed);
      ++tally.runs;
      tally.expected[place] += outcome.expected;
      tally.missed[place] += outcome.missed;
      tally.misled[place] += outcome.misled;
      for (std::size_t f = 0; f < method_faults; ++f) tally.hits[place][f] += outcome.hits[f];
      const bool same = run_method_world(row, seed).hash == outcome.hash;
      if (!same) ++tally.differ;
      if (!outcome.failure.empty()) ++tally.failures;
      const std::string name = row_name(row);
      const auto number = static_cast<unsigned long long>(seed);
      if (!same) std::printf("%s, seed %llu: two runs differ\n", name.c_str(), number);
      if (!outcome.failure.empty()) {
        std::printf("%s, seed %llu: %s\n  replay: ./run faults --method %s --from %llu --count 1 --show\n",
                    name.c_str(), number, outcome.failure.c_str(), name.c_str(), number);
      }
      if (o.show) std::printf("%s\n", run_method_world(row, seed, true).log.c_str());
      std::fflush(stdout);
    }
  }
  return tally;
}

struct IntelligenceTally {
  std::array<std::array<unsigned, stages>, stage_kinds> hits{};
  std::uint64_t runs = 0, failures = 0, differ = 0;
};

// Faults are left out as long as it fails, however it fails.
IntelligencePlan shrink(IntelligencePlan plan) {
  for (std::size_t i = plan.faults.size(); i-- > 0;) {
    IntelligencePlan smaller = plan;
    smaller.faults.erase(smaller.faults.begin() + static_cast<std::ptrdiff_t>(i));
    if (!run_intelligence_world(smaller).failure.empty()) plan = smaller;
  }
  return plan;
}

void report_failure(const IntelligencePlan& plan, const std::string& failure, const Options& o) {
  const auto seed = static_cast<unsigned long long>(plan.seed);
  std::printf("intelligence, seed %llu: %s\n", seed, failure.c_str());
  if (o.brief) return;
  const IntelligencePlan small = shrink(plan);
  const auto again = run_intelligence_world(small, o.show);
  std::printf(
      "  shrunk: %s; %zu slots, %zu Berths\n  replay: ./run faults --intelligence --from %llu --count 1 --show\n",
      again.failure.c_str(), small.slots(), small.priorities.size(), seed);
  for (const auto& f : small.faults) std::printf("    %s in %s, %u skipped\n", name(f.kind), name(f.stage), f.skip);
  if (o.show) std::printf("%s\n", again.log.c_str());
}

IntelligenceTally work_intelligence(const Options& o, unsigned worker) {
  IntelligenceTally tally;
  for (std::uint64_t seed = o.from + worker; seed < o.from + o.intelligence_count; seed += o.workers) {
    const IntelligencePlan plan = IntelligencePlanner(seed).make();
    const auto outcome = run_intelligence_world(plan);
    ++tally.runs;
    sum(tally.hits, outcome.hits);
    if (run_intelligence_world(plan).hash != outcome.hash) {
      ++tally.differ;
      std::printf("intelligence, seed %llu: two runs differ\n", static_cast<unsigned long long>(seed));
    }
    if (!outcome.failure.empty()) {
      ++tally.failures;
      report_failure(plan, outcome.failure, o);
    }
    std::fflush(stdout);
  }
  return tally;
}

void add(IntelligenceTally& total, const IntelligenceTally& part) {
  total.runs += part.runs;
  total.failures += part.failures;
  total.differ += part.differ;
  sum(total.hits, part.hits);
}

void add(Tally& total, const Tally& part) {
  total.runs += part.runs;
  total.failures += part.failures;
  total.solvable += part.solvable;
  total.differ += part.differ;
  sum(total.hits, part.hits);
  sum(total.step_hits, part.step_hits);
}
void add(MethodTally& total, const MethodTally& part) {
  total.runs += part.runs;
  total.failures += part.failures;
  total.differ += part.differ;
  for (std::size_t row = 0; row < method_rows; ++row) {
    total.expected[row] += part.expected[row];
    total.missed[row] += part.missed[row];
    total.misled[row] += part.misled[row];
    for (std::size_t f = 0; f < method_faults; ++f) total.hits[row][f] += part.hits[row][f];
  }
}

struct TreeTally {
  std::uint64_t runs = 0, differ = 0, failures = 0;
};

void add(TreeTally& total, const TreeTally& part) {
  total.runs += part.runs;
  total.differ += part.differ;
  total.failures += part.failures;
}

// Each worker is a process; its tally comes back through a pipe as plain bytes of the same program.
template <class T>
T side_by_side(const Options& o, T (*work)(const Options&, unsigned)) {
  if (o.workers == 1) return work(o, 0);
  std::vector<int> pipes;
  for (unsigned w = 0; w < o.workers; ++w) {
    int ends[2];
    if (pipe(ends) != 0) std::abort();
    std::fflush(stdout);
    if (fork() == 0) {
      const T tally = work(o, w);
      const bool written = write(ends[1], &tally, sizeof tally) == static_cast<ssize_t>(sizeof tally);
      std::fflush(stdout);
      _exit(written ? 0 : 3);
    }
    close(ends[1]);
    pipes.push_back(ends[0]);
  }
  T total;
  for (const int end : pipes) {
    T part;
    if (read(end, &part, sizeof part) != static_cast<ssize_t>(sizeof part)) {
      std::printf("a worker died\n");
      ++total.failures;
      continue;
    }
    add(total, part);
  }
  while (wait(nullptr) > 0) {
  }
  return total;
}

bool print_matrix(const Tally& t, bool complete) {
  std::printf("%-16s", "fault \\ phase");
  for (int c = 0; c < columns; ++c) std::printf("%13s", name(static_cast<Column>(c)));
  std::printf("\n");
  bool enough = true;
  for (int f = 0; f < world_fault_kinds; ++f) {
    std::printf("%-16s", name(static_cast<FaultKind>(f)));
    for (int c = 0; c < columns; ++c) {
      std::printf("%13u", t.hits[f][c]);
      enough = enough && t.hits[f][c] >= fewest_hits;
    }
    std::printf("\n");
  }
  std::printf("\n%-28s", "fault \\ step of a binding");
  for (int k = 0; k < step_kinds; ++k) std::printf("%14s", name(static_cast<StepKind>(k)));
  std::printf("\n");
  for (int s = 0; s < steps; ++s) {
    std::printf("%-28s", name(aimed_steps[s]));
    for (int k = 0; k < step_kinds; ++k) {
      if (!can_strike(static_cast<StepKind>(k), aimed_steps[s])) {
        std::printf("%14s", "-");
        continue;
      }
      std::printf("%14u", t.step_hits[k][s]);
      enough = enough && t.step_hits[k][s] >= fewest_hits;
    }
    std::printf("\n");
  }
  if (complete && !enough) std::printf("a fault hit a phase or a step fewer than %u times\n", fewest_hits);
  return enough || !complete;
}

// The negotiation has no master, and its faults are its own.
bool can_hit(int row, int fault) {
  if (row != negotiation_row) return true;
  constexpr std::array<int, 7> others{static_cast<int>(FaultKind::overrun_master),
                                      static_cast<int>(FaultKind::waiting_lost),
                                      static_cast<int>(FaultKind::twice),
                                      static_cast<int>(FaultKind::slow),
                                      static_cast<int>(FaultKind::deaf),
                                      fault_restart,
                                      -1};
  return std::ranges::find(others, fault) == others.end();
}

bool print_methods(const MethodTally& t, const Options& o) {
  std::printf("\n%-21s", "method \\ fault");
  for (int f = 0; f < method_faults; ++f) std::printf("%10s", method_fault_name(f));
  std::printf("%10s%8s%8s\n", "findable", "missed", "misled");
  bool enough = true;
  for (int row = o.first_row; row < o.last_row; ++row) {
    const auto place = static_cast<std::size_t>(row);
    std::printf("%-21s", row_name(row).c_str());
    for (int f = 0; f < method_faults; ++f) {
      if (!can_hit(row, f)) {
        std::printf("%10s", "-");
        continue;
      }
      const auto hits = t.hits[place][static_cast<std::size_t>(f)];
      std::printf("%10u", hits);
      enough = enough && hits >= fewest_hits;
    }
    std::printf("%10llu%8llu%8llu\n", static_cast<unsigned long long>(t.expected[place]),
                static_cast<unsigned long long>(t.missed[place]), static_cast<unsigned long long>(t.misled[place]));
  }
  const bool counts = o.method_count >= 200;
  if (counts && !enough) std::printf("a fault hit a method fewer than %u times\n", fewest_hits);
  std::printf(
      "%llu worlds of one method, each run twice, from seed %llu; %llu differed; %llu failed; missed, misled: slower "
      "than the window\n",
      static_cast<unsigned long long>(t.runs), static_cast<unsigned long long>(o.from),
      static_cast<unsigned long long>(t.differ), static_cast<unsigned long long>(t.failures));
  return (enough || !counts) && t.failures == 0 && t.differ == 0 && t.runs > 0;
}

// False: there is none of that name.
bool choose_method(Options& o, const std::string& name) {
  o.main_job = name == "none";
  if (name == "none") o.last_row = 0;
  if (name == "none" || name == "all") return true;
  for (int row = 0; row < method_rows; ++row) {
    if (row_name(row) != name) continue;
    o.first_row = row;
    o.last_row = row + 1;
    return true;
  }
  return false;
}

// Of all that were tried, each run twice, by this machine as it is busy now.
void print_speed(std::uint64_t worlds, std::chrono::steady_clock::time_point began, unsigned workers) {
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - began;
  std::printf("%.0f worlds per minute with %u worker%s, %.0f s\n", 60.0 * static_cast<double>(worlds) / took.count(),
              workers, workers == 1 ? "" : "s", took.count());
}

// ---- trees of buses (docs/multilevel.md)

TreeTally work_trees(const Options& o, unsigned worker) {
  TreeTally tally;
  for (std::uint64_t seed = o.from + worker; seed < o.from + o.trees; seed += o.workers) {
    const TreePlan plan = plan_of_tree(seed, {.mixed = o.mixed_trees, .as_sold = o.trees_as_sold},
                                       std::filesystem::temp_directory_path());
    const char* const frames = std::getenv("BERTH_WORLDS_FRAMES");  // of this bus, in the log
    TreeWorld first(plan, frames == nullptr ? "" : frames), second(plan);
    const std::string wrong = first.go(troubles_of_a_tree);
    static_cast<void>(second.go(troubles_of_a_tree));
    ++tally.runs;
    const bool differs = frames == nullptr && first.log() != second.log();
    tally.differ += differs ? 1U : 0U;
    tally.failures += wrong.empty() ? 0U : 1U;
    if (differs) std::printf("tree %llu: two runs differ\n", static_cast<unsigned long long>(seed));
    if (!wrong.empty()) std::printf("tree %llu: %s", static_cast<unsigned long long>(seed), wrong.c_str());
    if (o.show) std::printf("%s%s", plant::write_plant(plan.plant).c_str(), first.log().c_str());
    std::fflush(stdout);
  }
  return tally;
}

bool trees(const Options& o) {
  const auto began = std::chrono::steady_clock::now();
  const TreeTally t = side_by_side(o, work_trees);
  std::printf("%llu trees of buses%s, each run twice, from seed %llu; %llu differed; %llu failed\n",
              static_cast<unsigned long long>(t.runs), o.mixed_trees ? " with replacements and sister buses" : "",
              static_cast<unsigned long long>(o.from), static_cast<unsigned long long>(t.differ),
              static_cast<unsigned long long>(t.failures));
  print_speed(t.runs, began, o.workers);
  return t.differ == 0 && t.failures == 0 && t.runs > 0;
}

bool main_job(const Options& o) {
  const auto began = std::chrono::steady_clock::now();
  const Tally t = side_by_side(o, work);
  const bool enough = o.twins || o.waits || print_matrix(t, o.complete);
  std::printf(
      "%llu worlds%s, each run twice, from seed %llu; %llu of them must end operational; %llu differed; %llu failed\n",
      static_cast<unsigned long long>(t.runs),
      o.twins   ? " with twins on several buses"
      : o.waits ? " with who waits"
                : "",
      static_cast<unsigned long long>(o.from), static_cast<unsigned long long>(t.solvable),
      static_cast<unsigned long long>(t.differ), static_cast<unsigned long long>(t.failures));
  print_speed(t.runs, began, o.workers);
  return t.failures == 0 && t.differ == 0 && enough && t.runs > 0;
}

bool intelligence(const Options& o) {
  const auto began = std::chrono::steady_clock::now();
  const IntelligenceTally t = side_by_side(o, work_intelligence);
  std::printf("\n%-16s", "fault \\ stage");
  for (int s = 0; s < stages; ++s) std::printf("%15s", name(static_cast<Stage>(s)));
  std::printf("\n");
  for (int f = 0; f < stage_kinds; ++f) {
    std::printf("%-16s", name(static_cast<StageKind>(f)));
    for (int s = 0; s < stages; ++s) std::printf("%15u", t.hits[f][s]);
    std::printf("\n");
  }
  std::printf(
      "%llu worlds of programs, configurations, links and take-over, each run twice, from seed %llu; %llu differed; "
      "%llu failed\n",
      static_cast<unsigned long long>(t.runs), static_cast<unsigned long long>(o.from),
      static_cast<unsigned long long>(t.differ), static_cast<unsigned long long>(t.failures));
  print_speed(t.runs, began, o.workers);
  return t.failures == 0 && t.differ == 0 && t.runs > 0;
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  bool counted = false, only_methods = false, only_intelligence = false, only_trees = false, only_twins = false;
  bool only_waits = false, as_sold = false, plain = false;
  for (int i = 1; i < argc; ++i) {
    const auto value = [&] { return i + 1 < argc ? std::strtoull(argv[++i], nullptr, 0) : 0ULL; };
    if (std::strcmp(argv[i], "--from") == 0) {
      o.from = value();
    } else if (std::strcmp(argv[i], "--count") == 0) {
      o.count = value();
      counted = true;
    } else if (std::strcmp(argv[i], "--workers") == 0) {
      o.workers = static_cast<unsigned>(value());
    } else if (std::strcmp(argv[i], "--show") == 0) {
      o.show = true;
    } else if (std::strcmp(argv[i], "--trees") == 0) {
      only_trees = o.mixed_trees = true;
    } else if (std::strcmp(argv[i], "--plain") == 0) {
      plain = true;
    } else if (std::strcmp(argv[i], "--waits") == 0) {
      only_waits = o.waits = true;
      o.as_sold = as_sold;
    } else if (std::strcmp(argv[i], "--as-sold") == 0) {
      only_waits = o.waits = o.as_sold = o.trees_as_sold = as_sold = true;
    } else if (std::strcmp(argv[i], "--twins") == 0) {
      only_twins = true;
    } else if (std::strcmp(argv[i], "--brief") == 0) {
      o.brief = true;
    } else if (std::strcmp(argv[i], "--intelligence") == 0) {
      only_intelligence = true;
    } else if (std::strcmp(argv[i], "--method") == 0 && i + 1 < argc && choose_method(o, argv[i + 1])) {
      ++i;
      only_methods = true;
    } else {
      std::fprintf(stderr,
                   "usage: faults [--from SEED] [--count N] [--method NAME|all|none | --intelligence | --trees | "
                   "--twins] [--waits] [--as-sold] [--plain] "
                   "[--workers N] [--show] [--brief]\n"
                   "methods:");
      for (int row = 0; row < method_rows; ++row) std::fprintf(stderr, " %s", row_name(row).c_str());
      std::fprintf(stderr, "\n");
      return 2;
    }
  }
  if (o.workers == 0) o.workers = 1;
  if (plain) o.mixed_trees = o.waits = o.as_sold = false;
  o.complete = o.count >= 3300;
  if (counted) o.method_count = o.main_job ? (o.count + 9) / 10 : o.count;
  if (counted) o.intelligence_count = only_intelligence ? o.count : o.method_count;
  if (only_trees) {
    if (counted) o.trees = o.count;
    return trees(o) ? 0 : 1;
  }
  // Of what one method is asked for alone, the trees are no part.
  const bool with_trees = o.main_job && o.first_row == 0 && o.last_row == method_rows;
  if (counted) o.trees = (o.count + 199) / 200;
  bool good = true;
  if (only_intelligence) return intelligence(o) ? 0 : 1;
  Options twins = o;
  twins.twins = true;
  if (!only_twins) twins.count = (o.count + 9) / 10;
  if (only_twins) return main_job(twins) ? 0 : 1;
  if (only_waits) return main_job(o) ? 0 : 1;
  if (o.main_job) good = main_job(o);
  if (o.main_job) good = main_job(twins) && good;
  if (with_trees) good = trees(o) && good;
  if (o.first_row < o.last_row) {
    const auto began = std::chrono::steady_clock::now();
    const MethodTally t = side_by_side(o, work_methods);
    good = print_methods(t, o) && good;
    print_speed(t.runs, began, o.workers);
  }
  if (!only_methods) good = intelligence(o) && good;
  return good ? 0 : 1;
}
