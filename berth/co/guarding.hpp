/// Node guarding and life guarding (CiA 301 §7.2.8.3.2.1, objects 100Ch and 100Dh; docs/protocols/cia301.md §Error
/// control): the older error control protocol, by remote frames on 700h + node-ID. CiA discourages it; paper 1's
/// preparation step uses it.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/nmt.hpp"
#include "berth/rt/task.hpp"

namespace berth::co {

/// The slave: answers every remote frame (any DLC) with its state and the toggle bit, which is 0 in the first answer
/// after reset communication. Life guarding begins with the first remote frame. While the heartbeat producer is active
/// (1017h not 0), the slave answers nothing.
class GuardingSlave final : private can::Handler, private rt::Job {
 public:
  class Observer {
   public:
    /// `lost`: no remote frame for the life time. Not `lost`: the master asks again after a loss. The owner handles
    /// EMCY 8130h and 1029h.
    virtual void life_guarding(bool lost, rt::Time at) noexcept = 0;

   protected:
    ~Observer() = default;
  };
  GuardingSlave(can::Dispatcher& dispatcher, Observer& observer) noexcept
      : dispatcher_(&dispatcher), observer_(&observer) {}

  /// Call after reset communication: toggle 0; life guarding waits for the first remote frame.
  void start(NodeId node, NmtState state = NmtState::pre_operational);
  void stop() noexcept;
  void set_state(NmtState state) noexcept { state_ = state; }
  /// 100Ch (as a duration) and 100Dh; if one is 0, there is no life guarding. A running life time starts anew.
  void set_life_time(rt::Duration guard_time, std::uint8_t life_time_factor) noexcept;
  /// The heartbeat has priority. True: no answers and no life guarding.
  void set_heartbeat_active(bool active) noexcept;
  [[nodiscard]] bool lost() const noexcept { return lost_; }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void arm() noexcept;
  can::Dispatcher* dispatcher_;
  Observer* observer_;
  rt::Duration life_time_{};
  NodeId node_;
  NmtState state_ = NmtState::pre_operational;
  bool toggle_ = false;
  bool guarded_ = false;  // a remote frame came since start
  bool heartbeat_ = false;
  bool lost_ = false;
};

struct GuardingEvent {
  enum class Kind : std::uint8_t {
    started,        ///< first answer
    state_changed,  ///< an answer carries another state than the one before
    toggle_error,   ///< an answer repeats the toggle bit; it does not count as an answer. The first answer may have
                    ///< either value
    lost,           ///< no answer for the node life time; reported once until `recovered`
    recovered,      ///< first answer after `lost`
    boot_up,        ///< boot-up message: the toggle starts at 0 again
  };
  Kind kind = Kind::started;
  NodeId node;
  NmtState state = NmtState::initialising;
  NmtState previous = NmtState::initialising;
};
[[nodiscard]] const char* name(GuardingEvent::Kind kind) noexcept;

/// The master's supervision of any number of nodes. Asks each node once per guard time.
class GuardingMaster final : private can::Handler, private rt::Job {
 public:
  class Observer {
   public:
    /// May call the master; must not destroy it.
    virtual void guarding(const GuardingEvent& event, rt::Time at) noexcept = 0;

   protected:
    ~Observer() = default;
  };
  GuardingMaster(can::Dispatcher& dispatcher, Observer& observer) noexcept
      : dispatcher_(&dispatcher), observer_(&observer) {}

  /// Asks every `guard_time` (not 0), the first time at once. Reports `lost` when `retry_factor` (at least 1) questions
  /// in a row had no answer before the next was due. 1F81h: bits 31..16 guard time in ms, 15..8 retry factor.
  void guard(NodeId node, rt::Duration guard_time, std::uint8_t retry_factor);
  void end(NodeId node) noexcept;
  [[nodiscard]] bool guarded(NodeId node) const noexcept;
  /// Newest state; empty before the first answer and while lost.
  [[nodiscard]] std::optional<NmtState> state(NodeId node) const noexcept;

 private:
  struct Node {
    NodeId node;
    rt::Duration guard_time{};
    rt::Time next{};
    std::uint8_t factor = 1;
    std::uint8_t missed = 0;
    NmtState state = NmtState::initialising;
    bool toggle = false;  // expected toggle bit, once it is known
    bool toggle_known = false;
    bool waits = false;  // asked, no answer yet
    bool seen = false;
    bool lost = false;
  };
  [[nodiscard]] Node* find(NodeId node) noexcept;
  [[nodiscard]] Node* first_due(rt::Time now) noexcept;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void answered(Node& node, std::uint8_t byte, NmtState state, rt::Time at) noexcept;
  void run() noexcept override;
  void due(Node& node) noexcept;
  void report(GuardingEvent::Kind kind, NodeId node, NmtState state, NmtState previous, rt::Time at) noexcept;
  void listen() noexcept;
  void arm() noexcept;

  can::Dispatcher* dispatcher_;
  Observer* observer_;
  std::vector<Node> nodes_;
};

struct GuardAnswer {
  NmtState state = NmtState::initialising;  ///< initialising: the frame was a boot-up message
  bool toggle = false;
  rt::Time at{};
};

/// Asks one node whether it is there (paper 1 §III, preparation; S1.30), up to `tries` times. The window of `timeout`
/// starts when the remote frame is on the wire, so a full bus does not look like silence. Any error control frame of
/// the node counts as an answer, also its boot-up or a heartbeat.
///
///     auto answer = co_await co::guard_once(dispatcher, node, timeout, 3);
///
/// Errc::timeout: no answer to any try. Errc::bus: a question never left within `timeout`.
class GuardRequest final : public rt::Operation<GuardRequest>,
                           private can::Handler,
                           private can::Confirmation,
                           private rt::Job {
 public:
  GuardRequest(can::Dispatcher& dispatcher, NodeId node, rt::Duration timeout, unsigned tries) noexcept
      : dispatcher_(&dispatcher), timeout_(timeout), tries_(tries), node_(node) {}
  bool start();
  Result<GuardAnswer> await_resume() const noexcept { return result_; }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void sent(rt::Time at) noexcept override;
  void run() noexcept override;
  void ask() noexcept;
  void send() noexcept;
  void end(const Result<GuardAnswer>& result) noexcept;
  can::Dispatcher* dispatcher_;
  rt::Duration timeout_;
  rt::Time give_up_{};
  unsigned tries_;
  NodeId node_;
  bool asked_ = false;  // the remote frame is on the wire
  Result<GuardAnswer> result_ = fail(Errc::cancelled, "node guarding");
};
[[nodiscard]] inline GuardRequest guard_once(can::Dispatcher& dispatcher, NodeId node, rt::Duration timeout,
                                             unsigned tries = 3) noexcept {
  return GuardRequest(dispatcher, node, timeout, tries);
}

}  // namespace berth::co
