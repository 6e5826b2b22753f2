/// The LSS slave of a device (CiA 305): frames in, frames out. No heap, no exceptions, no I/O.
///
/// The owner (a device) gives it every frame on 7E5h that the device really reads, sends the answers it returns (at
/// once or after the device's response latency) and does what it is told through `SlaveOwner`.
///
/// Node-ID and bit rate each exist three times and are never mixed up: *persistent* (in non-volatile memory), *pending*
/// (set by LSS; loaded from persistent at power-on and reset node) and *active* (in use; taken from pending at reset
/// communication). The bit rate also becomes active by activate bit timing.
///
/// All of CiA 305 except Fastscan (51h), which is ignored until it comes with its own issue: its place is one more case
/// in `Slave::handle`.
#pragma once

#include <cstdint>
#include <optional>

#include "berth/lss/frames.hpp"
#include "berth/rt/executor.hpp"

namespace berth::lss {

/// A node-ID and a bit rate that belong together.
struct Settings {
  NodeId node_id{};
  BitRateIndex bit_rate = BitRateIndex::kbit_125;
  friend bool operator==(const Settings&, const Settings&) = default;
};

/// How store configuration ended: one of `error::`ok, not_supported, storage, specific, and the specific code.
struct StoreResult {
  std::uint8_t code = error::ok;
  std::uint8_t specific = 0;
};

/// What the slave asks of its device. Called from `Slave::handle` or from a job; never from inside one another.
class SlaveOwner {
 public:
  /// Write `settings` to non-volatile memory. A value: done, answered at once. Empty: it takes time; call
  /// `Slave::stored` when it is done. Being slow or deaf meanwhile is the device's business: it just does not call
  /// `handle`.
  virtual std::optional<StoreResult> store(const Settings& settings) noexcept = 0;
  /// The device was initialising without a node-ID, has got one and was switched to waiting (CiA 305; facts C.1): it
  /// must now do its reset communication, which calls `Slave::reset_communication` and ends with the boot-up message.
  /// Also called for a configured device with `SlaveOptions::change_at_waiting`.
  virtual void wants_reset_communication() noexcept = 0;
  /// First switch delay over: set the controller to the active bit rate (0 from `bit_rate` = detect it) and stay
  /// silent.
  virtual void switch_bit_rate(BitRateIndex index) noexcept = 0;
  /// Second switch delay over: the device may send again.
  virtual void silence_over() noexcept = 0;

 protected:
  ~SlaveOwner() = default;
};

struct SlaveOptions {
  LssAddress address{};                         ///< object 1018h:01..04
  BitRateMask bit_rates = all_fixed_bit_rates;  ///< what configure bit timing accepts
  bool can_store = true;                        ///< false: 17h is answered 01
  /// A *configured* device takes a changed node-ID already at `04 00` (such devices exist; facts C.1). The standard's
  /// takes it at the next NMT reset communication.
  bool change_at_waiting = false;
};

class Slave final : private rt::Job {
 public:
  /// As after power-on with `persistent` in non-volatile memory, before the first reset communication: waiting, pending
  /// as persistent, active unconfigured. `executor` times the switch delays only.
  Slave(rt::Executor& executor, SlaveOwner& owner, const SlaveOptions& options, const Settings& persistent) noexcept;

  /// One frame; frames that are no LSS request (`is_lss`) are ignored. The answer, if there is one now.
  std::optional<can::Frame> handle(const can::Frame& frame) noexcept;
  /// The store that `SlaveOwner::store` began has ended. The answer, if the slave is still in configuration.
  std::optional<can::Frame> stored(const StoreResult& result) noexcept;

  /// Power-on and NMT reset node: waiting, pending = `persistent` (what the device's memory now holds), a running store
  /// or switch delay is forgotten, then `reset_communication`.
  void power_on(const Settings& persistent) noexcept;
  /// NMT reset communication: active = pending. A node-ID of 255: the device stays initialising, LSS only, no boot-up.
  /// The LSS state stays.
  void reset_communication() noexcept;

  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] const Settings& persistent() const noexcept { return persistent_; }
  [[nodiscard]] const Settings& pending() const noexcept { return pending_; }
  [[nodiscard]] const Settings& active() const noexcept { return active_; }
  /// No valid node-ID in use: the device is in NMT initialising.
  [[nodiscard]] bool initialising() const noexcept { return !active_.node_id.configured(); }
  /// Active and pending node-ID are 255: answers identify non-configured remote slave.
  [[nodiscard]] bool unconfigured() const noexcept { return initialising() && !pending_.node_id.configured(); }
  /// Second switch delay: the device must not send anything.
  [[nodiscard]] bool silent() const noexcept { return phase_ == BitTiming::silent; }
  [[nodiscard]] bool storing() const noexcept { return storing_; }
  [[nodiscard]] const LssAddress& address() const noexcept { return options_.address; }

 private:
  enum class BitTiming : std::uint8_t { idle, delay, silent };
  using Answer = std::optional<can::Frame>;
  Answer switch_global(std::uint8_t mode) noexcept;
  Answer select(unsigned i, std::uint32_t value) noexcept;
  Answer identify(unsigned i, std::uint32_t value) noexcept;
  Answer in_configuration(const can::Frame& frame) noexcept;
  Answer configure_node_id(std::uint8_t value) noexcept;
  Answer configure_bit_timing(std::uint8_t selector, std::uint8_t index) noexcept;
  Answer activate_bit_timing(std::uint16_t delay_ms) noexcept;
  Answer store() noexcept;
  void run() noexcept override;

  rt::Executor* executor_;
  SlaveOwner* owner_;
  SlaveOptions options_;
  Settings persistent_;
  Settings pending_;
  Settings active_{};
  Settings being_stored_{};
  rt::Duration switch_delay_{};
  State state_ = State::waiting;
  BitTiming phase_ = BitTiming::idle;
  std::uint8_t selected_ = 0;    // frames of 40h..43h that matched in order
  std::uint8_t identified_ = 0;  // frames of 46h..4Bh that matched in order
  bool storing_ = false;
};

}  // namespace berth::lss
