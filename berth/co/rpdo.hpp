/// One received PDO of a device: its parameters while it is active, its deadline and its errors.
#pragma once

#include "berth/co/pdo_context.hpp"
#include "berth/co/pdo_records.hpp"

namespace berth::co {

class Rpdo final : private can::Handler {
 public:
  /// Once, before all else. `room`: for as many entries as the mapping record has.
  void set_up(PdoContext& context, std::uint16_t number, std::span<PdoField> room) noexcept;
  [[nodiscard]] std::uint16_t number() const noexcept { return number_; }
  [[nodiscard]] bool active() const noexcept { return active_; }

  /// Begins anew, as its records say now.
  void configure() noexcept;
  /// Hears nothing; what waits for a SYNC is forgotten, its errors are over.
  void end() noexcept;
  /// 1400h:05 was written.
  void set_deadline(std::uint16_t milliseconds) noexcept;
  /// What waits for a SYNC is stored.
  void sync(rt::Time at) noexcept;
  /// The timer: its deadline may have run out.
  void run(rt::Time now) noexcept;
  /// When it will, or `rt::never`.
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
  std::uint8_t quick_size_ = no_size;  // with frames of this size there is nothing to do but to store them
  PdoMode mode_ = PdoMode::mapped;
  bool active_ = false;
  bool waiting_ = false;  // `data_` does
};

}  // namespace berth::co
