/// `berth init`: writes a machine file and a plant file, from device descriptions or from an existing bus.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/port_spec.hpp"
#include "interrupt.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

struct InitOptions {
  std::string file;              ///< machine file to write; empty: berth.toml
  std::string plant;             ///< plant file to write; empty: beside it, .plant.toml
  std::string name;              ///< of the machine; empty: as the folder is called
  std::vector<std::string> eds;  ///< "FILE" or "FILE:COUNT"
  bool force = false;            ///< existing files are replaced
};

/// Devices of one kind, with consecutive node-IDs.
struct InitDevice {
  std::string name;    ///< "{id}" in it stands for the node-ID if there are several
  std::string remark;  ///< what it is, for a comment
  std::string eds;     ///< description, as the user named it; empty: only the identity is known
  Identity device;     ///< the first; the others' serial numbers count up from it
  unsigned first_id = 0;
  unsigned count = 1;
  bool fixed = false;   ///< no LSS, or only its node-ID identifies it: the node-ID is set by hand
  bool has_id = false;  ///< it already has its node-ID
};

struct InitBus {
  std::string name;
  can::PortSpec port;
  std::uint32_t bitrate = 125'000;
  std::string remark;  ///< on the bit rate; may be empty
  unsigned master_id = 127;
  std::vector<InitDevice> devices;
  std::vector<std::string> left_out;  ///< found, but no slot can be written for it: why
};

struct InitPlan {
  std::string name;  ///< of the machine
  std::string from;  ///< what it was made from, for a comment
  std::vector<InitBus> buses;
  std::vector<std::string> notes;  ///< for the user

  [[nodiscard]] std::size_t devices() const noexcept;
};

/// One bus with the devices that `init.eds` describes; each file is read.
[[nodiscard]] tl::expected<InitPlan, Failure> plan_of_descriptions(const Options& options, const InitOptions& init);
/// What answers on the bus of `options.ports`; a device that matches one of `init.eds` gets it as its description. At a
/// running `berth up`'s socket, all its buses are asked.
[[nodiscard]] tl::expected<InitPlan, Failure> plan_of_bus(const Options& options, const InitOptions& init);
/// A description to be copied beside the machine file.
struct InitCopy {
  std::string from;
  std::string to;
  std::string bytes;
  bool there = false;  ///< it already exists
};
/// The descriptions that the machine file may not name where they are (berth/text/reach.hpp). The plan then names the
/// copies. `allowed`: folders whose files it may name. None when machine and plant file are in two folders.
[[nodiscard]] tl::expected<std::vector<InitCopy>, Failure> take_along(InitPlan& plan, const InitOptions& init,
                                                                      const std::vector<std::string>& allowed);
/// The file that "drive.eds:4" names with a count. Empty: no such file, or the count is not a possible number of
/// devices.
[[nodiscard]] std::string file_of_counted(const std::string& word);
/// Asks the user for what `options` and `init` lack. Status 1: write nothing.
[[nodiscard]] tl::expected<void, Failure> ask_for_machine(Options& options, InitOptions& init, Interrupt& interrupt);

/// The plant file of a machine file: NAME.plant.toml.
[[nodiscard]] std::string plant_beside(const std::string& file);
/// Why a file of this name, or in its folder, must not be written; empty: it may be.
[[nodiscard]] std::string init_file_problem(const std::string& path);
[[nodiscard]] std::string init_folder_problem(const std::string& path);

/// Makes a name for a slot from what a file or a device says: one that machine and plant files accept.
[[nodiscard]] std::string name_from(const std::string& said);
/// Afterwards no two slots of the plan have the same name, ignoring case.
void make_names_unique(InitPlan& plan);

/// The texts of the two files. `file` and `plant_file`: their paths as the user gives them; descriptions are named
/// relative to their folders.
[[nodiscard]] std::string machine_text(const InitPlan& plan, const std::string& file, const std::string& plant_file);
[[nodiscard]] std::string plant_text(const InitPlan& plan, const std::string& file, const std::string& plant_file);

}  // namespace berth::cli
