// `berth sim`: actions in a running plant (sim_running.cpp); and `berth sim two-with-one-id`, `again-with-one-id`,
// `wrong-bit-rate`, `lone-node`: fault confinement, step by step (docs/protocols/can-frames.md §Arbitration, §Fault
// confinement).
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/sim/scenarios.hpp"
#include "output.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

int run_scenario(const Options& options, const std::string& scenario) {
  constexpr unsigned until_bus_off = 30;  // coincidences: more than bus-off needs
  const auto steps = scenario == "lone-node"           ? sim::lone_node()
                     : scenario == "wrong-bit-rate"    ? sim::wrong_bit_rate()
                     : scenario == "again-with-one-id" ? sim::two_with_one_id(until_bus_off)
                                                       : sim::two_with_one_id();
  if (options.json) {
    nlohmann::ordered_json json;
    json["scenario"] = scenario;
    json["steps"] = nlohmann::ordered_json::array();
    for (const auto& step : steps) {
      auto& s = json["steps"].emplace_back();
      s["bit"] = step.bit;
      s["event"] = step.event;
      s["nodes"] = nlohmann::ordered_json::array();
      for (const auto& n : step.nodes) {
        s["nodes"].push_back({{"name", n.name}, {"tec", n.tec}, {"rec", n.rec}, {"state", sim::name(n.state)}});
      }
    }
    print_text(json.dump(2));
    return Exit::done;
  }
  std::size_t width = 5;
  for (const auto& step : steps) width = std::max(width, step.event.size());
  for (const auto& step : steps) {
    std::string line = fmt::format("bit {:>6}  {:<{}}", step.bit, step.event, width);
    for (const auto& n : step.nodes)
      line += fmt::format("  {}: TEC {:>3} REC {:>3} {:<7}", n.name, n.tec, n.rec, sim::name(n.state));
    while (line.ends_with(' ')) line.pop_back();
    print_line(line);
  }
  return Exit::done;
}

int run_version(const Options& options) {
  if (options.json) {
    print_text(nlohmann::ordered_json{{"version", BERTH_VERSION}}.dump(2));
  } else {
    print_line(fmt::format("berth {}", BERTH_VERSION));
  }
  return Exit::done;
}

constexpr std::pair<const char*, const char*> scenes[] = {
    {"two-with-one-id", "scene: two nodes send different data under one identifier: error-passive"},
    {"again-with-one-id", "scene: the same, repeated until bus-off"},
    {"wrong-bit-rate", "scene: a node at another bit rate drives a healthy one to bus-off"},
    {"lone-node", "scene: one node sends and no other acknowledges"}};

}  // namespace

void add_sim(Verb& berth, Options& options) {
  const Verb sim =
      berth.group("sim", "a running simulated machine: plug, unplug, power, inputs, faults; and textbook scenes");
  sim.footer(
      "Examples:\n"
      "  berth sim unplug s2 machine.toml\n  berth sim power off s2 machine.toml\n  berth sim devices machine.toml\n"
      "  berth sim wrong-bit-rate\n"
      "The machine runs in another terminal: berth up MACHINE --sim PLANT --pace");
  add_running_plant(sim, options);
  for (const auto& [name, help] : scenes) {
    const Verb scene =
        sim.add(name, help, [&options, scene = std::string(name)] { return run_scenario(options, scene); });
    json_flag(scene, options);
    scene.footer(std::string("Example:\n  berth sim ") + name);
  }
}

void add_version(Verb& berth, Options& options) {
  const Verb version = berth.add("version", "print version", [&options] { return run_version(options); });
  json_flag(version, options);
  version.footer("Example:\n  berth version --json");
}

}  // namespace berth::cli
