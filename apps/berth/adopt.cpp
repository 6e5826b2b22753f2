// `berth adopt`: makes the machine file and the bindings of a running machine, without disturbing it.
#include "adopt.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "berth/base/counted.hpp"
#include "berth/live/census.hpp"
#include "berth/store/database.hpp"
#include "berth/text/quantity.hpp"
#include "interrupt.hpp"
#include "machine_run.hpp"
#include "outputs.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

/// What was learnt about one bus.
struct Learnt {
  std::string bus;
  std::vector<live::NodeSeen> nodes;
  std::vector<std::string> master;  // its masters: verdict and evidence
  NodeId master_id;
  rt::Duration sync{0};
  std::uint64_t frames = 0;
};

std::string slot_name(const live::NodeSeen& node, std::set<std::string>& taken) {
  std::string name = node.name;
  std::ranges::replace_if(
      name, [](char c) { return c == '/' || c == '{' || c == '}' || c == '"' || c == '\\'; }, '-');
  if (name.empty()) name = fmt::format("node {}", node.id.value());
  if (!taken.insert(name).second) {
    name += fmt::format(" {}", node.id.value());
    taken.insert(name);
  }
  return name;
}

std::string remarks(const live::NodeSeen& node) {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  if (node.device_type) add(fmt::format("device type 0x{:08X}", *node.device_type));
  if (!node.hardware.empty()) add("hardware " + node.hardware);
  if (!node.software.empty()) add("software " + node.software);
  if (node.period.count() > 0) {
    add("heartbeat every " + text::write_duration(std::chrono::round<std::chrono::milliseconds>(node.period)));
  }
  if (node.guarded) add("guarded by its master");
  if (node.nmt_master) add("an NMT master by its 1F80h");
  if (node.state) add(berth::name(*node.state));
  return text;
}

// The slots' heartbeat period, if all agree within a tenth; else none, so that the default applies.
std::optional<std::chrono::milliseconds> common_period(const std::vector<live::NodeSeen>& nodes, NodeId master) {
  std::vector<rt::Duration> periods;
  for (const auto& node : nodes) {
    if (node.id != master && node.period.count() > 0) periods.push_back(node.period);
  }
  if (periods.empty()) return std::nullopt;
  const auto [low, high] = std::ranges::minmax(periods);
  const auto period = std::chrono::round<std::chrono::milliseconds>(high);
  if (high - low > high / 10 || period < 1ms || period > 20s) return std::nullopt;
  return period;
}

// Adds `assign = "fixed"` for a device without a serial number: only its node-ID distinguishes it from its equals.
std::string type_of(const Identity& device) {
  if (!device.knows(0)) return "type = \"any\"\n";
  std::string text = fmt::format("type = {{ vendor = 0x{:08X}", device.address.vendor);
  if (device.knows(1)) text += fmt::format(", product = 0x{:08X}", device.address.product);
  if (device.knows(2)) text += fmt::format(", revision = 0x{:08X}", device.address.revision);
  return text + (device.has_serial() ? " }\n" : " }\nassign = \"fixed\"\n");
}

struct Seated {
  std::string name;
  places::Assignment seat;
};

std::string machine_text(const Learnt& learnt, const design::Bus& bus, const AdoptOptions& adopt,
                         std::vector<Seated>& seats) {
  std::string text =
      fmt::format("# Written by `berth adopt` from what was heard and read on {}. Check it before use.\n",
                  can::to_string(bus.port));
  text += fmt::format("[machine]\nname = \"{}\"\n\n[bus.\"{}\"]\nport    = \"{}\"\nbitrate = {}\n", adopt.name,
                      bus.name, can::to_string(bus.port), bus.bitrate);
  for (const auto& line : learnt.master) text += "# " + line + "\n";
  if (learnt.master_id.configured()) text += fmt::format("master_id = {}\n", learnt.master_id.value());
  if (learnt.sync.count() > 0) {
    text += fmt::format("# SYNC every {:.1f} ms. When one of the devices produces it: tolerate = [\"sync\"]\n",
                        std::chrono::duration<double, std::milli>(learnt.sync).count());
  }
  if (const auto period = common_period(learnt.nodes, learnt.master_id)) {
    text += fmt::format("\n[bus.\"{}\".timing]\nheartbeat_period = \"{} ms\"\n", bus.name, period->count());
  }
  std::set<std::string> taken;
  for (const auto& node : learnt.nodes) {
    if (node.id == learnt.master_id) continue;
    if (!node.identity) {
      text += fmt::format("\n# node-ID {}: {}; write its [[slot]] by hand\n", node.id.value(),
                          node.problem.empty() ? "it was not asked for its identity" : node.problem);
      continue;
    }
    const std::string name = slot_name(node, taken);
    const auto& device = *node.identity;
    const std::string number =
        device.has_serial() ? fmt::format("serial number 0x{:08X}", device.address.serial) : "no serial number";
    text += fmt::format("\n# {}\n# {}\n[[slot]]\nbus  = \"{}\"\nid   = {}\nname = \"{}\"\n{}", remarks(node), number,
                        bus.name, node.id.value(), name, type_of(device));
    seats.push_back({name, {device, node.id}});
  }
  return text;
}

Result<void> write_seat(places::SlotStore& store, const std::string& machine, const std::string& bus,
                        const Seated& seated) {
  const auto slot = store.declare({machine, bus, seated.name});
  if (!slot) return fail(slot.error());
  const auto asked = store.ask(*slot, seated.seat, "adopted");
  if (!asked) return asked;
  return store.confirm(*slot, seated.seat, "adopted: it was heard and read there");
}

tl::expected<void, Failure> write_store(const std::string& path, const std::string& machine, const std::string& bus,
                                        const std::vector<Seated>& seats) {
  auto opened = store::Database::open(path, {.ended = ended_by({})});
  if (!opened) return tl::unexpected(failure(Exit::failed, opened.error().message));
  for (const auto& seated : seats) {
    const auto written = write_seat(**opened, machine, bus, seated);
    if (!written) return tl::unexpected(failure(Exit::failed, path + ": " + describe(written.error())));
  }
  return {};
}

rt::Task<void> ask_all(live::Census& census, live::CensusOptions options, std::string& problem, bool& over) {
  const auto asked = co_await census.ask(options);
  if (!asked) problem = describe(asked.error());
  over = true;
}

// A master may send only its heartbeat, and command no node, while Berth listens: only its objects show it.
void name_quiet_master(Learnt& learnt) {
  for (const auto& node : learnt.nodes) {
    if (!node.nmt_master || learnt.master_id.configured()) continue;
    learnt.master_id = node.id;
    learnt.master.push_back(
        fmt::format("node {} is an NMT master: bit 0 of its 1F80h is set{}; it sent no command while Berth listened",
                    node.id.value(), node.network_list ? ", and it has a network list (1F81h)" : std::string()));
  }
}

tl::expected<Learnt, Failure> learn(MachineRun& run, const Options& options, const AdoptOptions& adopt) {
  const design::Bus& bus = run.machine().buses.front();
  auto& dispatcher = run.session().network(bus.name)->services().dispatcher;
  live::Census census(dispatcher);
  Interrupt& interrupt = run.interrupt();
  wait_for(run.driver(), interrupt, adopt.listen);
  // The gate listens for its own time before it passes a request.
  if (const auto heard = run.strangers().listen_first(); !heard && !adopt.passive) {
    return tl::unexpected(heard.error());
  }
  const live::Gate& gate = *run.guards().gate(bus.name);
  if (gate.state() == live::GateState::down) {
    return tl::unexpected(failure(Exit::failed, fmt::format("bus {}: {} is down", bus.name, can::to_string(bus.port))));
  }
  Learnt learnt;
  learnt.bus = bus.name;
  learnt.master = gate.report();
  if (gate.watch().foreign()) learnt.master_id = gate.watch().probably();
  if (adopt.master != 0) learnt.master_id = NodeId(static_cast<std::uint8_t>(adopt.master));
  if (!learnt.master.empty() && !learnt.master_id.configured()) {
    learnt.master.emplace_back(
        "Berth could not find out which node it is: if it is among the slots, remove it (--master ID)");
  }
  if (!adopt.passive) {
    std::string problem;
    live::CensusOptions ask;
    ask.everybody = adopt.everybody;
    ask.own = learnt.master_id;
    ask.client_gone = std::min<rt::Duration>(ask.client_gone, adopt.listen);
    bool over = false;
    rt::Scope scope(run.driver().executor());
    scope.spawn(ask_all(census, ask, problem, over));
    wait_until(
        run.driver(), interrupt, [&] { return over; }, options.timeout.value_or(10min));
    if (interrupt.came()) return tl::unexpected(failure(Exit::no, "ended before all were asked; nothing was written"));
    if (!problem.empty()) return tl::unexpected(failure(Exit::failed, fmt::format("bus {}: {}", bus.name, problem)));
  }
  learnt.nodes = census.nodes();
  name_quiet_master(learnt);
  learnt.sync = census.sync_period();
  learnt.frames = census.frames();
  return learnt;
}

Json json_of(const live::NodeSeen& node) {
  Json json{{"id", node.id.value()}, {"heartbeats", node.beats}, {"guarded", node.guarded}};
  if (node.period.count() > 0) json["heartbeat_s"] = std::chrono::duration<double>(node.period).count();
  if (node.state) json["state"] = berth::name(*node.state);
  if (node.identity) json["address"] = to_string(*node.identity);
  if (!node.name.empty()) json["name"] = node.name;
  if (!node.problem.empty()) json["problem"] = node.problem;
  json["other_sdo_client"] = node.foreign_client;
  json["nmt_master"] = node.nmt_master;
  return json;
}

void report(const Learnt& learnt, const std::vector<Seated>& seats, const std::string& file, const std::string& store,
            bool json) {
  Json all{{"machine_file", seats.empty() ? Json(nullptr) : Json(file)},
           {"store", seats.empty() ? Json(nullptr) : Json(store)},
           {"slots", seats.size()},
           {"frames_heard", learnt.frames},
           {"master", learnt.master}};
  all["nodes"] = Json::array();
  for (const auto& node : learnt.nodes) all["nodes"].push_back(json_of(node));
  if (json) return print_text(all.dump(2));
  for (const auto& line : learnt.master) print_line(line);
  for (const auto& node : learnt.nodes) {
    print_line(fmt::format("{:>3}  {:<35}  {}{}", node.id.value(),
                           node.identity ? to_string(*node.identity) : "(does not report its identity)", node.name,
                           node.problem.empty() ? "" : "  " + node.problem));
  }
  if (!seats.empty()) print_line(fmt::format("{}: {}, bindings in {}", counted(seats.size(), "slot"), file, store));
}

std::string seed_machine(const Options& options, const AdoptOptions& adopt) {
  return fmt::format("[machine]\nname = \"{}\"\n[bus.\"{}\"]\nport = \"sim\"\nbitrate = {}\nrole = \"commissioner\"\n",
                     adopt.name, options.bus, adopt.bitrate);
}

// Removes the new files: left behind, they would block the next adoption.
void take_back(const std::string& file, const std::string& store) {
  std::error_code ignored;
  for (const auto& path : {file, store, store + "-wal"}) fs::remove(path, ignored);
}

std::optional<std::string> problem_with(const std::string& file, const std::string& store) {
  for (const auto& path : {file, store}) {
    if (fs::exists(path)) return path + " is there already; adopt overwrites nothing: name another file";
  }
  return std::nullopt;
}

}  // namespace

int run_adopt(const Options& wanted, const AdoptOptions& adopt) {
  Options options = wanted;
  if (options.bus.empty()) options.bus = "field";
  if (options.ports.size() != 1) {
    return tell(failure(Exit::usage, "name the port of the bus: --port socketcan:can0"), options.json);
  }
  const std::string store = options.store.file.empty() ? default_store(adopt.file) : options.store.file;
  if (const auto problem = problem_with(adopt.file, store)) return tell(failure(Exit::no, *problem), options.json);
  options.store.used = false;
  options.store.file.clear();
  options.outside.observe = adopt.passive;
  options.outside.read_only = true;
  const std::string seed = seed_machine(options, adopt);
  auto made = MachineRun::make(options, {adopt.file, {}, seed, {}});
  if (!made) return tell(made.error(), options.json);
  MachineRun& run = **made;
  const auto learnt = learn(run, options, adopt);
  if (!learnt) return tell(learnt.error(), options.json);
  std::vector<Seated> seats;
  const std::string text = machine_text(*learnt, run.machine().buses.front(), adopt, seats);
  if (seats.empty()) {
    report(*learnt, seats, adopt.file, store, options.json);
    if (options.json) return Exit::no;
    return tell(failure(Exit::no, adopt.passive ? "listening alone does not show the identity of a device, so no slot "
                                                  "can be written; without --passive devices are asked by SDO"
                                  : learnt->nodes.empty() && !adopt.everybody
                                      ? "no device was heard, so none was asked; --all asks every node-ID"
                                      : "no device reported its identity; nothing was written"),
                false);
  }
  const auto checked = design::read_machine(text, adopt.file, {});
  if (!checked.machine) return tell(failure(checked.findings), options.json);
  if (const auto written = write_output(adopt.file, text)) return tell(*written, options.json);
  if (const auto good = write_store(store, adopt.name, learnt->bus, seats); !good) {
    take_back(adopt.file, store);
    return tell(good.error(), options.json);
  }
  report(*learnt, seats, adopt.file, store, options.json);
  return Exit::done;
}

}  // namespace berth::cli
