/// A bus as a DBC file, for tools that support CAN signals but not CANopen (CANdb++, SavvyCAN, cantools, PEAK's).
///
/// DBC names have letters, digits and `_`, 32 at most: other characters become `_`, longer names are cut, and the
/// second of two equal names gets a number. The original name and the object ("6000h:01") are in the comment. Text is
/// Windows-1252, as these tools read it; characters outside it become "?". Bits are little endian, as in every PDO.
#pragma once

#include <string>

#include "berth/document/bus_signals.hpp"

namespace berth::document {

[[nodiscard]] std::string dbc_of(const BusSignals& bus);

}  // namespace berth::document
