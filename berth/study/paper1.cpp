// Paper 1 §IV: 30 slaves at 50 kbit/s (S1.39 to S1.49).
#include <fmt/format.h>

#include "berth/co/guarding.hpp"
#include "berth/discovery/auto.hpp"
#include "berth/nodeid/paper1_times.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/research/and_master.hpp"
#include "berth/study/commissioning.hpp"
#include "berth/study/listings.hpp"
#include "berth/study/reproduce.hpp"
#include "berth/study/simulated.hpp"
#include "berth/study/stage.hpp"
#include "berth/study/verdict.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;
using plant::Speaks;
namespace times = nodeid::paper1;

constexpr auto longest_run = 30min;

/// The paper's conditions. The collect window is that of formula (3), rounded up to whole 10 ms: 30.1 became 40.
times::Conditions conditions_of(const Conditions& wanted) {
  times::Conditions c;
  if (wanted.bit_rate) c.bit_rate = *wanted.bit_rate;
  if (wanted.latency) c.t_resp = *wanted.latency;
  const auto least = times::t_collect_least(times::published, c);
  c.t_collect = (least + 10ms - 1ns) / 10ms * 10ms;
  return c;
}

Cast slaves(const times::Conditions& c, Speaks speaks, bool configured = false) {
  return {.devices = c.slaves,
          .speaks = {Speaks::lss, speaks},
          .response = {c.t_resp, c.t_resp, 0, rt::Duration(0)},
          .configured = configured};
}

/// The paper's fixed window; after DIRS its T_resp + T_DIS.
nodeid::DiscoveryOptions paper_window(const times::Conditions& c, unsigned dis_bits) {
  nodeid::DiscoveryOptions options;
  options.window = nodeid::DiscoveryOptions::Window::fixed;
  options.collect = c.t_collect;
  options.direct = c.t_resp + times::time_of(dis_bits, c);
  options.t_proc = c.t_proc;
  return options;
}

// S1.30: node guarding, slave by slave; each answers T_resp after its question.
rt::Task<void> guard_all(Stage& stage, const times::Conditions& c, unsigned& done) {
  for (unsigned id = 1; id <= c.slaves; ++id) {
    const auto node = NodeId(static_cast<std::uint8_t>(id));
    const auto answer = co_await co::guard_once(stage.master(), node, c.t_resp + 100ms, 1);
    if (answer.has_value()) ++done;
  }
}

rt::Task<void> find_rand(Stage& stage, const times::Conditions& c, std::vector<LssAddress>& found) {
  nodeid::RandMaster master(stage.master());
  const auto options = paper_window(c, times::bound.dis);
  const auto report = co_await master.discover(options);
  if (!report) co_return;
  for (const auto& device : report->found) found.push_back(device.address);
}

rt::Task<void> find_and(Stage& stage, const times::Conditions& c, std::vector<research::AndAddress>& found) {
  research::AndMaster master(stage.master());
  research::AndOptions options;
  options.inquire = false;  // the paper's AND finds its 48-bit addresses
  options.discovery = paper_window(c, times::and_published.dis);
  const auto report = co_await master.discover(options);
  if (!report) co_return;
  for (const auto& device : report->found) found.push_back(device.short_address);
}

// S1.29: all to waiting, the one slave selected, its node-ID configured; then the master's processing time.
rt::Task<void> bind_all(Stage& stage, const times::Conditions& c, unsigned& done) {
  lss::Master lss(stage.master());
  for (unsigned id = 1; id <= c.slaves; ++id) {
    const LssAddress address = stage.world().devices()[id - 1]->plan().address;
    const auto node = NodeId(static_cast<std::uint8_t>(id));
    const auto waiting = co_await lss.switch_global(lss::State::waiting);
    const auto selected = co_await lss.switch_selective(address);
    const auto configured = co_await lss.configure_node_id(node);
    co_await rt::sleep_for(c.t_proc);
    if (waiting.has_value() && selected.has_value() && configured.has_value()) ++done;
  }
}

std::string other_conditions(const Conditions& wanted) {
  return wanted.bit_rate || wanted.latency ? " Published for 50 kbit/s and 4 ms." : "";
}

constexpr const char* both_marks =
    "begin: the master's heartbeat 77F#05 before the first request; end: the one after the procedure";

Row preparation(const times::Conditions& c, Figures& figures) {
  Row row{.paper = 1, .what = "preparation: 30 slaves guarded, formula (2)"};
  row.published = seconds(times::Printed::detect_all);
  row.formula = seconds(times::t_detect_all(times::published, c));
  unsigned done = 0;
  Stage stage(plant_of(slaves(c, Speaks::rand, true)), c.bit_rate);
  row.simulated = measured(stage, guard_all(stage, c, done), longest_run, figures, "paper1-preparation");
  auto wrong = differences(stage, seats_from(stage, 1), Hold::active);
  if (done != c.slaves) wrong.push_back(fmt::format("{} of {} slaves answered", done, c.slaves));
  if (!right(figures, "paper1-preparation", wrong)) row.simulated.reset();
  row.trace = "paper1-preparation";
  row.marks = both_marks;
  row.note = fmt::format(
      "simulated: a master that asks one after the other waits T_resp each time, formula (2) counts it once; 30 x "
      "formula "
      "(1) with base frames of 55 and 65 bits is {:.4f} s. The paper's guarding frames of 150 and 160 bits do not "
      "exist. "
      "Berth: no figure, heartbeats cost no questions.",
      seconds(c.slaves * times::t_detect(times::bound, c)));
  return row;
}

Row collect(const times::Conditions& c) {
  Row row{.paper = 1, .what = "least collect window, formula (3)"};
  row.published = seconds(times::Printed::collect_least);
  row.formula = seconds(times::t_collect_least(times::published, c));
  row.note = fmt::format(
      "Taken as 40 ms by the paper, {} ms here. It counts 8 + 1 answers; there are as many as distinct chunks in a "
      "phase, "
      "up to 30. Not simulated: a bound, not a procedure.",
      c.t_collect / 1ms);
  return row;
}

std::optional<double> rand_as_published(const times::Conditions& c, Figures& figures, const char* name) {
  std::vector<LssAddress> found;
  Stage stage(plant_of(slaves(c, Speaks::rand)), c.bit_rate);
  const auto span = measured(stage, find_rand(stage, c, found), longest_run, figures, name);
  return right(figures, name, differences(stage, found)) ? span : std::nullopt;
}

Row rand(const times::Conditions& c, Figures& figures) {
  Row row{.paper = 1, .what = "discovery: 30 slaves by RAND, formula (7)"};
  row.published = seconds(times::Printed::network);
  row.formula = seconds(times::t_network_id(times::published, c));
  row.simulated = rand_as_published(c, figures, "paper1-discovery");
  row.berth = by_planner(slaves(c, Speaks::rand), c.bit_rate, discovery::Method::planner_rand, {.known_types = true},
                         figures, "paper1-discovery-berth");
  row.trace = "paper1-discovery";
  row.marks = both_marks;
  row.note = fmt::format(
      "11.2 s is 11.14 s rounded up, and needs T_node_ID in (7); as printed, with T_ID_phase, it is {:.3f} s. The "
      "paper "
      "counts 185 and 145 bits; the bus sends fewer: with the bounds of 120 and 80 bits (7) is {:.2f} s. Berth: "
      "planner-rand, one type, serial numbers 1 to 30, the type known.",
      seconds(times::t_network_id_printed(times::published, c)), seconds(times::t_network_id(times::bound, c)));
  return row;
}

// AND's own addresses are 48 bits of the LSS address: they show which devices were found.
std::vector<std::string> differences_by_and(Stage& stage, const std::vector<research::AndAddress>& found) {
  std::vector<LssAddress> addresses;
  for (const auto& each : found) {
    LssAddress address;
    for (const auto& device : stage.world().devices()) {
      if (research::AndAddress(device->plan().address) == each) address = device->plan().address;
    }
    addresses.push_back(address);
  }
  return differences(stage, addresses);
}

Row and_protocol(const times::Conditions& wanted, Figures& figures) {
  auto c = wanted;
  c.phases = times::and_phases;
  Row row{.paper = 1, .what = "discovery: 30 slaves by AND"};
  row.published = seconds(times::Printed::and_network);
  row.formula = seconds(times::t_network_id(times::and_published, c));
  std::vector<research::AndAddress> found;
  Stage stage(plant_of(slaves(c, Speaks::and_protocol)), c.bit_rate);
  row.simulated = measured(stage, find_and(stage, c, found), longest_run, figures, "paper1-and");
  if (!right(figures, "paper1-and", differences_by_and(stage, found))) row.simulated.reset();
  row.trace = "paper1-and";
  row.marks = both_marks;
  row.note =
      "formula: (7) with 12 phases and every frame 135 bits, which gives the paper's figure: it charges AND answers of "
      "eight data bytes and RAND answers of none. Simulated: every frame a base frame of eight bytes, the answers too, "
      "as the wire format in docs/and.md. "
      "Berth: no planner speaks AND; its figure for the same 30 slaves is RAND's.";
  return row;
}

std::optional<double> bound_by_berth(const times::Conditions& c, Figures& figures, const char* name) {
  Stage stage(plant_of(slaves(c, Speaks::rand)), c.bit_rate);
  Commissioning berth(stage);
  const auto seats = seats_from(stage, 1);
  const auto span = measured(stage, berth.bind(seats), longest_run, figures, name);
  auto wrong = differences(stage, seats, Hold::stored);
  if (berth.bound() != c.slaves) wrong.push_back(fmt::format("{} of {} slaves bound", berth.bound(), c.slaves));
  return right(figures, name, wrong) ? span : std::nullopt;
}

Row binding(const times::Conditions& c, Figures& figures) {
  Row row{.paper = 1, .what = "binding: 30 slaves, formula (9)"};
  row.published = seconds(times::Printed::all_bind);
  row.formula = seconds(times::t_all_bind(times::published, c));
  unsigned done = 0;
  {
    Stage stage(plant_of(slaves(c, Speaks::rand)), c.bit_rate);
    row.simulated = measured(stage, bind_all(stage, c, done), longest_run, figures, "paper1-binding");
    auto wrong = differences(stage, seats_from(stage, 1), Hold::pending);
    if (done != c.slaves) wrong.push_back(fmt::format("{} of {} slaves answered", done, c.slaves));
    if (!right(figures, "paper1-binding", wrong)) row.simulated.reset();
  }
  row.berth = bound_by_berth(c, figures, "paper1-binding-berth");
  row.trace = "paper1-binding";
  row.marks = both_marks;
  row.note = fmt::format(
      "The paper's own numbers give 1.14 s, not 1.15. It counts LSS frames as extended ones of 2 to 5 bytes; they are "
      "base "
      "frames of 8: (9) with 135 bits each is {:.3f} s. Simulated as the paper has it: nothing is stored, and the last "
      "slave's node-ID is pending. Berth does more (places::Binder): it asks under every node-ID whether it is free, "
      "asks each slave for its node-ID, has it store the new one, hears it boot and reads its identity under it.",
      seconds(times::t_all_bind(times::bound, c)));
  return row;
}

// S1.48: no time is printed, only that all are found and bound.
Row emulation(const times::Conditions& wanted, Figures& figures) {
  auto c = wanted;
  c.slaves = 120;
  Row row{.paper = 1, .what = "discovery: the emulation's 120 slaves by RAND"};
  row.formula = seconds(times::t_network_id(times::published, c));
  row.simulated = rand_as_published(c, figures, "paper1-120-slaves");
  row.berth = by_planner(slaves(c, Speaks::rand), c.bit_rate, discovery::Method::planner_rand, {.known_types = true},
                         figures, "paper1-120-slaves-berth");
  row.trace = "paper1-120-slaves";
  row.marks = both_marks;
  row.note =
      "The paper prints no time, only that all are found, as here. 120 distinct chunks can answer one phase: whose "
      "answers do not fit into the window are found in a later procedure.";
  return row;
}

/// Tables I and II: the five slaves, s1 to s5 (S1.28, S1.38, S1.49).
trace::Trace figure_9_trace(const Conditions& wanted, Figures& figures) {
  const auto c = conditions_of(wanted);
  constexpr LssAddress addresses[]{{0x0100'0001, 1, 0, 0xA}, {1, 1, 0, 5}, {1, 5, 0, 8}, {1, 1, 0, 6}, {1, 1, 0, 7}};
  auto cast = slaves(c, Speaks::rand);
  cast.devices = static_cast<unsigned>(std::size(addresses));
  auto plant = plant_of(cast);
  for (std::size_t i = 0; i < std::size(addresses); ++i) plant.devices[i].address = addresses[i];
  Stage stage(plant, c.bit_rate);
  std::vector<LssAddress> found;
  stage.settle();
  stage.record();
  stage.run(find_rand(stage, c, found), longest_run);
  right(figures, "paper1-figure9", differences(stage, found));
  return stage.trace();
}

}  // namespace

namespace paper1 {
trace::Trace figure_9(const Conditions& conditions, Figures& figures) { return figure_9_trace(conditions, figures); }
}  // namespace paper1

void reproduce_paper1(const Conditions& conditions, Figures& figures) {
  const auto c = conditions_of(conditions);
  const auto first = figures.rows.size();
  figures.rows.push_back(preparation(c, figures));
  figures.rows.push_back(collect(c));
  figures.rows.push_back(rand(c, figures));
  figures.rows.push_back(and_protocol(c, figures));
  figures.rows.push_back(binding(c, figures));
  figures.rows.push_back(emulation(c, figures));
  for (auto i = first; i < figures.rows.size(); ++i) figures.rows[i].note += other_conditions(conditions);
}

}  // namespace berth::study
