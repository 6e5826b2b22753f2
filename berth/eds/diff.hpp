/// What two device descriptions say differently, and what a description says differently from the device itself.
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
  only_in_second,  ///< against a device: it says by its sub-index 0 that it has more of them
  object_type,     ///< VAR, ARRAY, RECORD...
  data_type,
  access,
  mapping,  ///< may be mapped into a PDO
  default_value,
  value,  ///< ParameterValue; against a device: what it has now
  low_limit,
  high_limit,
  name,
  obj_flags,
  dummy,     ///< data type that may be mapped as a dummy
  identity,  ///< vendor, product, revision: `field` says which
  device,    ///< other facts of [DeviceInfo]: `field` says which
  commissioning,
  unreadable,  ///< against a device: it refused for another reason, or did not answer
};
[[nodiscard]] const char* name(Aspect aspect) noexcept;  ///< "only in first", "data type"...

struct Difference {
  Aspect aspect = Aspect::only_in_first;
  std::optional<ObjectRef> object;  ///< empty: about the device as a whole
  bool whole = false;               ///< the object with all of its sub-objects
  std::string field;                ///< "VendorNumber"; else ""
  std::string first;                ///< as the first file has it; "" = nothing
  std::string second;
  friend bool operator==(const Difference&, const Difference&) = default;
};

/// "6000h:01  data type  UNSIGNED8 | UNSIGNED16".
[[nodiscard]] std::string to_string(const Difference& difference);

/// First what concerns the device as a whole, then by object. Values are compared as they are meant, not as they are
/// written: 0x10 is 16, a missing AccessType is its default. Of an object that only one file has there is one entry.
[[nodiscard]] std::vector<Difference> diff(const File& first, const File& second);

/// @name Against a live device
/// Which objects to read, what came back, and what that means. The reading is the caller's work (`berth eds diff
/// --node`), so that this is the same for every way to reach a device.
/// @{

/// What an SDO upload of one sub-object gave.
struct LiveAnswer {
  ObjectRef object;
  std::uint32_t abort_code = 0;  ///< the device's refusal, else 0
  std::string failure;           ///< no answer or a broken one, in words; else ""
  std::vector<std::uint8_t> bytes;
};

struct LiveOptions {
  bool values = false;            ///< also compare values with the file's, of objects that can be written
  std::size_t most_bytes = 4096;  ///< DOMAINs, and strings that may be longer, are not read
};

/// Every sub-object that a client may read without harm: readable, no DOMAIN, not kept from scans by its ObjFlags.
/// Ascending.
[[nodiscard]] std::vector<ObjectRef> to_read(const File& file, const LiveOptions& options = {});

/// `first` is the file, `second` the device. Missing objects (0602 0000h) and sub-objects (0609 0011h), types by the
/// length of the value, vendor, product and revision of object 1018h against the file's, the highest sub-index of
/// arrays and records.
[[nodiscard]] std::vector<Difference> diff_live(const File& file, std::span<const LiveAnswer> answers, NodeId node,
                                                const LiveOptions& options = {});
/// @}

}  // namespace berth::eds
