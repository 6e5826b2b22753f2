/// The content of an EDS or DCF (CiA 306) as data: made by `read` (eds.hpp), from an XDD, or by hand, and written by
/// `write`.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/eds/document.hpp"
#include "berth/eds/modules.hpp"
#include "berth/od/description.hpp"

namespace berth::eds {

/// [FileInfo]: the file's texts, as UTF-8.
struct FileInfo {
  std::string file_name = {};
  std::string file_version = {};
  std::string file_revision = {};
  std::string eds_version = {};  ///< "" when missing, which means 3.0
  std::string description = {};
  std::string creation_time = {};  ///< hh:mmAM
  std::string creation_date = {};  ///< mm-dd-yyyy
  std::string created_by = {};
  std::string modification_time = {};
  std::string modification_date = {};
  std::string modified_by = {};
  std::string last_eds = {};  ///< DCF: the EDS it was made from
  friend bool operator==(const FileInfo&, const FileInfo&) = default;
};

/// [DeviceInfo]. Missing or unreadable numbers are empty.
struct DeviceInfo {
  std::string vendor_name = {};
  std::optional<std::uint32_t> vendor_number = {};
  std::string product_name = {};
  std::optional<std::uint32_t> product_number = {};
  std::optional<std::uint32_t> revision_number = {};
  std::string order_code = {};
  std::vector<std::uint16_t> baud_rates = {};  ///< supported bit rates in kbit/s, ascending
  bool boot_up_master = false;
  bool boot_up_slave = false;
  std::uint8_t granularity = 0;  ///< smallest unit of a PDO mapping in bits; 0 = the mapping is fixed
  bool dynamic_channels = false;
  bool group_messaging = false;
  std::uint16_t rpdos = 0;  ///< NrOfRXPDO
  std::uint16_t tpdos = 0;
  bool lss = false;              ///< LSS_Supported
  std::uint8_t compact_pdo = 0;  ///< bit n = sub-index n+1 of each PDO's communication record exists
  friend bool operator==(const DeviceInfo&, const DeviceInfo&) = default;
};

/// [DeviceComissioning] of a DCF (also read when spelt DeviceCommissioning).
struct Commissioning {
  std::optional<NodeId> node_id = {};
  std::string node_name = {};
  std::optional<std::uint16_t> baud_rate = {};  ///< kbit/s
  std::optional<std::uint32_t> net_number = {};
  std::string network_name = {};
  bool canopen_manager = false;
  std::optional<std::uint32_t> lss_serial_number = {};
  std::string node_refd = {};
  std::string net_refd = {};
  friend bool operator==(const Commissioning&, const Commissioning&) = default;
};

/// A value that the file sets (ParameterValue or [xxxxValue]), as opposed to the device's default.
struct Parameter {
  ObjectRef object = {};
  od::DataType type = od::DataType::none;
  od::Literal value = {};
  std::uint32_t line = 0;  ///< its line in the file; 0 = not from a file
};

/// UploadFile or DownloadFile of a DOMAIN: a plain file name beside the DCF. Names that lead elsewhere (`../`, absolute
/// paths, drive letters) are reported and omitted: the file is untrusted input.
struct FileReference {
  ObjectRef object = {};
  bool download = false;  ///< the file's content is downloaded to the device; else the device's content is stored in
                          ///< the file
  std::string name = {};
  std::uint32_t line = 0;
};

/// `Denotation`: the application's name of an object.
struct Denotation {
  ObjectRef object = {};
  std::string text = {};
  friend bool operator==(const Denotation&, const Denotation&) = default;
};

/// `ParamRefd`: a link reference to the object's documentation (CiA 306-1 §5).
struct ParamRef {
  ObjectRef object = {};
  std::string text = {};
  friend bool operator==(const ParamRef&, const ParamRef&) = default;
};

/// [xxxxObjectLinks]: objects that belong together with this one.
struct ObjectLinks {
  std::uint16_t index = 0;
  std::vector<std::uint16_t> links = {};
  friend bool operator==(const ObjectLinks&, const ObjectLinks&) = default;
};

/// [ToolN] (CiA 306-3): a program for this device; `$EDS` in the command stands for the file. Berth never runs it.
struct Tool {
  std::string name = {};
  std::string command = {};
  friend bool operator==(const Tool&, const Tool&) = default;
};

/// One segment of [DynamicChannels] (CiA 306-3 §5.2.2): indices in which a programmable device makes network variables.
struct DynamicSegment {
  od::DataType type = od::DataType::none;
  od::Access access = od::Access::ro;  ///< ro, rwr: the device produces; rww, wo: it consumes
  std::uint16_t first = 0;
  std::uint16_t last = 0;
  std::uint32_t offset = 0;      ///< PPOffset: byte offset of the segment in the process image
  std::uint32_t difference = 1;  ///< BOOLEAN: bytes from one variable to the next (Berth's interpretation of the unit)

  /// The greatest number of variables: 254 sub-indices an index.
  [[nodiscard]] std::uint32_t capacity() const noexcept { return last < first ? 0 : (last - first + 1U) * 254U; }
  /// Byte offset of a variable in the process image; empty when the object lies outside of the segment.
  [[nodiscard]] std::optional<std::uint32_t> address(ObjectRef variable) const noexcept;
  friend bool operator==(const DynamicSegment&, const DynamicSegment&) = default;
};

/// The understood content.
struct File {
  Document document;
  /// Never null after `read`; for a file with errors, its understandable part. The initial values are the file's
  /// ParameterValues if it has any, else its DefaultValues.
  std::shared_ptr<const od::Description> description;
  FileInfo info;
  DeviceInfo device;
  std::optional<Commissioning> commissioning = {};
  std::vector<Parameter> parameters = {};           ///< ascending by object
  std::vector<FileReference> file_references = {};  ///< ascending by object
  std::vector<Denotation> denotations = {};         ///< ascending by object
  /// DefaultValues of the objects in `parameters`, if the file gives them too; ascending by object.
  std::vector<Parameter> defaults = {};
  std::vector<ParamRef> param_refs = {};       ///< ascending by object
  std::vector<ObjectLinks> object_links = {};  ///< ascending by index
  std::vector<std::string> comments = {};      ///< [Comments] Line1...
  std::vector<Tool> tools = {};
  std::vector<DynamicSegment> dynamic_segments = {};
  /// The kinds of modules that a modular device accepts; `expand` (modules.hpp) makes a description with modules.
  std::vector<Module> modules = {};
  /// DCF [ConnectedModules]: the kind's number in each slot, from the first slot on.
  std::vector<std::uint16_t> connected_modules = {};

  /// Vendor-ID and product code: from object 1018h if it gives them and they are not 0, else from [DeviceInfo].
  [[nodiscard]] TypeCode type_code() const;
  /// The revision number, likewise.
  [[nodiscard]] std::uint32_t revision() const;

 private:
  [[nodiscard]] std::uint32_t identity(std::uint8_t sub, const std::optional<std::uint32_t>& otherwise) const;
};

}  // namespace berth::eds
