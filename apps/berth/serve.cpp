// `berth serve`: offers buses to other programs by socketcand over TCP: those of a simulated plant in real time, those
// of a machine file, or single ports.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/design/machine.hpp"
#include "berth/io/loop_driver.hpp"
#include "berth/io/open_port.hpp"
#include "berth/io/socketcand_protocol.hpp"
#include "berth/serve/hub.hpp"
#include "berth/serve/socketcand_server.hpp"
#include "interrupt.hpp"
#include "listening.hpp"
#include "machine_file.hpp"
#include "output.hpp"
#include "ports.hpp"
#include "simulated.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
using Done = tl::expected<void, Failure>;

struct ServeOptions {
  std::string plant;               ///< plant file; empty: real ports
  std::vector<std::string> ports;  ///< "NAME=PORT" or "PORT"
  std::string listen = "127.0.0.1:29536";
  std::optional<std::chrono::nanoseconds> duration;
  std::uint32_t bit_rate = 0;
  bool anywhere = false;
  bool listen_only = false;
};

/// "can1" and "vcan1" mean the second bus: socketcand's clients often ask for such names.
std::optional<std::size_t> number_of(std::string_view name) {
  if (name.starts_with('v')) name.remove_prefix(1);
  if (!name.starts_with("can")) return std::nullopt;
  name.remove_prefix(3);
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (error != std::errc{} || end != name.data() + name.size()) return std::nullopt;
  return number;
}

/// The offered buses. Each client gets a node on the bus that it asks for.
class Buses {
 public:
  virtual ~Buses() = default;
  /// In the order of their numbers; no name occurs twice.
  [[nodiscard]] const std::vector<std::string>& names() const noexcept { return names_; }
  [[nodiscard]] io::LoopDriver& driver() noexcept { return *driver_; }
  virtual void start() {}
  std::unique_ptr<can::Port> attach(const std::string& asked, std::string& why) {
    const bool known = std::ranges::find(names_, asked) != names_.end();
    const auto number = known ? std::nullopt : number_of(asked);
    if (known || (number && *number < names_.size())) return node(known ? asked : names_[*number]);
    why = fmt::format("there is none of this name, but {}", fmt::join(names_, ", "));
    return nullptr;
  }

 protected:
  virtual std::unique_ptr<can::Port> node(const std::string& bus) = 0;
  std::vector<std::string> names_;
  std::unique_ptr<io::LoopDriver> driver_;
};

class PlantBuses final : public Buses {
 public:
  PlantBuses(std::unique_ptr<plant::World> world, bool listen_only)
      : world_(std::move(world)), listen_only_(listen_only) {
    driver_ = std::make_unique<io::LoopDriver>(world_->executor());
    for (const auto& bus : world_->sim().buses()) names_.push_back(bus->name());
  }
  void start() override { world_->start(); }

 private:
  std::unique_ptr<can::Port> node(const std::string& bus) override {
    sim::ControllerOptions options;
    options.listen_only = listen_only_;
    options.fd = world_->bus(bus)->fd();
    return world_->attach_master(bus, options);
  }
  std::unique_ptr<plant::World> world_;
  bool anywhere = false;
  bool listen_only_;
};

class PortBuses final : public Buses {
 public:
  PortBuses() { driver_ = std::make_unique<io::LoopDriver>(executor_); }
  Done add(const std::string& name, const can::PortSpec& spec, const io::PortOptions& options) {
    if (std::ranges::find(names_, name) != names_.end()) {
      return tl::unexpected(
          failure(Exit::usage, fmt::format("two ports are called {}: write one as NAME={}", name, to_string(spec))));
    }
    auto port = io::open_port(driver_->loop(), spec, options);
    if (!port) return tl::unexpected(failure(Exit::failed, port.error()));
    hubs_[name] = std::make_unique<serve::Hub>(executor_, std::move(*port));
    names_.push_back(name);
    return {};
  }

 private:
  std::unique_ptr<can::Port> node(const std::string& bus) override { return hubs_.at(bus)->attach(); }
  rt::Executor executor_;
  std::map<std::string, std::unique_ptr<serve::Hub>> hubs_;
};

using Made = tl::expected<std::unique_ptr<Buses>, Failure>;

Made plant_buses(const Options& options, const ServeOptions& serve) {
  const auto plant = load_plant(serve.plant, options);
  if (!plant) return tl::unexpected(plant.error());
  const auto rates = bus_rates(options);
  if (!rates) return tl::unexpected(rates.error());
  auto world = make_world(*plant, *rates, serve.plant, options);
  if (!world) return tl::unexpected(world.error());
  return std::make_unique<PlantBuses>(std::move(*world), serve.listen_only);
}

/// The default name of a port's bus: its interface, or its name on its server.
std::string bus_name_of(const can::PortSpec& spec) {
  if (spec.kind == can::PortKind::socketcan) return spec.address;
  if (spec.kind == can::PortKind::socketcand) return spec.address.substr(spec.address.find('/') + 1);
  return "can0";
}

Done add_port(PortBuses& buses, const std::string& written, const ServeOptions& serve) {
  auto equals = written.find('=');
  auto spec = port_of_word(written);
  if (spec) equals = std::string::npos;  // the "=" belongs to the port, such as a device's path
  if (!spec && equals != std::string::npos) spec = port_of_word(written.substr(equals + 1));
  if (!spec) return tl::unexpected(failure(Exit::usage, spec.error()));
  const auto name = equals == std::string::npos ? bus_name_of(*spec) : written.substr(0, equals);
  return buses.add(name, *spec, {.bit_rate = serve.bit_rate, .listen_only = serve.listen_only, .bus = name});
}

Done add_machine(PortBuses& buses, const Options& options, const ServeOptions& serve) {
  const auto machine = design::load_machine(options.machine, options.files.allow_outside);
  if (!machine.machine) return tl::unexpected(failure(machine.findings));
  for (const auto& bus : machine.machine->buses) {
    if (bus.port.kind == can::PortKind::sim) {
      return tl::unexpected(failure(
          Exit::usage, fmt::format("{}:{}: bus {} is simulated: give the plant file: berth serve PLANT --machine {}",
                                   machine.machine->file, bus.place.line, bus.name, options.machine)));
    }
    auto added =
        buses.add(bus.name, bus.port, {.bit_rate = bus.bitrate, .listen_only = serve.listen_only, .bus = bus.name});
    if (!added) return added;
  }
  return {};
}

Made port_buses(const Options& options, const ServeOptions& serve) {
  auto buses = std::make_unique<PortBuses>();
  for (const auto& port : serve.ports) {
    if (auto added = add_port(*buses, port, serve); !added) return tl::unexpected(added.error());
  }
  if (serve.ports.empty()) {
    if (auto added = add_machine(*buses, options, serve); !added) return tl::unexpected(added.error());
  }
  return buses;
}

void tell_counters(const serve::ServerCounters& c, bool json) {
  if (json) {
    print_line(Json{{"clients", c.clients},
                    {"too_slow", c.too_slow},
                    {"misbehaved", c.misbehaved},
                    {"frames_out", c.frames_out},
                    {"frames_in", c.frames_in},
                    {"not_sent", c.not_sent},
                    {"unspeakable", c.unspeakable},
                    {"malformed", c.malformed}}
                   .dump());
    return;
  }
  print_line(fmt::format("{}, {} to them, {} from them", counted(c.clients, "client"), counted(c.frames_out, "frame"),
                         c.frames_in));
  if (c.too_slow > 0) print_line(fmt::format("{} disconnected because they read too slowly", c.too_slow));
  if (c.misbehaved > 0) print_line(fmt::format("{} disconnected because of what they sent", c.misbehaved));
  if (c.not_sent > 0) print_line(fmt::format("{} frames that the bus did not take", c.not_sent));
  if (c.unspeakable > 0)
    print_line(fmt::format("{} remote and FD frames, which socketcand cannot carry", c.unspeakable));
  if (c.malformed > 0) print_line(fmt::format("{} commands with wrong arguments", c.malformed));
}

/// If the user names nothing, the folder's machine file is used. A machine file named as the plant is one, too.
void complete(Options& options, ServeOptions& serve) {
  if (serve.plant.empty() && serve.ports.empty()) options.machine = default_machine(options);
  if (options.machine.empty() && is_machine_file(serve.plant)) std::swap(options.machine, serve.plant);
}

int run_serve(Options options, ServeOptions serve) {
  complete(options, serve);
  const auto where = may_listen({.option = "--listen",
                                 .where = serve.listen,
                                 .default_port = io::socketcand_port,
                                 .anywhere = serve.anywhere,
                                 .may = serve.listen_only ? "hear every frame of the buses"
                                                          : "hear and send every frame of the buses, as a node can"});
  if (!where) return tell(where.error(), options.json);
  if (serve.plant.empty() && serve.ports.empty() && options.machine.empty()) {
    return tell(failure(Exit::usage, "what is to be served? Give a plant file, --port PORT, or --machine FILE"),
                options.json);
  }
  auto buses = serve.plant.empty() ? port_buses(options, serve) : plant_buses(options, serve);
  if (!buses) return tell(buses.error(), options.json);
  io::LoopDriver& driver = (*buses)->driver();
  Interrupt interrupt(&driver.loop());
  serve::ServerOptions server_options;
  server_options.tell = [json = options.json](const std::string& text) {
    print_line(json ? Json{{"client", text}}.dump() : text);
  };
  auto server = serve::SocketcandServer::listen(
      driver.loop(), *where, [&](const std::string& bus, std::string& why) { return (*buses)->attach(bus, why); },
      std::move(server_options));
  if (!server) return tell(failure(Exit::failed, server.error()), options.json);
  (*buses)->start();
  const auto address = io::to_string((*server)->where());
  if (options.json) {
    print_line(Json{{"listening", address}, {"buses", Json((*buses)->names())}}.dump());
  } else {
    for (const auto& name : (*buses)->names()) print_line(fmt::format("socketcand://{}/{}", address, name));
  }
  write_behind();
  wait_for(driver, interrupt, serve.duration.value_or(rt::Duration::max()));
  tell_counters((*server)->counters(), options.json);
  return Exit::done;
}

}  // namespace

void add_serve(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<ServeOptions>();
  const Verb serve = berth.add("serve", "offer buses to other programs by socketcand (python-can, another Berth)",
                               [&options, wanted] { return run_serve(options, *wanted); });
  serve.footer(
      "Examples:\n  berth serve plant.toml -m machine.toml\n  berth serve machine.toml\n"
      "  berth serve --port slcan:/dev/ttyACM0 --bitrate 125000\n"
      "  berth serve --port socketcan:can0 --listen 0.0.0.0 --listen-anywhere\n"
      "  berth serve --port backbone=plant:/tmp/plant.sock\n"
      "Clients: a machine file's port = \"socketcand://127.0.0.1:29536/BUS\"; python-can:\n"
      "  can.Bus(interface=\"socketcand\", host=\"127.0.0.1\", port=29536, channel=\"BUS\")\n"
      "can0 is the first bus, can1 the second.");
  const Word plant = serve.word("plant", wanted->plant, "plant file: its buses, simulated in real time").shown("PLANT");
  serve
      .word("--machine,-m", options.machine,
            "machine file: with PLANT the bit rates of its buses; alone, or in PLANT's place: its buses' own ports "
            "(default: berth.toml, or the only one of the folder)")
      .shown("MACHINE");
  reach_word(serve, options);
  serve.word("--port", wanted->ports, "this port, as PORT or NAME=PORT; as often as wanted")
      .shown("[NAME=]PORT")
      .one_each()
      .excludes(plant);
  serve.word("--bitrate", wanted->bit_rate, "bit rate of the ports").shown("BIT/S");
  serve.word("--listen", wanted->listen, "where to listen (default 127.0.0.1:29536; port 0: any that is free)")
      .shown("HOST:PORT");
  anywhere_flag(serve, wanted->anywhere);
  serve.flag("--listen-only", wanted->listen_only, "clients hear and cannot send");
  serve.time("--for", wanted->duration, "end after this time");
  plant_words(serve, options);
  json_flag(serve, options, "JSON objects, one per line");
  real_time_word(serve, options);
}

}  // namespace berth::cli
