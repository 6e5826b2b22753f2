/// A process image that a device keeps up to date: objects of its dictionary by the variables' names.
///
///     process::DeviceImage link(device, executor, image.network(),
///                               std::vector<process::Bound>{{"Silo level", {0x6000, 1}}, {"Belt motor", {0x6200, 1}}},
///                               {.cycle = 5ms, .application_timeout = 50ms});
///     for (const auto& problem : link.problems()) …
///
/// Output variables: whatever the network wrote in one instant (RPDOs, SDO) is one publication, and what one RPDO
/// carries is never torn. Each has a validity: `BERTH_WAITING` until it is received for the first time in operational,
/// `BERTH_SILENT` when the deadline of its RPDO (1400h:05) has passed.
///
/// Input variables: taken every `cycle`, or when `exchange` is called, on SYNC say; changed ones are written to the
/// dictionary, an event of the TPDOs that map them.
///
/// An error of the application (`ApplicationSide::set_error`) is the device's: EMCY, 1001h and 1003h.
///
/// The application is lost when it commits nothing for `application_timeout`; from its first commit on. Then EMCY 6100h
/// (software, internal) is told, its own error is over, and all input variables become 0, so that no device goes on
/// with what a program wrote that has ended; its next commit ends both.
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
    bool hold = false;                   ///< the inputs of an application that is lost stay as they are
    const can::Port* port = nullptr;     ///< whose state the diagnosis has
  };
  /// All of the executor's thread; device and image must outlive it, and the device must not run any more when it is
  /// gone. It adds to the device's callbacks: those that are set already are called, too. Uses the heap, here only.
  DeviceImage(device::Device& device, rt::Executor& executor, NetworkSide& image, std::span<const Bound> bound,
              const Options& options);
  DeviceImage(const DeviceImage&) = delete;
  DeviceImage& operator=(const DeviceImage&) = delete;

  /// Variables and objects that do not fit each other, and why; all others are bound.
  [[nodiscard]] std::span<const std::string> problems() const noexcept { return problems_; }
  /// Publishes what the dictionary holds, and takes what the application committed.
  void exchange() noexcept;
  /// An application was there, and is lost.
  [[nodiscard]] bool lost() const noexcept { return lost_; }

  /// From the end of the first frame that a snapshot brought until what the application made of that snapshot was in
  /// the dictionary, its TPDOs in the queue.
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
  // By number of publication: when its first frame came; never: it brought none.
  std::array<rt::Time, 64> began_;
  rt::Time first_ = rt::never;  // frame after the last publication
  std::uint64_t seen_ = 0;
  Reactions reactions_;
  std::uint16_t error_ = 0;         // of the application
  rt::Time committed_ = rt::never;  // never: not yet
  bool lost_ = false;
};

}  // namespace berth::process
