/// One request and the window for its answers: used by the AND master and the RAND walk.
///
/// The window begins at the request's `sent`. Every answer of these protocols has a higher priority than the next
/// request, so frames heard before that belong to the previous request.
#pragma once

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/rt/task.hpp"

namespace berth::nodeid {

/// How long a window stays open.
struct WindowTimes {
  rt::Duration first{0};       ///< closes after this time without an answer; 0: no window, done when sent
  rt::Duration after_last{0};  ///< closes this time after the last answer; 0: stays open until `first`
  rt::Duration least{0};       ///< answers do not close it earlier than this after the request
  rt::Duration most{0};        ///< closes after this time at the latest; 0: no limit
  rt::Duration send_timeout = std::chrono::seconds(1);  ///< if not sent by then: `Errc::bus`
};

class Exchanges;

/// Made by `Exchanges::request`; its destruction ends it.
class Exchange final : public rt::Operation<Exchange>, private rt::Job, private can::Confirmation {
 public:
  ~Exchange();
  bool start() noexcept;
  /// When the request was sent; `bus` if it could not be sent.
  Result<rt::Time> await_resume() noexcept { return outcome_; }

 private:
  friend class Exchanges;
  Exchange(Exchanges& owner, const can::Frame& frame, const WindowTimes& times) noexcept
      : owner_(&owner), frame_(frame), times_(times) {}
  void send() noexcept;
  void sent(rt::Time at) noexcept override;
  void run() noexcept override;
  void stay_open(rt::Time until) noexcept;
  void fail_with(const char* text) noexcept;
  void end() noexcept;

  Exchanges* owner_;
  can::Frame frame_;
  WindowTimes times_;
  rt::Time limit_{};  // of the sending, then of the window
  rt::Time closes_{};
  bool open_ = false;
  Result<rt::Time> outcome_{};
};

/// The one exchange that may be under way. Must outlive it.
class Exchanges {
 public:
  explicit Exchanges(can::Dispatcher& dispatcher) noexcept : dispatcher_(&dispatcher) {}
  [[nodiscard]] Exchange request(const can::Frame& frame, const WindowTimes& times) noexcept {
    return {*this, frame, times};
  }
  /// A request was sent and its window is open.
  [[nodiscard]] bool open() const noexcept { return current_ != nullptr && current_->open_; }
  /// An answer came at `at`: the window now waits `after_last`.
  void heard(rt::Time at) noexcept;
  /// An answer to an earlier request came at `at`: the answers to this one waited for the bus behind it.
  void delayed(rt::Time at) noexcept;
  /// All expected answers are here: the window closes now.
  void close() noexcept;
  /// When the last window was opened: its request's `sent`.
  [[nodiscard]] rt::Time opened() const noexcept { return opened_; }
  [[nodiscard]] can::Dispatcher& dispatcher() const noexcept { return *dispatcher_; }

 private:
  friend class Exchange;
  can::Dispatcher* dispatcher_;
  Exchange* current_ = nullptr;
  rt::Time opened_{};
};

}  // namespace berth::nodeid
