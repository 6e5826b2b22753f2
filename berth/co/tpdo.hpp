/// One transmitted PDO of a device: its parameters while it is active, when it is sampled, and when it may be sent.
#pragma once

#include <optional>

#include "berth/co/pdo_context.hpp"
#include "berth/co/pdo_records.hpp"

namespace berth::co {

class Tpdo final : private can::Confirmation {
 public:
  /// Call once, first. `room`: for as many entries as the mapping record has.
  void set_up(PdoContext& context, std::uint16_t number, std::span<PdoField> room) noexcept;
  [[nodiscard]] std::uint16_t number() const noexcept { return number_; }
  [[nodiscard]] bool active() const noexcept { return active_; }
  /// The identifier to listen to, its own: for remote frames, and with `collisions` for any frame.
  [[nodiscard]] std::optional<std::uint32_t> heard_key(bool collisions) const noexcept {
    return active_ && (collisions || answers_) ? std::optional(key_) : std::nullopt;
  }

  /// Begins anew, as its records say.
  void configure() noexcept;
  /// Withdraws what waits.
  void end() noexcept;
  /// 1800h:05 was written.
  void set_event_time(std::uint16_t milliseconds) noexcept;

  /// See `Pdos::event`.
  bool event() noexcept;
  /// The value of `object`, at `offset` in the values, changed.
  bool changed(ObjectRef object, std::uint32_t offset) noexcept;
  /// See `Pdos::send_dam`; `closed`: this is no active DAM MPDO.
  [[nodiscard]] can::Queued send_dam(std::uint8_t node, ObjectRef object, std::span<const std::uint8_t> data) noexcept;
  void sync(std::uint8_t counter) noexcept;
  /// A remote frame with this identifier came.
  void requested(std::uint32_t key) noexcept;
  /// The SYNC window is over: drops a sampled PDO that is not on the bus.
  void close_window() noexcept;
  /// Called by the timer: another try, or the event timer, may be due.
  void run(rt::Time now) noexcept;
  /// When `run` has something to do; `rt::never`: nothing.
  [[nodiscard]] rt::Time due() const noexcept { return std::min(due_, waiting_ ? free_at_ : rt::never); }

 private:
  void sent(rt::Time at) noexcept override;
  bool note_event() noexcept;
  void attempt() noexcept;
  void send_scanned() noexcept;
  void sample() noexcept;
  void send_sample() noexcept;
  [[nodiscard]] bool may_go() noexcept;
  [[nodiscard]] can::Queued submit(const can::Frame& frame) noexcept;
  void failed(can::Queued why) noexcept;
  void restart_event_timer() noexcept;

  std::uint32_t key_ = 0;
  PdoContext* context_ = nullptr;
  PdoMapping mapping_;
  rt::Time due_ = rt::never;            // event timer
  rt::Time free_at_{};                  // earliest time to send: inhibit time, or another try after a full queue
  std::array<std::uint8_t, 8> data_{};  // as sampled at a SYNC
  std::uint16_t number_ = 0;
  std::uint16_t inhibit_ = 0;     // 1800h:03, if event-driven
  std::uint16_t event_time_ = 0;  // 1800h:05, if event-driven
  std::uint8_t type_ = 0;
  std::uint8_t start_at_ = 0;  // SYNC counter to wait for, 0 = counting
  std::uint8_t syncs_ = 0;
  PdoMode mode_ = PdoMode::mapped;
  bool quick_ = false;
  bool active_ : 1 = false;
  bool answers_ : 1 = false;  // to remote frames
  bool event_ : 1 = false;    // an event since the last SYNC
  bool sampled_ : 1 = false;  // `data_` is sampled
  bool waiting_ : 1 = false;  // to be sent at `free_at_`
  bool stamped_ : 1 = false;  // maps 1013h
};

// Inline for the set's `event`: most TPDOs are event-driven, without times.
inline bool Tpdo::event() noexcept {
  if (!quick_) [[unlikely]]
    return note_event();
  can::Frame frame;
  frame.id = key_ & ~can::extended_flag;
  frame.extended = (key_ & can::extended_flag) != 0;
  frame.size = static_cast<std::uint8_t>(mapping_.size());
  mapping_.pack(context_->base, frame.data.data());
  const can::Queued queued = context_->dispatcher->send(frame);
  waiting_ = false;
  if (queued != can::Queued::yes) failed(queued);
  return true;
}

}  // namespace berth::co
