#include "berth/decode/emcy_words.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>

namespace berth::decode {
namespace {

struct CodeWords {
  std::uint16_t code;
  const char* words;
};

// The codes of drives, as in IEC 61800-7-201. The source is the list of Beckhoff's EtherCAT slave stack (cia402appl.h),
// which public repositories of drives contain. It has no codes that manufacturers define themselves.
constexpr CodeWords of_402[] = {
    {0x2110, "short circuit or earth leakage at the input"},
    {0x2120, "earth leakage at the input"},
    {0x2121, "earth leakage, phase L1"},
    {0x2122, "earth leakage, phase L2"},
    {0x2123, "earth leakage, phase L3"},
    {0x2130, "short circuit at the input"},
    {0x2131, "short circuit between the phases L1 and L2"},
    {0x2132, "short circuit between the phases L2 and L3"},
    {0x2133, "short circuit between the phases L3 and L1"},
    {0x2211, "internal current, No. 1"},
    {0x2212, "internal current, No. 2"},
    {0x2213, "over-current in the ramp function"},
    {0x2214, "over-current in the sequence"},
    {0x2220, "continuous over-current inside the device"},
    {0x2221, "continuous over-current inside the device, No. 1"},
    {0x2222, "continuous over-current inside the device, No. 2"},
    {0x2230, "short circuit or earth leakage inside the device"},
    {0x2240, "earth leakage inside the device"},
    {0x2250, "short circuit inside the device"},
    {0x2310, "continuous over-current at the motor"},
    {0x2311, "continuous over-current at the motor, No. 1"},
    {0x2312, "continuous over-current at the motor, No. 2"},
    {0x2320, "short circuit or earth leakage at the motor"},
    {0x2330, "earth leakage at the motor"},
    {0x2331, "earth leakage, phase U"},
    {0x2332, "earth leakage, phase V"},
    {0x2333, "earth leakage, phase W"},
    {0x2340, "short circuit at the motor"},
    {0x2341, "short circuit between the phases U and V"},
    {0x2342, "earth leakage between the phases V and W"},
    {0x2343, "earth leakage between the phases W and U"},
    {0x2350, "load too high for too long (I²t)"},
    {0x2351, "load soon too high (I²t, warning)"},
    {0x3110, "mains over-voltage"},
    {0x3111, "mains over-voltage, phase L1"},
    {0x3112, "mains over-voltage, phase L2"},
    {0x3113, "mains over-voltage, phase L3"},
    {0x3120, "mains under-voltage"},
    {0x3121, "mains under-voltage, phase L1"},
    {0x3122, "mains under-voltage, phase L2"},
    {0x3123, "mains under-voltage, phase L3"},
    {0x3130, "mains phase missing"},
    {0x3131, "mains phase L1 missing"},
    {0x3132, "mains phase L2 missing"},
    {0x3133, "mains phase L3 missing"},
    {0x3134, "order of the mains phases"},
    {0x3140, "mains frequency"},
    {0x3141, "mains frequency too high"},
    {0x3142, "mains frequency too low"},
    {0x3210, "DC link over-voltage"},
    {0x3211, "over-voltage, No. 1"},
    {0x3212, "over-voltage, No. 2"},
    {0x3220, "DC link under-voltage"},
    {0x3221, "under-voltage, No. 1"},
    {0x3222, "under-voltage, No. 2"},
    {0x3230, "load"},
    {0x3310, "output over-voltage"},
    {0x3311, "output over-voltage, phase U"},
    {0x3312, "output over-voltage, phase V"},
    {0x3313, "output over-voltage, phase W"},
    {0x3320, "armature circuit"},
    {0x3321, "armature circuit interrupted"},
    {0x3330, "field circuit"},
    {0x3331, "field circuit interrupted"},
    {0x4110, "too warm around the device"},
    {0x4120, "too cold around the device"},
    {0x4130, "temperature of the supply air"},
    {0x4140, "temperature at the air outlet"},
    {0x4210, "device too hot"},
    {0x4220, "device too cold"},
    {0x4300, "temperature of the drive"},
    {0x4310, "drive too hot"},
    {0x4320, "drive too cold"},
    {0x4400, "temperature of the supply"},
    {0x4410, "supply too hot"},
    {0x4420, "supply too cold"},
    {0x5100, "supply"},
    {0x5110, "supply of the electronics too low"},
    {0x5111, "supply of +15 V or -15 V"},
    {0x5112, "supply of +24 V"},
    {0x5113, "supply of +5 V"},
    {0x5120, "supply of the DC link"},
    {0x5210, "measuring circuit"},
    {0x5220, "computing circuit"},
    {0x5300, "operating unit"},
    {0x5400, "power section"},
    {0x5410, "output stage"},
    {0x5420, "chopper"},
    {0x5430, "input stage"},
    {0x5440, "contacts"},
    {0x5450, "fuses"},
    {0x5451, "fuse of L1"},
    {0x5452, "fuse of L2"},
    {0x5453, "fuse of L3"},
    {0x5500, "memory"},
    {0x5510, "RAM"},
    {0x5520, "ROM"},
    {0x5530, "EEPROM"},
    {0x6010, "software reset (watchdog)"},
    {0x6310, "parameters lost"},
    {0x6320, "parameter wrong"},
    {0x7100, "power"},
    {0x7110, "brake chopper"},
    {0x7111, "brake chopper failed"},
    {0x7112, "over-current of the brake chopper"},
    {0x7113, "protective circuit of the brake chopper"},
    {0x7120, "motor"},
    {0x7121, "motor blocked"},
    {0x7122, "motor, or its commutation"},
    {0x7123, "motor tilted"},
    {0x7200, "measuring circuit"},
    {0x7300, "sensor"},
    {0x7301, "tachometer"},
    {0x7302, "tachometer with wrong polarity"},
    {0x7303, "resolver 1"},
    {0x7304, "resolver 2"},
    {0x7305, "incremental encoder 1"},
    {0x7306, "incremental encoder 2"},
    {0x7307, "incremental encoder 3"},
    {0x7310, "speed"},
    {0x7320, "position"},
    {0x7400, "computing circuit"},
    {0x7500, "communication"},
    {0x7510, "serial interface No. 1"},
    {0x7520, "serial interface No. 2"},
    {0x7600, "external data storage"},
    {0x8300, "torque control"},
    {0x8311, "torque too high"},
    {0x8312, "hard to start"},
    {0x8313, "torque at standstill"},
    {0x8321, "torque too low"},
    {0x8331, "torque"},
    {0x8400, "speed controller"},
    {0x8500, "position controller"},
    {0x8600, "positioning controller"},
    {0x8611, "following error too great"},
    {0x8612, "reference limit"},
    {0x8700, "synchronisation controller"},
    {0x8800, "winding controller"},
    {0x8900, "monitoring of process data"},
    {0xF001, "deceleration"},
    {0xF002, "sub-synchronous run"},
    {0xF003, "stroke operation"},
};

// Inclinometers: two manufacturers list the same codes, ifm (manual of the JN2101) and SICK (manual of the TMM61).
constexpr CodeWords of_410[] = {
    {0x5010, "sensor of the X axis"},
    {0x5020, "sensor of the Y axis"},
};

// Lifts: CiA 417 §8.4 on canopen-lift.org.
constexpr CodeWords of_417[] = {
    {0x3111, "mains over-voltage"},
    {0x3121, "mains under-voltage"},
    {0x3211, "over-voltage inside the device"},
    {0x3221, "under-voltage inside the device"},
    {0xFF01, "light barrier defective"},
    {0xFF02, "finger protection defective"},
    {0xFF03, "motion detection defective"},
    {0xFF04, "application"},
    {0xFF05, "car too fast"},
    {0xFF06, "car moved where it must not"},
};

std::span<const CodeWords> table_of(std::uint16_t profile) noexcept {
  if (profile == 402) return of_402;
  if (profile == 410) return of_410;
  if (profile == 417) return of_417;
  return {};
}

}  // namespace

const char* emcy_words(std::uint16_t code, std::uint16_t profile) noexcept {
  const auto table = table_of(profile);
  const auto found = std::ranges::find(table, code, &CodeWords::code);
  return found == table.end() ? co::emcy_text(code) : found->words;
}

std::string register_words(std::uint8_t bits) {
  static constexpr std::array<const char*, 8> names{"generic",       "current",        "voltage",  "temperature",
                                                    "communication", "device profile", "reserved", "manufacturer"};
  std::string text;
  for (unsigned i = 0; i < names.size(); ++i) {
    if ((bits >> i & 1U) != 0) text += fmt::format("{}{}", text.empty() ? "" : ", ", names[i]);
  }
  return text.empty() ? "no error" : text;
}

std::string emcy_line(const co::Emcy& message, std::uint16_t profile) {
  std::string line = fmt::format("EMCY {:04X}h {}", message.code, emcy_words(message.code, profile));
  if (message.error_register != 0) line += "; register: " + register_words(message.error_register);
  const bool says_more = std::ranges::any_of(message.info, [](std::uint8_t byte) { return byte != 0; });
  if (says_more) line += fmt::format("; info {:02X}", fmt::join(message.info, " "));
  return line;
}

}  // namespace berth::decode
