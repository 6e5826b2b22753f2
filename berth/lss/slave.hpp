/// The LSS slave of a device (CiA 305): frames in, frames out. No heap, no exceptions, no I/O.
///
/// The owner (a device) passes it every frame on 7E5h that the device really reads, sends the returned answers (at once
/// or after the device's response latency, in their order: `AnswerQueue`) and executes the calls of `SlaveOwner`.
///
/// Node-ID and bit rate each exist three times, strictly separate: *persistent* (in non-volatile memory), *pending*
/// (set by LSS; loaded from persistent at power-on and reset node) and *active* (in use; taken from pending at reset
/// communication). The bit rate also becomes active by activate bit timing.
///
/// Implements all of CiA 305, each service in the LSS states of its table (docs/protocols/cia305.md §State table):
/// switch state selective in waiting only, so that a slave in configuration stays silent to its own address;
/// configuration and inquiry in configuration only; switch state global and identification in both. Fastscan (51h)
/// finds only a slave that waits and has no node-ID, active and pending 255; one with a node-ID stays silent. Fastscan
/// completes, and the slave enters configuration, only when all 32 bits of the serial number were asked in a request
/// whose next part is 0 (or 4, as in paper 4, or more: S4.15). Until then every matching request is answered and
/// changes only the part that is asked next. A request that does not match is not answered and changes nothing.
///
/// With feedback (paper 4; S4.10) the next bits of the slave's address precede an answer to Fastscan: after 80h the
/// first of the vendor-ID; after bits 31 to 16 (in 29-bit frames) the lower half; after a whole part the first of the
/// next part; none after the whole address or after any other bit. Base frames work the same with four bits. The toggle
/// bit is 0 for an upper half and 1 for a lower one, whatever the master skipped.
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

/// The result of store configuration: one of `error::`ok, not_supported, storage, specific, and the specific code.
struct StoreResult {
  std::uint8_t code = error::ok;
  std::uint8_t specific = 0;
};

/// Implemented by the device. Called from `Slave::handle` or from a job; never from inside one another.
class SlaveOwner {
 public:
  /// Write `settings` to non-volatile memory. A value: done, answered at once. Empty: it takes time; call
  /// `Slave::stored` when it is done. A device that is slow or deaf meanwhile just does not call `handle`.
  virtual std::optional<StoreResult> store(const Settings& settings) noexcept = 0;
  /// The device was initialising without a node-ID, has got one and was switched to waiting (docs/protocols/cia305.md
  /// §Node-ID and bit rate): it must do its reset communication, which calls `Slave::reset_communication` and ends
  /// with the boot-up message. Also called for a configured device with `SlaveOptions::change_at_waiting`.
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
  BitRateMask bit_rates = all_fixed_bit_rates;  ///< accepted by configure bit timing
  bool can_store = true;                        ///< false: 17h is answered 01
  /// A *configured* device uses a changed node-ID already at `04 00` (such devices exist; docs/protocols/cia305.md
  /// §Node-ID and bit rate). A standard device uses it at the next NMT reset communication.
  bool change_at_waiting = false;
  bool fastscan = true;                                 ///< false: 51h is ignored
  Feedback feedback = Feedback::none;                   ///< with `fastscan`
  std::uint16_t feedback_base = default_feedback_base;  ///< first of the sixteen identifiers (`usable_feedback_base`)
};

/// Up to two frames, to be sent in this order: feedback, then the answer.
class Answers {
 public:
  Answers() noexcept = default;
  Answers(const std::optional<can::Frame>& answer) noexcept  // NOLINT(google-explicit-constructor): most have one
      : answer_(answer) {}
  Answers(const can::Frame& feedback, const can::Frame& answer) noexcept : feedback_(feedback), answer_(answer) {}
  [[nodiscard]] bool has_value() const noexcept { return answer_.has_value(); }
  explicit operator bool() const noexcept { return has_value(); }
  /// The answer, when there is one.
  [[nodiscard]] const can::Frame& operator*() const noexcept { return *answer_; }
  [[nodiscard]] const can::Frame* operator->() const noexcept { return &*answer_; }
  /// The feedback to send before it.
  [[nodiscard]] const std::optional<can::Frame>& feedback() const noexcept { return feedback_; }

 private:
  std::optional<can::Frame> feedback_;
  std::optional<can::Frame> answer_;
};

class Slave final : private rt::Job {
 public:
  /// As after power-on with `persistent` in non-volatile memory, before the first reset communication: waiting, pending
  /// as persistent, active unconfigured. `executor` times the switch delays only.
  Slave(rt::Executor& executor, SlaveOwner& owner, const SlaveOptions& options, const Settings& persistent) noexcept;

  /// Processes one frame and returns the answer, if there is one now; ignores frames that are no LSS request
  /// (`is_lss`).
  Answers handle(const can::Frame& frame) noexcept;
  /// The store begun by `SlaveOwner::store` has ended. Returns the answer, if the slave is still in configuration.
  std::optional<can::Frame> stored(const StoreResult& result) noexcept;

  /// Power-on and NMT reset node: waiting, pending = `persistent` (the content of the device's memory), a running store
  /// or switch delay is forgotten, then `reset_communication`.
  void power_on(const Settings& persistent) noexcept;
  /// NMT reset communication: active = pending. With node-ID 255 the device stays initialising, LSS only, no boot-up.
  /// The LSS state stays.
  void reset_communication() noexcept;

  /// A scheme other than LSS gave the device a node-ID, or removed it: pending, until reset communication.
  void set_pending(NodeId id) noexcept { pending_.node_id = id; }

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
  Answers fastscan(const can::Frame& frame) noexcept;
  [[nodiscard]] std::optional<FeedbackValue> feedback_after(const FastscanRequest& request) const noexcept;
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
  std::uint8_t part_ = 0;        // Fastscan: the next part to be asked
  bool storing_ = false;
};

}  // namespace berth::lss
