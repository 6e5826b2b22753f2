/// Configurations that SDO clients wrote to the manager (1F20h, 1F22h; docs/manager-objects.md), kept over Berth's end:
/// one file a slot, in a folder beside the slot table. What a file is says its name: `.dcf` is a DCF, `.cdcf` a concise
/// one, as `config =` takes them.
///
/// A file is replaced whole: written under another name, synced, renamed. Where a crash came between a new file and the
/// end of an old one of the other form, the newer counts.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "berth/base/result.hpp"
#include "berth/places/slot.hpp"

namespace berth::operate {

class WrittenFiles {
 public:
  enum class Form : std::uint8_t { dcf, concise };
  struct Place {
    std::filesystem::path folder = {};  ///< made when the first file is; empty: nothing is kept
    std::string machine_file = {};      ///< from its folder, `as_named` names files
    bool writes = true;                 ///< false: what is there counts, and is left as it is
  };

  WrittenFiles() = default;
  explicit WrittenFiles(Place place) : place_(std::move(place)) {}

  /// The slot's file; empty: it has none.
  [[nodiscard]] std::string of(const places::SlotName& slot) const;
  /// Instead of what the slot had, of either form. Its path; empty: nothing is kept here. Errors: `io`, with the path
  /// and the system's reason; then the slot has what it had.
  [[nodiscard]] Result<std::string> keep(const places::SlotName& slot, Form form,
                                         std::span<const std::uint8_t> bytes) const;
  /// The slot has none from now on. Errors: `io`.
  [[nodiscard]] Result<void> drop(const places::SlotName& slot) const;
  /// The path as `config =` of the machine file has it.
  [[nodiscard]] std::string as_named(const std::string& path) const;

 private:
  [[nodiscard]] std::filesystem::path path_of(const places::SlotName& slot, Form form) const;
  Place place_;
};

}  // namespace berth::operate
