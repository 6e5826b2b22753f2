/// Wrong behaviour of a simulated device: its answers about its identity (1018h), and what it does when its heartbeat
/// time (1017h) is written. Inside of room `plant`.
#pragma once

#include <array>
#include <optional>

#include "berth/device/device.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/rt/executor.hpp"

namespace berth::plant {

class OddAnswers final : private od::Hook, private rt::Job {
 public:
  /// Nothing is odd unless the plan says so. `device` must outlive it.
  OddAnswers(const PlantOddities& plan, device::Device& device, rt::Executor& executor);

 private:
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  void run() noexcept override;

  PlantOddities plan_;
  device::Device* device_;
  rt::Executor* executor_;
  std::array<std::uint8_t, 4> shown_{};
  std::array<std::uint32_t, 4> readings_{};  // of each part of 1018h
  std::optional<std::uint16_t> kept_;        // 1017h, in its own memory
};

}  // namespace berth::plant
