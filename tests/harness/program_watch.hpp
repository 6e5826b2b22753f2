// Checks whenever a device changes: is one operational with anything but its slot's program?
#pragma once

#include <fmt/format.h>

#include <string>
#include <vector>

#include "berth/base/crc.hpp"
#include "berth/device/program_image.hpp"
#include "berth/device/programs.hpp"
#include "tests/harness/rig.hpp"

namespace berth::harness {

// The program's identification; 0: there is no complete program.
inline std::uint32_t program_of(const plant::SimDevice& device) {
  const auto& memory = device.device().programs()->memory();
  const auto& program = memory.program(1);
  std::vector<std::uint8_t> bytes(program.valid ? program.length : 0);
  if (program.valid) memory.read(1, 0, bytes);
  return program.valid ? crc32(bytes) : 0;
}

class ProgramWatch final : private plant::World::Observer {
 public:
  // `right`: the identification for every device that is programmed.
  ProgramWatch(plant::World& world, std::uint32_t right) : world_(world), right_(right) { world.add_observer(*this); }
  ~ProgramWatch() { world_.remove_observer(*this); }
  ProgramWatch(const ProgramWatch&) = delete;
  ProgramWatch& operator=(const ProgramWatch&) = delete;

  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }
  // Empty: the device runs its slot's program.
  [[nodiscard]] std::string check(const plant::SimDevice& device) const {
    const auto has = program_of(device);
    if (has != right_) return fmt::format("{} has program {:08X}h instead of {:08X}h", device.name(), has, right_);
    return device.device().programs()->runs() ? std::string() : device.name() + " does not run its program";
  }

 private:
  void plant_changed(const plant::SimDevice& device) noexcept override {
    const bool programmed = device.device().programs() != nullptr;
    const bool runs = programmed && device.powered() && device.device().state() == NmtState::operational;
    if (!runs || !failure_.empty()) return;
    const auto has = program_of(device);
    if (has != right_) failure_ = fmt::format("{} is operational with program {:08X}h", device.name(), has);
  }
  plant::World& world_;
  std::uint32_t right_;
  std::string failure_;
};

}  // namespace berth::harness
