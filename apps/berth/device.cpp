// `berth device`: runs devices of a plant file in real time on real ports, each as its own node.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "berth/base/counted.hpp"
#include "berth/device/storage_words.hpp"
#include "berth/io/loop_driver.hpp"
#include "berth/io/open_port.hpp"
#include "berth/plant/port_device.hpp"
#include "berth/serve/hub.hpp"
#include "interrupt.hpp"
#include "output.hpp"
#include "outputs.hpp"
#include "ports.hpp"
#include "simulated.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;
using Done = tl::expected<void, Failure>;

struct DeviceOptions {
  std::vector<std::string> ports;   ///< "PORT" or "BUS=PORT"
  std::vector<std::string> names;   ///< devices to run; empty: all that are plugged in
  std::vector<std::string> others;  ///< devices not to run
  std::optional<std::chrono::nanoseconds> duration;
  std::uint32_t bit_rate = 0;
};

constexpr rt::Duration port_check = 200ms;

/// The port of each bus. If the user names no bus, the port belongs to the only one.
using Ports = std::map<std::string, can::PortSpec>;

tl::expected<Ports, Failure> read_ports(const plant::PlantFile& plant, const Options& options,
                                        const DeviceOptions& device) {
  std::set<std::string> buses;
  for (const auto& one : plant.devices) buses.insert(one.bus);
  Ports ports;
  for (const auto& written : device.ports) {
    auto spec = port_of_word(written);
    std::string bus = options.bus;
    if (const auto equals = written.find('='); !spec && equals != std::string::npos) {
      bus = written.substr(0, equals);
      spec = port_of_word(written.substr(equals + 1));
    }
    if (!spec) return tl::unexpected(failure(Exit::usage, spec.error()));
    if (bus.empty() && buses.size() == 1) bus = *buses.begin();
    if (!buses.contains(bus)) {
      return tl::unexpected(failure(
          Exit::usage, fmt::format("--port {}: {}; the plant has devices on {}", written,
                                   bus.empty() ? "of which bus? Write BUS=PORT" : "nothing is on bus \"" + bus + "\"",
                                   fmt::join(buses, ", "))));
    }
    if (!ports.emplace(bus, *spec).second) {
      return tl::unexpected(failure(Exit::usage, fmt::format("two ports for the bus \"{}\"", bus)));
    }
  }
  return ports;
}

/// The plant's devices to run here. The user names a gateway by its device above; its devices beneath are chosen only
/// together with that one.
class Choice {
 public:
  Choice(const plant::PlantFile& plant, const Ports& ports) : plant_(plant), ports_(ports) {}

  tl::expected<std::set<std::string>, Failure> of(const DeviceOptions& wanted) {
    const auto& named = wanted.names.empty() ? wanted.others : wanted.names;
    for (const auto& name : named) {
      if (auto good = check(name); !good) return tl::unexpected(good.error());
    }
    for (const auto& name : wanted.names) {
      if (auto good = take(name); !good) return tl::unexpected(good.error());
    }
    if (!wanted.names.empty()) return chosen_;
    for (const auto& one : plant_.devices) {
      const bool out = std::ranges::find(wanted.others, one.name) != wanted.others.end();
      if (!one.plugged || out || !ports_.contains(one.bus) || above(one.name) != nullptr) continue;
      if (auto good = take(one.name); !good) return tl::unexpected(good.error());
    }
    if (chosen_.empty()) return tl::unexpected(failure(Exit::usage, "no device of the plant is plugged in there"));
    return chosen_;
  }

 private:
  /// The gateway of which this device is a port beneath; null: none.
  const plant::PlantGateway* above(const std::string& name) const {
    const auto has = [&](const auto& gateway) { return std::ranges::count(gateway.beneath, name) > 0; };
    const auto it = std::ranges::find_if(plant_.gateways, has);
    return it == plant_.gateways.end() ? nullptr : &*it;
  }
  Done check(const std::string& name) const {
    if (plant_.device(name) == nullptr) {
      std::vector<std::string_view> known;
      for (const auto& one : plant_.devices) known.push_back(one.name);
      const auto meant = text::closest(name, known);
      return tl::unexpected(failure(Exit::usage, fmt::format("the plant has no device \"{}\"{}", name,
                                                             meant.empty() ? "" : fmt::format("; {}?", meant))));
    }
    if (const auto* const gateway = above(name)) {
      return tl::unexpected(
          failure(Exit::usage, fmt::format("{} is a port of the gateway \"{}\": name that one", name, gateway->above)));
    }
    return {};
  }
  Done take(const std::string& name) {
    if (auto good = has_port(name); !good) return good;
    chosen_.insert(name);
    const auto gateway = std::ranges::find(plant_.gateways, name, &plant::PlantGateway::above);
    if (gateway == plant_.gateways.end()) return {};
    for (const auto& port : gateway->beneath) {
      if (auto good = has_port(port); !good) {
        good.error().message += fmt::format(
            "; it is a port of the gateway \"{}\": all its ports run, or, with --except \"{}\", none", name, name);
        return good;
      }
      chosen_.insert(port);
    }
    return {};
  }
  Done has_port(const std::string& name) const {
    const auto& bus = plant_.device(name)->bus;
    if (ports_.contains(bus)) return {};
    return tl::unexpected(failure(
        Exit::usage, fmt::format("{} is on the bus \"{}\", which has no port: add --port {}=PORT", name, bus, bus)));
  }

  const plant::PlantFile& plant_;
  const Ports& ports_;
  std::set<std::string> chosen_;
};

/// The ports of one bus, one per device. A serial line or a network connection is shared by all devices.
class BusPorts {
 public:
  BusPorts(io::Loop& loop, can::PortSpec spec, io::PortOptions options)
      : loop_(&loop), spec_(std::move(spec)), options_(std::move(options)) {}

  tl::expected<std::unique_ptr<can::Port>, Failure> next() {
    if (hub_) return hub_->attach();
    auto port = io::open_port(*loop_, spec_, options_);
    if (!port) return tl::unexpected(failure(Exit::failed, port.error()));
    const bool one_for_all = spec_.kind == can::PortKind::slcan || spec_.kind == can::PortKind::socketcand;
    if (!one_for_all) return std::move(*port);
    hub_ = std::make_unique<serve::Hub>(loop_->executor(), std::move(*port));
    return hub_->attach();
  }
  [[nodiscard]] std::string name() const { return can::to_string(spec_); }

 private:
  io::Loop* loop_;
  can::PortSpec spec_;
  io::PortOptions options_;
  std::unique_ptr<serve::Hub> hub_;
};

/// Prints one line per event, as text or as JSON.
class Voice final : public plant::PortDevices::Observer {
 public:
  Voice(const rt::Executor& executor, bool json) : executor_(&executor), json_(json) {}

  void device_changed(const plant::PortDevice& device) noexcept override {
    const auto& d = device.device();
    const Seen seen{device.powered(), device.powered() && !d.powered(), d.booting(), d.node_id(), d.state()};
    auto& before = seen_[device.name()];
    if (seen == before || !quiet_.empty()) return;
    before = seen;
    if (json_) {
      auto json = line("changed");
      json["device"] = device.name();
      json["node_id"] = seen.id.configured() ? Json(seen.id.value()) : Json(nullptr);
      json["state"] = seen.word();
      return print_line(json.dump());
    }
    const auto id = seen.id.configured() ? fmt::format("node-ID {:>3}", seen.id.value()) : std::string("no node-ID ");
    print_line(fmt::format("{:>10.3f} s  {:<20} {}  {}", now(), device.name(), id, seen.word()));
  }

  void state_not_kept() noexcept override {
    if (std::exchange(told_not_kept_, true)) return;
    print_error("the file of --sim-state cannot be written; what the devices store is lost at the end");
  }

  void script_told(const plant::PortDevice& device, const script::Message& told) noexcept override {
    end_run_of(told);
    if (!json_) return print_error(script_line(now(), device.name(), told));
    auto json = line("script");
    json["device"] = device.name();
    json["file"] = told.file;
    json["line"] = told.line;
    json["failed"] = told.kind != script::Message::Kind::printed;
    json["text"] = told.text;
    print_line(json.dump());
  }
  bool scripts_must_end() noexcept override { return is_ending(); }

  void started(const Options& options, const plant::PortDevices& devices,
               const std::map<std::string, std::unique_ptr<BusPorts>>& ports) {
    if (json_) {
      auto json = line("started");
      json["plant"] = options.sim.plant;
      for (const auto& d : devices.all()) {
        json["devices"].push_back({{"device", d->name()},
                                   {"bus", d->plan().bus},
                                   {"port", ports.at(d->plan().bus)->name()},
                                   {"lss_address", to_string(d->device().options().address)},
                                   {"unlike_description", device::storage_words(d->device())}});
      }
      return print_line(json.dump());
    }
    for (const auto& d : devices.all()) {
      print_line(fmt::format("{:<20} {} on {}", d->name(), to_string(d->device().options().address),
                             ports.at(d->plan().bus)->name()));
      for (const auto& words : device::storage_words(d->device())) print_line("    " + words);
    }
    print_line("Ctrl-C ends it");
  }

  void port_changed(const std::string& port, const can::Status& status) {
    const char* const word = !status.up ? "down" : status.bus_off ? "bus-off" : "up";
    if (json_) {
      auto json = line("port");
      json["port"] = port;
      json["state"] = word;
      return print_line(json.dump());
    }
    print_line(fmt::format("{:>10.3f} s  {} is {}", now(), port, word));
  }

  void ended(const plant::PortDevices& devices, bool interrupted) {
    quiet_ = "ended";
    if (!json_) {
      for (const auto& d : devices.all()) {
        const auto lost = d->port_status().lost + d->lost();
        if (lost > 0) print_line(fmt::format("{}: {} received and lost", d->name(), counted(lost, "frame")));
      }
      return;
    }
    auto json = line("ended");
    json["why"] = interrupted ? "signal" : "time";
    for (const auto& d : devices.all()) {
      const auto id = d->device().node_id();
      json["devices"].push_back({{"device", d->name()},
                                 {"node_id", id.configured() ? Json(id.value()) : Json(nullptr)},
                                 {"state", name(d->device().state())},
                                 {"lost", d->lost()},
                                 {"lost_by_port", d->port_status().lost}});
    }
    print_line(json.dump());
  }

 private:
  struct Seen {
    bool powered = false;
    bool waiting = false;  // a gateway waits for its buses beneath
    bool booting = false;
    NodeId id;
    NmtState state = NmtState::initialising;
    friend bool operator==(const Seen&, const Seen&) = default;
    [[nodiscard]] std::string word() const {
      return !powered ? "off" : waiting ? "waits" : booting ? "boots" : name(state);
    }
  };
  [[nodiscard]] double now() const {
    return std::chrono::duration<double>(executor_->now().time_since_epoch()).count();
  }
  [[nodiscard]] Json line(const char* event) const { return {{"event", event}, {"at_s", now()}}; }

  const rt::Executor* executor_;
  bool json_;
  bool told_not_kept_ = false;
  std::string quiet_;
  std::map<std::string, Seen> seen_;
};

/// Reports when a port goes down or comes back.
class PortWatch {
 public:
  PortWatch(const plant::PortDevices& devices, const std::map<std::string, std::unique_ptr<BusPorts>>& ports,
            Voice& voice)
      : ports_(&ports), voice_(&voice) {
    for (const auto& d : devices.all()) first_.try_emplace(d->plan().bus, d.get());
    for (const auto& [bus, d] : first_) was_[bus] = state(*d);
  }
  void look(rt::Time now) {
    if (now < due_) return;
    due_ = now + port_check;
    for (const auto& [bus, d] : first_) {
      if (std::exchange(was_[bus], state(*d)) != state(*d))
        voice_->port_changed(ports_->at(bus)->name(), d->port_status());
    }
  }

 private:
  static std::pair<bool, bool> state(const plant::PortDevice& device) {
    const auto status = device.port_status();
    return {status.up, status.bus_off};
  }
  const std::map<std::string, std::unique_ptr<BusPorts>>* ports_;
  Voice* voice_;
  std::map<std::string, const plant::PortDevice*> first_;
  std::map<std::string, std::pair<bool, bool>> was_;
  rt::Time due_{};
};

struct Household {
  explicit Household(bool json) : voice(executor, json), devices(executor, &voice) {}
  rt::Executor executor;
  io::LoopDriver driver{executor, port_check};
  Voice voice;
  std::map<std::string, std::unique_ptr<BusPorts>> ports;
  plant::PortDevices devices;
};

Done fill(Household& house, const plant::PlantFile& plant, const Ports& ports, const std::set<std::string>& chosen,
          const DeviceOptions& options, bool as_json) {
  for (const auto& [bus, spec] : ports) {
    house.ports[bus] = std::make_unique<BusPorts>(house.driver.loop(), spec,
                                                  io::PortOptions{.bit_rate = options.bit_rate, .bus = bus});
  }
  Random seeds(plant.seed);
  Findings findings;
  for (const auto& plan : plant.devices) {
    const auto random = seeds.fork();  // taken for every device, so that the choice does not change it
    if (!chosen.contains(plan.name)) continue;
    auto port = house.ports.at(plan.bus)->next();
    if (!port) return tl::unexpected(port.error());
    const auto* const bus = plant.bus(plan.bus);
    const auto own = (*port)->status().bit_rate;
    house.devices.add(plan, std::move(*port), own != 0 || bus == nullptr ? own : bus->bitrate, random, findings,
                      plant.gateway_part(plan.name));
  }
  if (has_errors(findings)) return tl::unexpected(failure(findings));
  for (const auto& gateway : plant.gateways) {
    if (chosen.contains(gateway.above) && !house.devices.add_gateway(gateway, plant, findings)) break;
  }
  if (has_errors(findings)) return tl::unexpected(failure(findings));
  warn(findings, as_json);
  return {};
}

int run_device(const Options& options, const DeviceOptions& wanted) {
  const auto plant = load_plant(options.sim.plant, options);
  if (!plant) return tell(plant.error(), options.json);
  const auto ports = read_ports(*plant, options, wanted);
  if (!ports) return tell(ports.error(), options.json);
  const auto chosen = Choice(*plant, *ports).of(wanted);
  if (!chosen) return tell(chosen.error(), options.json);

  Household house(options.json);
  Interrupt interrupt(&house.driver.loop());
  if (const auto filled = fill(house, *plant, *ports, *chosen, wanted, options.json); !filled) {
    return tell(filled.error(), options.json);
  }
  if (!options.sim.state.empty()) {
    if (const auto bad = may_keep(options.sim.state, "--sim-state")) return tell(*bad, options.json);
    const auto kept = house.devices.keep_state(options.sim.state);
    if (!kept)
      return tell(failure(Exit::failed, fmt::format("{}: {}", options.sim.state, describe(kept.error()))),
                  options.json);
  }
  house.voice.started(options, house.devices, house.ports);
  for (const auto& device : house.devices.all()) device->power(true);
  PortWatch watch(house.devices, house.ports, house.voice);
  const auto look = [&] {
    watch.look(house.driver.now());
    return false;
  };
  write_behind();
  wait_until(house.driver, interrupt, look, wanted.duration.value_or(rt::Duration::max()));
  house.voice.ended(house.devices, interrupt.came());
  for (const auto& device : house.devices.all()) device->power(false);
  return Exit::done;
}

}  // namespace

void add_device(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<DeviceOptions>();
  const Verb device = berth.add("device", "devices of a plant file on a real port, in real time",
                                [&options, wanted] { return run_device(options, *wanted); });
  device.word("plant", options.sim.plant, "plant file").required().shown("PLANT");
  device.word("--port", wanted->ports, "port that the plant's bus is, or BUS=PORT")
      .required()
      .one_each()
      .shown("[BUS=]PORT");
  const auto names =
      device.word("--device", wanted->names, "these alone (default: all that are plugged in at the start)")
          .one_each()
          .shown("NAME");
  device.word("--except", wanted->others, "all that are plugged in but these").one_each().excludes(names).shown("NAME");
  device.word("--bus", options.bus, "bus of --port, where the plant has several").shown("NAME");
  device.word("--bitrate", wanted->bit_rate, "bit/s to set the interface to (default: as it stands)").shown("BIT/S");
  reach_word(device, options);
  plant_words(device, options);
  device.time("--for", wanted->duration, "end after this time (default: Ctrl-C)");
  json_flag(device, options, "one JSON object a line");
  real_time_word(device, options);
  device.footer(
      "The plant file's events and its wire settings have no effect on a real port.\n"
      "Examples:\n  berth device plant.toml --port socketcan:vcan0\n"
      "  berth device plant.toml --port can0 --device left --sim-state left.state\n"
      "  berth device plant.toml --port up=can0 --port down=can1 --device gateway");
}

}  // namespace berth::cli
