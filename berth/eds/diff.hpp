/// Differences between two device descriptions, and between a description and its device.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/eds/file.hpp"

namespace berth::eds {

enum class Aspect : std::uint8_t {
  only_in_first,   ///< an object or sub-object; `first` has its name
  only_in_second,  ///< against a device: its sub-index 0 shows that it has more sub-objects
  object_type,     ///< VAR, ARRAY, RECORD...
  data_type,
  access,
  mapping,  ///< may be mapped into a PDO
  default_value,
  value,  ///< ParameterValue; against a device: its current value
  low_limit,
  high_limit,
  name,
  obj_flags,
  dummy,     ///< data type that may be mapped as a dummy
  identity,  ///< vendor, product, revision: see `field`
  device,    ///< other facts of [DeviceInfo]: see `field`
  commissioning,
  unreadable,  ///< against a device: it refused for another reason, or did not answer
};
[[nodiscard]] const char* name(Aspect aspect) noexcept;  ///< "only in first", "data type"...

struct Difference {
  Aspect aspect = Aspect::only_in_first;
  std::optional<ObjectRef> object;  ///< empty: concerns the whole device
  bool whole = false;               ///< the object and all of its sub-objects
  std::string field;                ///< "VendorNumber"; else ""
  std::string first;                ///< in the first file; "" = nothing
  std::string second;
  friend bool operator==(const Difference&, const Difference&) = default;
};

/// "6000h:01  data type  UNSIGNED8 | UNSIGNED16".
[[nodiscard]] std::string to_string(const Difference& difference);

/// Differences of the whole device first, then by object. Compares values by meaning, not by spelling: 0x10 is 16, a
/// missing AccessType is its default. For an object that only one file has, there is one entry.
[[nodiscard]] std::vector<Difference> diff(const File& first, const File& second);

/// @name Against a live device
/// Which objects to read, and the evaluation of the answers. The caller reads them (`berth eds diff --node`), so that
/// this works for every way to reach a device.
/// @{

/// The result of an SDO upload of one sub-object.
struct LiveAnswer {
  ObjectRef object;
  std::uint32_t abort_code = 0;  ///< the device's refusal, else 0
  std::string failure;           ///< why there is no valid answer, in words; else ""
  std::vector<std::uint8_t> bytes;
};

struct LiveOptions {
  bool values = false;            ///< also compare the values of writable objects with the file's
  std::size_t most_bytes = 4096;  ///< DOMAINs, and strings that may be longer, are not read
};

/// Every sub-object that a client may safely read: readable, no DOMAIN, not excluded from scans by its ObjFlags.
/// Ascending.
[[nodiscard]] std::vector<ObjectRef> to_read(const File& file, const LiveOptions& options = {});

/// `first` is the file, `second` the device. Checks for missing objects (0602 0000h) and sub-objects (0609 0011h),
/// types by the length of the value, vendor, product and revision in object 1018h against the file's, and the highest
/// sub-index of arrays and records.
[[nodiscard]] std::vector<Difference> diff_live(const File& file, std::span<const LiveAnswer> answers, NodeId node,
                                                const LiveOptions& options = {});
/// @}

}  // namespace berth::eds
