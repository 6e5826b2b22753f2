/// Concise DCF (CiA 302-3, object 1F22h): a device's configuration as a stream of SDO downloads. U32 number of entries,
/// then for each: U16 index, U8 sub-index, U32 size in bytes, the data; all little-endian. An empty stream is an empty
/// configuration.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/base/result.hpp"
#include "berth/eds/file.hpp"

namespace berth::eds {

/// One download: the bytes as sent over the bus.
struct ConciseEntry {
  ObjectRef object = {};
  std::vector<std::uint8_t> data = {};
  friend bool operator==(const ConciseEntry&, const ConciseEntry&) = default;
};

struct ConciseDcf {
  std::vector<ConciseEntry> entries = {};  ///< in the order of writing to the device; an object may occur several times
  friend bool operator==(const ConciseDcf&, const ConciseDcf&) = default;
};

/// Makes the stream. At most 2^32-1 entries, and bytes per value.
[[nodiscard]] std::vector<std::uint8_t> encode(const ConciseDcf& dcf);

/// Errors: `Errc::invalid`; `detail` is the byte offset of the wrong field, index and sub-index name the entry if its
/// head could be read. Wrong are: a stream that ends inside a field, a size beyond the rest, a count that the rest
/// cannot hold, bytes after the last entry. Sizes in the stream are not trusted: nothing is reserved for them.
[[nodiscard]] Result<ConciseDcf> decode_concise_dcf(std::span<const std::uint8_t> stream);

/// A value's bytes as in an SDO, with `$NODEID` resolved. Errors: `Errc::invalid` for an empty value, a number for a
/// type of variable length, and `$NODEID` for an unconfigured node.
[[nodiscard]] Result<std::vector<std::uint8_t>> encode(const od::Literal& value, od::DataType type, NodeId node_id);
/// The value of a type in these bytes. Errors: `Errc::mismatch` when a scalar's length is not the type's.
[[nodiscard]] Result<od::Literal> decode(std::span<const std::uint8_t> bytes, od::DataType type);

/// `value` as the description would write it: the formula, if its default is `$NODEID` + n and gives the same value for
/// `node_id`.
[[nodiscard]] od::Literal with_formula(const od::Description& description, ObjectRef object, od::Literal value,
                                       NodeId node_id);

enum class Order : std::uint8_t {
  /// As the parameters are: ascending by object.
  as_given,
  /// In an order that devices accept (CiA 301 §7.5.2): each PDO and SDO channel is switched off, set, and switched on
  /// again (with the description's COB-ID if only its mapping is set); a mapping is emptied, filled, and counted; SYNC
  /// and EMCY likewise. The configuration date 1020h comes after all other values, store parameters 1010h last.
  working,
};

/// The parameters of a DCF for one node, without those that cannot be written (ro, const) and those that ObjFlags bit 0
/// excludes from downloads. The content of `DownloadFile`s is not included (dcf.hpp reads it). Errors: as `encode`,
/// with the object.
[[nodiscard]] Result<ConciseDcf> concise_dcf(const File& file, NodeId node_id, Order order = Order::working);
/// The same for any parameters of a description.
[[nodiscard]] Result<ConciseDcf> concise_dcf(const od::Description& description, std::span<const Parameter> parameters,
                                             NodeId node_id, Order order = Order::working);
/// Puts any entries into the working order; of several entries for one object the last counts.
[[nodiscard]] ConciseDcf in_working_order(ConciseDcf dcf);

/// Converts to parameters, ascending by object, with the types of a description; of several entries for an object the
/// last counts. Errors: `Errc::not_found` for an object that the description does not have, `Errc::mismatch` for a
/// wrong length; both with the object.
[[nodiscard]] Result<std::vector<Parameter>> parameters(const ConciseDcf& dcf, const od::Description& description,
                                                        NodeId node_id);

}  // namespace berth::eds
