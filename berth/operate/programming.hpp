/// The programs of the slots' devices (docs/programs.md): what `programs =` wants, and its download before a device is
/// started, or when a user asks for it.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "berth/manager/program_loader.hpp"
#include "berth/network/boot_slave.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// A program as it is downloaded.
struct ProgramImage {
  std::vector<std::uint8_t> bytes;
  std::uint32_t identification = 0;  ///< CRC-32 of the content, without an image's head
  TypeCode type{};                   ///< the product that its head names; 0, 0: none, or no head
};
/// Errc::io: it cannot be read. Errc::invalid: it is empty, or longer than 16 MiB.
[[nodiscard]] Result<ProgramImage> load_program(const std::string& file);
/// The same of a file's content.
[[nodiscard]] Result<ProgramImage> program_of(std::vector<std::uint8_t> bytes);
/// Replaces a program's file, atomically; its earlier content is in FILE.before then. 0, or an errno.
[[nodiscard]] int replace_program(const std::string& file, std::span<const std::uint8_t> bytes);

/// Whether the device answers and is of the product that the image names. Asked before its program is stopped and
/// cleared, because a device that refuses the image afterwards has no program left. Errc::mismatch: another vendor-ID
/// or product code (1018h). A device without that object may be of any product.
rt::Task<Result<void>> suits(const ProgramImage& image, co::SdoAccess& device);

class Programming {
 public:
  Programming(BusServices& services, SlotTable& slots) noexcept
      : s_(services), slots_(slots), transfers_(services.dispatcher) {}

  /// Sets what the boot-up of the slot's device checks. A file that cannot be read: no program is expected, which is
  /// letter G.
  void expect(const Seat& seat, manager::SlaveRules& rules);
  /// What is wrong with the slot's files; empty: nothing.
  [[nodiscard]] std::string unreadable(const Seat& seat);
  /// `BootSource::other_programs` and `BootSource::update` of the slot's device.
  rt::Task<Result<std::string>> others(Seat& seat, network::BootTarget& target);
  rt::Task<Result<void>> update(Seat& seat, network::BootTarget& target);

  /// Shared by all downloads on this bus.
  [[nodiscard]] manager::ProgramTransfers& transfers() noexcept { return transfers_; }

 private:
  /// The slot's device answers under its node-ID. A boot loader may lack parts of 1018h: those it has are compared.
  rt::Task<Result<void>> is_the_same(const Seat& seat, network::BootTarget& target);
  /// Each file is read when first needed, and again after it changed.
  struct Loaded {
    std::int64_t changed = 0;  ///< time of its last change
    Result<ProgramImage> image = fail(Errc::io, "not read yet");
  };
  const Result<ProgramImage>& image(const std::string& file);
  [[nodiscard]] std::uint32_t expected(const places::SlotProgram& program);

  BusServices& s_;
  SlotTable& slots_;
  manager::ProgramTransfers transfers_;
  std::map<std::string, Loaded> images_;
};

}  // namespace berth::operate
