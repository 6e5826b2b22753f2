/// The signal gateway of a whole device (`SignalGateway`). Its sides are devices. Its table is given, or read from the
/// upstream one's objects (routing_objects.hpp) each time it becomes operational. It reports on the bus above: late
/// signals (EMCY FF05h), and an invalid row, which is left out (FF06h).
#pragma once

#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "berth/device/device.hpp"
#include "berth/multilevel/emcy_gateway.hpp"
#include "berth/multilevel/signal_gateway.hpp"

namespace berth::multilevel {

class DeviceSignals {
 public:
  struct Side {
    device::Device* device = nullptr;
    MeteredPort* port = nullptr;  ///< for its TPDOs; null: delays of signals to this side are unknown
  };
  /// All must outlive it. sides[0] is upstream, the others are the buses beneath ports 1, 2, ...
  DeviceSignals(rt::Executor& executor, std::vector<Side> sides, EmcyGateway& emcy);

  /// Replaces the table. Returns its errors; those signals are left out. The application's safety condition is kept
  /// (`set_safe`), the mode is 0 again.
  std::vector<SignalProblem> set_table(std::vector<Signal> table);
  /// From now on the table is read from the objects; the safety condition holds until `set_safe` changes it.
  void follow_objects();
  void set_safe(bool safe);
  /// Call it when the NMT state of a side may have changed: forwarding waits until all sides are operational.
  void look();
  /// Not null after `set_table`, or after `follow_objects` has read a table.
  [[nodiscard]] SignalGateway* engine() noexcept { return engine_ ? &*engine_ : nullptr; }

 private:
  [[nodiscard]] SignalSide signal_side(const Side& side) const;
  [[nodiscard]] bool all_operational() const noexcept;
  void watch(std::uint8_t side, ObjectRef object);
  void written(std::uint8_t side, ObjectRef object);
  void late(bool late);
  void tell_late(bool late);
  void read_objects();

  rt::Executor* executor_;
  std::vector<Side> sides_;
  EmcyGateway* emcy_;
  std::optional<SignalGateway> engine_;
  std::set<std::pair<std::uint8_t, ObjectRef>> watched_;
  unsigned late_ = 0;  // late signals
  NmtState upper_ = NmtState::initialising;
  bool follows_ = false;
  bool wrong_ = false;  // reported above
  bool safe_ = false;
};

}  // namespace berth::multilevel
