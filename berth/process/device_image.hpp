/// A process image that a device keeps up to date: objects of its dictionary by the variables' names.
///
///     process::DeviceImage link(device, executor, image, {{"Silo level", {0x6000, 1}}, {"Belt motor", {0x6200, 1}}},
///                               milliseconds(5));
///     for (const auto& problem : link.problems()) …
///
/// Output variables: whatever the network wrote in one instant (RPDOs, SDO) is one publication, and what one RPDO
/// carries is never torn. Input variables: taken every `cycle`, or when `exchange` is called, on SYNC say; changed ones
/// are written to the dictionary, an event of the TPDOs that map them.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "berth/device/device.hpp"
#include "berth/process/image.hpp"
#include "berth/rt/executor.hpp"
#include "berth/rt/later.hpp"

namespace berth::process {

struct Bound {
  std::string variable;
  ObjectRef object;
};

class DeviceImage final : private rt::Job {
 public:
  /// `cycle` 0: only `exchange`. All of the executor's thread; device and image must outlive it, and the device must
  /// not run any more when it is gone. Uses the heap, here only.
  DeviceImage(device::Device& device, rt::Executor& executor, Image& image, std::span<const Bound> bound,
              rt::Duration cycle);

  /// Variables and objects that do not fit each other, and why; all others are bound.
  [[nodiscard]] std::span<const std::string> problems() const noexcept { return problems_; }
  /// Publishes what the dictionary holds, and takes what the application committed.
  void exchange() noexcept;

 private:
  struct Line {
    ObjectRef object;
    const std::uint8_t* from;
    std::uint32_t offset;
    std::uint32_t size;
  };
  void bind(const Bound& bound);
  void run() noexcept override;
  void publish() noexcept;
  void take() noexcept;

  device::Device* device_;
  rt::Executor* executor_;
  Image* image_;
  rt::Duration cycle_;
  rt::Later<DeviceImage, &DeviceImage::publish> publish_{*this, *executor_};
  std::vector<Line> outputs_;
  std::vector<Line> inputs_;
  std::vector<std::string> problems_;
};

}  // namespace berth::process
