// `berth plant`: a simulated plant in a process of its own. It runs in real time and offers its buses to other
// processes (`--listen`), or alone for some simulated time (`--for`), for plants without a master (paper 2; S2.31).
#include <fmt/format.h>

#include <cstdio>
#include <nlohmann/json.hpp>
#include <set>

#include "berth/base/words.hpp"
#include "berth/command/control.hpp"
#include "berth/io/loop_driver.hpp"
#include "berth/io/plant_port.hpp"
#include "interrupt.hpp"
#include "plant_commands.hpp"
#include "record.hpp"
#include "simulated.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

tl::expected<std::unique_ptr<plant::World>, Failure> world_of(const plant::PlantFile& plant, const Options& options) {
  const auto rates = bus_rates(options);
  if (!rates) return tl::unexpected(rates.error());
  return make_world(plant, *rates, options.sim.plant, options);
}

using Json = nlohmann::ordered_json;

double seconds(rt::Time at) { return std::chrono::duration<double>(at.time_since_epoch()).count(); }

/// Why the device has no node-ID; empty: it has one.
std::string reason(const plant::SimDevice& device) {
  const auto truth = device.truth();
  if (!truth.plugged) return "not plugged in";
  if (!truth.powered) return "no power";
  if (truth.active.configured()) return {};
  if (truth.booting) return "boots";
  const auto* negotiator = device.device().schemes().negotiator();
  if (negotiator == nullptr) return "waits for a master to give it one";
  if (negotiator->state() == research::Negotiating::exhausted) return research::name(negotiator->state());
  return fmt::format("negotiates: {}", research::name(negotiator->state()));
}

/// Records when each device took or lost its node-ID, and why.
class NodeIds final : public plant::World::Observer {
 public:
  struct Event {
    double at_s;
    std::string device;
    NodeId node_id;  ///< unconfigured: the device lost it
    std::string why;
  };
  explicit NodeIds(plant::World& world) : world_(&world) { world.add_observer(*this); }
  ~NodeIds() { world_->remove_observer(*this); }
  NodeIds(const NodeIds&) = delete;
  NodeIds& operator=(const NodeIds&) = delete;

  void plant_changed(const plant::SimDevice& device) noexcept override {
    const auto truth = device.truth();
    auto& before = ids_[truth.name];
    const bool pulled = !truth.powered && powered_.erase(truth.name) > 0;
    if (truth.powered) powered_.insert(truth.name);
    if (truth.active == before && !pulled) return;
    before = truth.active;
    const auto* negotiator = device.device().schemes().negotiator();
    std::string why;
    if (pulled) {
      why = truth.plugged ? "no power" : "unplugged";
    } else if (!before.configured()) {
      const auto lost = negotiator != nullptr ? negotiator->lost() : research::IdLoss::none;
      why = lost == research::IdLoss::none ? "reset" : research::name(lost);
    }
    events.push_back({seconds(world_->sim().now()), truth.name, before, why});
  }
  void script_told(const plant::SimDevice& device, const script::Message& told) noexcept override {
    scripts.push_back({seconds(world_->sim().now()), device.name(), told});
    end_run_of(told);
  }
  bool scripts_must_end() noexcept override { return is_ending(); }
  struct Script {
    double at_s;
    std::string device;
    script::Message told;
  };
  std::vector<Event> events;
  std::vector<Script> scripts;  ///< what the scripts printed, and their errors

 private:
  plant::World* world_;
  std::map<std::string, NodeId> ids_;
  std::set<std::string> powered_;
};

Json device_json(const plant::SimDevice& device, bool duplicate) {
  const auto truth = device.truth();
  const auto why = duplicate ? "another device has it too" : reason(device);
  Json json{{"name", truth.name}, {"bus", truth.bus}, {"node_id", nullptr}, {"state", nullptr}};
  if (truth.active.configured()) json["node_id"] = truth.active.value();
  if (truth.powered) json["state"] = name(truth.state);
  json["lss_address"] = to_string(truth.address);
  json["why"] = why.empty() ? Json(nullptr) : Json(why);
  return json;
}

std::string event_line(const NodeIds::Event& event) {
  if (event.node_id.configured()) {
    return fmt::format("{:>10.4f} s  {:<20} node-ID {}", event.at_s, event.device, event.node_id.value());
  }
  return fmt::format("{:>10.4f} s  {:<20} none: {}", event.at_s, event.device, event.why);
}

void print_alone(const NodeIds& ids, const Json& report) {
  for (const auto& e : ids.events) print_line(event_line(e));
  for (const auto& s : ids.scripts) print_line(script_line(s.at_s, s.device, s.told));
  print_line("");
  print_line(fmt::format("{:<20} {:<8} {:>4}  {:<16} {:<36} {}", "device", "bus", "id", "state", "LSS address", "why"));
  for (const auto& d : report["devices"]) {
    const auto text = [&](const char* key) { return d.at(key).is_null() ? "-" : d.at(key).get<std::string>(); };
    const auto id = d.at("node_id").is_null() ? "-" : fmt::format("{}", d.at("node_id").get<int>());
    print_line(fmt::format("{:<20} {:<8} {:>4}  {:<16} {:<36} {}", text("name"), text("bus"), id, text("state"),
                           text("lss_address"), d.at("why").is_null() ? "" : text("why")));
  }
}

// Runs the plant alone, as fast as possible. Status 1: a device with power has no node-ID, or shares it, or a script
// failed.
int run_alone(plant::World& world, const Options& options) {
  Record record;
  if (!options.files.record.empty()) {
    if (const auto good = record.write_to(options.files.record, options.files.force); !good)
      return tell(good.error(), options.json);
  }
  constexpr int nobody = -1;  // there is no node of Berth's
  std::vector<std::unique_ptr<BusTap>> taps;
  for (const auto& bus : world.sim().buses()) taps.push_back(std::make_unique<BusTap>(record, *bus, nobody));
  NodeIds ids(world);
  world.start();
  world.sim().run_until(&run_must_end, *options.timeout);
  taps.clear();
  std::set<std::string> doubled;
  for (const auto& [one, other] : world.duplicates()) doubled.insert({one->name(), other->name()});
  Json report{{"plant", options.sim.plant}, {"time_s", seconds(world.sim().now())}};
  bool good = doubled.empty();
  for (const auto& device : world.devices()) {
    const auto truth = device->truth();
    if (truth.powered && !truth.active.configured()) good = false;
    report["devices"].push_back(device_json(*device, doubled.contains(truth.name)));
  }
  report["events"] = Json::array();
  for (const auto& e : ids.events) {
    Json json{{"at_s", e.at_s}, {"device", e.device}, {"node_id", nullptr}};
    if (e.node_id.configured()) json["node_id"] = e.node_id.value();
    if (!e.why.empty()) json["why"] = e.why;
    report["events"].push_back(json);
  }
  report["scripts"] = Json::array();
  for (const auto& s : ids.scripts) {
    const bool failed = s.told.kind != script::Message::Kind::printed;
    if (failed) good = false;
    report["scripts"].push_back({{"at_s", s.at_s},
                                 {"device", s.device},
                                 {"file", s.told.file},
                                 {"line", s.told.line},
                                 {"failed", failed},
                                 {"text", s.told.text}});
  }
  if (options.json) {
    print_text(report.dump(2));
    return record.finish(good ? Exit::done : Exit::no);
  }
  print_alone(ids, report);
  return record.finish(good ? Exit::done : Exit::no);
}

// Answers `berth sim` from another process. This process knows no slots.
rt::Task<void> answer(plant::World& world, const plant::PlantFile& plant, const command::Request& request,
                      command::Reply& reply) {
  reply = request.verb == plant_verb
              ? do_in_plant({&world, &plant, nullptr}, request)
              : command::refusal(
                    Exit::usage,
                    "this process runs only a plant: it accepts only `berth sim`; ask the `berth up` that uses it");
  co_return;
}

int run_plant(const Options& options) {
  const auto plant = load_plant(options.sim.plant, options);
  if (!plant) return tell(plant.error(), options.json);
  auto world = world_of(*plant, options);
  if (!world) return tell(world.error(), options.json);
  if (options.timeout) return run_alone(**world, options);
  io::LoopDriver driver((*world)->executor());
  Interrupt interrupt(&driver.loop());
  auto server = io::PlantServer::listen(driver.loop(), options.control, [&](const std::string& bus, std::string& why) {
    std::unique_ptr<can::Port> port = (*world)->attach_master(bus);
    std::vector<std::string> names;
    for (const auto& each : plant->buses) names.push_back(each.name);
    if (!port) why = fmt::format("the plant has no bus \"{}\", but {} (--bus)", bus, some_of(names));
    return port;
  });
  if (!server) return tell(failure(Exit::failed, server.error()), options.json);
  const std::string control = plant_control(options.control);
  const auto commands = command::ControlServer::listen(
      control, driver.loop(),
      [&](const command::Request& request, command::Reply& reply) { return answer(**world, *plant, request, reply); });
  if (!commands) return tell(failure(Exit::failed, commands.error()), options.json);
  (*world)->start();
  print_line(options.json ? Json{{"listening", options.control}, {"control", control}}.dump()
                          : fmt::format("plant {} at {}; Ctrl-C ends it", options.sim.plant, options.control));
  write_behind();
  wait_for(driver, interrupt, rt::Duration::max());
  return Exit::done;
}

}  // namespace

void add_plant(Verb& berth, Options& options) {
  const Verb plant =
      berth.add("plant", "a simulated plant: in real time for `berth up` in other processes, or by itself",
                [&options] { return run_plant(options); });
  plant.word("plant", options.sim.plant, "plant file").required().shown("PLANT");
  plant.exactly_one([&options](const Verb& how) {
    how.word("--listen", options.control, "socket that `port = \"plant:PATH\"` of a machine file names")
        .shown("SOCKET");
    how.time("--for", options.timeout, "no socket: the plant by itself, so long, as fast as possible");
  });
  plant.word("--record", options.files.record, "with --for: write every frame to this file, as candump -L does")
      .shown("FILE");
  plant.word("--machine,-m", options.machine, "machine file: bit rates of buses that the plant file gives none")
      .shown("MACHINE");
  reach_word(plant, options);
  force_word(plant, options);
  plant_words(plant, options);
  json_flag(plant, options);
  plant.footer(
      "Examples:\n  berth plant plant.toml -m machine.toml --listen /tmp/plant.sock\n"
      "  berth plant plant.toml --for \"20 s\"");
}

}  // namespace berth::cli
