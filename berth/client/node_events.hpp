/// The events of a remote node: boot-up, NMT states, loss of its heartbeat, and emergencies. Delivered by callbacks, or
/// one by one to a task. Part of `RemoteNode`.
#pragma once

#include <deque>
#include <functional>
#include <memory>

#include "berth/client/inbox.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/heartbeat.hpp"

namespace berth::client {

/// An emergency message of the node.
struct Emergency {
  NodeId node;
  rt::Time at{};  ///< end of the frame
  co::Emcy emcy;  ///< code, error register, manufacturer's bytes
  /// "current, device input side"; "error reset or no error" for 00xxh.
  [[nodiscard]] const char* text() const noexcept { return co::emcy_text(emcy.code); }
};

/// Boot-up, change of the NMT state, loss of the heartbeat.
struct StateEvent {
  NodeId node;
  rt::Time at{};
  co::HeartbeatEvent::Kind kind = co::HeartbeatEvent::Kind::started;
  NmtState state = NmtState::initialising;
  NmtState previous = NmtState::initialising;
};

class NodeEvents : private rt::Job {
 public:
  static constexpr std::size_t kept_events = 64;  ///< waiting emergencies and waiting state events, of each

  /// Replaces the previous callback; empty ends it.
  void on_state(std::function<void(const StateEvent&)> call) { on_state_ = share(std::move(call)); }
  void on_emcy(std::function<void(const Emergency&)> call) { on_emcy_ = share(std::move(call)); }
  /// `Result` of the oldest event not yet taken (`Inbox::next`).
  [[nodiscard]] Inbox<StateEvent>::Next next_state(rt::Time deadline) noexcept { return states_.next(deadline); }
  [[nodiscard]] Inbox<Emergency>::Next next_emcy(rt::Time deadline) noexcept { return emergencies_.next(deadline); }

 protected:
  template <class E>
  using Callback = std::shared_ptr<const std::function<void(const E&)>>;

  explicit NodeEvents(rt::Executor& executor) noexcept : executor_(&executor) {}
  ~NodeEvents() = default;
  NodeEvents(const NodeEvents&) = delete;
  NodeEvents& operator=(const NodeEvents&) = delete;

  void happened(const StateEvent& event);
  void happened(const Emergency& event);
  /// No more events come: a wait ends with Errc::cancelled.
  void close() noexcept;

  template <class E>
  static Callback<E> share(std::function<void(const E&)> call) {
    if (!call) return nullptr;
    return std::make_shared<const std::function<void(const E&)>>(std::move(call));
  }
  /// Calls back later, unless the callback is replaced or the node destroyed before.
  template <class E>
  void tell(const Callback<E>& call, const E& event) {
    if (call == nullptr) return;
    to_tell_.push_back([weak = std::weak_ptr(call), event] {
      if (const auto still = weak.lock()) (*still)(event);
    });
    executor_->post(*this);
  }

 private:
  friend class Tpdo;
  void run() noexcept override;

  rt::Executor* executor_;
  std::deque<std::function<void()>> to_tell_;
  Inbox<StateEvent> states_{kept_events};
  Inbox<Emergency> emergencies_{kept_events};
  Callback<StateEvent> on_state_;
  Callback<Emergency> on_emcy_;
};

}  // namespace berth::client
