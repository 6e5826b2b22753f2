/// The parts of a plant file's device, for a simulated bus (`SimDevice`) or a port (`PortDevice`). Inside of room
/// `plant`.
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
/// `bit_rate`: used by blank memory, bit/s; `seed`: for the device's own random numbers.
[[nodiscard]] device::Options options_of(const PlantDevice& plan, const LssAddress& address, std::uint32_t bit_rate,
                                         std::uint64_t seed);

/// The flash memory of its programs, with the initial program; null if it is not programmed, or the program's file
/// cannot be read (an error).
[[nodiscard]] std::unique_ptr<device::SimFlash> program_flash_of(const PlantDevice& plan, rt::Executor& executor);
[[nodiscard]] device::ProgramOptions programs_of(const PlantDevice& plan, device::SimFlash* flash);
/// Checks its initial program image; errors are findings.
[[nodiscard]] bool check_programs(const PlantDevice& plan, const od::Description& description, Findings& findings);

/// The memory in which a simulated master keeps the node-IDs that it gives, separate from its parameters' memory. It
/// survives power-off, and writing takes no time.
class SimListMemory final : public manager::ListMemory {
 public:
  [[nodiscard]] std::size_t size() const noexcept override { return manager::ListStore::footprint; }
  void read(std::size_t at, std::span<std::uint8_t> into) const noexcept override;
  bool write(std::size_t at, std::span<const std::uint8_t> bytes) noexcept override;

  /// Called after each write; may be empty.
  void on_write(std::function<void()> callback) { on_write_ = std::move(callback); }
  /// Writes `bytes` more bytes, then calls `cut` in the middle of that write; `cut` may only post a job that cuts the
  /// power. The byte where it stops becomes `torn` (0..255), or keeps its value (-1).
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

/// Makes a device the NMT master of its bus (key `master`).
struct PlantMastery {
  // Unless it is a flying master.
  std::unique_ptr<SimListMemory> memory{};
  std::unique_ptr<manager::ListStore> store{};
  std::unique_ptr<manager::NodeIdAssigner> assigner{};
  std::unique_ptr<network::DictionaryManager> manager{};  ///< null: it is not a master
};
/// `device` belongs to the plan, and must not observe its NMT state by `on()` yet. All must outlive it.
[[nodiscard]] PlantMastery master_of(const PlantDevice& plan, can::Dispatcher& dispatcher, device::Device& device);

/// For `Kept`; empty where there is none.
[[nodiscard]] std::vector<std::uint8_t> list_memory_of(const PlantMastery& mastery);

struct Described {
  std::shared_ptr<const od::Description> description;
  TypeCode type;  ///< with a description file only
  std::uint32_t revision = 0;
  bool unreadable = false;
};

/// Reads each device description once.
class Descriptions {
 public:
  /// Null if it cannot be read. The findings of its first reading: the errors, and a warning about missing mandatory
  /// objects, which the device has nevertheless. `part`: built-in descriptions get the objects of a gateway.
  [[nodiscard]] const Described* of(const PlantDevice& device, Findings& findings, GatewayPart part = {});

 private:
  std::map<std::string, Described> known_;
};
[[nodiscard]] LssAddress address_of(const PlantDevice& device, const Described& described) noexcept;

/// Reads and compiles each device's script once.
class Scripts {
 public:
  /// None for a device without a script, or if the script cannot be read or compiled (an error).
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
/// Replaces the file by renaming, so that it is always whole; false: the old one stays.
bool write_state_file(const std::string& path, std::string_view text);
/// The text of a state file, none when there is no file. Refused: it cannot be read, or could not be written.
[[nodiscard]] Result<std::optional<std::string>> read_state_file(const std::string& path);

}  // namespace berth::plant
