/// What an emergency code means for a device of a profile: CiA 301 gives the classes, and each profile codes of its own
/// below them, so that 3210h is a DC link over-voltage of a drive (CiA 402) and an internal voltage of an I/O module
/// (CiA 401).
#pragma once

#include <cstdint>

namespace berth::decode {

/// `profile`: the device profile number, the lower word of 1000h (CiA 301 §7.5.2.1); 0 = none, or not known. Codes of
/// CiA 402 (also in its object 603Fh) and CiA 417 (§8.4) are as makers' manuals and canopen-lift.org publish them; for
/// every other profile, and what these do not have, it is `co::emcy_text`. Never null.
[[nodiscard]] const char* emcy_words(std::uint16_t code, std::uint16_t profile) noexcept;

}  // namespace berth::decode
