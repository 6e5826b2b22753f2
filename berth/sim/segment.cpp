#include "berth/sim/segment.hpp"

#include <algorithm>

#include "berth/can/length.hpp"

namespace berth::sim {
namespace {

// Do senders of one identifier send one frame on the wire? Among FD frames, ESI distinguishes a passive sender from an
// active one.
[[gnu::cold]] bool all_send_one_fd_frame(const std::vector<BusNode*>& senders) noexcept {
  const can::Frame first = senders.front()->head_frame();
  return std::ranges::all_of(senders, [&](const BusNode* node) {
    const can::Frame frame = node->head_frame();
    return frame == first && frame.esi == first.esi;
  });
}

bool all_send_one_frame(const std::vector<BusNode*>& senders) noexcept {
  const can::PackedFrame& frame = senders.front()->transmit.head().frame;
  if (frame.fd()) return all_send_one_fd_frame(senders);
  return std::ranges::all_of(senders, [&](const BusNode* node) {
    const can::PackedFrame& other = node->transmit.head().frame;
    return !other.fd() && other == frame;
  });
}

}  // namespace

Segment::Segment(Bus& bus) noexcept
    : medium_(bus),
      integration_(medium_.executor, medium_.nodes, *this),
      deliveries_(medium_.executor, *this),
      play_(medium_, deliveries_, *this) {}

// Adding and removing nodes.

void Segment::join(BusNode& node) {
  if (state_ == State::busy && unanswered_) replay();
  medium_.nodes.join(node);
  medium_.contenders.grow(medium_.nodes.slots().size());
  medium_.filters.grow(medium_.nodes.slots().size());
  node.segment = this;
  node.transmit.break_off();
  medium_.filters.set(node.slot, {}, node.accept);
  refresh();
}

void Segment::leave(BusNode& node) noexcept {
  disturb(node);
  detach(node);
}

void Segment::detach(BusNode& node) noexcept {
  medium_.filters.set(node.slot, node.accept, {});
  medium_.nodes.leave(node);
  node.segment = nullptr;
  refresh();
}

void Segment::refresh() noexcept {
  medium_.nodes.recount();
  schedule_integration();
}

void Segment::integrate(BusNode& node, std::uint32_t runs) noexcept {
  node.access.exclude();
  // A node of another bit rate samples the rest of the frame under way.
  const bool other_rate = node.powered && bit_time_of(node.bit_rate) != medium_.nodes.bit();
  if (state_ == State::busy && (unanswered_ || (other_rate && !frame_.fd))) replay();
  node.access.integrate(runs, medium_.executor.now());
  node.access.end_suspension();
  refresh();
  if (state_ != State::bitwise) return offer(node);
  if (node.powered) play_.put(node, medium_.executor.now());
}

void Segment::disturb(BusNode& node) noexcept {
  if (state_ == State::busy) {
    const bool acknowledges = node.acknowledges();
    if (node.transmit.sending() || (acknowledges && medium_.nodes.acknowledgers() <= senders_.size() + 1)) {
      replay();
    } else if (acknowledges) {
      medium_.nodes.lose_acknowledger();
    }
  }
  if (state_ == State::bitwise) static_cast<void>(play_.take_out(node));
  deliveries_.settle(node);
  node.transmit.break_off();
  node.access.end_suspension();
  medium_.withdraw(node);
  if (state_ == State::starting && medium_.contenders.empty()) schedule_start();
}

void Segment::hand_over(BusNode& node, Segment& to) {
  if (this == &to) return;
  if (state_ == State::busy) replay();
  if (to.state_ == State::busy) to.replay();
  const bool playing = state_ == State::bitwise;
  const rt::Time grid = playing ? play_.grid(node.bit_rate) : medium_.executor.now();
  auto group = playing ? play_.take_out(node) : nullptr;
  const bool sends = node.transmit.sending();
  node.transmit.break_off();
  medium_.withdraw(node);
  if (state_ == State::starting && medium_.contenders.empty()) schedule_start();
  deliveries_.hand_over(node, to.deliveries_);
  if (to.medium_.nodes.empty()) to.medium_.free_at = medium_.free_at;
  detach(node);
  if (playing && to.state_ != State::bitwise) {
    to.play(grid, false);
    to.medium_.sof = medium_.sof;
  }
  to.join(node);
  if (to.state_ != State::bitwise) return to.offer(node);
  if (group != nullptr) {
    to.play_.put(std::move(group), node.bit_rate, grid);
  } else if (node.powered && !node.access.excluded()) {
    to.play_.put(node, grid);
  }
  if (sends) {
    to.medium_.contenders.put(node.slot, node.transmit.head().arbitration);
    node.transmit.begin();
  } else {
    to.offer(node);
  }
}

// Integration.

void Segment::schedule_integration() noexcept {
  if (idle()) {
    integration_.schedule(state_ == State::starting ? medium_.sof : rt::never);
  } else {
    integration_.cancel();
  }
}

void Segment::integration_due() noexcept {
  if (!idle()) return;
  const rt::Time now = medium_.executor.now();
  integration_.count(state_ == State::starting ? std::min(medium_.sof, now) : now);
  refresh();
}

void Segment::integrated(BusNode& node) noexcept {
  if (node.errors.bus_off()) {
    node.errors.set_bus_off(false);
    node.set_counters(0, 0);
    node.tell_if_changed();
  }
  if (state_ != State::bitwise) offer(node);
}

// Starts of frames.

void Segment::offer(BusNode& node) noexcept {
  if (node.transmit.sending()) return;
  if (medium_.contend(node)) {
    if (state_ == State::quiet || (state_ == State::starting && medium_.sof > medium_.executor.now())) schedule_start();
  } else if (state_ == State::starting && medium_.contenders.empty()) {
    schedule_start();
  }
}

void Segment::schedule_start() noexcept {
  const auto& nodes = medium_.nodes;
  if (medium_.contenders.empty()) {
    cancel();
    state_ = State::quiet;
    if (nodes.any_integrating()) schedule_integration();
    return;
  }
  rt::Duration bit = nodes.bit();
  const rt::Time earliest = std::max(medium_.executor.now(), medium_.free_at);
  medium_.sof = earliest;
  if (nodes.any_suspended() || nodes.mixed()) {
    rt::Time first = rt::never;
    for (const auto& contender : medium_.contenders.all()) {
      const Participation& access = nodes.at(contender.slot()).access;
      first = std::min(first, access.suspends() ? std::max(earliest, access.not_before()) : earliest);
    }
    medium_.sof = first;
    bit = nodes.shortest_bit();
  }
  state_ = State::starting;
  medium_.executor.at(medium_.sof + sample_point(bit), *this, rt::Rank::medium);
}

void Segment::run() noexcept {
  if (state_ == State::starting) {
    arbitrate();
  } else if (state_ == State::busy && unanswered_) {
    give_up();
  } else if (state_ == State::busy) {
    finish();
  }
}

// The winners of arbitration; false if they send different frames.
inline bool Segment::pick_senders() noexcept {
  senders_.clear();
  if (medium_.nodes.any_suspended() || !medium_.contenders.one_wins()) return pick_among_several();
  senders_.push_back(&medium_.nodes.at(medium_.contenders.first().slot()));
  return true;
}

bool Segment::pick_among_several() noexcept {
  auto& contenders = medium_.contenders;
  const auto& nodes = medium_.nodes;
  std::uint32_t best = nodes.any_suspended() ? 0xFFFF'FFFFU : contenders.first().arbitration();
  const rt::Time now = medium_.executor.now();
  for (const auto& contender : contenders.all()) {
    if (nodes.any_suspended() && nodes.at(contender.slot()).access.suspended(now)) {
      contenders.excuse(contender.slot());
    } else {
      best = std::min(best, contender.arbitration());
    }
  }
  for (const auto& contender : contenders.all()) {
    BusNode& node = nodes.at(contender.slot());
    if (contender.arbitration() == best && !node.access.suspended(now)) senders_.push_back(&node);
  }
  std::ranges::sort(senders_, {}, &BusNode::number);
  return all_send_one_frame(senders_);
}

void Segment::arbitrate() noexcept {
  const auto& nodes = medium_.nodes;
  const auto& faults = medium_.faults;
  const bool alike = pick_senders();
  if (nodes.any_integrating()) {
    integration_.cancel();
    integration_.count(medium_.sof);
  }
  const BusNode& first = *senders_.front();
  frame_ = first.head_frame();
  medium_.begin_frame(frame_, first.number);
  if (!alike) ++medium_.statistics.collisions;
  unanswered_ = nodes.present() == 1 && !faults.disturbed() && !frame_.fd && first.errors.passive();
  if ((!alike || nodes.mixed() || nodes.acknowledgers() <= senders_.size() || faults.disturbed() || faults.doomed()) &&
      !unanswered_) {
    ++medium_.statistics.bitwise;
    return play(medium_.sof, true);
  }
  for (BusNode* node : senders_) {
    medium_.begin_attempt(*node);
    if (node->access.end_suspension()) medium_.nodes.suspension(false);
  }
  const rt::Duration bit = nodes.bit();
  if (frame_.fd) [[unlikely]] {
    frame_bits_ = can::exact_fd_bits(frame_).all();
    frame_time_ = offset_of_bit(frame_, static_cast<int>(frame_bits_), bit, medium_.bus.data_bit_time());
  } else {
    frame_bits_ = can::exact_bits(frame_);
    frame_time_ = frame_bits_ * bit;
  }
  state_ = State::busy;
  medium_.executor.at(medium_.sof + frame_time_ + (unanswered_ ? 6 : -3) * bit, *this, rt::Rank::medium);
}

// Ends of frames.

void Segment::finish() noexcept {
  const rt::Time now = medium_.executor.now();
  medium_.free_at = medium_.sof + frame_time_;
  state_ = State::quiet;
  medium_.statistics.busy += frame_time_;
  if (senders_.size() > 1) ++medium_.statistics.merged;
  medium_.count_good(frame_, frame_bits_, now, senders_.front()->number);
  medium_.deliver(frame_, now);
  for (BusNode* node : senders_) {
    node->statistics.sent_bits += frame_bits_;
    node->confirm(now);
  }
  auto& nodes = medium_.nodes;
  if (nodes.any_noisy()) nodes.count_good_frame(senders_, medium_.free_at);
  if (nodes.any_integrating()) integration_.dominant_until(medium_.free_at - 11 * nodes.bit());
  for (BusNode* node : senders_) medium_.contend(*node);
  if (nodes.any_integrating()) schedule_integration();
  schedule_start();
}

// A passive node alone on the wire repeats its frame for ever: ACK error, six recessive bits of flag, eight of
// delimiter, three of intermission, no change of a counter (rule 3, exception 1), suspend transmission.
void Segment::give_up() noexcept {
  BusNode& node = *senders_.front();
  medium_.free_at = medium_.executor.now();
  state_ = State::quiet;
  medium_.statistics.busy += medium_.free_at - medium_.sof;
  can::BusError error;
  error.report = can::error_report(can::ErrorKind::other, can::ErrorPlace::acknowledge, true, true, node.errors.tec(),
                                   node.errors.rec());
  error.frame = frame_;
  error.sender = error.first = node.number;
  medium_.count_error(error, medium_.free_at);
  ++node.statistics.transmit_errors;
  node.access.suspend(medium_.free_at + 8 * medium_.nodes.bit());
  medium_.nodes.suspension(true);
  node.transmit.mark_tried();
  node.transmit.attempt_over();
  offer(node);
  if (state_ == State::quiet) schedule_start();
}

// Bit by bit.

void Segment::play(rt::Time start, bool sending) {
  cancel();
  integration_.cancel();
  state_ = State::bitwise;
  play_.begin(start, sending);
}

// What the frame under way was computed from has changed: it is played again bit by bit up to now, and on from here.
void Segment::replay() {
  ++medium_.statistics.bitwise;
  play(medium_.sof, true);
  play_.catch_up();
}

void Segment::sent(BusNode& node, rt::Time at) noexcept {
  medium_.withdraw(node);
  node.confirm(at);
  offer(node);
}

void Segment::play_over() noexcept {
  state_ = State::quiet;
  refresh();
  schedule_start();
}

}  // namespace berth::sim
