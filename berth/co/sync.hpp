/// SYNC producer and consumer of one device (CiA 301 §7.2.5, objects 1005h, 1006h, 1007h, 1019h;
/// docs/protocols/cia301.md §SYNC and TIME).
///
/// Works on the objects of a dictionary; missing ones count as their defaults (080h, 0, 0, 0). Writes from the network
/// take effect at once. Refused are:
/// - 1005h: a change of bits 30..0 except bit 30 itself while bit 30 (producer) is set, a restricted CAN-ID, bits above
///   bit 10 of an 11-bit identifier: 0609 0030.
/// - 1019h: 1 and 241..255: 0609 0030; a change while 1006h is not 0, whichever device makes the SYNC: 0800 0022 (CiA
///   301 §7.5.2.22).
/// A write of 1005h or 1006h restarts the period; setting bit 30 anew restarts the counter.
///
/// The producer sends every 1006h microseconds by the device's clock, without drift, first after one period. A SYNC
/// that is not on the bus when the next is due is replaced; the counter counts those that were on the bus. The device
/// also processes its own SYNCs, when they are on the bus. The counter starts at 1 with `start`. The consumer accepts a
/// SYNC of the length that 1019h requires (0 or 1 byte). Another length raises EMCY 8240h (info bytes: length received,
/// length expected), and the SYNC does not count; the next good one ends the error.
#pragma once

#include <cstdint>

#include "berth/can/dispatcher.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/service_owner.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

class Sync final : private od::Hook, private can::Handler, private can::Confirmation, private rt::Job {
 public:
  class Observer {
   public:
    /// A SYNC, received or own; called after the PDOs. `counter` 0: without.
    virtual void synchronised(std::uint8_t counter, rt::Time at) noexcept = 0;
    /// A consumer with a period (1006h) heard no SYNC for 1.5 periods (reported once), or hears it again.
    virtual void sync_missing(bool missing, rt::Time at) noexcept {
      (void)missing;
      (void)at;
    }

   protected:
    ~Observer() = default;
  };

  /// `pdos` may be null.
  Sync(can::Dispatcher& dispatcher, od::Values& values, ServiceOwner& owner, Pdos* pdos);

  /// An NMT state with SYNC is entered: pre-operational, or operational from elsewhere (`Services::sync_time`). Reads
  /// the objects. Do not call it between pre-operational and operational: the counter goes on there.
  void start() noexcept;
  /// The state is left: reset, stopped.
  void stop() noexcept;
  [[nodiscard]] bool running() const noexcept { return running_; }
  void observe(Observer* observer) noexcept { observer_ = observer; }

  /// True if 1005h bit 30 is set and 1006h is not 0.
  [[nodiscard]] bool producer() const noexcept;
  /// As last reported by `Observer::sync_missing`: for the red LED (CiA 303-3). Begins with the first SYNC.
  [[nodiscard]] bool missing() const noexcept { return missing_; }
  /// SYNCs since `start`.
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }

 private:
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  od::AbortCode writing_cob_id(std::uint32_t value) const noexcept;
  od::AbortCode writing_overflow(std::uint8_t value) const noexcept;
  void apply() noexcept;
  void read_window() noexcept;
  [[nodiscard]] std::uint8_t next_counter() const noexcept;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(rt::Time at) noexcept override;
  void run() noexcept override;
  void synchronise(std::uint8_t counter, rt::Time at) noexcept;
  void produce() noexcept;
  void supervise(rt::Time at) noexcept;
  void set_missing(bool missing, rt::Time at) noexcept;
  void wrong_length(bool on, std::uint8_t length = 0) noexcept;

  can::Dispatcher* dispatcher_;
  od::Values* values_;
  ServiceOwner* owner_;
  Pdos* pdos_;
  Observer* observer_ = nullptr;
  rt::Duration period_{};  ///< 1006h
  rt::Duration window_{};
  rt::Time next_{};
  std::uint64_t count_ = 0;
  CobId cob_id_;
  std::uint8_t overflow_ = 0;  ///< 1019h
  std::uint8_t counter_ = 0;   ///< of the last own SYNC on the bus
  bool running_ = false;
  bool wrong_length_ = false;
  bool produces_ = false;
  bool missing_ = false;
};

}  // namespace berth::co
