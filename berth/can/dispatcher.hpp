/// Shares one port among the services of a node: each receives the identifiers it registered for, and a confirmation
/// when its own frames are on the wire.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "berth/can/port.hpp"

namespace berth::can {

class Dispatcher;

/// Receives frames for a service. Registered for ranges of keys; removes itself when destroyed.
class Handler {
 public:
  virtual void received(const Frame& frame, rt::Time at) noexcept = 0;
  Handler(const Handler&) = delete;
  Handler& operator=(const Handler&) = delete;

 protected:
  Handler() = default;
  ~Handler();

 private:
  friend class Dispatcher;
  Dispatcher* dispatcher_ = nullptr;
};

/// Called when one frame is on the wire. Removes itself when destroyed.
class Confirmation {
 public:
  virtual void sent(rt::Time at) noexcept = 0;
  Confirmation(const Confirmation&) = delete;
  Confirmation& operator=(const Confirmation&) = delete;
  [[nodiscard]] bool pending() const noexcept { return tag_ != 0; }

 protected:
  Confirmation() = default;
  inline ~Confirmation();

 private:
  friend class Dispatcher;
  Dispatcher* dispatcher_ = nullptr;
  Confirmation* next_ = nullptr;  // the next waiting one
  std::uint32_t tag_ = 0;
};

/// For services that must react to error state, bus-off and cable.
class StatusHandler {
 public:
  virtual void changed(const Status& status, rt::Time at) noexcept = 0;

 protected:
  ~StatusHandler() = default;
};

/// The only listener of a port. Handlers are found by binary search over the ranges (20 bytes each, and 8 of filter);
/// several handlers may receive one key, in the order in which they were added. Registering may allocate; passing a
/// frame does not. A handler may add and remove handlers, itself included, while it is called; a handler added
/// meanwhile receives the next frame, not this one. It must not destroy the dispatcher.
class Dispatcher final : private Listener {
 public:
  Dispatcher(rt::Executor& executor, Port& port) noexcept;
  ~Dispatcher();
  Dispatcher(const Dispatcher&) = delete;
  Dispatcher& operator=(const Dispatcher&) = delete;

  [[nodiscard]] rt::Executor& executor() const noexcept { return *executor_; }
  [[nodiscard]] Port& port() const noexcept { return *port_; }

  /// Registers `handler` for `range`. It may be added for several ranges, and receives a frame once for each that
  /// contains it. A handler belongs to one dispatcher: adding it to another removes it from the first.
  void add(IdRange range, Handler& handler);
  /// Removes it from all ranges. Does nothing when it is in none.
  void remove(Handler& handler) noexcept;
  void on_status(StatusHandler* handler) noexcept { status_handler_ = handler; }

  /// Queues a frame without confirmation.
  Queued send(const Frame& frame) noexcept { return port_->send(frame, 0); }
  /// Queues a frame; `confirmation.sent` is called once when it is on the wire. One frame per confirmation at a time.
  Queued send(const Frame& frame, Confirmation& confirmation) noexcept;
  /// Takes the frame back if it is still queued, and forgets the confirmation.
  void withdraw(Confirmation& confirmation) noexcept;

 private:
  friend class Confirmation;
  struct Entry {
    Handler* handler;
    std::uint32_t last;   // end of its range
    std::uint16_t order;  // 0, 1, ... in the order of adding
    bool alone;           // no other range overlaps
  };
  void received(const Frame& frame, rt::Time at) noexcept override;
  void sent(std::uint32_t tag, rt::Time at) noexcept override;
  void changed(const Status& status, rt::Time at) noexcept override;
  [[nodiscard]] IdRange range(std::size_t i) const noexcept { return {firsts_[i], entries_[i].last}; }
  [[nodiscard]] std::size_t after(std::uint32_t key) const noexcept;
  void received_by_order(const Frame& frame, rt::Time at) noexcept;
  void erase(std::size_t i) noexcept;
  void refresh() noexcept;
  static void forget(Confirmation*& place) noexcept;

  rt::Executor* executor_;
  Port* port_;
  StatusHandler* status_handler_ = nullptr;
  std::vector<std::uint32_t> firsts_;  // sorted: start of each entry's range; separate because the search touches it
  std::vector<Entry> entries_;         // parallel to `firsts_`; equal ones by order
  Confirmation* waiting_ = nullptr;    // few wait at a time, in no order
  std::vector<IdRange> accept_;        // built by `refresh`; kept, so that a change of identifiers needs no heap
  std::uint32_t widest_ = 0;           // size of the widest range, so that a search knows how far back to look
  // For a frame that several handlers receive:
  std::uint32_t heard_ = 0;  // order of the last handler called, plus one
  std::uint32_t end_ = 0;    // a handler added meanwhile is not called for this frame
  std::uint32_t next_tag_ = 0;
};

inline Confirmation::~Confirmation() {
  if (dispatcher_ != nullptr) dispatcher_->withdraw(*this);
}

}  // namespace berth::can
