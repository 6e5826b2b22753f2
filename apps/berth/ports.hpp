/// Which port each bus of a machine runs on: what the machine file says, `--port` stronger, `--sim` strongest.
#pragma once

#include <optional>
#include <tl/expected.hpp>

#include "berth/command/reply.hpp"
#include "berth/design/machine.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// Puts `--port` in place of what the file says: "socketcan:vcan0" for the only bus (or the one of `--bus`),
/// "drives=socketcan:can1" for a bus by its name, as often as there are buses.
[[nodiscard]] tl::expected<void, Failure> override_ports(design::Machine& machine, const Options& options);

/// A port as a person names it: as in a machine file, or what it is guessed from: "can0", "/dev/ttyACM0",
/// "host:29536/can0", "plant.sock". The error is for people.
[[nodiscard]] tl::expected<can::PortSpec, std::string> port_of_word(const std::string& word);

/// Only this bus and its slots are left, and what it leads to by gateways: one process for one network of a machine. Of
/// a bus without a port: those on the way to it.
void restrict_to(design::Machine& machine, const std::string& bus);

/// The name by which a process for one bus alone is known: its control socket's.
[[nodiscard]] std::string bus_process(const std::string& machine, const std::string& bus);

/// A control socket is found by the machine's name, which a copy of the folder has, too. So a request says which file
/// is meant, and who runs another refuses it.
void name_machine(command::Request& request, const Options& options);
/// Takes that out of the request. A refusal: another file is meant.
[[nodiscard]] std::optional<command::Reply> other_machine(command::Request& request, const std::string& running);

/// Where a `berth up` that runs the machine, or only the bus of `--bus`, listens: `--control`, else by name.
[[nodiscard]] std::vector<std::string> control_paths(const Options& options, const design::Machine& machine);
/// That of them at which a process listens now; empty: none does.
[[nodiscard]] std::string running_control(const Options& options, const design::Machine& machine);
/// The process that listens at `path` runs another machine file, whose machine has the same name: for who only follows
/// its frames and asks nothing that would be refused. Empty: it does not.
[[nodiscard]] std::optional<Failure> runs_another(const Options& options, const std::string& path);

/// The buses are all in other hands than this process's simulator, so that it runs in real time by a loop.
[[nodiscard]] bool all_elsewhere(const design::Machine& machine) noexcept;

/// Real devices hang on it: neither a simulated bus of this process nor a plant's of another.
[[nodiscard]] bool is_real(const can::PortSpec& port) noexcept;

/// Why the machine cannot run without `--sim`, when it cannot: a bus that is simulated beside one that is not.
[[nodiscard]] Failure needs_plant(const design::Machine& machine);

}  // namespace berth::cli
