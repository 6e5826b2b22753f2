/// The time of the messages. Values are acquired in the executor's time, which no person sets; messages have UTC.
#pragma once

#include "berth/sparkplug/message.hpp"

namespace berth::fleet {

/// Asked by several threads at once.
class Clock {
 public:
  [[nodiscard]] virtual sparkplug::Now now() const noexcept = 0;

 protected:
  ~Clock() = default;
};

/// This computer's.
class SystemClock final : public Clock {
 public:
  [[nodiscard]] sparkplug::Now now() const noexcept override;
};

}  // namespace berth::fleet
