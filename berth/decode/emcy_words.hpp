/// The meaning of an emergency code for a device with a profile: CiA 301 gives the classes, and each profile adds its
/// own codes, so that 3210h is a DC link over-voltage of a drive (CiA 402) and an internal voltage of an I/O module
/// (CiA 401).
#pragma once

#include <cstdint>
#include <string>

#include "berth/co/emcy.hpp"

namespace berth::decode {

/// `profile`: the device profile number, the lower word of 1000h (CiA 301 §7.5.2.1); 0 = none, or not known. The
/// codes of CiA 401 are among `co::emcy_text`'s; those of CiA 402 (also in its object 603Fh), 410 and 417 are here. Of
/// CiA 404, 406 and 408 no public document was found that gives codes beyond CiA 301's. Never null.
[[nodiscard]] const char* emcy_words(std::uint16_t code, std::uint16_t profile) noexcept;
/// The bits of an error register (1001h, CiA 301 §7.5.2.2): "generic, current"; "no error".
[[nodiscard]] std::string register_words(std::uint8_t bits);
/// A whole message: "EMCY 2310h output current too high (overload); register: generic, current; info 01 02 00 00 00".
/// Omits the register without a bit, and manufacturer's bytes that are all 0.
[[nodiscard]] std::string emcy_line(const co::Emcy& message, std::uint16_t profile);

}  // namespace berth::decode
