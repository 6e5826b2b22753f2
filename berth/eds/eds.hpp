/// Electronic data sheets and device configuration files (CiA 306): reading.
///
/// The reader is tolerant: it accepts what files in the field contain, reports each oddity with line, column and key,
/// and refuses (a finding of severity `error`) only what it cannot understand: a value that is no value of its type, a
/// file without objects, a file beyond the limits below. Every row of docs "hard cases" §4 is a test
/// (tests/eds/quirks_test.cpp).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/ids.hpp"
#include "berth/eds/document.hpp"
#include "berth/od/description.hpp"

namespace berth::eds {

/// [FileInfo]: texts as they stand in the file, as UTF-8.
struct FileInfo {
  std::string file_name;
  std::string file_version;
  std::string file_revision;
  std::string eds_version;  ///< "" when missing, which means 3.0
  std::string description;
  std::string creation_time;  ///< hh:mmAM
  std::string creation_date;  ///< mm-dd-yyyy
  std::string created_by;
  std::string modification_time;
  std::string modification_date;
  std::string modified_by;
  std::string last_eds;  ///< DCF: the EDS it was made from
};

/// [DeviceInfo]. Numbers that are missing or unreadable are empty.
struct DeviceInfo {
  std::string vendor_name;
  std::optional<std::uint32_t> vendor_number;
  std::string product_name;
  std::optional<std::uint32_t> product_number;
  std::optional<std::uint32_t> revision_number;
  std::string order_code;
  std::vector<std::uint16_t> baud_rates;  ///< supported bit rates in kbit/s, ascending
  bool boot_up_master = false;
  bool boot_up_slave = false;
  std::uint8_t granularity = 0;  ///< smallest unit of a PDO mapping in bits; 0 = the mapping is fixed
  bool dynamic_channels = false;
  bool group_messaging = false;
  std::uint16_t rpdos = 0;  ///< NrOfRXPDO
  std::uint16_t tpdos = 0;
  bool lss = false;              ///< LSS_Supported
  std::uint8_t compact_pdo = 0;  ///< bit n = sub-index n+1 of each PDO's communication record exists
};

/// [DeviceComissioning] of a DCF (also read when spelt DeviceCommissioning).
struct Commissioning {
  std::optional<NodeId> node_id;
  std::string node_name;
  std::optional<std::uint16_t> baud_rate;  ///< kbit/s
  std::optional<std::uint32_t> net_number;
  std::string network_name;
  bool canopen_manager = false;
  std::optional<std::uint32_t> lss_serial_number;
  std::string node_refd;
  std::string net_refd;
};

/// A value that the file sets (ParameterValue or [xxxxValue]) as against one it gives as the device's default.
struct Parameter {
  ObjectRef object;
  od::DataType type = od::DataType::none;
  od::Literal value;
  std::uint32_t line = 0;
};

/// UploadFile or DownloadFile of a DOMAIN: a plain file name beside the DCF. Names that lead elsewhere (`../`, absolute
/// paths, drive letters) are reported and left out: the file is untrusted input.
struct FileReference {
  ObjectRef object;
  bool download = false;  ///< the file's content is written to the device; else the device's is stored there
  std::string name;
};

/// `Denotation`: the application's name of an object.
struct Denotation {
  ObjectRef object;
  std::string text;
};

/// Everything that was understood.
struct File {
  Document document;
  /// Never null after `read`; of a file with errors what could be understood. The initial values are the file's
  /// ParameterValues where it has any, else its DefaultValues.
  std::shared_ptr<const od::Description> description;
  FileInfo info;
  DeviceInfo device;
  std::optional<Commissioning> commissioning;
  std::vector<Parameter> parameters;           ///< ascending by object
  std::vector<FileReference> file_references;  ///< ascending by object
  std::vector<Denotation> denotations;         ///< ascending by object

  /// Vendor-ID and product code: of object 1018h where it gives them and they are not 0, else of [DeviceInfo].
  [[nodiscard]] TypeCode type_code() const;
  /// The revision number, likewise.
  [[nodiscard]] std::uint32_t revision() const;

 private:
  [[nodiscard]] std::uint32_t identity(std::uint8_t sub, const std::optional<std::uint32_t>& otherwise) const;
};

struct Reading {
  File file;
  Findings findings;  ///< by line
  [[nodiscard]] bool usable() const noexcept { return !has_errors(findings); }
};

/// Bounds on what a hostile file can make the reader do.
struct ReadOptions {
  std::size_t max_bytes = 64U << 20U;        ///< a longer file is refused
  std::size_t max_sub_objects = 1U << 18U;   ///< after expanding CompactSubObj and CompactPDO
  std::size_t max_value_bytes = 64U << 20U;  ///< names and defaults after expanding
  std::size_t max_findings = 1000;
};

/// Reads the text of an EDS or DCF. `file_name` is only for the findings. No I/O, no exceptions but bad_alloc.
[[nodiscard]] Reading read(std::string text, std::string_view file_name, const ReadOptions& options = {});
/// Reads a file; one that cannot be opened or is too long is a Reading with one error.
[[nodiscard]] Reading read_file(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace berth::eds
