// `berth gateway`: the buses of a machine, real or simulated in real time, for scripts and tools that speak CiA 309-3.
#include "gateway.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "berth/operate/report.hpp"
#include "interrupt.hpp"
#include "output.hpp"
#include "time_option.hpp"

namespace berth::cli {

using Json = nlohmann::ordered_json;

tl::expected<std::unique_ptr<GatewayHost>, Failure> GatewayHost::listen(Rig& rig, const std::string& where,
                                                                        GatewayRights rights,
                                                                        std::function<void(const std::string&)> say) {
  const auto endpoint = io::parse_endpoint(where, serve::gateway_309_port);
  if (!endpoint) {
    return tl::unexpected(
        failure(Exit::usage, fmt::format("gateway at {}: write HOST:PORT, such as 127.0.0.1:7000", where)));
  }
  std::unique_ptr<GatewayHost> host(new GatewayHost);
  serve::Gateway309Options options;
  options.commands = rights.commands;
  options.confirmed = rights.confirmed;
  options.tell = std::move(say);
  auto server = serve::Gateway309Server::listen(*rig.loop(), *endpoint, rig.session(), std::move(options));
  if (!server) return tl::unexpected(failure(Exit::failed, server.error()));
  host->server_ = std::move(*server);
  return host;
}

namespace {

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

void tell_counters(const serve::Gateway309Counters& c, bool json) {
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
  print_line(fmt::format("{} clients, {} lines", c.clients, c.lines));
  if (c.too_slow > 0) print_line(fmt::format("{} let go because they took too little", c.too_slow));
  if (c.silent > 0) print_line(fmt::format("{} let go because they were silent", c.silent));
  if (c.strange > 0) print_line(fmt::format("{} let go because they did not begin with a command", c.strange));
  if (c.too_many > 0) print_line(fmt::format("{} let go because there were enough", c.too_many));
}

}  // namespace

int run_gateway(const Options& wanted, const GatewayOptions& gateway) {
  Options options = wanted;
  options.pace = true;
  auto made = Rig::make(options, {options.machine, options.sim, {}, {}});
  if (!made) return tell(made.error(), options.json);
  Rig& rig = **made;
  Interrupt interrupt(rig.loop());
  const auto say = [&](const std::string& text) {
    print_line(options.json ? Json{{"event", text}}.dump(-1, ' ', false, Json::error_handler_t::replace) : text);
  };
  rig.session().on_event([&](const operate::Event& event) { say(operate::to_line(event)); });
  if (const auto clear = rig.strangers().listen_first(); !clear) return tell(clear.error(), options.json);
  auto host = GatewayHost::listen(rig, gateway.listen, {gateway.commands || options.yes, options.yes}, say);
  if (!host) return tell(host.error(), options.json);
  announce(**host, rig.machine(), options.json);
  rig.power_on();
  wait_for(rig.driver(), interrupt, gateway.duration.value_or(rt::Duration::max()));
  tell_counters((*host)->counters(), options.json);
  rig.session().on_event({});
  host->reset();
  return rig.record().kept() ? Exit::done
                             : tell(failure(Exit::failed, options.record + ": the record could not be written"), false);
}

void add_gateway(CLI::App& app, Options& options, std::function<int()>& action) {
  const auto gateway = std::make_shared<GatewayOptions>();
  auto* const sub =
      app.add_subcommand("gateway", "the machine's buses for scripts and tools by CiA 309-3 (ASCII) over TCP");
  sub->callback(
      [&options, &action, gateway] { action = [&options, gateway] { return run_gateway(options, *gateway); }; });
  sub->footer(
      "Examples:\n  berth gateway machine.toml --sim plant.toml\n  berth gateway machine.toml --listen 127.0.0.1:7000\n"
      "  printf '[1] 1 5 read 0x1000 0 u32\\n' | nc -N 127.0.0.1 7000\n"
      "Net 1 is the first bus of the machine file. There is no password. On real buses clients may only read unless\n"
      "--commands is given. Beside the main job: berth up machine.toml --gateway 127.0.0.1:7000. docs/gateway.md has "
      "the commands.");
  sub->add_option("machine,--machine,-m", options.machine, "machine file")->option_text("MACHINE")->required();
  sub->add_option("--sim", options.sim, "plant file: run on a simulated world, in real time");
  sub->add_option("--sim-state", options.state, "file that keeps what the simulated devices remember between runs");
  sub->add_option("--seed", options.seed, "seed of the simulated world, instead of the plant file's");
  sub->add_option("--port", options.ports, "port of the bus, or BUS=PORT, instead of the machine file's")
      ->allow_extra_args(false)
      ->option_text("[BUS=]PORT");
  sub->add_option("--record", options.record, "write every frame to this file, as candump does");
  sub->add_option("--listen", gateway->listen, "where to listen (default 127.0.0.1:7000; port 0: any that is free)")
      ->option_text("HOST:PORT");
  time_option(
      *sub, "--for", [gateway](std::chrono::nanoseconds time) { gateway->duration = time; }, "end after this time");
  sub->add_flag("--commands", gateway->commands,
                "clients may command a real machine: NMT, SDO download, PDO, LSS; else they only read");
  sub->add_flag("--yes,-y", options.yes,
                "--commands, and they may disturb operational devices of it: reset, LSS, store");
  sub->add_flag("--json", options.json, "JSON objects, one per line");
  // It needs real time.
  auto* const up = app.get_subcommand("up");
  up->add_option_function<std::string>(
        "--gateway", [&options](const std::string& where) { options.gateway = where, options.pace = true; },
        "offer the buses by CiA 309-3 there too, such as 127.0.0.1:7000")
      ->option_text("HOST:PORT")
      ->excludes("--fast");
  up->add_flag("--gateway-commands", options.gateway_commands,
               "clients of --gateway may command a real machine: NMT, SDO download, PDO, LSS; else they only read");
}

}  // namespace berth::cli
