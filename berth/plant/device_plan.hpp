/// What a device of a plant file is made of, wherever it sits: on a simulated bus (`SimDevice`) or on a port
/// (`PortDevice`). Inside of room `plant`.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/device/device.hpp"
#include "berth/manager/dictionary_manager.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/script/behaviour.hpp"

namespace berth::plant {

/// What 1010h stores.
[[nodiscard]] device::GroupOf parameter_group_of(const PlantDevice& plan) noexcept;
/// Bytes of its non-volatile memory. An NMT master's has room for 64 KiB in all.
[[nodiscard]] std::size_t memory_of(const PlantDevice& plan, const od::Description& description) noexcept;
[[nodiscard]] device::Timing timing_of(const PlantDevice& plan);
/// `bit_rate`: what blank memory counts as, bit/s; `seed`: for what the device draws itself.
[[nodiscard]] device::Options options_of(const PlantDevice& plan, const LssAddress& address, std::uint32_t bit_rate,
                                         std::uint64_t seed);

/// The flash memory of its programs, with the program that it has; null when it is not programmed, or the file of that
/// program cannot be read (an error).
[[nodiscard]] std::unique_ptr<device::SimFlash> program_flash_of(const PlantDevice& plan, rt::Executor& executor);
[[nodiscard]] device::ProgramOptions programs_of(const PlantDevice& plan, device::SimFlash* flash);
/// The image that it has from the beginning; what is wrong with it is a finding.
[[nodiscard]] bool check_programs(const PlantDevice& plan, const od::Description& description, Findings& findings);

/// What makes a device the NMT master of its bus (key `master`).
struct PlantMastery {
  std::unique_ptr<manager::DictionaryManager> manager{};  ///< null: it is no master
  std::unique_ptr<manager::NodeIdAssigner> assigner{};    ///< only of one that is no flying master
};
/// `device` is the plan's, and observes nothing of its NMT state by `on()` yet. All must stay.
[[nodiscard]] PlantMastery master_of(const PlantDevice& plan, can::Dispatcher& dispatcher, device::Device& device);

struct Described {
  std::shared_ptr<const od::Description> description;
  TypeCode type;  ///< with a description file only
  std::uint32_t revision = 0;
  bool unreadable = false;
};

/// Device descriptions, each read once.
class Descriptions {
 public:
  /// Null when it cannot be read. The findings are those of its first reading: the errors, and a warning of the
  /// mandatory objects that it lacks and the device has all the same.
  /// `part`: the built-in ones have the objects of a gateway.
  [[nodiscard]] const Described* of(const PlantDevice& device, Findings& findings, GatewayPart part = {});

 private:
  std::map<std::string, Described> known_;
};
[[nodiscard]] LssAddress address_of(const PlantDevice& device, const Described& described) noexcept;

/// Devices' scripts, each read and compiled once.
class Scripts {
 public:
  /// None of a device without one, nor where it cannot be read or does not compile (an error).
  [[nodiscard]] std::optional<script::Script> of(const PlantDevice& device, Findings& findings);

 private:
  std::map<std::string, std::optional<script::Script>> known_;  // by path
};

/// What a device remembers between two runs of the program: one line of a state file.
struct Kept {
  std::uint32_t serial = 0;
  NodeId node_id;
  std::uint32_t bit_rate = 0;
  bool plugged = false;
  std::vector<std::uint8_t> image;
  std::string name;
};
[[nodiscard]] std::string write_state(std::span<const Kept> devices);
[[nodiscard]] Result<std::vector<Kept>> parse_state(std::string_view text);
/// By renaming, so that it is whole at any time; false: the old one stays.
bool write_state_file(const std::string& path, std::string_view text);
/// The text of a state file, none when there is no file. Refused: it cannot be read, or could not be written.
[[nodiscard]] Result<std::optional<std::string>> read_state_file(const std::string& path);

}  // namespace berth::plant
