/// Heartbeats, answers to guarding, boot-ups and EMCYs of the slots' devices: what is heard, and what is done about it.
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

  // What the bus tells.
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at);
  void guarding(const co::GuardingEvent& event, rt::Time at);
  void emergency(NodeId node, const co::Emcy& message) noexcept { emergencies_.heard(node, message); }

  /// EMCYs that were counted: now and then.
  void tell_repeated_emcys() { emergencies_.tell_repeated(); }
  /// Acts on it. The turn must be held.
  rt::Task<void> handle(Wake wake);
  /// Two devices with one identity that once fell into one frame drift apart: their heartbeats then come twice as
  /// often.
  void check_rates();
  /// Such a device may be one that beats at a period of its own: it is asked whether it is alone.
  rt::Task<void> ask_who_beats_fast();
  /// A device can fall silent while nothing listens for its heartbeat: while it is programmed, configured or asked.
  /// What was there in this run and is absent for long is gone, as with a lost heartbeat.
  void give_up_silent();
  /// Devices without error control are asked by SDO now and then: silence makes the slot absent.
  rt::Task<void> ask_the_unwatched();
  /// A slot has no device, and its node-ID is heard: a device that the slot was taken from while its cable was cut,
  /// say, whose boot-up message nobody hears.
  void look_at_voices();
  /// A person sent this NMT command: it is not worked against. `listens`: what the device's heartbeat tells of it comes
  /// here; else the slot shows what it was told, as it does of a device without heartbeat.
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
  std::array<std::optional<rt::Time>, 128> came_{};  // by node-ID: a boot-up that was acted on at once
};

/// What the consumers of heartbeats and EMCYs and the guarding call: they are made before there is a `Supervision`.
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
