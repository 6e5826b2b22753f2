/// The engine of a signal gateway (paper 3 Figure 14; docs/multilevel.md §Signals): copies values of received PDOs to
/// objects on other buses, which are sent as the TPDOs there say. `routing.hpp` has its table; in a `GatewayDevice`,
/// `device_signals.hpp` drives it.
///
///     std::vector<SignalSide> sides{{&upper.values(), [&](ObjectRef ref) { upper.services().changed(ref); }},
///                                   {&lower.values(), [&](ObjectRef ref) { lower.services().changed(ref); },
///                                   &lower_port}};
///     SignalGateway gateway(executor, sides, table);
///     for (std::size_t i = 0; i < table.size(); ++i)
///       device_of(table[i].from).on_write(table[i].source, [&, i] { gateway.received(i); });
///     gateway.set_complete(true);       // all has started
///     gateway.set_safe(true);           // the application says so
///
/// A signal is forwarded while the start-up is complete, the application's safety condition holds, its mode is on, and
/// it is fresh (S3.32, S3.33). Values received before these conditions hold are not forwarded later.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "berth/multilevel/metered_port.hpp"
#include "berth/multilevel/routing.hpp"
#include "berth/od/values.hpp"
#include "berth/rt/later.hpp"

namespace berth::multilevel {

struct SignalSide {
  od::Values* values = nullptr;
  std::function<void(ObjectRef)> changed{};  ///< the object's value changed, or it has an event: for its TPDOs
  MeteredPort* port = nullptr;               ///< for them; null: delays of signals to this side are unknown
  std::function<void(ObjectRef, bool)>
      silence{};  ///< its TPDO is not sent (true), or sent again; for `Stopped::silent`
};

struct SignalFigures {
  std::uint64_t forwarded = 0;
  std::uint64_t refused = 0;  ///< received while not forwarded
  std::uint64_t measured = 0;
  std::uint64_t late = 0;  ///< later than its budget
  rt::Duration longest{};  ///< from reception to the end of the frame that carries it
};

class SignalGateway {
 public:
  /// Signals with `problems` are left out: `received` does nothing for them. Nothing is forwarded yet.
  SignalGateway(rt::Executor& executor, std::vector<SignalSide> sides, std::vector<Signal> table);
  ~SignalGateway();

  /// The source of this signal (index in the table) was received.
  void received(std::size_t signal);

  /// @name When signals are forwarded
  /// @{
  void set_complete(bool complete);
  void set_safe(bool safe);
  void set_mode(unsigned mode);  ///< 0..31
  /// A device's values were reset: sets the targets of signals that are not forwarded again.
  void refresh();
  [[nodiscard]] bool forwards(std::size_t signal) const noexcept { return rows_[signal].open; }
  /// @}

  /// A signal is later than its budget, or in time again (`late` false). Called from the executor.
  void on_late(std::function<void(std::size_t signal, bool late)> call) { late_call_ = std::move(call); }
  [[nodiscard]] const SignalFigures& figures(std::size_t signal) const noexcept { return rows_[signal].figures; }
  [[nodiscard]] const std::vector<Signal>& table() const noexcept { return table_; }

 private:
  struct Row {
    std::span<const std::uint8_t> source{};
    std::uint8_t* target = nullptr;  // null: left out
    std::uint32_t key = 0;           // of the frame that carries the target; 0: none
    rt::Time received = rt::Time{};
    rt::Time waiting = rt::never;    // received, not yet given to the port
    rt::Time under_way = rt::never;  // given to the port
    bool ever = false;
    bool open = false;
    bool late = false;
    SignalFigures figures{};
  };
  class Meter final : public PortMeter {
   public:
    Meter(SignalGateway& gateway, std::uint8_t side) noexcept : gateway_(&gateway), side_(side) {}
    void submitted(std::uint32_t key, rt::Time at) noexcept override;
    void on_the_wire(std::uint32_t key, rt::Time at) noexcept override;

   private:
    SignalGateway* gateway_;
    std::uint8_t side_;
  };
  void resolve(std::size_t signal);
  [[nodiscard]] bool may_go(std::size_t signal) const noexcept;
  void open_or_close(std::size_t signal, bool anew);
  void close(std::size_t signal);
  void put(std::size_t signal, std::span<const std::uint8_t> value, bool event);
  void set_late(std::size_t signal, bool late);
  void watch() noexcept;
  void due() noexcept;

  rt::Executor* executor_;
  std::vector<SignalSide> sides_;
  std::vector<Signal> table_;
  std::vector<Row> rows_;
  std::vector<std::unique_ptr<Meter>> meters_;
  std::function<void(std::size_t, bool)> late_call_;
  unsigned mode_ = 0;
  bool complete_ = false;
  bool safe_ = false;
  rt::Later<SignalGateway, &SignalGateway::due> due_;
};

/// The communication record (1800h..19FFh) of the TPDO that carries an object, valid or not; empty: none.
[[nodiscard]] std::optional<std::uint16_t> tpdo_record_of(const od::Values& values, ObjectRef object);
/// The identifier of the valid TPDO that carries an object of this device; empty: none.
[[nodiscard]] std::optional<std::uint32_t> tpdo_of(const od::Values& values, ObjectRef object);

}  // namespace berth::multilevel
