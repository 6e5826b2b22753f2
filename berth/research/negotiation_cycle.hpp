/// A device's negotiation cycles (paper 2), from listening to the announcement; the rules are in `Negotiator`.
#pragma once

#include <cstdint>

#include "berth/research/negotiation_sender.hpp"
#include "berth/research/node_id_choice.hpp"
#include "berth/rt/later.hpp"

namespace berth::research {

class NegotiationCycle {
 public:
  class Owner {
   public:
    /// The announcement was sent; the cycle is off.
    virtual void id_won(NodeId id) noexcept = 0;
    /// All are in use; the device asks again later.
    virtual void none_free() noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// All must outlive this.
  NegotiationCycle(rt::Executor& executor, NegotiationSender& sender, NodeIdChoice& choice,
                   const NegotiatorOptions& options, Owner& owner) noexcept
      : sender_(sender), choice_(choice), options_(&options), owner_(&owner), step_(*this, executor) {}

  /// Waits for silence, then asks.
  void listen() noexcept;
  /// Waits for the end of another device's cycle.
  void wait() noexcept;
  void suspend(rt::Duration time) noexcept;
  void stop() noexcept;

  void heard_request() noexcept;
  void heard_used(NodeId id) noexcept;
  void heard_identity(unsigned byte, std::uint8_t value) noexcept;
  void sent() noexcept;

  [[nodiscard]] Negotiating state() const noexcept { return state_; }
  [[nodiscard]] bool had_rival() const noexcept { return rival_; }
  [[nodiscard]] std::uint32_t begun() const noexcept { return cycles_; }

 private:
  void step() noexcept;
  void enter(Negotiating state, rt::Duration own) noexcept;
  void restart(rt::Duration own) noexcept;
  void offer(const can::Frame& frame) noexcept;
  void ask() noexcept;
  void join() noexcept;
  void send_byte() noexcept;
  void byte_done() noexcept;
  void announce() noexcept;
  void lose_cycle() noexcept;
  [[nodiscard]] rt::Duration behind() const noexcept;

  NegotiationSender& sender_;
  NodeIdChoice& choice_;
  const NegotiatorOptions* options_;
  Owner* owner_;
  rt::Later<NegotiationCycle, &NegotiationCycle::step> step_;
  NodeId candidate_;        // announced, not yet on the wire
  rt::Time window_ends_{};  // listening, asked: not before
  std::uint32_t cycles_ = 0;
  std::uint8_t byte_ = 0;  // next to send
  Negotiating state_ = Negotiating::off;
  bool rival_ = false;
  bool leads_ = false;  // the device itself sent the last frame of this cycle
};

}  // namespace berth::research
