/// `berth init`: a machine file and a plant file to go with it, from device descriptions or from a bus that is there.
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
  bool force = false;            ///< files that are there are replaced
};

/// Devices of one kind, with consecutive node-IDs.
struct InitDevice {
  std::string name;    ///< "{id}" in it stands for the node-ID when there are several
  std::string remark;  ///< what it is, for a comment
  std::string eds;     ///< description, as the person named it; empty: known by its identity alone
  Identity device;     ///< the first; the serial numbers of the others count on
  unsigned first_id = 0;
  unsigned count = 1;
  bool fixed = false;   ///< it has no LSS, or nothing but its node-ID tells which it is: that is set by hand
  bool has_id = false;  ///< it has its node-ID already
};

struct InitBus {
  std::string name;
  can::PortSpec port;
  std::uint32_t bitrate = 125'000;
  std::string remark;  ///< on the bit rate; may be empty
  unsigned master_id = 127;
  std::vector<InitDevice> devices;
  std::vector<std::string> left_out;  ///< found, but no slot can be written of it: why
};

struct InitPlan {
  std::string name;  ///< of the machine
  std::string from;  ///< what it was made from, for a comment
  std::vector<InitBus> buses;
  std::vector<std::string> notes;  ///< for the person

  [[nodiscard]] std::size_t devices() const noexcept;
};

/// One bus with the devices that `init.eds` describes; each file is read.
[[nodiscard]] tl::expected<InitPlan, Failure> plan_of_descriptions(const Options& options, const InitOptions& init);
/// What answers on the bus of `options.ports`; devices that fit one of `init.eds` get it as description. At a running
/// `berth up`'s socket all its buses are asked.
[[nodiscard]] tl::expected<InitPlan, Failure> plan_of_bus(const Options& options, const InitOptions& init);
/// A description that is to lie beside the machine file.
struct InitCopy {
  std::string from;
  std::string to;
  std::string bytes;
  bool there = false;  ///< already
};
/// The descriptions that the machine file may not name where they lie (berth/text/reach.hpp); the plan names their
/// copies. `allowed`: folders whose files it may name. Of machine and plant files in two folders: none.
[[nodiscard]] tl::expected<std::vector<InitCopy>, Failure> take_along(InitPlan& plan, const InitOptions& init,
                                                                      const std::vector<std::string>& allowed);
/// The file that "drive.eds:4" names with its count; empty: no such file, or no number of devices that a bus can have.
[[nodiscard]] std::string file_of_counted(const std::string& word);
/// Asks a person for what `options` and `init` lack. Status 1: nothing is to be written.
[[nodiscard]] tl::expected<void, Failure> ask_for_machine(Options& options, InitOptions& init, Interrupt& interrupt);

/// The plant file that belongs to a machine file: NAME.plant.toml.
[[nodiscard]] std::string plant_beside(const std::string& file);
/// Why a file of this name is not to be written, and why not in its folder; empty: it may be.
[[nodiscard]] std::string init_file_problem(const std::string& path);
[[nodiscard]] std::string init_folder_problem(const std::string& path);

/// A name for a slot, made from what a file or a device says: one that machine and plant files take.
[[nodiscard]] std::string name_from(const std::string& said);
/// No two slots of the plan have one name, in either case.
void make_names_unique(InitPlan& plan);

/// The two files' texts. `file`: where the machine file will be, `plant` the plant file, as the person names them:
/// descriptions are named relative to their folders.
[[nodiscard]] std::string machine_text(const InitPlan& plan, const std::string& file, const std::string& plant_file);
[[nodiscard]] std::string plant_text(const InitPlan& plan, const std::string& file, const std::string& plant_file);

}  // namespace berth::cli
