/// Configurations that were given while Berth ran (by 1F20h, 1F22h or `berth configure --from`), kept after Berth ends:
/// one file per slot, in a folder beside the slot table. The file's name shows its form: `.dcf` is a DCF, `.cdcf` a
/// concise one, as `config =` accepts them.
///
/// A file is replaced whole: written under another name, synced, renamed. If a crash leaves a new file and an old one
/// of the other form, the newer counts.
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
    std::filesystem::path folder = {};  ///< created with the first file; empty: nothing is kept
    std::string machine_file = {};      ///< `as_named` gives paths relative to its folder
    bool writes = true;                 ///< false: existing files count, and are left as they are
  };

  WrittenFiles() = default;
  explicit WrittenFiles(Place place) : place_(std::move(place)) {}

  /// The slot's file; empty: it has none.
  [[nodiscard]] std::string of(const places::SlotName& slot) const;
  /// Replaces the slot's file, of either form. Returns its path; empty: nothing is kept here. Errors: `io`, with the
  /// path and the system's reason; then the slot keeps its old file.
  [[nodiscard]] Result<std::string> keep(const places::SlotName& slot, Form form,
                                         std::span<const std::uint8_t> bytes) const;
  /// The slot has no file any more. Errors: `io`.
  [[nodiscard]] Result<void> drop(const places::SlotName& slot) const;
  /// The path as `config =` of the machine file has it.
  [[nodiscard]] std::string as_named(const std::string& path) const;

 private:
  [[nodiscard]] std::filesystem::path path_of(const places::SlotName& slot, Form form) const;
  Place place_;
};

}  // namespace berth::operate
