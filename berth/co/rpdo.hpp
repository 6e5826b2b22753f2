/// One received PDO of a device: its parameters while it is active, its deadline and its errors.
#pragma once

#include "berth/co/pdo_context.hpp"
#include "berth/co/pdo_records.hpp"

namespace berth::co {

class Rpdo final : private can::Handler {
 public:
  /// Call once, first. `room`: for as many entries as the mapping record has.
  void set_up(PdoContext& context, std::uint16_t number, std::span<PdoField> room) noexcept;
  [[nodiscard]] std::uint16_t number() const noexcept { return number_; }
  [[nodiscard]] bool active() const noexcept { return active_; }

  /// Begins anew, as its records say.
  void configure() noexcept;
  /// Stops receiving; forgets data that waits for a SYNC and clears the errors.
  void end() noexcept;
  /// 1400h:05 was written.
  void set_deadline(std::uint16_t milliseconds) noexcept;
  /// Stores the data that waits for a SYNC.
  void sync(rt::Time at) noexcept;
  /// Called by the timer: the deadline may have run out.
  void run(rt::Time now) noexcept;
  /// When the deadline runs out, or `rt::never`.
  [[nodiscard]] rt::Time due() const noexcept { return due_; }

 private:
  static constexpr std::uint8_t no_size = 0xFF;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void received_slow(const can::Frame& frame, rt::Time at) noexcept;
  void received_mpdo(const can::Frame& frame, rt::Time at) noexcept;
  void store(const std::uint8_t* data, rt::Time at) noexcept;
  void supervise(rt::Time at) noexcept;
  void fault(PdoFault fault, bool on, std::uint8_t length = 0) noexcept;
  void set_fault(PdoFault fault, bool on, const std::array<std::uint8_t, 5>& info) noexcept;
  void choose_way() noexcept;

  PdoContext* context_ = nullptr;
  PdoMapping mapping_;
  rt::Time due_ = rt::never;            // deadline, while it runs
  std::array<std::uint8_t, 8> data_{};  // waits for a SYNC
  std::uint16_t number_ = 0;
  std::uint16_t deadline_ = 0;  // 1400h:05
  std::uint8_t type_ = 0;
  std::uint8_t faults_ = 0;            // a bit for each `PdoFault`
  std::uint8_t quick_size_ = no_size;  // a frame of this size only needs to be stored
  PdoMode mode_ = PdoMode::mapped;
  bool active_ = false;
  bool waiting_ = false;  // `data_` waits
};

}  // namespace berth::co
