#include "berth/decode/emcy_words.hpp"

#include <algorithm>
#include <span>

#include "berth/co/emcy.hpp"

namespace berth::decode {
namespace {

struct CodeWords {
  std::uint16_t code;
  const char* words;
};

// Drives.
constexpr CodeWords of_402[] = {
    {0x2110, "short circuit or earth leakage at the input"},
    {0x2120, "earth leakage at the input"},
    {0x2130, "short circuit at the input"},
    {0x2220, "continuous over-current inside the device"},
    {0x2230, "short circuit or earth leakage inside the device"},
    {0x2250, "short circuit inside the device"},
    {0x2310, "continuous over-current at the motor"},
    {0x2320, "short circuit or earth leakage at the motor"},
    {0x2330, "earth leakage at the motor"},
    {0x2340, "short circuit at the motor"},
    {0x2350, "load too high for too long (I²t)"},
    {0x2351, "load soon too high (I²t, warning)"},
    {0x3110, "mains over-voltage"},
    {0x3120, "mains under-voltage"},
    {0x3130, "mains phase missing"},
    {0x3210, "DC link over-voltage"},
    {0x3220, "DC link under-voltage"},
    {0x3310, "output over-voltage"},
    {0x4110, "too warm around the device"},
    {0x4120, "too cold around the device"},
    {0x4210, "device too hot"},
    {0x4220, "device too cold"},
    {0x4310, "drive too hot"},
    {0x4320, "drive too cold"},
    {0x5100, "supply"},
    {0x5110, "supply of the electronics too low"},
    {0x5210, "measuring circuit"},
    {0x5410, "output stage"},
    {0x5530, "non-volatile memory"},
    {0x6010, "software reset (watchdog)"},
    {0x6310, "parameters lost"},
    {0x6320, "parameter wrong"},
    {0x7110, "brake chopper"},
    {0x7121, "motor blocked"},
    {0x7122, "motor, or its commutation"},
    {0x7300, "sensor"},
    {0x7305, "incremental encoder 1"},
    {0x7306, "incremental encoder 2"},
    {0x7310, "speed"},
    {0x7320, "position"},
    {0x7500, "communication"},
    {0x8311, "torque too high"},
    {0x8331, "torque"},
    {0x8400, "speed controller"},
    {0x8500, "position controller"},
    {0x8611, "following error too great"},
    {0x8612, "position limit"},
    {0x8700, "synchronisation"},
    {0xF001, "deceleration"},
};

// Lifts.
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
  if (profile == 417) return of_417;
  return {};
}

}  // namespace

const char* emcy_words(std::uint16_t code, std::uint16_t profile) noexcept {
  const auto table = table_of(profile);
  const auto found = std::ranges::find(table, code, &CodeWords::code);
  return found == table.end() ? co::emcy_text(code) : found->words;
}

}  // namespace berth::decode
