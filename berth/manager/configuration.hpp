/// What a device's configuration shall be, as a file says it: a DCF (CiA 306), an XDC (CiA 311) or a concise DCF
/// (CiA 302-3, 1F22h). Plain data. `configurator.hpp` brings it into a device.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/od/data_type.hpp"

namespace berth::manager {

/// The configuration date of object 1020h (CiA 301 §7.5.2.24). A device sets both to 0 when a value of its
/// configuration changes; a configuration manager writes them last (CiA 302-3, 1F26h and 1F27h are what it expects).
struct ConfigurationDate {
  std::uint32_t days = 0;  ///< sub-index 1: days since 1984-01-01
  std::uint32_t ms = 0;    ///< sub-index 2: milliseconds after midnight
  /// A 0 in either means "not configured".
  [[nodiscard]] constexpr bool valid() const noexcept { return days != 0 && ms != 0; }
  friend constexpr bool operator==(const ConfigurationDate&, const ConfigurationDate&) noexcept = default;
};
/// "2025-01-15 09:00:00.000".
[[nodiscard]] std::string to_string(const ConfigurationDate& date);

/// One value that the file sets.
struct Setting {
  ObjectRef object;
  od::DataType type = od::DataType::none;  ///< none: of a concise DCF
  od::Literal value;                       ///< may be `$NODEID` + n
  std::string name;                        ///< "Heartbeat: Producer heartbeat time"; empty when the file gives none
  std::uint32_t line = 0;                  ///< in the file; 0 = a file without lines
  bool compare_only = false;               ///< ro, const, or ObjFlags bit 0: never written, but must agree
};

/// A file's settings, for any node of the type. What no configuration manager touches is left out: error and status
/// registers (1001h to 1003h), the time stamp 1013h, the commands of 1010h, 1011h and 1023h to 1026h, programs
/// (1F50h to 1F57h), and read-only process values, which are what the process makes them. 1020h is `date`.
struct Configuration {
  std::string file;               ///< as messages name it
  std::vector<Setting> settings;  ///< ascending by object, each object once
  ConfigurationDate date;         ///< the file's own values of 1020h; 0, 0 = none
  std::uint32_t modified = 0;  ///< [FileInfo] ModificationDate (else CreationDate) in days since 1984-01-01; 0 = none
  TypeCode type;               ///< vendor-ID and product code; 0, 0 = the file does not say
  std::optional<NodeId> node_id;  ///< [DeviceComissioning] NodeID
  std::uint32_t device_type = 0;  ///< 1000h; 0 = the file does not say
  std::uint32_t revision = 0;     ///< [DeviceInfo] RevisionNumber; 0 = the file does not say
};

/// Values that the devices of slots shall have besides those of `config =`, and instead of them where both say
/// something: what the machine's links need. By the slots' names.
using SlotSettings = std::map<std::string, std::shared_ptr<const Configuration>, std::less<>>;

struct LoadedConfiguration {
  Configuration configuration;
  Findings findings;
  [[nodiscard]] bool usable() const noexcept { return !has_errors(findings); }
};

/// Reads a DCF or XDC (`.dcf`, `.eds`, `.xdc`, `.xdd`) or a concise DCF (any other name). A DCF's DOMAINs take the
/// content of their DownloadFiles, which stand beside it. A PDO or SDO channel of which the file sets anything gets the
/// file's default as its COB-ID when the file sets none: what an interrupted configuration switched off is switched on
/// again. Findings: as the reader of the file has them (errors and warnings), and an error when it sets nothing.
[[nodiscard]] LoadedConfiguration load_configuration(const std::filesystem::path& path);
/// The same of the text of a DCF or XDC (1F20h), and of a concise DCF (1F22h). `name` is for the findings and messages.
/// A DownloadFile is an error: there is no folder.
[[nodiscard]] LoadedConfiguration read_configuration(std::string text, const std::string& name);
[[nodiscard]] LoadedConfiguration read_concise_configuration(std::span<const std::uint8_t> stream,
                                                             const std::string& name);

/// One value as one node shall have it.
struct Entry {
  ObjectRef object;
  std::vector<std::uint8_t> bytes;  ///< as an SDO carries them
  od::DataType type = od::DataType::none;
  std::string name;
  std::uint32_t line = 0;
  bool compare_only = false;
  bool own = false;  ///< the configuration manager's, not the file's: looked at even when the date agrees
};

struct Wanted {
  std::string file;
  TypeCode type = {};  ///< as `Configuration::type`
  std::vector<Entry>
      entries;  ///< ascending by object, each once; mapping entries beyond their sub-index 0 are left out
  /// What 1020h shall be. The file's own when it is valid. Else made from what is wanted, so that another value is
  /// another date: the days are the file's modification date, or come from a hash when there is none; the milliseconds
  /// are a hash of all entries.
  ConfigurationDate date;
};

/// Both, as one file: where they differ about an object `over` counts, and what is said of the whole is of `base`. A
/// date that the file gives itself is left out: it stands for less than all of it.
[[nodiscard]] Configuration joined(const Configuration& base, const Configuration& over);

/// For one node; `own` replaces or adds values. Errors: `Errc::invalid` with the object whose value cannot be had.
[[nodiscard]] Result<Wanted> wanted(const Configuration& configuration, NodeId node, std::span<const Entry> own = {});

/// For people: "26 (0x1A)", large numbers in hex alone, texts quoted, bytes in hex, long ones cut.
[[nodiscard]] std::string print_value(od::DataType type, std::span<const std::uint8_t> bytes);

}  // namespace berth::manager
