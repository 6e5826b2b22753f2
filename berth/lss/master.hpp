/// The LSS master (CiA 305): each service is one awaitable operation.
///
///     auto reply = co_await master.switch_selective(address);
///     if (!reply) co_return fail(reply.error());
///
/// One service is on the wire at a time; others queue in the order of their start. A reply window starts when the
/// request's last frame is confirmed as sent; earlier answers belong to an earlier request and are ignored (counted in
/// `stale`). Nothing protects a *sequence* of services (select, configure, store) from another task that uses the same
/// master: use one task per master, or coordinate the tasks.
///
/// A Fastscan request also collects the feedback of its window (paper 4). Answers and feedback are collected until the
/// window ends and are not paired by their order: on the wire one slave's answer overtakes another's feedback (S4.10).
///
/// Errors: `timeout` no answer in any attempt; `aborted` the slave refused, `detail` = error code | specific code << 8;
/// `bus` the request could not be sent; `invalid` an argument out of range; `cancelled` the master was destroyed.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/lss/frames.hpp"
#include "berth/lss/lacks.hpp"
#include "berth/rt/task.hpp"

namespace berth::lss {

/// The waiting times of one service.
struct ServiceOptions {
  rt::Duration timeout = std::chrono::milliseconds(100);  ///< reply window, from `sent` of the last request frame
  unsigned retries = 1;                                   ///< more attempts after the first when no device answered
  /// Listen to the end of the window even after an answer: two devices with one LSS address answer twice (unless their
  /// frames merge on the bus), and a late answer cannot count for the next request.
  bool full_window = false;
  /// Minimum time after `sent` to listen for the answer of another device, answered or not. Not more than `timeout`.
  rt::Duration listen{0};
};

struct MasterOptions {
  ServiceOptions service{};                                                ///< select, configure, inquire
  ServiceOptions identify{.retries = 0, .full_window = true};              ///< identify services
  ServiceOptions store{.timeout = std::chrono::seconds(5), .retries = 0};  ///< store configuration
  /// Fastscan: paper 4's window, and no repetition, because silence means "the bit is 1".
  ServiceOptions fastscan{.timeout = std::chrono::milliseconds(10), .retries = 0, .full_window = true};
  rt::Duration inhibit{0};  ///< least time from a request's `sent` to the next request (single-slot receive buffers)
  rt::Duration send_timeout = std::chrono::seconds(1);  ///< if a request is not acknowledged by then, the error is
                                                        ///< `bus`
  std::uint16_t feedback_base = 0;  ///< first of the sixteen feedback identifiers (`usable_feedback_base`); 0: none
};

/// For one call; empty: the master's options for that service.
using ServiceChoice = std::optional<ServiceOptions>;

/// A feedback value received in one window.
struct HeardFeedback {
  FeedbackValue feedback{};
  std::uint16_t times = 0;  ///< frames; equal ones may have merged into one on the bus
  rt::Time first{};
};

/// The answers to one request. Answers beyond `heard.size()` are counted, not kept.
struct Reply {
  std::array<can::Frame, 2> heard{};  ///< the first answers
  std::array<rt::Time, 2> heard_at{};
  unsigned answers = 0;   ///< matching answers in the window
  unsigned others = 0;    ///< other frames on 7E4h in the window
  unsigned stale = 0;     ///< frames on 7E4h before `sent`
  unsigned attempts = 0;  ///< 1 = answered at once
  bool differ = false;    ///< two answers had different content: two slaves in configuration
  rt::Time sent{};        ///< confirmation of the last request frame (of the last attempt)
  rt::Time last_at{};     ///< the last matching answer in the window
  /// Fastscan: the distinct feedback values of the window, ascending by kind, half and value; if there are more than
  /// `Master::most_feedback`, the lowest. Memory of the master: valid until its next service begins.
  std::span<const HeardFeedback> feedback{};

  /// Bytes 1..4 of the first answer (inquire).
  [[nodiscard]] std::uint32_t value() const noexcept { return value32(heard[0]); }
  /// Byte 1 of the first answer (inquire node-ID: 1..127 or 255).
  [[nodiscard]] std::uint8_t byte() const noexcept { return heard[0].data[1]; }
};

/// A master's record of how its slaves answer, for `select_alone`.
struct AnswerTimes {
  rt::Duration slowest{0};  ///< from a request's `sent` to an answer; old values fade
  unsigned heard = 0;       ///< answers in the record
  bool strangers = true;    ///< a device may be in configuration unnoticed, and nothing is known of its speed
  bool lost = false;  ///< a device in configuration stopped answering, or answered unasked: it may receive again at any
                      ///< time
  /// Start of the time in which no service that has an answer went unanswered, no device was lost, and no unrequested
  /// frame came on 7E4h.
  rt::Time calm_since{};
  std::uint64_t unexpected = 0;  ///< frames on 7E4h while no service was under way
  /// How often the node-ID may have been taken from more than one device: besides the intended device, from another
  /// that had been released and whose node-ID is not confirmed yet.
  std::uint64_t taken_back = 0;

  void learn(rt::Duration answer_time) noexcept;
};

/// The distinct feedback values of one window, ascending; if there are too many, the lowest.
class FeedbackWindow {
 public:
  static constexpr std::size_t most = 256;
  FeedbackWindow() { heard_.reserve(most); }
  void add(const FeedbackValue& feedback, rt::Time at) noexcept;
  void clear() noexcept { heard_.clear(); }
  [[nodiscard]] std::span<const HeardFeedback> heard() const noexcept { return heard_; }

 private:
  std::vector<HeardFeedback> heard_;
};

class Master;

/// One service on the wire. Made by `Master`; destroying it ends the service. A started one may outlive the master.
class Exchange final : public rt::Operation<Exchange>, private rt::Job, private can::Confirmation {
 public:
  ~Exchange();
  bool start() noexcept;
  Result<Reply> await_resume() noexcept;

  /// `11 80`: 128 is no node-ID, so every slave in configuration refuses it and stays unchanged. Detects such slaves
  /// even if they lack inquiries. Silence is an answer: `Reply::answers` is 0.
  [[nodiscard]] static Exchange anybody_configuring(Master& master, const ServiceOptions& options) noexcept;

 private:
  friend class Master;
  enum class Answer : std::uint8_t { none, may, must };
  enum class Step : std::uint8_t { idle, queued, inhibited, sending, listening, done };
  struct Plan {
    Answer answer = Answer::must;
    Command expected{};
    bool checks_code = false;  // byte 1 of the answer is an error code
    bool valid = true;
    bool feedback = false;  // collect feedback
    std::uint8_t count = 1;
    std::array<can::Frame, 6> frames{};
    [[nodiscard]] static Plan make(Answer answer, Command expected, const can::Frame& frame) noexcept;
  };
  Exchange(Master& master, const ServiceOptions& options, const Plan& plan) noexcept;
  void refuse(Error error) noexcept;
  void take_turn() noexcept;
  void send_next() noexcept;
  void send() noexcept;
  void heard(const can::Frame& frame, rt::Time at) noexcept;
  void sent(rt::Time at) noexcept override;
  void run() noexcept override;
  void window_over() noexcept;
  void done(Error error) noexcept;
  void done() noexcept;
  void end() noexcept;

  Master* master_;
  Exchange* next_ = nullptr;  // in the master's queue
  ServiceOptions options_;
  Plan plan_;
  Step step_ = Step::idle;
  bool failed_ = false;
  std::uint8_t next_frame_ = 0;
  rt::Time give_up_{};  // sending
  Reply reply_{};
  Error error_{};
};

class Master final : private can::Handler {
 public:
  explicit Master(can::Dispatcher& dispatcher, const MasterOptions& options = {});
  /// Services under way end with `cancelled`.
  ~Master();

  [[nodiscard]] const MasterOptions& options() const noexcept { return options_; }
  void set_options(const MasterOptions& options);
  static constexpr std::size_t most_feedback = FeedbackWindow::most;
  [[nodiscard]] rt::Time now() const noexcept { return dispatcher_->executor().now(); }

  // All: await for Result<Reply>.

  /// `04 state`. It has no answer; done when sent.
  [[nodiscard]] Exchange switch_global(State state) noexcept;
  /// 40h..43h; the one slave with this address goes from waiting to configuration and answers 44h. `timeout`: no such
  /// slave, or it is in configuration already, where the standard does not serve this: see `select_alone.hpp`.
  [[nodiscard]] Exchange switch_selective(const LssAddress& address, ServiceChoice options = {}) noexcept;
  /// `11 id`: 1..127, or unconfigured. Sets the pending node-ID. `aborted`: the slave refused.
  [[nodiscard]] Exchange configure_node_id(NodeId id, ServiceChoice options = {}) noexcept;
  /// `13 00 index`: table selector 0. Sets the pending bit rate.
  [[nodiscard]] Exchange configure_bit_timing(BitRateIndex index, ServiceChoice options = {}) noexcept;
  /// `15 delay`. No answer; done when sent. The caller then restarts its own port after one delay and stays silent for
  /// another.
  [[nodiscard]] Exchange activate_bit_timing(std::uint16_t delay_ms) noexcept;
  /// `17`: pending becomes persistent.
  [[nodiscard]] Exchange store(ServiceChoice options = {}) noexcept;
  /// 5Ah..5Dh for part 0..3 (vendor, product, revision, serial): `Reply::value`.
  [[nodiscard]] Exchange inquire(unsigned part, ServiceChoice options = {}) noexcept;
  /// 5Eh: `Reply::byte`.
  [[nodiscard]] Exchange inquire_node_id(ServiceChoice options = {}) noexcept;
  /// 46h..4Bh. Silence is an answer: `Reply::answers` is 0.
  [[nodiscard]] Exchange identify_remote(const IdentifyRanges& ranges, ServiceChoice options = {}) noexcept;
  /// 4Ch. Silence is an answer: `Reply::answers` is 0.
  [[nodiscard]] Exchange identify_non_configured(ServiceChoice options = {}) noexcept;

  /// 51h. Silence is an answer: `Reply::answers` is 0. Feedback: `Reply::feedback`.
  /// `full_window` false: done at the first 4Fh, which is correct only if no other device can answer later.
  [[nodiscard]] Exchange fastscan(const FastscanRequest& request, ServiceChoice options = {}) noexcept;

  /// For the answers to all services except store, which is slow by nature.
  [[nodiscard]] const AnswerTimes& answer_times() const noexcept { return times_; }
  /// A device may be in configuration unnoticed / a proof shows that none is.
  void suspect_strangers() noexcept { times_.strangers = true; }
  void no_strangers() noexcept { times_.strangers = false; }
  /// A device was lost in configuration: from the call on, every answer to 11h is waited for, before 17h.
  void lost_one() noexcept;
  /// The node-ID was taken from all devices in configuration, perhaps more than one.
  void took_back() noexcept { ++times_.taken_back; }

  /// Services that its slaves lack, as learnt by `select_alone.hpp`.
  [[nodiscard]] LackMemory& lacks() noexcept { return lacks_; }

  /// Earliest time of the next request.
  [[nodiscard]] rt::Time earliest() const noexcept { return earliest_; }

 private:
  friend class Exchange;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void listen();
  void enter(Exchange& exchange) noexcept;
  void leave(Exchange& exchange) noexcept;

  can::Dispatcher* dispatcher_;
  MasterOptions options_;
  Exchange* first_ = nullptr;  // the current one, then those that wait
  rt::Time earliest_{};        // inhibit time
  AnswerTimes times_{};
  LackMemory lacks_;
  FeedbackWindow feedback_;  // of the last window
};

/// The complete LSS address of the one slave in configuration. `duplicate`: different answers to one inquiry.
[[nodiscard]] rt::Task<Result<LssAddress>> inquire_address(Master& master);

}  // namespace berth::lss
