#include "ports.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "berth/base/real_path.hpp"
#include "berth/command/control.hpp"
#include "berth/tree/beneath.hpp"

namespace berth::cli {

namespace {

std::string bus_names(const design::Machine& machine) {
  std::string names;
  for (const auto& bus : machine.buses) names += (names.empty() ? "" : ", ") + bus.name;
  return names;
}

Failure wrong_port(const std::string& written, const std::string& why) {
  return failure(Exit::usage, fmt::format("--port {}: {}", written, why));
}

}  // namespace

namespace {

// Guesses the kind of port from a word without one: a serial device and a plant's socket are files, a server's address
// has a colon.
std::optional<can::PortSpec> guessed(const std::string& word) {
  if (word.find('=') != std::string::npos) return std::nullopt;  // BUS=PORT with another machine's bus
  std::error_code none;
  const auto is = [&](std::filesystem::file_type type) { return std::filesystem::status(word, none).type() == type; };
  if (word.starts_with("/dev/") || is(std::filesystem::file_type::character)) {
    return can::PortSpec{can::PortKind::slcan, word};
  }
  if (word.ends_with(".sock") || is(std::filesystem::file_type::socket)) {
    return can::PortSpec{can::PortKind::plant, word};
  }
  const auto colon = word.find(':');
  const auto slash = word.find('/');
  if (colon != std::string::npos) {
    const bool server = slash != std::string::npos && slash > colon + 1;
    return server ? can::parse_port("socketcand://" + word) : std::nullopt;
  }
  constexpr std::size_t longest_interface = 15;
  const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '-'; };
  const bool interface =
      word.size() <= longest_interface && word.find("can") != std::string::npos && std::ranges::all_of(word, letter);
  if (interface) return can::PortSpec{can::PortKind::socketcan, word};
  return std::nullopt;
}

}  // namespace

tl::expected<can::PortSpec, std::string> port_of_word(const std::string& word) {
  auto port = can::parse_port(word);
  if (!port) port = guessed(word);
  if (port && port->kind != can::PortKind::sim) return *port;
  return tl::unexpected(
      fmt::format("--port {}: this is not a port; use socketcan:can0 (or can0), slcan:/dev/ttyACM0, "
                  "socketcand://host:29536/can0 or plant:/run/plant.sock; `berth ports` lists what is plugged in",
                  word));
}

tl::expected<void, Failure> override_ports(design::Machine& machine, const Options& options) {
  for (const auto& written : options.ports) {
    const auto equals = written.find('=');
    const bool names_bus = equals != std::string::npos && machine.bus(written.substr(0, equals)) != nullptr;
    std::string name = names_bus ? written.substr(0, equals) : options.bus;
    if (name.empty() && machine.buses.size() == 1) name = machine.buses.front().name;
    if (name.empty()) {
      return tl::unexpected(
          wrong_port(written, fmt::format("which bus? Write BUS=PORT; the buses are {}", bus_names(machine))));
    }
    const auto port = port_of_word(names_bus ? written.substr(equals + 1) : written);
    if (!port) return tl::unexpected(failure(Exit::usage, port.error()));
    const auto bus = std::ranges::find(machine.buses, name, &design::Bus::name);
    if (bus == machine.buses.end() && names_bus) {
      return tl::unexpected(wrong_port(
          written,
          fmt::format("Berth has no port on bus {} (port = \"gateway\"): where it is to have one, write that port "
                      "into [bus.{}] of {}",
                      name, name, machine.file)));
    }
    if (bus == machine.buses.end()) {
      return tl::unexpected(
          wrong_port(written, fmt::format("there is no bus \"{}\"; the buses are {}", name, bus_names(machine))));
    }
    bus->port = *port;
  }
  return {};
}

void restrict_to(design::Machine& machine, const std::string& bus) {
  const design::Machine whole = machine;
  const auto way = tree::way_to(whole, bus);
  // For a bus without a port, the buses on the way to it stay; for a bus with a port, all buses beneath it.
  const auto stays = [&](const std::string& name) {
    const auto to = tree::way_to(whole, name);
    const std::size_t common = std::min(to.gateways.size(), way.gateways.size());
    const bool on_the_way = std::equal(to.gateways.begin(), to.gateways.begin() + static_cast<std::ptrdiff_t>(common),
                                       way.gateways.begin());
    return to.bus == way.bus && on_the_way && (way.gateways.empty() || to.gateways.size() <= way.gateways.size());
  };
  std::erase_if(machine.buses, [&](const auto& b) { return !stays(b.name); });
  std::erase_if(machine.beneath, [&](const auto& b) { return !stays(b.name); });
  std::erase_if(machine.slots, [&](const auto& s) { return !stays(s.spec.name.bus); });
  std::erase_if(machine.links, [&](const auto& link) {
    const auto elsewhere = [&](const design::LinkEnd& end) { return machine.slot(end.slot) == nullptr; };
    return elsewhere(link.from) || std::ranges::any_of(link.to, elsewhere);
  });
}

std::string bus_process(const std::string& machine, const std::string& bus) { return machine + "." + bus; }

std::vector<std::string> control_paths(const Options& options, const design::Machine& machine) {
  if (!options.control.empty()) return {options.control};
  std::vector<std::string> paths{command::control_path(machine.name)};
  const bool only = options.bus.empty() && machine.buses.size() == 1;
  const std::string bus = only ? machine.buses.front().name : tree::way_to(machine, options.bus).bus;
  if (!bus.empty()) paths.push_back(command::control_path(bus_process(machine.name, bus)));
  return paths;
}

namespace {

constexpr const char* file_meant = "machine_file";

}  // namespace

void name_machine(command::Request& request, const Options& options) {
  if (options.control.empty() && !options.machine.empty())
    request.arguments[file_meant] = real_path(options.machine).string();
}

std::optional<command::Reply> other_machine(command::Request& request, const std::string& running) {
  const auto meant = request.arguments.extract(file_meant);
  const std::string real = real_path(running).string();
  if (meant.empty() || meant.mapped() == real) return std::nullopt;
  return command::refusal(Exit::failed,
                          fmt::format("the running `berth up` is of {}, not of {}, and both machines have the same "
                                      "name; give one of them another [machine] name, or name the other file",
                                      real, meant.mapped()));
}

std::string running_control(const Options& options, const design::Machine& machine) {
  const auto paths = control_paths(options, machine);
  const auto found = std::ranges::find_if(paths, command::control_answers);
  return found == paths.end() ? std::string() : *found;
}

std::optional<Failure> runs_another(const Options& options, const std::string& path) {
  constexpr int patience_ms = 2000;
  command::Request report{"report", {}};
  name_machine(report, options);
  const auto reply = command::control_call(path, report, patience_ms);
  if (!reply || reply->error.empty()) return std::nullopt;
  return failure(Exit::failed, reply->error);
}

bool all_elsewhere(const design::Machine& machine) noexcept {
  return std::ranges::none_of(machine.buses, [](const auto& b) { return b.port.kind == can::PortKind::sim; });
}

bool is_real(const can::PortSpec& port) noexcept {
  return port.kind != can::PortKind::sim && port.kind != can::PortKind::plant;
}

Failure needs_plant(const design::Machine& machine) {
  const auto simulated =
      std::ranges::find_if(machine.buses, [](const auto& b) { return b.port.kind == can::PortKind::sim; });
  const bool only = std::ranges::all_of(machine.buses, [](const auto& b) { return b.port.kind == can::PortKind::sim; });
  if (only || simulated == machine.buses.end()) {
    return failure(Exit::usage,
                   "the machine's buses are simulated: give the plant file with --sim PLANT, or a port with --port");
  }
  return failure(Exit::usage, fmt::format("{}:{}: bus {} is simulated and others are not: give it a port with "
                                          "--port {}=PORT, take one of the others by --bus, or give --sim PLANT to "
                                          "simulate them all",
                                          machine.file, simulated->place.line, simulated->name, simulated->name));
}

}  // namespace berth::cli
