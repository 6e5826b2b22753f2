/// The port of each bus: `--sim` before `--port` before the machine file.
#pragma once

#include <optional>
#include <tl/expected.hpp>

#include "berth/command/reply.hpp"
#include "berth/design/machine.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// Replaces the file's port by `--port`: "socketcan:vcan0" for the only bus (or the one of `--bus`),
/// "drives=socketcan:can1" for the bus of this name; may be repeated for more buses.
[[nodiscard]] tl::expected<void, Failure> override_ports(design::Machine& machine, const Options& options);

/// A port as the user writes it: as in a machine file, or short: "can0", "/dev/ttyACM0", "host:29536/can0",
/// "plant.sock". The error is for users.
[[nodiscard]] tl::expected<can::PortSpec, std::string> port_of_word(const std::string& word);

/// Keeps only this bus, its slots and the buses behind its gateways, for a process that runs one network of a machine.
/// For a bus without a port: also the buses on the way to it.
void restrict_to(design::Machine& machine, const std::string& bus);

/// Names the process of one bus alone, for its control socket.
[[nodiscard]] std::string bus_process(const std::string& machine, const std::string& bus);

/// Control sockets are found by the machine's name, which a copy of the folder has too. So a request names the file,
/// and a process that runs another file refuses it.
void name_machine(command::Request& request, const Options& options);
/// Removes that name from the request. A reply: refused, another file is meant.
[[nodiscard]] std::optional<command::Reply> other_machine(command::Request& request, const std::string& running);

/// Where a `berth up` that runs the machine, or only the bus of `--bus`, may listen: `--control`, else by name.
[[nodiscard]] std::vector<std::string> control_paths(const Options& options, const design::Machine& machine);
/// The one of them at which a process listens now; empty: none.
[[nodiscard]] std::string running_control(const Options& options, const design::Machine& machine);
/// The process at `path` runs another machine file with the same machine name. For a client that only follows frames
/// and so sends nothing that would be refused. Empty: it does not.
[[nodiscard]] std::optional<Failure> runs_another(const Options& options, const std::string& path);

/// This process simulates no bus, so it runs in real time by a loop.
[[nodiscard]] bool all_elsewhere(const design::Machine& machine) noexcept;

/// The port has real devices: it is neither simulated by this process nor by another's plant.
[[nodiscard]] bool is_real(const can::PortSpec& port) noexcept;

/// Why the machine cannot run without `--sim`: one of its buses is simulated and another is not.
[[nodiscard]] Failure needs_plant(const design::Machine& machine);

}  // namespace berth::cli
