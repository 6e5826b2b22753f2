/// Finds the machine of a command: its file, the one in the folder, or a bus by itself.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/design/machine.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// `Machine::file` of a machine without a file: nothing about it is written to disk.
inline constexpr const char* no_machine_file = "(no machine file)";
[[nodiscard]] bool is_ad_hoc(const design::Machine& machine) noexcept;

/// For a command that names no machine file, port or socket: `berth.toml` of the current folder, else the only machine
/// file there, whose name is printed on standard error unless with --json. Empty: there is none, or there are several.
[[nodiscard]] std::string default_machine(const Options& options);
/// "; this folder has a.toml, b.toml" for the message about a missing machine file.
[[nodiscard]] std::string machines_here();

/// A file with a table [machine]; plant files and device libraries have none.
[[nodiscard]] bool is_machine_file(const std::string& path);

/// The text of a machine file with one bus at the port of `options` and no slots.
[[nodiscard]] tl::expected<std::string, Failure> ad_hoc_machine(const Options& options);

/// The machine of the file, or the bus at the port, with what --eds says of its nodes.
[[nodiscard]] tl::expected<design::Machine, Failure> machine_of(const Options& options);
/// The machine that `options` names, or else the folder's: for commands that need more than a bus by itself.
[[nodiscard]] tl::expected<design::Machine, Failure> machine_by_file(const Options& options);
/// Adds what --eds says: "drive.eds" for every node without another description, "5=drive.eds" for one.
[[nodiscard]] tl::expected<void, Failure> describe_nodes(design::Machine& machine, const Options& options);

}  // namespace berth::cli
