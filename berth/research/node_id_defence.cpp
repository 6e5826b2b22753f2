#include "berth/research/node_id_defence.hpp"

#include <utility>

#include "berth/research/negotiation_frames.hpp"
#include "berth/research/negotiation_parts.hpp"

namespace berth::research {
namespace {

constexpr rt::Duration lost_frame = std::chrono::milliseconds(500);  // then checks whether the controller lost it
constexpr unsigned coin_after = 2;  // insistences answered by a defence; after that by a coin toss
constexpr unsigned yield_after = 8;

}  // namespace

void NodeIdDefence::hold(NodeId id, bool firm, rt::Time since) noexcept {
  node_id_ = id;
  firm_ = firm;
  owes_ = defended_ = false;
  insisted_ = 0;
  since_ = since;
  schedule_check();
}

void NodeIdDefence::stop() noexcept {
  speak_.cancel();
  calm_.cancel();
  node_id_ = NodeId();
  firm_ = owes_ = defended_ = false;
  insisted_ = 0;
}

void NodeIdDefence::heard_request() noexcept {
  if (sender_.queued() || owes_) return;
  owes_ = true;
  if (options_->literal) return speak_at({});
  speak_at(2 * sender_.frame_time() + (node_id_.value() - 1) * options_->answer_slot +
           sender_.random(options_->answer_slot));
}

void NodeIdDefence::heard_used(NodeId id) noexcept {
  if (id == node_id_) return conflict();
  // Answers follow the order of the node-IDs, with a gap after each.
  if (!owes_ || sender_.queued() || options_->literal) return;
  const unsigned turn = (node_id_.value() + 127U - id.value()) % 127U - 1U;
  speak_at(2 * sender_.frame_time() + turn * options_->answer_slot + sender_.random(options_->answer_slot));
}

void NodeIdDefence::sent() noexcept {
  owes_ = false;
  defended_ = true;
  schedule_check();
}

void NodeIdDefence::conflict() noexcept {
  if (options_->literal) {
    sender_.drop();
    sender_.put(used(node_id_));
    if (!firm_) lose(IdLoss::literal);
    return;
  }
  if (!firm_ && sender_.now() < since_ + sender_.in_world(options_->probation)) return lose(IdLoss::defended);
  sender_.after(options_->contest, calm_);
  if (std::exchange(defended_, false)) ++insisted_;
  if (!firm_ && insisted_ > coin_after && (insisted_ > yield_after || sender_.dice().below(2) == 0)) {
    return lose(IdLoss::contested);
  }
  if (firm_ && insisted_ > yield_after) return;  // defended often enough
  if (sender_.queued()) return;
  owes_ = true;
  speak_at(sender_.random(options_->jitter));
}

void NodeIdDefence::lose(IdLoss why) noexcept {
  const auto id = node_id_;
  stop();
  owner_->id_lost(id, why);
}

void NodeIdDefence::speak() noexcept {
  if (!node_id_.configured()) return;
  if (sender_.queued() && !sender_.forgotten()) return sender_.after(lost_frame, speak_);
  sender_.after(sender_.put(used(node_id_)) ? lost_frame : requeue_pause, speak_);
}

void NodeIdDefence::speak_at(rt::Duration own) noexcept { sender_.after(own, speak_); }

void NodeIdDefence::schedule_check() noexcept {
  speak_.cancel();
  if (options_->literal || options_->check <= rt::Duration::zero()) return;
  speak_at(options_->check / 2 + sender_.random(options_->check));
}

void NodeIdDefence::calm() noexcept {
  insisted_ = 0;
  defended_ = false;
  if (node_id_.configured()) owner_->id_kept(node_id_);
}

}  // namespace berth::research
