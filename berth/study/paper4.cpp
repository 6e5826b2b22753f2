// Paper 4: Fastscan without and with feedback (S4.3, S4.7, S4.14 to S4.18).
#include <fmt/format.h>

#include "berth/lss/fastscan.hpp"
#include "berth/study/formulas.hpp"
#include "berth/study/listings.hpp"
#include "berth/study/simulated.hpp"
#include "berth/study/verdict.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;
using plant::Speaks;

/// The paper's device (S4.14).
constexpr LssAddress device{0x0135'5341, 0x0447'0003, 0x0002'0006, 0xFEED'F00D};
constexpr std::uint8_t node = 3;

Fastscan formula_of(const Conditions& c, rt::Duration timeout) {
  Fastscan f;
  if (c.bit_rate) f.bit_rate = *c.bit_rate;
  if (c.latency) f.response = *c.latency;
  f.timeout = timeout;
  return f;
}

plant::PlantFile plant_for(const Fastscan& f, Speaks speaks) {
  auto plant = plant_of({.devices = 1, .speaks = {speaks}});
  auto& only = plant.devices[0];
  only.address = device;
  only.response = {f.response, f.response, 0, rt::Duration(0)};
  only.storing.time = f.store;
  only.reset = f.boot;
  return plant;
}

class Three final : public lss::FastscanOwner {
 public:
  NodeId assign(const lss::FastscanDevice& found) noexcept override {
    right = found.address == device;
    return NodeId(node);
  }
  bool right = false;
};

/// As the paper's master: one device, its node-ID stored.
lss::FastscanOptions literal(rt::Duration window, lss::Feedback feedback) {
  lss::FastscanOptions options;
  options.form = lss::FastscanForm::literal;
  options.feedback = feedback;
  options.window = window;
  options.confirm = false;
  options.wait_first = false;
  options.store = true;
  options.most_devices = 1;
  return options;
}

rt::Task<void> discover(Stage& stage, const lss::FastscanOptions& options, Three& owner) {
  lss::Master master(stage.master());
  lss::Fastscan fastscan(master, options);
  co_await fastscan.discover(owner);
}

/// Runs the paper's procedure until the boot-up message of node 3, and keeps what was on the bus.
std::optional<double> procedure(const Fastscan& f, lss::Feedback feedback, Figures& figures, const std::string& name) {
  const bool plain = feedback == lss::Feedback::none;
  Stage stage(plant_for(f, plain ? Speaks::fastscan : Speaks::feedback_29), f.bit_rate);
  Three owner;
  const auto options = literal(f.timeout, feedback);
  stage.settle();
  stage.record();
  const bool ended = stage.run(discover(stage, options, owner), 1min);
  stage.run_until_quiet(100ms, 10s);
  stage.crop_after_boot_up();
  const double span = keep(stage, f.bit_rate, figures, name);
  auto wrong = differences(stage, seats_from(stage, node), Hold::stored);
  if (!ended) wrong.emplace_back("not over in its time");
  if (!owner.right) wrong.emplace_back("the device was not found by its address");
  return right(figures, name, wrong) ? std::optional(span) : std::nullopt;
}

std::optional<double> planner(const Fastscan& f, bool feedback, Figures& figures, const std::string& name) {
  const auto plant = plant_for(f, feedback ? Speaks::feedback_29 : Speaks::fastscan);
  const auto method = feedback ? discovery::Method::planner_feedback : discovery::Method::planner_fastscan;
  return by_method(plant, f.bit_rate, method, {.window = f.timeout, .bind = true, .first_id = node}, figures, name);
}

constexpr const char* marks = "begin: the first request, 7E5#51..80; end: the boot-up message 703#00";

rt::Task<void> scan_only(Stage& stage, const lss::FastscanOptions& options, std::vector<LssAddress>& found) {
  lss::Master master(stage.master());
  lss::Fastscan fastscan(master, options);
  const auto scanned = co_await fastscan.scan();
  if (scanned && *scanned) found.push_back((*scanned)->address);
}

Row all_bits(const Conditions& c, Figures& figures) {
  Row row{.paper = 4, .what = "all 128 bits of an LSS address, 10 ms time-out"};
  const auto f = formula_of(c, 10ms);
  row.published = 1.25;
  row.formula = seconds(scan_windows(about_128, f.timeout));
  auto options = literal(f.timeout, lss::Feedback::none);
  const auto plant = plant_for(f, Speaks::fastscan);
  {
    std::vector<LssAddress> found;
    Stage stage(plant, f.bit_rate);
    row.simulated = measured(stage, scan_only(stage, options, found), 1min, figures, "paper4-scan");
    if (!right(figures, "paper4-scan", differences(stage, found))) row.simulated.reset();
  }
  row.berth = by_method(plant, f.bit_rate, discovery::Method::planner_fastscan, {.window = f.timeout}, figures,
                        "paper4-scan-berth");
  row.trace = "paper4-scan";
  row.marks = "begin: the master's heartbeat 77F#05 before the first request; end: the one after the last window";
  row.note =
      "128 x 10 ms are 1.28 s, and the four confirmations that the paper mentions make 1.32. Simulated: the 132 "
      "requests of "
      "Table 1, each on the wire for about 1 ms before its window. Berth: planner-fastscan, nothing known, windows "
      "learnt.";
  return row;
}

Row table(const Conditions& c, bool feedback, rt::Duration timeout, double published, std::string what,
          const std::string& name, Figures& figures) {
  Row row{.paper = 4, .what = std::move(what)};
  const auto f = formula_of(c, timeout);
  row.published = published;
  row.formula = seconds(scan(feedback ? table_2_requests : table_1_requests, f) + configure(f));
  row.simulated = procedure(f, feedback ? lss::Feedback::extended : lss::Feedback::none, figures, name);
  row.berth = planner(f, feedback, figures, name + "-berth");
  row.trace = name;
  row.marks = marks;
  return row;
}

trace::Trace listed(const Conditions& c, lss::Feedback feedback, Figures& figures, const char* name) {
  (void)procedure(formula_of(c, 20ms), feedback, figures, name);
  return figures.traces.back().trace;
}

}  // namespace

namespace paper4 {
trace::Trace table_1(const Conditions& conditions, Figures& figures) {
  return listed(conditions, lss::Feedback::none, figures, "paper4-table1");
}
trace::Trace table_2(const Conditions& conditions, Figures& figures) {
  return listed(conditions, lss::Feedback::extended, figures, "paper4-table2");
}
}  // namespace paper4

void reproduce_paper4(const Conditions& conditions, Figures& figures) {
  figures.rows.push_back(all_bits(conditions, figures));
  constexpr const char* device_times =
      " The paper names neither bit rate nor the device's times: 125 kbit/s, answers after 0.5 ms, store and boot 5 ms "
      "each fit it.";
  constexpr const char* binder = " places::Binder, which asks first whether the node-ID is free: 400 ms of silence.";
  auto one =
      table(conditions, false, 20ms, 2.78, "Fastscan until boot-up, 20 ms time-out, Table 1", "paper4-table1", figures);
  one.note = std::string("132 requests and their whole windows, then configure, store, switch, boot-up.") +
             device_times + " Berth: planner-fastscan, nothing known of the device, windows learnt; then" + binder;
  auto two = table(conditions, true, 20ms, 0.210, "Fastscan with feedback until boot-up, 20 ms time-out, Table 2",
                   "paper4-table2", figures);
  two.note = std::string("9 requests and their whole windows, then the same.") + device_times +
             " Berth: planner-feedback, then" + binder;
  auto three = table(conditions, true, 10ms, 0.100, "Fastscan with feedback, \"less than 100 ms\", 10 ms time-out",
                     "paper4-under-100ms", figures);
  three.note =
      std::string(
          "The paper prints a bound and no time-out: with 20 ms it is above (the row before), 10 ms, the paper's other "
          "one, are "
          "9 x 10 ms and the configuration. Finding the address alone keeps below 100 ms; until boot-up it does not. "
          "Berth: planner-feedback, then") +
      binder;
  figures.rows.push_back(std::move(one));
  figures.rows.push_back(std::move(two));
  figures.rows.push_back(std::move(three));
}

}  // namespace berth::study
