// The RAND rows of the figures for finding devices: 30 blank RAND slaves of one type at 50 kbit/s that answer after
// 4 ms, found by the published procedure and by the walk of the tree of chunks, both with the same window: it closes
// 4 ms and one answer frame after the last answer. A discovery ends when every address is known; the closing phase 0
// that nobody answers is a column of its own. The rows of Fastscan and feedback are bench/discovery.cpp's.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "bench/tools/figures.hpp"
#include "berth/nodeid/rand_walk.hpp"
#include "berth/study/contest.hpp"
#include "berth/study/formulas.hpp"
#include "berth/study/stage.hpp"

using namespace berth;
using namespace std::chrono_literals;
using plant::Speaks;
using study::Serials;

namespace {

constexpr std::uint32_t bit_rate = 50'000;
constexpr unsigned slaves = 30;
constexpr auto window = 4ms + study::time_of(study::feedback_bits, bit_rate);  // IUS: extended, no data

struct Found {
  rt::Duration known{};
  rt::Duration closing{};
  unsigned requests = 0;
  unsigned count = 0;
  bool complete = false;
};

rt::Task<void> published(study::Stage& stage, Found& found) {
  nodeid::RandMaster master(stage.master());
  nodeid::DiscoveryOptions options;
  options.t_resp = window;
  const auto report = co_await master.discover(options);
  if (!report || report->found.empty()) co_return;
  found.known = report->found.back().at - report->began;
  found.closing = report->ended - report->found.back().at;
  found.requests = report->requests;
  found.count = static_cast<unsigned>(report->found.size());
  found.complete = report->end == nodeid::DiscoveryReport::End::complete;
}

rt::Task<void> walk(study::Stage& stage, std::span<const nodeid::WalkKind> kinds, Found& found) {
  nodeid::RandWalk master(stage.master());
  nodeid::WalkOptions options;
  options.longest = options.after_last = window;
  const auto report = co_await master.discover(kinds, options);
  if (!report) co_return;
  found.known = report->known - report->began;
  found.closing = report->ended - report->known;
  found.requests = report->requests + report->switches;
  found.count = static_cast<unsigned>(report->found.size());
  found.complete = report->end == nodeid::DiscoveryReport::End::complete;
}

Found trial(Speaks speaks, Serials serials, bool by_walk, std::uint64_t seed) {
  const auto plant = study::plant_of({.devices = slaves,
                                      .serials = serials,
                                      .speaks = {Speaks::lss, speaks},
                                      .response = {4ms, 4ms, 0, rt::Duration(0)},
                                      .seed = seed});
  const std::vector<nodeid::WalkKind> kinds{{plant.devices.front().address.type(), std::nullopt}};
  study::Stage stage(plant, bit_rate);
  stage.settle();
  Found found;
  const bool ended = stage.run(by_walk ? walk(stage, kinds, found) : published(stage, found), 10min);
  if (ended && found.complete && found.count == slaves) return found;
  std::fprintf(stderr, "bench node_id: %u of %u slaves\n", found.count, slaves);
  std::exit(1);
}

/// Seeds 1 to `seeds`: the one in which the second does worst against the first.
struct Against {
  Found first, second;
  double times = 0;
};
Against against(Speaks speaks, Serials serials, unsigned seeds) {
  Against worst;
  for (unsigned seed = 1; seed <= seeds; ++seed) {
    // The published procedure knows nothing of the extension: its slaves are the paper's.
    const auto first = trial(Speaks::rand, serials, false, seed);
    const auto second = trial(speaks, serials, true, seed);
    const double times = std::chrono::duration<double>(first.known) / std::chrono::duration<double>(second.known);
    if (worst.times == 0 || times < worst.times) worst = {first, second, times};
  }
  return worst;
}

/// 30 devices of one type found and with their node-IDs, nothing stored, as `berth compare` has it.
struct Bound {
  Serials serials;
  const char* name;
  double aim;     // seconds
  double before;  // seconds, when the planner was new
};
constexpr Bound bound_cases[]{{Serials::consecutive, "consecutive", 1.0, 1.40}, {Serials::random, "random", 2.8, 3.10}};

bench::Figure bound(const Bound& b) {
  study::Contest contest;
  contest.methods = {discovery::Method::planner_rand};
  contest.devices = {slaves};
  contest.bit_rates = {bit_rate};
  contest.serials = {b.serials};
  const auto cells = study::compare(contest, 1);
  if (cells.size() != 1 || cells.front().bound != slaves) std::exit(1);
  const double seconds = std::chrono::duration<double>(cells.front().bus_time).count();
  return bench::at_most(fmt::format("found and with node-IDs, {} serials ({} s before)", b.name, b.before), seconds,
                        b.aim, "s");
}

}  // namespace

int main() {
  struct Case {
    const char* what;
    Speaks speaks;
    Serials serials;
    double aim;
    unsigned seeds;
  };
  const Case cases[]{
      {"consecutive serials, paper's slaves", Speaks::rand, Serials::consecutive, 20, 1},
      {"random serials, slaves with the extension", Speaks::rand_resume, Serials::random, 5, 20},
      {"random serials, paper's slaves", Speaks::rand, Serials::random, 0, 20},
      {"consecutive serials, slaves with the extension", Speaks::rand_resume, Serials::consecutive, 0, 1}};
  std::vector<bench::Figure> figures;
  std::vector<std::vector<std::string>> rows;
  for (const auto& c : cases) {
    const auto r = against(c.speaks, c.serials, c.seeds);
    rows.push_back({c.what, bench::time_text(r.first.known), bench::time_text(r.second.known),
                    fmt::format("{:.1f} x", r.times), bench::time_text(r.first.closing),
                    bench::time_text(r.second.closing), std::to_string(r.first.requests),
                    std::to_string(r.second.requests)});
    if (c.aim > 0) figures.push_back(bench::at_least(std::string("planner-rand, ") + c.what, r.times, c.aim, "x"));
  }
  for (const auto& b : bound_cases) figures.push_back(bound(b));
  bench::print_columns(
      "30 blank RAND slaves of one known type, 50 kbit/s, 4 ms; worst of the seeds (random: 20)",
      {"", "published", "walk", "less by", "closing, published", "closing, walk", "requests", "requests, walk"}, rows);
  bench::print_figures("node-ID, RAND", figures);
  return 0;
}
