/// What a device of a plant file is made of, wherever it sits: on a simulated bus (`SimDevice`) or on a port
/// (`PortDevice`). Inside of room `plant`.
#pragma once

#include <functional>
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
#include "berth/manager/node_id_assigner.hpp"
#include "berth/network/dictionary_manager.hpp"
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

/// The memory of a simulated master for the node-IDs that it gives, beside that of its parameters: it outlives power,
/// and takes no time.
class SimListMemory final : public manager::ListMemory {
 public:
  [[nodiscard]] std::size_t size() const noexcept override { return manager::ListStore::footprint; }
  void read(std::size_t at, std::span<std::uint8_t> into) const noexcept override;
  bool write(std::size_t at, std::span<const std::uint8_t> bytes) noexcept override;

  /// Called after each write; may be empty.
  void on_write(std::function<void()> callback) { on_write_ = std::move(callback); }
  /// From now on `bytes` more bytes are written, and `cut` is called in the middle of that write: it may only post a
  /// job that cuts the power. The byte at which it stops holds `torn` (0..255), or what it held (-1).
  void cut_after(std::uint64_t bytes, std::function<void()> cut, int torn = -1);

  /// The content up to the last byte ever written; the rest is blank.
  [[nodiscard]] std::span<const std::uint8_t> image() const noexcept { return bytes_; }
  void restore(std::span<const std::uint8_t> image) { bytes_.assign(image.begin(), image.end()); }

 private:
  std::vector<std::uint8_t> bytes_;
  std::function<void()> on_write_;
  std::function<void()> cut_;
  std::uint64_t left_ = 0;  // bytes until the planned cut
  int torn_ = -1;
};

/// What makes a device the NMT master of its bus (key `master`).
struct PlantMastery {
  // Only of one that is no flying master.
  std::unique_ptr<SimListMemory> memory{};
  std::unique_ptr<manager::ListStore> store{};
  std::unique_ptr<manager::NodeIdAssigner> assigner{};
  std::unique_ptr<network::DictionaryManager> manager{};  ///< null: it is no master
};
/// `device` is the plan's, and observes nothing of its NMT state by `on()` yet. All must stay.
[[nodiscard]] PlantMastery master_of(const PlantDevice& plan, can::Dispatcher& dispatcher, device::Device& device);

/// For `Kept`; empty where there is none.
[[nodiscard]] std::vector<std::uint8_t> list_memory_of(const PlantMastery& mastery);

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
  std::vector<std::uint8_t> list_memory;  ///< of a master's `SimListMemory`
  std::string name;
};
[[nodiscard]] std::string write_state(std::span<const Kept> devices);
[[nodiscard]] Result<std::vector<Kept>> parse_state(std::string_view text);
/// By renaming, so that it is whole at any time; false: the old one stays.
bool write_state_file(const std::string& path, std::string_view text);
/// The text of a state file, none when there is no file. Refused: it cannot be read, or could not be written.
[[nodiscard]] Result<std::optional<std::string>> read_state_file(const std::string& path);

}  // namespace berth::plant
