/// The order in which a configuration is written (CiA 301 §7.5.2; docs/protocols/cia302.md §Configuration). Pure.
///
/// Many communication objects accept a value only while what they describe is switched off. The plan first switches off
/// everything that will change, then writes the plain values, then those of what is off, and finally switches on. So
/// two PDOs can also swap their COB-IDs:
///
///     PDO          COB-ID bit 31, mapping sub-index 0 = 0, entries, sub-index 0 = n, other parameters, COB-ID
///     SDO channel  COB-ID bit 31 of both, node-ID, COB-IDs
///     1005h        bit 30 off, ..., CAN-ID, bit 30
///     1019h        1006h = 0, 1019h, 1006h
///     1012h 1014h  valid bits off, the new COB-ID
///     1016h        0 in every entry that changes, then the new ones: no node-ID stands in two of them
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "berth/manager/configuration.hpp"

namespace berth::manager {

/// The device's values, as far as they could be read.
using Held = std::map<ObjectRef, std::vector<std::uint8_t>>;

/// One download.
struct Step {
  ObjectRef object;
  std::vector<std::uint8_t> bytes;
  std::size_t entry = 0;  ///< the entry that it writes, or that needs it
  bool prepares = false;  ///< it switches something off or restores it; the value is not the entry's
  friend bool operator==(const Step&, const Step&) = default;
};

/// The objects, besides the entries themselves, whose values `plan` needs, ascending. `changes[i]`: entry i will be
/// written.
[[nodiscard]] std::vector<ObjectRef> also_needed(std::span<const Entry> entries, const std::vector<bool>& changes);

/// Writes exactly the entries that change, and switches off what they need to be off. Objects missing from `held` do
/// not exist or cannot be read: they are not switched off.
[[nodiscard]] std::vector<Step> plan(std::span<const Entry> entries, const std::vector<bool>& changes,
                                     const Held& held);

}  // namespace berth::manager
