// `berth sim plug`, `unplug`, `power`, `reset`, `fault`, `devices`: the user's actions in a simulated machine that
// another process runs, requested by that process's control socket. Also `berth world`.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "berth/command/control.hpp"
#include "berth/command/verbs.hpp"
#include "berth/text/quantity.hpp"
#include "machine_file.hpp"
#include "plant_commands.hpp"
#include "ports.hpp"
#include "request_verb.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
using Paths = tl::expected<std::vector<std::string>, Failure>;

// First the process of a plant: the `berth up` that uses the plant cannot act in it.
Paths where_it_may_run(const Options& options, const design::Machine& machine) {
  std::vector<std::string> paths;
  for (const auto& bus : machine.buses) {
    const bool wanted = options.bus.empty() || bus.name == options.bus;
    if (wanted && bus.port.kind == can::PortKind::plant) paths.push_back(plant_control(bus.port.address));
  }
  const auto processes = control_paths(options, machine);
  paths.insert(paths.end(), processes.begin(), processes.end());
  return paths;
}

Failure runs_nowhere(const Options& options, const design::Machine& machine) {
  const auto real = std::ranges::find_if(machine.buses, [](const auto& bus) { return is_real(bus.port); });
  if (real != machine.buses.end()) {
    return failure(Exit::no, fmt::format("bus {} is on {}: on a real bus a person plugs devices and switches power; "
                                         "`berth sim` is for a machine that runs with --sim PLANT",
                                         real->name, can::to_string(real->port)));
  }
  return failure(Exit::failed, fmt::format("{0} does not run: start it in another terminal, "
                                           "`berth up {0} --sim PLANT --pace`",
                                           options.machine));
}

tl::expected<std::string, Failure> running_plant(Options options) {
  const bool plant_alone = !options.ports.empty() && options.machine.empty();
  if (plant_alone) {
    const auto port = port_of_word(options.ports.front());
    if (!port) return tl::unexpected(failure(Exit::usage, port.error()));
    if (port->kind == can::PortKind::plant) return plant_control(port->address);
    return tl::unexpected(
        failure(Exit::no, fmt::format("{} is not a simulated plant; `berth sim` is for those", can::to_string(*port))));
  }
  options.machine = default_machine(options);
  if (options.machine.empty() && !options.control.empty()) return options.control;
  if (options.machine.empty()) {
    return tl::unexpected(failure(Exit::usage, "which machine? Name its file, --machine FILE"));
  }
  auto machine = design::load_machine(options.machine, options.files.allow_outside);
  if (!machine.machine) return tl::unexpected(failure(machine.findings));
  if (auto good = override_ports(*machine.machine, options); !good) return tl::unexpected(good.error());
  const auto paths = where_it_may_run(options, *machine.machine);
  if (!paths) return tl::unexpected(paths.error());
  const auto path = std::ranges::find_if(*paths, command::control_answers);
  if (path == paths->end()) return tl::unexpected(runs_nowhere(options, *machine.machine));
  return *path;
}

int ask_plant(const Options& options, command::Request request) {
  constexpr int patience_ms = 30'000;
  if (!options.bus.empty()) request.arguments["bus"] = options.bus;
  const auto path = running_plant(options);
  if (!path) return tell(path.error(), options.json);
  if (!path->ends_with(".control")) name_machine(request, options);  // a plant by itself has no machine file
  const auto reply = command::control_call(*path, request, patience_ms);
  if (!reply) return tell(failure(Exit::failed, reply.error()), options.json);
  if (options.json) {
    print_text(Json::parse(reply->json).dump(2));
    return reply->status;
  }
  print_lines(reply->lines);
  if (!reply->error.empty()) print_errors(reply->error);
  return reply->status;
}

/// The words that all these verbs have: the machine, and the process that runs it.
void running_words(const Verb& verb, Options& options) {
  json_flag(verb, options);
  verb.word("--machine,-m", options.machine, "machine file (default: berth.toml, or the only one of the folder)");
  reach_word(verb, options);
  verb.word("--bus", options.bus, "one bus of the machine");
  verb.word("--port,-p", options.ports, "a plant by itself: plant:SOCKET of `berth plant --listen`")
      .one_each()
      .shown("[BUS=]PORT");
  control_word(verb, options);
}

/// Reads "KEY=VALUE" as in an [[event]] of a plant file; the word without "=" is the device.
std::string read_fault(command::Request& request, const std::vector<std::string>& words) {
  for (const auto& word : words) {
    const auto equals = word.find('=');
    const std::string key = word.substr(0, equals);
    if (equals == std::string::npos && request.arguments.contains("device")) {
      return fmt::format("{}: one device; write the other keys of an [[event]] as KEY=VALUE", text::quoted(word));
    }
    std::string value = equals == std::string::npos ? word : word.substr(equals + 1);
    if (key == "nodes") std::ranges::replace(value, ',', '\n');
    const std::string into = equals == std::string::npos ? "device" : key;
    if (into == "action")
      return fmt::format("{}: the action comes first: `berth sim fault ACTION`", text::quoted(word));
    if (!request.arguments.emplace(into, std::move(value)).second) {
      return fmt::format("{}: {} is given twice", text::quoted(word), into);
    }
  }
  return {};
}

void add_device_verb(const Verb& sim, Options& options, const std::string& name, const std::string& help,
                     const std::string& example) {
  const auto device = std::make_shared<std::string>();
  const Verb verb = sim.add(name, help, [&options, device, name] {
    return ask_plant(options, {plant_verb, {{"action", name}, {"device", *device}}});
  });
  verb.word("device", *device, "its name in the plant file, or its slot's name or node-ID").required().shown("DEVICE");
  running_words(verb, options);
  verb.footer("Example:\n  " + example);
}

void add_power(const Verb& sim, Options& options) {
  const auto words = std::make_shared<std::pair<std::string, std::string>>();
  const Verb power = sim.add("power", "a device's power, on or off; it stays on the cable", [&options, words] {
    return ask_plant(options, {plant_verb, {{"action", "power-" + words->first}, {"device", words->second}}});
  });
  power.word("state", words->first, "on or off").required().one_of(std::vector<std::string>{"on", "off"});
  power.word("device", words->second, "its name in the plant file, or its slot's name or node-ID")
      .required()
      .shown("DEVICE");
  running_words(power, options);
  power.footer("Example:\n  berth sim power off s2 machine.toml");
}

void add_set(const Verb& sim, Options& options) {
  const auto request = std::make_shared<command::Request>(command::Request{plant_verb, {{"action", "set"}}});
  const Verb set = sim.add("set", "an object of a device, as its hardware would: a sensor, a switch",
                           [&options, request] { return ask_plant(options, *request); });
  const auto word = [&](const std::string& key, const std::string& help, const std::string& shown) {
    set.word(
           key, [request, key](const std::string& text) { request->arguments[key] = text; }, help)
        .required()
        .shown(shown);
  };
  word("device", "its name in the plant file, or its slot's name or node-ID", "DEVICE");
  word("object", "index or name, from 2000h on, whether or not SDO may write it", "OBJECT");
  word("value", "as for `berth sdo write`", "VALUE");
  running_words(set, options);
  set.footer("Example:\n  berth sim set s2 6000h:01 5 -m machine.toml\nWhat maps the object is sent: a changed input.");
}

void add_fault(const Verb& sim, Options& options) {
  struct Fault {
    std::string action;
    std::vector<std::string> words;
  };
  const auto fault = std::make_shared<Fault>();
  const Verb verb = sim.add("fault", "any event of a plant file, now", [&options, fault] {
    command::Request request{plant_verb, {{"action", fault->action}}};
    const auto wrong = read_fault(request, fault->words);
    return wrong.empty() ? ask_plant(options, std::move(request)) : tell(failure(Exit::usage, wrong), options.json);
  });
  verb.word("action", fault->action,
            "deaf, slow, recover, cut-cable, join, disturb, overrun, set-serial, set-node-id, …")
      .required()
      .shown("ACTION");
  verb.word("event", fault->words, "its device, and KEY=VALUE as in an [[event]] (docs/plant-file.md)")
      .shown("DEVICE KEY=VALUE ...");
  running_words(verb, options);
  verb.footer(
      "Examples:\n  berth sim fault deaf s2 duration=\"5 s\" -m machine.toml\n"
      "  berth sim fault slow s3 latency=\"50 ms\" -m machine.toml\n"
      "  berth sim fault cut-cable nodes=s1,s2 --bus field -m machine.toml\n"
      "  berth sim fault disturb id=0x705 bit_from_end=0 kind=dominant nodes=master");
}

/// Adds the words and options that the table of verbs has for it. A word there is optional, or the verb's only one.
void add_world_verb(const Verb& world, Options& options, const std::string& name, const std::string& example) {
  const std::string verb = "world " + name;
  const auto request = std::make_shared<command::Request>(command::Request{verb, {}});
  const Verb made = world.add(name, help_of(verb), [&options, request] { return ask_plant(options, *request); });
  for (const auto& parameter : command::verb(verb)->parameters) {
    const bool option = parameter.form == command::Form::option;
    if (parameter.form != command::Form::word && !option) continue;
    const std::string key(parameter.name);
    Word word = made.word((option ? "--" : "") + key,
                          [request, key](const std::string& text) { request->arguments[key] = text; },
                          std::string(parameter.help));
    if (parameter.required) word.required();
    if (option) word.shown(std::string(parameter.value));
  }
  running_words(made, options);
  made.footer("Example:\n  " + example);
}

}  // namespace

void add_world(Verb& berth, Options& options) {
  const Verb world = berth.group("world", "the time of a simulated machine that runs: pause, step, speed");
  world.footer(
      "Examples:\n  berth world pause -m machine.toml\n  berth world step 10 -m machine.toml\n"
      "The machine runs in another terminal: berth up MACHINE --sim PLANT --pace");
  add_world_verb(world, options, "pause", "berth world pause -m machine.toml");
  add_world_verb(world, options, "run", "berth world run -m machine.toml");
  add_world_verb(world, options, "step", "berth world step 10 -m machine.toml");
  add_world_verb(world, options, "speed", "berth world speed 0.1 -m machine.toml");
  add_world_verb(world, options, "damage", "berth world damage 3 --bus field -m machine.toml");
}

void add_running_plant(const Verb& sim, Options& options) {
  add_device_verb(sim, options, "plug", "onto the bus and powered", "berth sim plug s2 machine.toml");
  add_device_verb(sim, options, "unplug", "off the bus and without power", "berth sim unplug s2 machine.toml");
  add_power(sim, options);
  add_device_verb(sim, options, "reset", "its firmware starts again, as by a watchdog",
                  "berth sim reset s2 machine.toml");
  add_set(sim, options);
  add_fault(sim, options);
  const Verb devices =
      sim.add("devices", "the true state of the plant's devices, independent of what Berth knows", [&options] {
        return ask_plant(options, {plant_verb, {{"action", "devices"}}});
      });
  running_words(devices, options);
  devices.footer("Example:\n  berth sim devices machine.toml");
}

}  // namespace berth::cli
