/// A port's calls to its listener: noted while descriptors are read, delivered between them, one call a job. If the
/// process was held up, frames read late have times later than the executor's. They are delivered at those times, in
/// order with the timers due meanwhile and with the reads of other ports, as if nothing had been late. Internal to room
/// `io`.
#pragma once

#include <span>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/io/ring.hpp"
#include "berth/rt/executor.hpp"

namespace berth::io {

class Deliveries final : private rt::Job {
 public:
  explicit Deliveries(rt::Executor& executor) noexcept : executor_(&executor) {}

  /// Drops calls noted for another listener. A frame is delivered if a range contains it at that moment.
  void listen(can::Listener* listener, std::span<const can::IdRange> accept);
  [[nodiscard]] bool anybody() const noexcept { return listener_ != nullptr; }
  /// Sorted, without overlaps.
  [[nodiscard]] const std::vector<can::IdRange>& accept() const noexcept { return accept_; }

  // Noted for the current listener; ignored without one. `at`: not before that of the previous call.
  void received(const can::Frame& frame, rt::Time at) noexcept;
  void sent(std::uint32_t tag, rt::Time at) noexcept;
  void changed(const can::Status& status, rt::Time at) noexcept;
  void error(const can::Frame& report, rt::Time at) noexcept;

  [[nodiscard]] std::size_t size() const noexcept { return events_.size(); }
  [[nodiscard]] bool empty() const noexcept { return events_.empty(); }
  void clear() noexcept { events_.clear(); }

 private:
  enum class What : std::uint8_t { received, sent, changed, error };
  struct Event {
    What what = What::received;
    std::uint32_t tag = 0;
    rt::Time at{};
    can::Frame frame{};
    can::Status status{};
  };
  Event& add(What what, rt::Time at) noexcept;
  void wait_for_next() noexcept;
  void run() noexcept override;

  rt::Executor* executor_;
  can::Listener* listener_ = nullptr;
  std::vector<can::IdRange> accept_;
  Ring<Event> events_;
};

}  // namespace berth::io
