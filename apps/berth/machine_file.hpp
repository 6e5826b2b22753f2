/// Which machine a command is about: its file, the one that lies in the folder, or a bus by itself.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/design/machine.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

/// `Machine::file` of a machine that no file describes: nothing about it is written to disk.
inline constexpr const char* no_machine_file = "(no machine file)";
[[nodiscard]] bool is_ad_hoc(const design::Machine& machine) noexcept;

/// Where no machine file, port or socket is named: `berth.toml` of the current folder, else its only machine file. It
/// is said on standard error which other one, unless with --json. Empty: there is none, or there are several.
[[nodiscard]] std::string default_machine(const Options& options);
/// "; this folder has a.toml, b.toml" for the message that no machine file is named.
[[nodiscard]] std::string machines_here();

/// A file with a table [machine], which plant files and device libraries do not have.
[[nodiscard]] bool is_machine_file(const std::string& path);

/// The text of a machine file of one bus without slots, on the port of `options`: for commands that need no slots.
[[nodiscard]] tl::expected<std::string, Failure> ad_hoc_machine(const Options& options);

/// The machine of the file, or the bus at the port, with what --eds says of its nodes.
[[nodiscard]] tl::expected<design::Machine, Failure> machine_of(const Options& options);
/// The machine that `options` names or that is of this folder: for commands that no bus by itself is enough for.
[[nodiscard]] tl::expected<design::Machine, Failure> machine_by_file(const Options& options);
/// Adds what --eds says: "drive.eds" of every node that nothing else is known of, "5=drive.eds" of one.
[[nodiscard]] tl::expected<void, Failure> describe_nodes(design::Machine& machine, const Options& options);

}  // namespace berth::cli
