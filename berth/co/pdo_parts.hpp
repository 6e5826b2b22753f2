/// What `Pdos` keeps of each PDO. Only its own sources include this.
#pragma once

#include "berth/co/pdo.hpp"

namespace berth::co {

enum class PdoMode : std::uint8_t { mapped, sam, dam };

/// Types 00h..F0h, acyclic and cyclic.
[[nodiscard]] constexpr bool synchronous(std::uint8_t type) noexcept { return type <= 0xF0; }
[[nodiscard]] constexpr bool event_driven(std::uint8_t type) noexcept { return type >= 0xFE; }
inline constexpr std::uint8_t rtr_sampled_at_sync = 0xFC;
inline constexpr std::uint8_t rtr_only = 0xFD;

inline constexpr unsigned most_pdos = 512;
[[nodiscard]] constexpr std::uint16_t communication_index(PdoKind kind, unsigned number) noexcept {
  return static_cast<std::uint16_t>((kind == PdoKind::rpdo ? 0x13FFU : 0x17FFU) + number);
}
[[nodiscard]] constexpr std::uint16_t mapping_index(PdoKind kind, unsigned number) noexcept {
  return static_cast<std::uint16_t>(communication_index(kind, number) + 0x200U);
}

struct Pdos::Rpdo final : can::Handler {
  static constexpr std::uint8_t no_size = 0xFF;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  /// Event-driven, without a deadline and without errors: what fits needs no look at anything else.
  void choose_way() noexcept {
    const bool quick = active && mode == PdoMode::mapped && !synchronous(type) && deadline == 0 && faults == 0;
    quick_size = quick ? static_cast<std::uint8_t>(mapping.size()) : no_size;
  }

  Pdos* set = nullptr;
  PdoMapping mapping;
  rt::Time due = rt::never;            // deadline, while it runs
  std::array<std::uint8_t, 8> data{};  // waits for a SYNC
  std::uint16_t number = 0;
  std::uint16_t deadline = 0;  // 1400h:05
  std::uint8_t type = 0;
  std::uint8_t faults = 0;  // a bit for each `Fault`
  std::uint8_t quick_size = no_size;
  PdoMode mode = PdoMode::mapped;
  bool active = false;
  bool waiting = false;  // `data` does
};

struct Pdos::Tpdo final : can::Confirmation {
  void sent(rt::Time at) noexcept override { set->sent(*this, at); }
  /// Event-driven, without times and time stamp: an event is a frame.
  void choose_way() noexcept {
    quick = active && mode == PdoMode::mapped && event_driven(type) && inhibit == 0 && event_time == 0 && !stamped;
  }

  std::uint32_t key = 0;
  Pdos* set = nullptr;
  PdoMapping mapping;
  rt::Time due = rt::never;            // event timer
  rt::Time free_at{};                  // not to be sent before: inhibit time, or another try after a full queue
  std::array<std::uint8_t, 8> data{};  // as sampled at a SYNC
  std::uint16_t number = 0;
  std::uint16_t inhibit = 0;     // 1800h:03, of event-driven ones
  std::uint16_t event_time = 0;  // 1800h:05, of event-driven ones
  std::uint8_t type = 0;
  std::uint8_t start_at = 0;  // SYNC counter to wait for, 0 = counting
  std::uint8_t syncs = 0;
  PdoMode mode = PdoMode::mapped;
  bool quick = false;
  bool active : 1 = false;
  bool answers : 1 = false;  // remote frames
  bool event : 1 = false;    // since the last SYNC
  bool sampled : 1 = false;  // `data` is
  bool waiting : 1 = false;  // to be sent at `free_at`
  bool stamped : 1 = false;  // maps 1013h
};

/// Objects whose SAM MPDO has to wait, oldest first.
struct Pdos::SamQueue {
  static constexpr std::size_t size = 32;
  std::array<ObjectRef, size> objects{};
  std::size_t count = 0;
};

inline std::span<Pdos::Rpdo> Pdos::rpdos() const noexcept { return {rpdos_.get(), rpdo_count_}; }
inline std::span<Pdos::Tpdo> Pdos::tpdos() const noexcept { return {tpdos_.get(), tpdo_count_}; }

// Most devices number their PDOs without gaps; else they still ascend.
template <class Pdo>
Pdo* Pdos::find(std::span<Pdo> pdos, unsigned number) noexcept {
  if (number - 1 < pdos.size() && pdos[number - 1].number == number) return &pdos[number - 1];
  std::size_t low = 0;
  std::size_t high = pdos.size();
  while (low < high) {
    const std::size_t middle = (low + high) / 2;
    if (pdos[middle].number < number) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low < pdos.size() && pdos[low].number == number ? &pdos[low] : nullptr;
}

}  // namespace berth::co
