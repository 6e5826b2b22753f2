/// Kinds of devices as their makers' public pages and users' reports describe them: one row each, with its source in
/// words. No row is one maker's device: vendor-IDs are fictitious, and what several sources say alike is one row.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "berth/plant/plant_file.hpp"

namespace berth::field {

/// What 1018h:04 says.
enum class Serial : std::uint8_t {
  own,     ///< a number of each device's own
  zero,    ///< 0: CiA 301 reserves it
  lot,     ///< the same in all of one lot, the week of production say
  absent,  ///< there is no such sub-index
};

/// Where the node-ID comes from.
enum class From : std::uint8_t {
  switches,   ///< rotary or DIP switches
  connector,  ///< coded pins of the plug
  firmware,   ///< fixed, or set by keys at the device
  lss,        ///< LSS; blank when new, or with the factory's node-ID
  object,     ///< an object of the maker's own, written by SDO
};

/// 1017h, 100Ch and 100Dh.
struct Watched {
  std::string_view access = "rw";  ///< of 1017h; empty: there is none
  std::uint16_t period = 0;        ///< 1017h at power-on, in ms
  std::uint16_t low = 0;           ///< limits; 0: none
  std::uint16_t high = 0;
  bool guards = false;  ///< 100Ch and 100Dh are there
};

struct Kind {
  std::string_view name;
  std::string_view source;
  std::uint32_t device_type = 0;  ///< 1000h
  unsigned parts = 4;             ///< sub-indices of 1018h, 1 to 4
  Serial serial = Serial::own;
  From from = From::lss;
  std::uint8_t factory = 0;  ///< node-ID when new; 0: none
  bool says_product = true;  ///< false: 1018h:02 and :03 are 0
  plant::SpeaksSet speaks{};
  plant::PlantLss lss{};
  Watched watched{};
  plant::Latency response{};
  rt::Duration boot = std::chrono::milliseconds(50);
  std::uint32_t slowest = 10'000;  ///< bit rates, in bit/s
  std::uint32_t quickest = 1'000'000;
  bool settings = false;  ///< a parameter that can be written, and 1010h
  bool emcy = false;      ///< an emergency at each power-on
  unsigned most = 127;    ///< devices of the kind in one machine
};

/// At least twenty.
[[nodiscard]] std::span<const Kind> kinds() noexcept;
[[nodiscard]] const Kind* kind(std::string_view name) noexcept;

}  // namespace berth::field
