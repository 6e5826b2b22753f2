/// A process image that a device keeps up to date: maps variables by name to objects of its dictionary.
///
///     process::DeviceImage link(device, executor, image.network(),
///                               std::vector<process::Bound>{{"Silo level", {0x6000, 1}}, {"Belt motor", {0x6200, 1}}},
///                               {.cycle = 5ms, .application_timeout = 50ms});
///     for (const auto& problem : link.problems()) …
///
/// Output variables: all writes from the network in one instant (RPDOs, SDO) are one publication, and the content of
/// one RPDO is never torn. Each has a validity: `BERTH_WAITING` until it is received for the first time in operational,
/// `BERTH_SILENT` when the deadline of its RPDO (1400h:05) has passed.
///
/// Input variables: read every `cycle`, or when `exchange` is called (for example, on SYNC); changed ones are written
/// to the dictionary, which is an event for the TPDOs that map them.
///
/// An error of the application (`ApplicationSide::set_error`) becomes one of the device: EMCY, 1001h and 1003h.
///
/// After its first commit, the application counts as lost when it commits nothing for `application_timeout`. Then EMCY
/// 6100h (software, internal) is sent, the application's own error is cleared, and all input variables become 0, so
/// that no device continues with values of an ended program. Its next commit ends this.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/device/device.hpp"
#include "berth/process/device_diagnosis.hpp"
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
  static constexpr std::uint16_t application_lost = 0x6100;
  struct Options {
    rt::Duration cycle{};                ///< 0: only `exchange`
    rt::Duration application_timeout{};  ///< 0: none
    bool hold = false;                   ///< keep the inputs of a lost application
    const can::Port* port = nullptr;     ///< source of the bus state for the diagnosis
  };
  /// All calls from the executor's thread; device and image must outlive it, and the device must not run after its end.
  /// It adds to the device's callbacks: existing ones are still called. Only the constructor uses the heap.
  DeviceImage(device::Device& device, rt::Executor& executor, NetworkSide& image, std::span<const Bound> bound,
              const Options& options);
  DeviceImage(const DeviceImage&) = delete;
  DeviceImage& operator=(const DeviceImage&) = delete;

  /// Variables and objects that do not match, and why; all others are bound.
  [[nodiscard]] std::span<const std::string> problems() const noexcept { return problems_; }
  /// Publishes the values of the dictionary, and takes the application's committed values.
  void exchange() noexcept;
  /// True when an application was there and is lost.
  [[nodiscard]] bool lost() const noexcept { return lost_; }

  /// Time from the end of the first frame of a snapshot until the application's result for that snapshot was in the
  /// dictionary and its TPDOs in the queue.
  struct Reactions {
    std::uint64_t count = 0;
    rt::Duration shortest{};
    rt::Duration longest{};
    rt::Duration sum{};
  };
  [[nodiscard]] const Reactions& reactions() const noexcept { return reactions_; }

 private:
  struct Line {
    ObjectRef object;
    const std::uint8_t* from;
    std::uint32_t offset;
    std::uint32_t size;
    std::uint32_t number;
  };
  void bind(const Bound& bound);
  void listen();
  void run() noexcept override;
  void publish() noexcept;
  void take() noexcept;
  void silent(unsigned rpdo) noexcept;
  void received(std::uint32_t output) noexcept;
  void react() noexcept;
  void tell_error() noexcept;
  void write(const Line& line, std::span<const std::uint8_t> value) noexcept;
  void supervise() noexcept;

  device::Device* device_;
  rt::Executor* executor_;
  NetworkSide* image_;
  Options options_;
  DeviceDiagnosis diagnosis_;
  rt::Later<DeviceImage, &DeviceImage::publish> publish_{*this, *executor_};
  std::vector<Line> outputs_;
  std::vector<Line> inputs_;
  std::vector<std::string> problems_;
  // By number of publication: when its first frame came; never: it had none.
  std::array<rt::Time, 64> began_;
  rt::Time first_ = rt::never;  // frame after the last publication
  std::uint64_t seen_ = 0;
  Reactions reactions_;
  std::uint16_t error_ = 0;         // of the application
  rt::Time committed_ = rt::never;  // never: not so far
  bool lost_ = false;
};

}  // namespace berth::process
