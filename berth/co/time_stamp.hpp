/// TIME producer and consumer of one device (CiA 301 §7.2.6, objects 1012h and 1013h; docs/protocols/cia301.md §SYNC
/// and TIME).
///
/// Works on object 1012h: bit 31 consumer, bit 30 producer, bit 29 frame; without the object neither. Writes from the
/// network are refused with 0609 0030 for a change of bits 29..0 while bit 31 or 30 is set, a restricted CAN-ID, bits
/// above bit 10 of an 11-bit identifier. CiA 301 names no period: the application calls `send`. 1013h (high resolution
/// time stamp) is sent by PDO: `Pdos` writes it at sampling if a TPDO maps it; a receiving device maps it into an RPDO.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "berth/can/dispatcher.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

/// TIME_OF_DAY: the time that a TIME message carries.
struct TimeOfDay {
  static constexpr std::uint32_t milliseconds_a_day = 86'400'000;
  std::uint32_t milliseconds = 0;  ///< since midnight, 0..86 399 999
  std::uint16_t days = 0;          ///< since 1984-01-01

  /// From seconds since 1970-01-01 (UTC or what the network uses); empty before 1984 and after 2163-06-05.
  [[nodiscard]] static std::optional<TimeOfDay> from_unix(std::int64_t seconds,
                                                          std::uint32_t milliseconds = 0) noexcept;
  [[nodiscard]] std::int64_t unix_seconds() const noexcept;
  [[nodiscard]] std::array<std::uint8_t, 6> encode() const noexcept;
  /// Ignores the reserved upper 4 bits of the milliseconds. Empty when it is not 6 bytes, or a day has not so many
  /// milliseconds.
  [[nodiscard]] static std::optional<TimeOfDay> decode(std::span<const std::uint8_t> bytes) noexcept;
  friend constexpr bool operator==(const TimeOfDay&, const TimeOfDay&) noexcept = default;
};

class TimeStamp final : private od::Hook, private can::Handler {
 public:
  class Observer {
   public:
    /// A TIME message of another node; `at`: its end on the bus.
    virtual void time_of_day(const TimeOfDay& time, rt::Time at) noexcept = 0;

   protected:
    ~Observer() = default;
  };

  TimeStamp(can::Dispatcher& dispatcher, od::Values& values);
  /// An NMT state with TIME is entered (`Services::sync_time`), or left. `start` reads the object.
  void start() noexcept;
  void stop() noexcept;
  void observe(Observer* observer) noexcept { observer_ = observer; }

  [[nodiscard]] bool consumer() const noexcept;
  [[nodiscard]] bool producer() const noexcept;
  /// Sends a TIME message. `closed`: not started, or no producer.
  can::Queued send(const TimeOfDay& time) noexcept;

 private:
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  void apply() noexcept;
  void received(const can::Frame& frame, rt::Time at) noexcept override;

  can::Dispatcher* dispatcher_;
  od::Values* values_;
  Observer* observer_ = nullptr;
  std::uint32_t raw_ = 0;  ///< 1012h
  bool running_ = false;
};

}  // namespace berth::co
