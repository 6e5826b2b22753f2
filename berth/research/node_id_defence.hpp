/// How a device keeps its node-ID (paper 2; S2.17, S2.24, S2.25): answers, checks and defends it; the rules are in
/// `Negotiator`.
#pragma once

#include "berth/research/negotiation_sender.hpp"
#include "berth/rt/later.hpp"

namespace berth::research {

class NodeIdDefence {
 public:
  class Owner {
   public:
    virtual void id_lost(NodeId id, IdLoss why) noexcept = 0;
    /// A quarrel is over.
    virtual void id_kept(NodeId id) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  /// All must outlive this.
  NodeIdDefence(rt::Executor& executor, NegotiationSender& sender, const NegotiatorOptions& options,
                Owner& owner) noexcept
      : sender_(sender), options_(&options), owner_(&owner), speak_(*this, executor), calm_(*this, executor) {}

  /// `firm`: never yields. `since`: for `NegotiatorOptions::probation` after it the device is the newcomer.
  void hold(NodeId id, bool firm, rt::Time since) noexcept;
  void stop() noexcept;
  /// Unconfigured: none.
  [[nodiscard]] NodeId node_id() const noexcept { return node_id_; }

  void heard_request() noexcept;
  void heard_used(NodeId id) noexcept;
  void sent() noexcept;
  /// Another device uses the node-ID.
  void conflict() noexcept;

 private:
  void speak() noexcept;  // an answer, a defence or a check is due
  void calm() noexcept;   // a quarrel is over
  void lose(IdLoss why) noexcept;
  void speak_at(rt::Duration own) noexcept;
  void schedule_check() noexcept;

  NegotiationSender& sender_;
  const NegotiatorOptions* options_;
  Owner* owner_;
  rt::Later<NodeIdDefence, &NodeIdDefence::speak> speak_;
  rt::Later<NodeIdDefence, &NodeIdDefence::calm> calm_;
  NodeId node_id_;
  rt::Time since_{};
  unsigned insisted_ = 0;  // how often the other device returned after a defence
  bool firm_ = false;
  bool owes_ = false;      // an answer or a defence is due
  bool defended_ = false;  // a defence was sent since the other was last heard
};

}  // namespace berth::research
