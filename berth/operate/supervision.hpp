/// Heartbeats, answers to guarding, boot-ups and EMCYs of the slots' devices, and the reactions to them.
#pragma once

#include <array>
#include <optional>

#include "berth/operate/emergencies.hpp"
#include "berth/operate/slot_startup.hpp"
#include "berth/operate/spares.hpp"

namespace berth::operate {

class Supervision {
 public:
  Supervision(BusServices& services, SlotTable& slots, Agenda& agenda, Loans& loans, SlotStartup& startup,
              Presence& presence, Seating& seating, Spares& spares) noexcept
      : s_(services),
        slots_(slots),
        agenda_(agenda),
        loans_(loans),
        startup_(startup),
        presence_(presence),
        seating_(seating),
        spares_(spares),
        emergencies_(services, slots) {}

  // Messages from the bus.
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at);
  void guarding(const co::GuardingEvent& event, rt::Time at);
  void emergency(NodeId node, const co::Emcy& message) noexcept { emergencies_.heard(node, message); }

  /// Reports EMCYs that were counted. Call it regularly.
  void tell_repeated_emcys() { emergencies_.tell_repeated(); }
  /// Acts on the message. The turn must be held.
  rt::Task<void> handle(Wake wake);
  /// Finds heartbeats that come twice as often. Two devices with one identity may send theirs at the same moment at
  /// first, so that they look like one frame; later they drift apart.
  void check_rates();
  /// Such a device may just have a period of its own: asks whether it is alone.
  rt::Task<void> ask_who_beats_fast();
  /// A device can fall silent while nothing listens for its heartbeat: while it is programmed, configured or asked. A
  /// device seen in this run and absent for long is treated like one whose heartbeat was lost.
  void give_up_silent();
  /// Asks devices without error control by SDO at intervals; silence makes the slot absent.
  rt::Task<void> ask_the_unwatched();
  /// A slot has no device, but its node-ID is heard. Example: the slot was given away while the device's cable was cut,
  /// and nobody heard a boot-up message.
  void look_at_voices();
  /// A user sent this NMT command: it is not counteracted. `listens`: the device's heartbeat reports its state here;
  /// else the slot shows the commanded state, as for a device without heartbeat.
  void commanded(co::NmtCommand command, co::NmtTarget target, bool listens);

 private:
  void show(Seat& seat, const Wake& wake, NmtState state);
  bool hears_at_last(Seat& seat);
  rt::Task<void> booted(Seat& seat, rt::Time at);
  void lost(Seat& seat);
  rt::Task<bool> beats_alone(Seat& seat);
  void make_free(Seat& seat);
  rt::Task<void> told_state(Seat& seat);
  void doubt_who_leaves(Seat& seat);
  rt::Task<void> came_back(Seat& seat, rt::Time booted);
  void hurry(Seat& seat);
  [[nodiscard]] bool comes_anew(NodeId node, const Seat* seat, rt::Time at) noexcept;

  BusServices& s_;
  SlotTable& slots_;
  Agenda& agenda_;
  Loans& loans_;
  SlotStartup& startup_;
  Presence& presence_;
  Seating& seating_;
  Spares& spares_;
  Emergencies emergencies_;
  std::array<std::optional<rt::Time>, 128> came_{};  // by node-ID: a boot-up that led to immediate action
};

/// The observer of heartbeats, guarding and EMCYs: their consumers are made before there is a `Supervision`.
class SupervisionRelay final : public co::HeartbeatConsumer::Observer,
                               public co::GuardingMaster::Observer,
                               public co::EmcyConsumer::Observer {
 public:
  void lead_to(Supervision& supervision) noexcept { supervision_ = &supervision; }

 private:
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override { supervision_->heartbeat(event, at); }
  void guarding(const co::GuardingEvent& event, rt::Time at) noexcept override { supervision_->guarding(event, at); }
  void emergency(NodeId node, const co::Emcy& message, rt::Time) noexcept override {
    supervision_->emergency(node, message);
  }
  Supervision* supervision_ = nullptr;
};

}  // namespace berth::operate
