/// A device that is programmed over the bus (CiA 302-3; docs/programs.md): its boot loader, and the objects that a
/// manager sees.
///
///     1F50h:n  takes the image of program n, n = 1..count          1F56h:n  its identification: the content's CRC-32
///     1F51h:n  stops, starts, resets and clears it                 1F57h:n  whether the flash memory is busy, and an
///     error 1F52h    date and time of the latest program
///
/// Program 1 is the device's own: while it does not run, the device is in its boot loader. That has the same objects,
/// answers SDO and does not become operational. At power-on, and by NMT reset node, what is valid is started. Stopping
/// program 1 restarts the device into its boot loader, starting it restarts the device out of that; the SDO answer
/// leaves before. The other programs start and stop without that.
///
/// Refused: a download or clearing of a program that is started, and everything while the memory is busy: 0800 0022; a
/// start without a valid program: 0800 0024; another command: 0609 0030; an image that is longer than `longest`:
/// 0504 0005; one that is not for this product, or damaged: 0800 0020, and 1F57h says which.
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
  bool checked = true;  ///< only images with a head (program_image.hpp) are taken; else any bytes are a program
  rt::Duration restart = std::chrono::milliseconds(10);  ///< from the answer to a stop or start to the restart
};
/// 1F50h to 1F52h, 1F56h, 1F57h, for so many programs.
void add_programs(od::DescriptionBuilder& builder, std::uint8_t count = 1);

/// Errors of 1F57h, bits 1 to 7.
enum class FlashError : std::uint8_t {
  none = 0,
  no_program = 1,   ///< none that is valid
  format = 2,       ///< not known
  damaged = 3,      ///< format or CRC; also: of another product
  not_cleared = 4,  ///< before it was written
  write = 5,
  address = 6,  ///< it does not fit
};

class Programs final : private od::Hook, private od::Stream, private ProgramMemory::Owner, private rt::Job {
 public:
  class Owner {
   public:
    /// The firmware restarts, as by NMT reset node.
    virtual void restart() noexcept = 0;
    /// The write of `object` that is pending has its answer.
    virtual void answer(ObjectRef object, od::AbortCode code) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  /// `values` must have the objects (`add_programs`); `type` is the product whose images are taken.
  Programs(rt::Executor& executor, od::Values& values, const ProgramOptions& options, TypeCode type, Owner& owner);

  void power_on() noexcept;
  void power_off() noexcept;
  /// The firmware has started anew: after NMT reset node, or after `Owner::restart`.
  void restarted() noexcept;
  /// Program 1 runs; else the device is in its boot loader.
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
  ObjectRef awaited_{};       // the write that is pending; 0: none
  std::size_t received_ = 0;  // bytes of the image
  std::size_t content_ = 0;   // of these, of its content
  std::uint32_t crc_ = 0;     // of the content
  std::uint8_t number_ = 1;   // of the download or clearing under way
  bool open_ = false;         // a download
  bool into_loader_ = false;  // the next restart goes there
  std::array<std::uint8_t, 4> shown_{};
};

}  // namespace berth::device
