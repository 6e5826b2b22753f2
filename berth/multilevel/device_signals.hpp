/// The signal gateway of a whole device (`SignalGateway`): its sides are devices, its table is given, or read from the
/// objects of the upstream one (routing_objects.hpp) each time that this becomes operational. Signals that are late are
/// told above (EMCY FF05h), and so is a row that is wrong and left out (FF06h).
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
    MeteredPort* port = nullptr;  ///< where its TPDOs go; null: delays of signals to this side are not known
  };
  /// All stay; sides[0] is the upstream one, the others are the buses beneath ports 1, 2, ...
  DeviceSignals(rt::Executor& executor, std::vector<Side> sides, EmcyGateway& emcy);

  /// Another table; what is wrong with it, those signals being left out. The application's safety condition stays as
  /// it was (`set_safe`), the mode is 0 again.
  std::vector<SignalProblem> set_table(std::vector<Signal> table);
  /// From now on the objects have the table; the safety condition holds until `set_safe` says otherwise.
  void follow_objects();
  void set_safe(bool safe);
  /// The NMT state of a side may be another: forwarding waits for operational on all sides.
  void look();
  /// There after `set_table`, or when `follow_objects` has read one.
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
  unsigned late_ = 0;  // signals that are
  NmtState upper_ = NmtState::initialising;
  bool follows_ = false;
  bool wrong_ = false;  // told above
  bool safe_ = false;
};

}  // namespace berth::multilevel
