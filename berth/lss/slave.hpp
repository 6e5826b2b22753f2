/// The LSS slave of a device (CiA 305): frames in, frames out. No heap, no exceptions, no I/O.
///
/// The owner (a device) gives it every frame on 7E5h that the device really reads, sends the answers it returns (at
/// once or after the device's response latency, in their order: `AnswerQueue`) and does what it is told through
/// `SlaveOwner`.
///
/// Node-ID and bit rate each exist three times and are never mixed up: *persistent* (in non-volatile memory), *pending*
/// (set by LSS; loaded from persistent at power-on and reset node) and *active* (in use; taken from pending at reset
/// communication). The bit rate also becomes active by activate bit timing.
///
/// All of CiA 305, each service in the LSS states that its table names (docs/protocols/cia305.md §State table): switch
/// state selective in waiting only, so that a slave in configuration stays silent to its own address; configuration and
/// inquiry in configuration only; switch state global and identification in both. Fastscan (51h) finds only a slave
/// that waits and has no node-ID, active and pending 255: one with a node-ID stays silent, so a Fastscan does not find
/// it. It is complete, and the slave in configuration, only when all 32 bits of the serial number were asked in a
/// request whose next part is 0 (or 4, as paper 4 has it, or more: S4.15); until then every matching request is
/// answered and changes nothing but the part that is asked next. A request that does not match is not answered and
/// changes nothing.
///
/// With feedback (paper 4; S4.10) an answer to Fastscan is preceded by the next bits of the own address: after 80h the
/// vendor-ID's first; after bits 31 to 16 (in 29-bit frames) the lower half; after the whole of a part the first of the
/// part that comes next; after the whole address none, nor after any other bit. In base frames the same with four bits.
/// The toggle bit is 0 for an upper half and 1 for a lower one, whatever the master skipped.
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
  /// The device was initialising without a node-ID, has got one and was switched to waiting (docs/protocols/cia305.md
  /// §Node-ID and bit rate): it must now do its reset communication, which calls `Slave::reset_communication` and ends
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
  BitRateMask bit_rates = all_fixed_bit_rates;  ///< what configure bit timing accepts
  bool can_store = true;                        ///< false: 17h is answered 01
  /// A *configured* device takes a changed node-ID already at `04 00` (such devices exist; docs/protocols/cia305.md
  /// §Node-ID and bit rate). The standard's takes it at the next NMT reset communication.
  bool change_at_waiting = false;
  bool fastscan = true;                                 ///< false: 51h is ignored
  Feedback feedback = Feedback::none;                   ///< with `fastscan`
  std::uint16_t feedback_base = default_feedback_base;  ///< of the sixteen identifiers (`usable_feedback_base`)
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
  /// What goes before it.
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

  /// One frame; frames that are no LSS request (`is_lss`) are ignored. The answer, if there is one now.
  Answers handle(const can::Frame& frame) noexcept;
  /// The store that `SlaveOwner::store` began has ended. The answer, if the slave is still in configuration.
  std::optional<can::Frame> stored(const StoreResult& result) noexcept;

  /// Power-on and NMT reset node: waiting, pending = `persistent` (what the device's memory now holds), a running store
  /// or switch delay is forgotten, then `reset_communication`.
  void power_on(const Settings& persistent) noexcept;
  /// NMT reset communication: active = pending. A node-ID of 255: the device stays initialising, LSS only, no boot-up.
  /// The LSS state stays.
  void reset_communication() noexcept;

  /// Another scheme than LSS gave the device a node-ID, or took it: pending, until reset communication.
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
  std::uint8_t part_ = 0;        // Fastscan: the part that is asked next
  bool storing_ = false;
};

}  // namespace berth::lss
