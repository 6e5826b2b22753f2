/// A device's wanted configuration, as a file describes it: a DCF (CiA 306), an XDC (CiA 311) or a concise DCF (CiA
/// 302-3, 1F22h). Plain data. `configurator.hpp` writes it into a device.
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

/// The configuration date of object 1020h (CiA 301 §7.5.2.24). A device sets both values to 0 when its configuration
/// changes; a configuration manager writes them last (CiA 302-3: 1F26h and 1F27h hold the expected date).
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
  od::DataType type = od::DataType::none;  ///< none: from a concise DCF
  od::Literal value;                       ///< may be `$NODEID` + n
  std::string name;                        ///< "Heartbeat: Producer heartbeat time"; empty when the file gives none
  std::uint32_t line = 0;                  ///< in the file; 0 = a file without lines
  bool compare_only = false;               ///< ro, const, or ObjFlags bit 0: never written, but must agree
};

/// A file's settings, for any node of the type. Objects that no configuration manager writes are omitted: error and
/// status registers (1001h to 1003h), the time stamp 1013h, the commands of 1010h, 1011h and 1023h to 1026h, programs
/// (1F50h to 1F57h), and read-only process values, which the process determines. 1020h is `date`.
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

/// Values for the devices of slots that add to those of `config =` and override them: what the machine's links need. By
/// the slots' names.
using SlotSettings = std::map<std::string, std::shared_ptr<const Configuration>, std::less<>>;

struct LoadedConfiguration {
  Configuration configuration;
  Findings findings;
  [[nodiscard]] bool usable() const noexcept { return !has_errors(findings); }
};

/// Reads a DCF or XDC (`.dcf`, `.eds`, `.xdc`, `.xdd`) or a concise DCF (any other name). A DCF's DOMAINs get the
/// content of their DownloadFiles, which are in the same folder. If the file sets anything of a PDO or SDO channel but
/// not its COB-ID, the COB-ID is set to the file's default: this switches on again what an interrupted configuration
/// switched off. Findings: those of the file's reader (errors and warnings), and an error if the file sets nothing.
[[nodiscard]] LoadedConfiguration load_configuration(const std::filesystem::path& path);
/// `.dcf`, `.eds`, `.xdc`, `.xdd`, in any case.
[[nodiscard]] bool is_description(const std::filesystem::path& path);
/// The same from the text of a DCF or XDC (1F20h), and from a concise DCF (1F22h). `name` is for the findings and
/// messages. A DownloadFile is an error, because there is no folder.
[[nodiscard]] LoadedConfiguration read_configuration(std::string text, const std::string& name);
[[nodiscard]] LoadedConfiguration read_concise_configuration(std::span<const std::uint8_t> stream,
                                                             const std::string& name);

/// One value as wanted for one node.
struct Entry {
  ObjectRef object;
  std::vector<std::uint8_t> bytes;  ///< as sent by SDO
  od::DataType type = od::DataType::none;
  std::string name;
  std::uint32_t line = 0;
  bool compare_only = false;
  bool own = false;  ///< set by the configuration manager, not the file: compared even if the date agrees
};

struct Wanted {
  std::string file;
  TypeCode type = {};  ///< as `Configuration::type`
  std::vector<Entry>
      entries;  ///< ascending by object, each once; mapping entries beyond their sub-index 0 are left out
  /// The wanted 1020h: the file's own if valid. Else made from the entries, so that another value gives another date:
  /// the days are the file's modification date, or a hash without one; the milliseconds are a hash of all entries.
  ConfigurationDate date;
};

/// Both as one configuration: `over` overrides single objects, while file-wide properties come from `base`. The file's
/// own date is omitted, because it does not cover all of it.
[[nodiscard]] Configuration joined(const Configuration& base, const Configuration& over);

/// For one node; `own` replaces or adds values. Errors: `Errc::invalid` with the object whose value cannot be computed.
[[nodiscard]] Result<Wanted> wanted(const Configuration& configuration, NodeId node, std::span<const Entry> own = {});

/// For users: "26 (0x1A)", large numbers in hex alone, texts quoted, bytes in hex, long ones cut.
[[nodiscard]] std::string print_value(od::DataType type, std::span<const std::uint8_t> bytes);

}  // namespace berth::manager
