/// Loads and controls a device's programs (CiA 302-3; docs/programs.md): 1F50h takes a program's image; 1F51h stops,
/// clears and starts it; 1F56h identifies it; 1F57h shows the state of the device's flash memory.
///
///     ProgramLoader loader(access, wishes, options);
///     ProgramReport report;
///     const auto done = co_await loader.run(report);
///
/// What it does, in this order:
///   1. stop (1F51h = 0). The device may restart into its boot loader: it is asked until it answers again
///   2. clear (1F51h = 3), and 1F57h is read until the memory is idle
///   3. the image, by block transfer; segmented for a device without block transfer
///   4. 1F57h is read until the memory is idle; an error there is a failure
///   5. 1F56h must be the expected identification, if there is one
///   6. start (1F51h = 1), and 1F51h is read until it confirms this
/// `is_the_same` is called before 1, 2 and 6. Steps 1 to 5 for each program, then 6. Features that a device lacks
/// (1F57h, 1F56h, clearing) are omitted. If the device falls silent or restarts meanwhile, everything is repeated,
/// `tries` times in all.
#pragma once

#include <functional>
#include <span>
#include <string_view>

#include "berth/co/sdo_access.hpp"
#include "berth/manager/program_transfers.hpp"
#include "berth/rt/task.hpp"

namespace berth::manager {

/// Values written to 1F51h, and read from it.
enum class ProgramControl : std::uint8_t {
  stop = 0,   ///< read: stopped
  start = 1,  ///< read: started
  reset = 2,  ///< to the program's beginning; read: stopped, too
  clear = 3,  ///< read: there is no program
};
[[nodiscard]] std::string_view name(ProgramControl state) noexcept;  ///< as read: "stopped", "started", ...
/// The error field of 1F57h (bits 1 to 7) in words: "its format or checksum is wrong"; empty: no error.
[[nodiscard]] const char* flash_error(std::uint32_t status) noexcept;
[[nodiscard]] constexpr bool flash_busy(std::uint32_t status) noexcept { return (status & 1U) != 0; }

/// A program wanted in a device.
struct ProgramWish {
  std::uint8_t number = 1;              ///< sub-index of 1F50h to 1F57h, 1..254
  std::span<const std::uint8_t> image;  ///< must stay
  std::uint32_t identification = 0;     ///< the expected 1F56h; 0: any
};

enum class ProgramStage : std::uint8_t { stopping, clearing, downloading, flashing, checking, starting };
[[nodiscard]] std::string_view name(ProgramStage stage) noexcept;  ///< "stopping", ...

struct ProgramProgress {
  ProgramStage stage = ProgramStage::stopping;
  std::uint8_t number = 1;
  std::size_t done = 0;  ///< bytes sent; other stages: 0
  std::size_t total = 0;
};

struct ProgramOptions {
  /// For each answer of a download: a device writes its flash memory before it acknowledges a sub-block.
  rt::Duration answer_time = std::chrono::seconds(5);
  rt::Duration poll = std::chrono::milliseconds(100);    ///< between two reads of 1F57h and 1F51h
  rt::Duration flash_time = std::chrono::seconds(60);    ///< for clearing, and for writing after the download
  rt::Duration restart_time = std::chrono::seconds(10);  ///< into its boot loader, and out of it
  unsigned tries = 3;
  bool block = true;                      ///< false: segmented from the start
  ProgramTransfers* transfers = nullptr;  ///< of the bus; null: this one alone
  /// Called when the device is told to restart: its next boot-up message is no error. May be empty.
  std::function<void()> expects_boot_up = {};
  /// Whether it is still the intended device. Another device, which needs no program, may boot under its node-ID
  /// whenever this one is silent. An error says why not: nothing more is written then. May be empty: no check.
  std::function<rt::Task<Result<void>>()> is_the_same = {};
  /// Called at the beginning of each stage, and during a download for each hundredth. May be empty.
  std::function<void(const ProgramProgress&)> progress = {};
};

struct ProgramReport {
  ProgramStage stage = ProgramStage::stopping;  ///< the last stage
  std::uint8_t number = 1;                      ///< the last program
  std::size_t bytes = 0;                        ///< of images that the device accepted
  unsigned tries = 0;
};
/// "program 1: downloading: ..."
[[nodiscard]] std::string describe(const ProgramReport& report, const Error& error);

class ProgramLoader {
 public:
  /// All must outlive `run`.
  ProgramLoader(co::SdoAccess& device, std::span<const ProgramWish> wishes, const ProgramOptions& options) noexcept
      : device_(&device), wishes_(wishes), options_(&options) {}

  /// Errors: a refusal by the device (Errc::aborted), its silence (timeout); Errc::mismatch with the text of
  /// `flash_error`, or if it reports another identification, or does not start.
  [[nodiscard]] rt::Task<Result<void>> run(ProgramReport& report);

 private:
  rt::Task<Result<void>> once(ProgramReport& report);
  rt::Task<Result<void>> bring(const ProgramWish& wish, ProgramReport& report);
  rt::Task<Result<void>> identify();
  rt::Task<Result<void>> clear(const ProgramWish& wish);
  rt::Task<Result<void>> download(const ProgramWish& wish, ProgramReport& report);
  rt::Task<Result<void>> check(const ProgramWish& wish);
  void enter(ProgramReport& report, ProgramStage stage, const ProgramWish& wish) const;

  co::SdoAccess* device_;
  std::span<const ProgramWish> wishes_;
  const ProgramOptions* options_;
};

/// Steps 1 and 6 by themselves.
[[nodiscard]] rt::Task<Result<void>> stop_program(co::SdoAccess& device, std::uint8_t number,
                                                  const ProgramOptions& options);
[[nodiscard]] rt::Task<Result<void>> start_program(co::SdoAccess& device, std::uint8_t number,
                                                   const ProgramOptions& options);
/// Clears a stopped program and waits for the memory.
[[nodiscard]] rt::Task<Result<void>> clear_program(co::SdoAccess& device, std::uint8_t number,
                                                   const ProgramOptions& options);
/// 1F51h reports it as stopped. False also if the device has none, or does not answer.
[[nodiscard]] rt::Task<bool> is_stopped(co::SdoAccess& device, std::uint8_t number);

}  // namespace berth::manager
