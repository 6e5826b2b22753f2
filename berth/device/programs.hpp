/// A device that is programmed over the bus (CiA 302-3; docs/programs.md): its boot loader, and the objects for a
/// manager.
///
///     1F50h:n  takes the image of program n, n = 1..count          1F56h:n  its identification: the content's CRC-32
///     1F51h:n  stops, starts, resets and clears it                 1F57h:n  whether the flash memory is busy, and an
///     error 1F52h    date and time of the latest program
///
/// Program 1 is the device's own: while it does not run, the device is in its boot loader. The loader has the same
/// objects, answers SDO and does not become operational. Power-on and NMT reset node start the valid programs. Stopping
/// program 1 restarts the device into its boot loader, starting it restarts the device out of the loader; the SDO
/// answer is sent before. The other programs start and stop without a restart.
///
/// Refused:
/// - a download or clearing of a started program, and everything while the memory is busy: 0800 0022
/// - a start without a valid program: 0800 0024
/// - another command: 0609 0030
/// - an image longer than `longest`: 0504 0005
/// - an image that is damaged or for another product: 0800 0020; 1F57h says which
#pragma once

#include <vector>

#include "berth/device/program_memory.hpp"
#include "berth/od/values.hpp"

namespace berth::od {
class DescriptionBuilder;
}

namespace berth::device {

struct ProgramOptions {
  NvMemory* memory = nullptr;  ///< `ProgramMemory::footprint` bytes; null: the device has no programs
  ProgramLayout layout;
  bool checked = true;  ///< accept only images with a head (program_image.hpp); else any bytes are a program
  rt::Duration restart = std::chrono::milliseconds(10);  ///< from the answer to a stop or start to the restart
};
/// 1F50h to 1F52h, 1F56h, 1F57h, for so many programs.
void add_programs(od::DescriptionBuilder& builder, std::uint8_t count = 1);

/// Errors of 1F57h, bits 1 to 7.
enum class FlashError : std::uint8_t {
  none = 0,
  no_program = 1,   ///< no valid one
  format = 2,       ///< unknown
  damaged = 3,      ///< format or CRC; also: of another product
  not_cleared = 4,  ///< before writing
  write = 5,
  address = 6,  ///< does not fit
};

class Programs final : private od::Hook, private od::Stream, private ProgramMemory::Owner, private rt::Job {
 public:
  class Owner {
   public:
    /// Restart the firmware, as NMT reset node does.
    virtual void restart() noexcept = 0;
    /// Answer the pending write of `object`.
    virtual void answer(ObjectRef object, od::AbortCode code) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  /// `values` must have the objects (`add_programs`); images for the product `type` are accepted.
  Programs(rt::Executor& executor, od::Values& values, const ProgramOptions& options, TypeCode type, Owner& owner);

  void power_on() noexcept;
  void power_off() noexcept;
  /// The firmware has restarted: after NMT reset node, or after `Owner::restart`.
  void restarted() noexcept;
  /// True if program 1 runs; else the device is in its boot loader.
  [[nodiscard]] bool runs() const noexcept { return started_[0]; }
  [[nodiscard]] bool runs(std::uint8_t number) const noexcept { return started_[number - 1U]; }
  [[nodiscard]] bool downloading() const noexcept { return open_; }
  [[nodiscard]] const ProgramMemory& memory() const noexcept { return memory_; }

 private:
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  od::AbortCode open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept override;
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override;
  od::AbortCode close(ObjectRef ref, bool complete) noexcept override;
  void memory_ready(bool ok) noexcept override;
  void run() noexcept override;

  [[nodiscard]] od::AbortCode control(std::uint8_t number, std::uint8_t command) noexcept;
  [[nodiscard]] od::AbortCode set_started(std::uint8_t number, bool on) noexcept;
  void start_valid() noexcept;
  [[nodiscard]] od::AbortCode take_head() noexcept;
  [[nodiscard]] od::AbortCode take_content(std::span<const std::uint8_t> bytes) noexcept;
  od::AbortCode refuse(FlashError error, od::AbortCode code) noexcept;
  [[nodiscard]] std::uint32_t shown(ObjectRef ref) const noexcept;

  rt::Executor* executor_;
  ProgramOptions options_;
  TypeCode type_;
  Owner* owner_;
  ProgramMemory memory_;
  std::vector<bool> started_;
  std::vector<FlashError> errors_;
  std::array<std::uint8_t, ProgramHead::size> raw_head_{};
  ProgramHead head_;
  ObjectRef awaited_{};       // the pending write; 0: none
  std::size_t received_ = 0;  // bytes of the image
  std::size_t content_ = 0;   // content bytes among them
  std::uint32_t crc_ = 0;     // of the content
  std::uint8_t number_ = 1;   // for the download or clearing under way
  bool open_ = false;         // a download
  bool into_loader_ = false;  // the next restart enters the loader
  std::array<std::uint8_t, 4> shown_{};
};

}  // namespace berth::device
