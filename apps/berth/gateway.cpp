// `berth gateway`: the buses of a machine, real or simulated in real time, for scripts and tools that speak CiA 309-3.
#include "gateway.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/operate/report.hpp"
#include "interrupt.hpp"
#include "listening.hpp"
#include "machine_file.hpp"
#include "output.hpp"
#include "verbs.hpp"

namespace berth::cli {

using Json = nlohmann::ordered_json;

GatewayRights gateway_rights(const Options& options) noexcept {
  const bool commands = options.offers.gateway.commands;
  return {commands, commands && options.yes, options.offers.gateway.anywhere};
}

tl::expected<io::Endpoint, Failure> gateway_endpoint(const std::string& option, const std::string& where,
                                                     GatewayRights rights) {
  const char* const may =
      rights.confirmed  ? "command the machine (NMT, SDO download, PDO, LSS) and disturb devices that are operational"
      : rights.commands ? "command the machine (NMT, SDO download, PDO, LSS)"
                        : "read every object of its devices, and command them where the buses are simulated";
  return may_listen({.option = option,
                     .where = where,
                     .default_port = serve::cia309::default_port,
                     .anywhere = rights.anywhere,
                     .may = may});
}

tl::expected<std::unique_ptr<GatewayHost>, Failure> GatewayHost::listen(MachineRun& run, const io::Endpoint& where,
                                                                        GatewayRights rights,
                                                                        std::function<void(const std::string&)> say) {
  std::unique_ptr<GatewayHost> host(new GatewayHost);
  serve::cia309::ServerOptions options;
  options.commands = rights.commands;
  options.confirmed = rights.confirmed;
  options.tell = std::move(say);
  auto server = serve::cia309::Server::listen(*run.loop(), where, run.session(), std::move(options));
  if (!server) return tl::unexpected(failure(Exit::failed, server.error()));
  host->server_ = std::move(*server);
  return host;
}

namespace {

struct GatewayOptions {
  std::string listen = "127.0.0.1:7000";
  std::optional<std::chrono::nanoseconds> duration;
  bool commands = false;
  bool anywhere = false;
};

void announce(const GatewayHost& host, const design::Machine& machine, bool json) {
  if (json) {
    Json line{{"listening", host.where()}, {"nets", Json::array()}};
    for (const auto& bus : machine.buses) line["nets"].push_back(bus.name);
    return print_line(line.dump());
  }
  print_line("CiA 309-3 gateway at " + host.where());
  unsigned net = 0;
  for (const auto& bus : machine.buses) print_line(fmt::format("net {} is bus {}", ++net, bus.name));
}

void tell_counters(const serve::cia309::Counters& c, bool json) {
  if (json) {
    return print_line(Json{
        {"clients", c.clients},
        {"too_slow", c.too_slow},
        {"too_many", c.too_many},
        {"silent", c.silent},
        {"strange", c.strange},
        {"lines",
         c.lines}}.dump());
  }
  print_line(counted(c.clients, "client") + ", " + counted(c.lines, "line"));
  if (c.too_slow > 0) print_line(fmt::format("{} disconnected because they read too slowly", c.too_slow));
  if (c.silent > 0) print_line(fmt::format("{} disconnected because they were silent", c.silent));
  if (c.strange > 0) print_line(fmt::format("{} disconnected because they did not begin with a command", c.strange));
  if (c.too_many > 0) print_line(fmt::format("{} disconnected because there were too many", c.too_many));
}

int run_gateway(const Options& wanted, const GatewayOptions& gateway) {
  Options options = wanted;
  options.sim.pace = true;
  if (options.machine.empty()) {
    Options here = wanted;  // a port does not replace the machine file
    here.ports.clear();
    options.machine = default_machine(here);
  }
  if (options.machine.empty()) {
    return tell(failure(Exit::usage, "name the machine file: berth gateway machine.toml"), options.json);
  }
  const GatewayRights rights{gateway.commands || options.yes, options.yes, gateway.anywhere};
  const auto where = gateway_endpoint("--listen", gateway.listen, rights);
  if (!where) return tell(where.error(), options.json);
  auto made = MachineRun::make(options, {options.machine, options.sim.plant, {}, {}});
  if (!made) return tell(made.error(), options.json);
  MachineRun& run = **made;
  Interrupt& interrupt = run.interrupt();
  const auto say = [&](const std::string& text) {
    print_line(options.json ? Json{{"event", text}}.dump(-1, ' ', false, Json::error_handler_t::replace) : text);
  };
  run.session().on_event([&](const operate::Event& event) { say(operate::to_line(event)); });
  if (const auto clear = run.strangers().listen_first(); !clear) return tell(clear.error(), options.json);
  auto host = GatewayHost::listen(run, *where, rights, say);
  if (!host) return tell(host.error(), options.json);
  announce(**host, run.machine(), options.json);
  run.power_on();
  const auto records = [&run] {
    run.record().settle();
    return false;
  };
  wait_until(run.driver(), interrupt, records, gateway.duration.value_or(rt::Duration::max()));
  tell_counters((*host)->counters(), options.json);
  run.session().on_event({});
  host->reset();
  return run.record().finish(Exit::done);
}

}  // namespace

void add_gateway(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<GatewayOptions>();
  const Verb gateway = berth.add("gateway", "the machine's buses for scripts and tools by CiA 309-3 (ASCII) over TCP",
                                 [&options, wanted] { return run_gateway(options, *wanted); });
  gateway.footer(
      "Examples:\n  berth gateway machine.toml --sim plant.toml\n  berth gateway machine.toml --listen 127.0.0.1:7000\n"
      "  printf '[1] 1 5 read 0x1000 0 u32\\n' | nc -N 127.0.0.1 7000\n"
      "Net 1 is the first bus of the machine file. There is no password. On real buses\nclients may only read unless "
      "--commands is given. Beside the main job:\n  berth up machine.toml --gateway 127.0.0.1:7000\n"
      "docs/gateway.md has the commands.");
  machine_word(gateway, options);
  machine_option(gateway, options);
  gateway.word("--sim", options.sim.plant, "plant file: run on a simulated world, in real time").shown("PLANT");
  plant_words(gateway, options);
  gateway.word("--port", options.ports, "port of the bus, or BUS=PORT, instead of the machine file's")
      .one_each()
      .shown("[BUS=]PORT");
  gateway.word("--record", options.files.record, "write every frame to this file, as candump does").shown("FILE");
  gateway.word("--listen", wanted->listen, "where to listen (default 127.0.0.1:7000; port 0: any that is free)")
      .shown("HOST:PORT");
  anywhere_flag(gateway, wanted->anywhere);
  gateway.time("--for", wanted->duration, "end after this time");
  gateway.flag("--commands", wanted->commands,
               "clients may command a real machine: NMT, SDO download, PDO, LSS; else they only read");
  gateway.flag("--yes,-y", options.yes,
               "--commands, and they may disturb operational devices of it: reset, LSS, store");
  json_flag(gateway, options, "JSON objects, one per line");
}

}  // namespace berth::cli
