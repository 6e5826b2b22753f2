// The page of `GET /metrics`: any names and numbers give a page that a strict reader and Prometheus' own tool accept,
// and what is written about it (docs/metrics.md, the alerts, the dashboard) names what it has.
#include "berth/studio/metrics.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "../paths.hpp"
#include "../pch.hpp"
#include "../shell.hpp"
#include "berth/text/printable.hpp"
#include "metrics_reader.hpp"

namespace berth::studio {
namespace {

using test::MetricsPage;

std::string file_of(const std::string& name) {
  std::ifstream in(test::source_dir() + "/" + name);
  EXPECT_TRUE(in) << name;
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

/// The names of metrics in a text, without what a histogram's samples have behind them.
std::set<std::string> named_in(const std::string& text) {
  std::set<std::string> names;
  const std::regex name(R"(\bberth_[a-z_]+)");
  for (auto it = std::sregex_iterator(text.begin(), text.end(), name); it != std::sregex_iterator(); ++it)
    names.insert(std::regex_replace(it->str(), std::regex("_(bucket|sum|count)$"), ""));
  return names;
}

std::set<std::string> known_names() {
  std::set<std::string> names;
  for (const auto& metric : metrics()) names.insert(std::string(metric.name));
  return names;
}

About about() { return {.version = "1.2", .machine = "bench", .simulated = true, .start_s = 1.5e9, .age_s = 0.25}; }

/// Two buses, one of them beneath a gateway, and three slots.
Figures figures() {
  Figures out;
  out.buses.push_back({.name = "field",
                       .has_port = true,
                       .state = "warning",
                       .tec = std::uint8_t{97},
                       .rec = std::uint8_t{3},
                       .errors = 7,
                       .lost = 2,
                       .bus_offs = 1});
  out.buses.push_back({.name = "deep"});
  out.slots.push_back({.bus = 0,
                       .id = NodeId(5),
                       .name = "drive",
                       .state = places::SlotState::operational,
                       .heartbeats_lost = 1,
                       .emergencies = 4,
                       .boots = 3,
                       .mismatches = 9,
                       .differs = true});
  out.slots.push_back(
      {.bus = 0, .id = NodeId(6), .name = "spare", .state = places::SlotState::empty, .required = false});
  out.slots.push_back({.bus = 1, .id = NodeId(7), .name = "valve", .state = places::SlotState::power_cycle});
  return out;
}

std::vector<Traffic> traffic() {
  std::vector<Traffic> out(1);
  out[0].frames = 12;
  out[0].busy_s = 0.5;
  out[0].load = 0.125;
  out[0].sdo_aborts[5] = 2;
  out[0].sdo_aborts[99] = 1;
  return out;
}

TEST(StudioMetrics, EachFigureIsWhereItBelongs) {
  const MetricsPage page(metrics_page(about(), figures(), traffic(), Exposition::prometheus));
  const MetricsPage::Labels field{{"bus", "field"}}, drive{{"bus", "field"}, {"slot", "drive"}};
  EXPECT_EQ(page.value("berth_build_info", {{"version", "1.2"}}), 1);
  EXPECT_EQ(page.value("berth_machine_info", {{"machine", "bench"}, {"simulated", "true"}}), 1);
  EXPECT_EQ(page.value("berth_start_time_seconds"), 1.5e9);
  EXPECT_EQ(page.value("berth_figures_age_seconds"), 0.25);
  EXPECT_EQ(page.value("berth_bus_state", {{"bus", "field"}, {"state", "warning"}}), 1);
  EXPECT_EQ(page.value("berth_bus_state", {{"bus", "field"}, {"state", "bus-off"}}), 0);
  EXPECT_EQ(page.value("berth_bus_load_ratio", field), 0.125);
  EXPECT_EQ(page.value("berth_bus_busy_seconds_total", field), 0.5);
  EXPECT_EQ(page.value("berth_bus_frames_total", field), 12);
  EXPECT_EQ(page.value("berth_bus_errors_total", field), 7);
  EXPECT_EQ(page.value("berth_bus_lost_frames_total", field), 2);
  EXPECT_EQ(page.value("berth_bus_offs_total", field), 1);
  EXPECT_EQ(page.value("berth_bus_tec", field), 97);
  EXPECT_EQ(page.value("berth_bus_rec", field), 3);
  EXPECT_EQ(page.value("berth_bus_sdo_aborts_total", field), 3);
  EXPECT_EQ(page.value("berth_slots", {{"bus", "field"}, {"state", "operational"}}), 1);
  EXPECT_EQ(page.value("berth_slots", {{"bus", "field"}, {"state", "failed"}}), 0);
  EXPECT_EQ(page.value("berth_slots", {{"bus", "deep"}, {"state", "power cycle needed"}}), 1);
  EXPECT_EQ(page.value("berth_slot_info", {{"bus", "field"}, {"slot", "drive"}, {"node_id", "5"}}), 1);
  EXPECT_EQ(page.value("berth_slot_state", {{"bus", "field"}, {"slot", "spare"}, {"state", "empty"}}), 1);
  EXPECT_EQ(page.value("berth_slot_operational", drive), 1);
  EXPECT_EQ(page.value("berth_slot_required", drive), 1);
  EXPECT_EQ(page.value("berth_slot_required", {{"bus", "field"}, {"slot", "spare"}}), 0);
  EXPECT_EQ(page.value("berth_slot_heartbeats_lost_total", drive), 1);
  EXPECT_EQ(page.value("berth_slot_emergencies_total", drive), 4);
  EXPECT_EQ(page.value("berth_slot_restarts_total", drive), 2) << "the first boot-up is no restart";
  EXPECT_EQ(page.value("berth_slot_restarts_total", {{"bus", "field"}, {"slot", "spare"}}), 0);
  EXPECT_EQ(page.value("berth_slot_sdo_aborts_total", drive), 2);
  EXPECT_EQ(page.value("berth_slot_configuration_mismatches_total", drive), 9);
  EXPECT_EQ(page.value("berth_slot_configuration_differs", drive), 1);
}

TEST(StudioMetrics, WhatIsNotKnownHasNoSample) {
  const MetricsPage page(metrics_page(about(), figures(), traffic(), Exposition::prometheus));
  EXPECT_EQ(page.value("berth_slot_operational", {{"bus", "deep"}, {"slot", "valve"}}), 0);
  EXPECT_FALSE(page.value("berth_slot_restarts_total", {{"bus", "deep"}, {"slot", "valve"}}));
  EXPECT_FALSE(page.value("berth_bus_frames_total", {{"bus", "deep"}}));
  EXPECT_FALSE(page.value("berth_bus_tec", {{"bus", "deep"}}));
  // Before the executor told anything.
  const MetricsPage early(metrics_page({.version = "1"}, {}, {}, Exposition::prometheus));
  EXPECT_EQ(early.value("berth_build_info", {{"version", "1"}}), 1);
  EXPECT_FALSE(early.value("berth_figures_age_seconds"));
  EXPECT_EQ(early.types().size(), metrics().size());
}

TEST(StudioMetrics, ABucketHasAllThatWereNotLater) {
  Figures late;
  for (const double s : {-0.001, 0.0001, 0.0002, 0.03, 0.03, 5.0}) late.lateness.add(s);
  const MetricsPage page(metrics_page({}, late, {}, Exposition::prometheus));
  const auto bucket = [&](const char* le) { return page.value("berth_loop_latency_seconds_bucket", {{"le", le}}); };
  EXPECT_EQ(bucket("0.0001"), 2);
  EXPECT_EQ(bucket("0.00025"), 3);
  EXPECT_EQ(bucket("0.025"), 3);
  EXPECT_EQ(bucket("0.05"), 5);
  EXPECT_EQ(bucket("1"), 5);
  EXPECT_EQ(bucket("+Inf"), 6);
  EXPECT_EQ(page.value("berth_loop_latency_seconds_count"), 6);
  EXPECT_NEAR(*page.value("berth_loop_latency_seconds_sum"), 5.0603, 1e-9);
}

TEST(StudioMetrics, AnAbortIsCountedForItsServer) {
  Traffic one;
  one.add(can::Frame::base(0x585, {0x80, 0, 0x10, 0, 0, 0, 2, 6}), 125, 125'000);
  one.add(can::Frame::base(0x605, {0x80, 0, 0x10, 0, 0, 0, 4, 5}), 125, 125'000);
  EXPECT_EQ(one.sdo_aborts[5], 2U);
  one.add(can::Frame::base(0x585, {0x43, 0, 0x10, 0, 0x80, 0, 0, 0}), 125, 125'000);
  one.add(can::Frame::base(0x585, {0x81, 1, 2, 3, 4, 5, 6, 7}), 125, 125'000);  // segment 1 of a block, the last
  one.add(can::Frame::base(0x505, {0x80, 0, 0, 0, 0, 0, 0, 0}), 125, 125'000);
  one.add(can::Frame::base(0x680, {0x80, 0, 0, 0, 0, 0, 0, 0}), 125, 125'000);
  EXPECT_EQ(one.sdo_aborts[5], 2U);
  EXPECT_EQ(one.sdo_aborts[0], 0U);
  EXPECT_EQ(one.frames, 6U);
  EXPECT_DOUBLE_EQ(one.busy_s, 0.006);
}

TEST(StudioMetrics, AClientGetsTheFormThatItReads) {
  EXPECT_EQ(exposition_for(""), Exposition::prometheus);
  EXPECT_EQ(exposition_for("text/plain;version=0.0.4;q=0.5,*/*;q=0.1"), Exposition::prometheus);
  EXPECT_EQ(exposition_for("application/openmetrics-text;version=1.0.0,text/plain;version=0.0.4;q=0.5"),
            Exposition::open_metrics);
}

// Names may hold anything: each comes back as the reader's label, made one line of UTF-8, and twice in no page.
RC_GTEST_PROP(StudioMetrics, AnyNamesGiveAPageThatIsRead, ()) {
  const auto names = *rc::gen::container<std::vector<std::string>>(rc::gen::arbitrary<std::string>());
  Figures any;
  std::set<std::string> shown;
  for (const auto& name : names) {
    if (!shown.insert(text::one_line(name)).second) continue;
    any.buses.push_back({.name = name, .has_port = *rc::gen::arbitrary<bool>(), .state = "active"});
    any.slots.push_back({.bus = any.buses.size() - 1,
                         .id = NodeId(static_cast<std::uint8_t>(*rc::gen::inRange(1, 128))),
                         .name = name,
                         .heartbeats_lost = *rc::gen::arbitrary<std::uint64_t>()});
  }
  any.lateness.add(*rc::gen::arbitrary<double>());
  for (const bool open : {false, true}) {
    const auto text = metrics_page({.version = "1", .machine = names.empty() ? "" : names[0]}, any, {},
                                   open ? Exposition::open_metrics : Exposition::prometheus);
    const MetricsPage page(text, open);
    RC_ASSERT(text::is_printable(text));
    for (const auto& slot : any.slots) {
      const std::string name = text::one_line(slot.name);
      RC_ASSERT(page.value("berth_slot_required", {{"bus", name}, {"slot", name}}) == 1.0);
    }
  }
}

// ---- what others make of it ----

/// Runs a command of the shell with this text as its input; returns its exit status.
int fed(const std::string& command, const std::string& text) {
  const std::string file = fmt::format("{}/metrics_{}.txt", ::testing::TempDir(), ::getpid());
  std::ofstream(file) << text;
  const int status = std::system(  // NOLINT(concurrency-mt-unsafe): nothing else runs here
      fmt::format("{} < '{}'", command, file).c_str());
  std::remove(file.c_str());
  return WEXITSTATUS(status);
}

#define NEEDS_PROMTOOL() \
  if (!test::has("promtool")) GTEST_SKIP() << "needs metrics: promtool is not installed"

TEST(StudioMetrics, PromtoolFindsNothingWrong) {
  NEEDS_PROMTOOL();
  Figures odd = figures();
  odd.slots[0].name = "a \"quoted\"\\ name\nof two lines, {with=\"labels\"} # and \xc3\xa9";
  odd.slots[1].name = "\xff\x00 no UTF-8";
  odd.lateness.add(0.002);
  const auto text = metrics_page(about(), odd, traffic(), Exposition::prometheus);
  EXPECT_EQ(fed("promtool check metrics", text), 0) << text;
  EXPECT_NE(fed("promtool check metrics 2>/dev/null", "berth_x{a=\"} 1\n"), 0) << "it would not notice";
}

TEST(StudioMetrics, PrometheusClientReadsBothForms) {
  if (test::shell("PATH=/usr/bin:$PATH python3 -c 'import prometheus_client' 2>&1").status != 0)
    GTEST_SKIP() << "needs metrics: python3-prometheus-client is not installed";
  Figures odd = figures();
  odd.slots[0].name = "a \"quoted\"\\ name\nof two lines, {with=\"labels\"} # and \xc3\xa9";
  odd.lateness.add(0.002);
  const std::string script = test::source_dir() + "/tests/studio/read_metrics.py";
  for (const auto form : {Exposition::prometheus, Exposition::open_metrics}) {
    const auto text = metrics_page(about(), odd, traffic(), form);
    const char* const name = form == Exposition::open_metrics ? "open" : "text";
    EXPECT_EQ(fed(fmt::format("PATH=/usr/bin:$PATH python3 '{}' {} {}", script, name, metrics().size()), text), 0)
        << text;
  }
}

TEST(StudioMetrics, TheAlertsAreWhatPromtoolTestsThemToBe) {
  NEEDS_PROMTOOL();
  const std::string folder = test::source_dir();
  EXPECT_EQ(fed(fmt::format("promtool check rules '{}/packaging/prometheus/berth.rules.yml'", folder), ""), 0);
  EXPECT_EQ(fed(fmt::format("promtool test rules '{}/tests/studio/berth.rules.test.yml'", folder), ""), 0);
}

TEST(StudioMetrics, TheAlertsNameWhatThePageHasAndEachIsTested) {
  const auto rules = file_of("packaging/prometheus/berth.rules.yml");
  const auto tests = file_of("tests/studio/berth.rules.test.yml");
  const auto known = known_names();
  for (const auto& name : named_in(rules)) EXPECT_TRUE(known.contains(name)) << name;
  const std::regex alert(R"(- alert: (\w+))");
  std::size_t alerts = 0;
  for (auto it = std::sregex_iterator(rules.begin(), rules.end(), alert); it != std::sregex_iterator(); ++it) {
    ++alerts;
    const auto name = (*it)[1].str();
    EXPECT_NE(tests.find("alertname=\"" + name + "\""), std::string::npos) << name << " has no test";
    const auto rest = rules.substr(static_cast<std::size_t>(it->position()) + 1);
    const auto own = rest.substr(0, rest.find("- alert:"));
    for (const char* part : {"summary:", "description:", "severity:"})
      EXPECT_NE(own.find(part), std::string::npos) << name << " has no " << part;
    EXPECT_NE(file_of("docs/metrics.md").find("`" + name + "`"), std::string::npos) << name << " is not in the page";
  }
  EXPECT_GE(alerts, 7U);
}

void collect(const nlohmann::json& tree, const std::string& key, std::vector<std::string>& into) {
  if (tree.is_object()) {
    for (const auto& [name, value] : tree.items()) {
      if (name == key && value.is_string()) into.push_back(value.get<std::string>());
      collect(value, key, into);
    }
  } else if (tree.is_array()) {
    for (const auto& value : tree) collect(value, key, into);
  }
}

TEST(StudioMetrics, TheDashboardAsksOnlyForWhatThePageHas) {
  const auto board = nlohmann::json::parse(file_of("packaging/grafana/berth.json"));
  std::vector<std::string> queries;
  collect(board, "expr", queries);
  collect(board, "query", queries);
  EXPECT_GT(queries.size(), 10U);
  const auto known = known_names();
  std::set<std::string> asked;
  for (const auto& query : queries) {
    for (const auto& name : named_in(query)) {
      EXPECT_TRUE(known.contains(name)) << name << " in " << query;
      asked.insert(name);
    }
  }
  EXPECT_GT(asked.size(), 10U);
  // Prometheus reads each query.
  if (test::has("promtool")) {
    std::string rules = "groups:\n- name: q\n  rules:\n";
    for (const auto& query : queries) {
      if (query.starts_with("label_values") || query == "prometheus") continue;
      rules += fmt::format("  - record: q:{}\n    expr: {}\n", rules.size(),
                           nlohmann::json(std::regex_replace(query, std::regex(R"(\$__rate_interval)"), "1m")).dump());
    }
    const std::string file = fmt::format("{}/queries_{}.yml", ::testing::TempDir(), ::getpid());
    std::ofstream(file) << rules;
    EXPECT_EQ(fed(fmt::format("promtool check rules '{}'", file), ""), 0);
    std::remove(file.c_str());
  }
  std::set<int> ids;
  for (const auto& panel : board.at("panels")) EXPECT_TRUE(ids.insert(panel.at("id").get<int>()).second);
}

TEST(StudioMetrics, TheTableOfTheManualIsThatOfTheCode) {
  const auto manual = file_of("docs/metrics.md");
  std::set<std::string> rows;
  std::istringstream lines(manual);
  for (std::string line; std::getline(lines, line);) {
    std::smatch row;
    if (!std::regex_match(line, row, std::regex(R"(\| `(berth_\w+)` \| (\w+) \| .+ \|)"))) continue;
    rows.insert(row[1].str());
    for (const auto& metric : metrics()) {
      if (metric.name == row[1].str()) {
        EXPECT_EQ(row[2].str(), std::string(metric.type)) << row[1].str();
      }
    }
  }
  EXPECT_EQ(rows, known_names());
  const auto known = known_names();
  for (const auto& name : named_in(manual)) EXPECT_TRUE(known.contains(name)) << name;
}

}  // namespace
}  // namespace berth::studio
