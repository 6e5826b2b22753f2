/// A bus as a DBC file, for tools that know CAN signals and not CANopen (CANdb++, SavvyCAN, cantools, PEAK's).
///
/// DBC's names are of letters, digits and `_`, 32 at most: other characters become `_`, longer names are cut, and of
/// two that are equal then the second gets a number. The name as it was, and the object ("6000h:01"), is the comment.
/// Text is Windows-1252, as these tools read it; characters that it lacks become "?". Bits are little endian, as in
/// every PDO.
#pragma once

#include <string>

#include "berth/document/bus_signals.hpp"

namespace berth::document {

[[nodiscard]] std::string dbc_of(const BusSignals& bus);

}  // namespace berth::document
