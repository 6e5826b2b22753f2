/// The values that `publish =` chose: in which PDO each is, and what was heard of it.
///
/// `plan_signals` finds each object in the PDOs of its slot's device, from the slot's description, configuration and
/// links: nothing is asked on the bus. What no PDO carries must be marked `poll = true`.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/can/frame.hpp"
#include "berth/design/machine.hpp"
#include "berth/rt/executor.hpp"
#include "berth/sparkplug/own_metric.hpp"
#include "berth/traffic/link_network.hpp"

namespace berth::fleet {

struct Signal {
  std::size_t slot = 0;    ///< index in `Machine::slots`
  design::Publish wanted;  ///< as the file has it
  std::string metric{};    ///< "Signals/Position": the object as written
  ObjectRef object{};
  od::DataType type = od::DataType::none;
  bool type_is_described = false;  ///< false: a network variable; a write must say the type
  double factor = 1;               ///< of one count in `unit`
  std::string unit{};
  std::size_t bus = 0;  ///< index in `Machine::buses`; without meaning if it is polled
  std::uint32_t key = 0;
  std::uint8_t at = 0;      ///< first bit in the PDO
  std::uint8_t bits = 0;    ///< 0: polled
  rt::Duration timeout{0};  ///< an older value is stale; 0: never

  [[nodiscard]] bool polled() const noexcept { return bits == 0; }
  /// The data type at the broker: a value with a scale is a Double in its unit.
  [[nodiscard]] sparkplug::DataType data_type() const noexcept;
  /// `raw`: as `od::load` has it.
  [[nodiscard]] sparkplug::Value value(std::uint64_t raw) const;
  /// The same as a number in its unit, for deadbands.
  [[nodiscard]] double number(std::uint64_t raw) const noexcept;
  /// What `sdo write` takes for a value of a host. Empty: it is no number that the object can count.
  [[nodiscard]] std::optional<std::string> text_for(const sparkplug::Value& value) const;
};

struct SignalPlan {
  std::vector<Signal> signals;  ///< in the order of the slots
  Findings findings;            ///< errors at the places of the machine file; then `signals` lacks those
};
/// `links`: of a plan without errors, or null.
[[nodiscard]] SignalPlan plan_signals(const design::Machine& machine, const traffic::LinkPlan* links);

/// What was heard of the signals, and how many bits each bus carried. On the frame's path: no heap, no lock, no clock.
class SignalTable {
 public:
  struct State {
    std::uint64_t raw = 0;
    rt::Time at{};  ///< when it was heard or read
    bool known = false;
    bool failed = false;  ///< the last reading failed
    std::string text{};   ///< of a polled text
  };

  /// `signals` must outlive it.
  SignalTable(const std::vector<Signal>& signals, std::size_t buses);
  /// A frame of a bus, by its index in `Machine::buses`.
  void frame(std::size_t bus, const can::Frame& frame, rt::Time at) noexcept;
  [[nodiscard]] const State& state(std::size_t signal) const noexcept { return states_[signal]; }
  void set(std::size_t signal, State state) { states_[signal] = std::move(state); }
  /// The device is gone: its values are those of another time.
  void forget(std::size_t signal) { states_[signal] = {}; }
  /// Bits on this bus since the last call, stuff bits estimated.
  [[nodiscard]] std::uint64_t take_bits(std::size_t bus) noexcept;

 private:
  struct Part {
    std::uint32_t signal = 0;
    std::uint8_t at = 0;
    std::uint8_t bits = 0;
    od::DataType type = od::DataType::none;
  };
  struct Range {
    std::uint32_t first = 0;  // in parts_
    std::uint32_t count = 0;
  };
  struct BusTable {
    std::vector<Range> base;  // by identifier
    std::unordered_map<std::uint32_t, Range> extended;
    std::uint64_t bits = 0;
  };
  void hear(const Range& range, const can::Frame& frame, rt::Time at) noexcept;

  std::vector<Part> parts_;
  std::vector<BusTable> buses_;
  std::vector<State> states_;
};

}  // namespace berth::fleet
