#include "berth/sim/segment.hpp"

#include <algorithm>
#include <bit>

#include "berth/can/length.hpp"
#include "berth/sim/world.hpp"

namespace berth::sim {

// Nodes come and go.

void Segment::join(Controller& node) {
  if (state_ == State::busy && unanswered_) replay();
  const auto hole = std::ranges::find(nodes_, nullptr);
  node.slot_ = static_cast<std::uint32_t>(hole - nodes_.begin());
  if (hole == nodes_.end()) {
    nodes_.push_back(&node);
    filters_.grow(nodes_.size());
  } else {
    *hole = &node;
  }
  node.segment_ = this;
  node.sending_ = false;
  ++count_;
  if ((node.tec_ | node.rec_) != 0) ++noisy_;
  filters_.set(node.slot_, {}, node.accept_);
  refresh();
}

void Segment::leave(Controller& node) noexcept {
  disturb(node);
  detach(node);
}

void Segment::detach(Controller& node) noexcept {
  filters_.set(node.slot_, node.accept_, {});
  if ((node.tec_ | node.rec_) != 0) --noisy_;
  nodes_[node.slot_] = nullptr;
  node.segment_ = nullptr;
  node.slot_ = Controller::nothing;
  --count_;
  refresh();
}

void Segment::set_filter(Controller& node, const std::vector<can::IdRange>& before) {
  filters_.set(node.slot_, before, node.accept_);
}

void Segment::counters_changed(bool was_clean, bool is_clean) noexcept {
  if (was_clean && !is_clean) ++noisy_;
  if (!was_clean && is_clean) --noisy_;
}

void Segment::refresh() noexcept {
  ackers_ = integrating_ = suspended_ = present_ = 0;
  mixed_ = false;
  std::uint32_t rate = 0;
  for (const Controller* node : nodes_) {
    if (node == nullptr || !node->powered_) continue;
    if (node->participates() && !node->listen_only_) ++ackers_;
    if (node->runs_left_ > 0 && node->runs_left_ != Controller::nothing) ++integrating_;
    if (node->runs_left_ == Controller::nothing) continue;
    ++present_;
    if (node->suspends_) ++suspended_;
    if (rate != 0 && rate != node->bit_rate_) mixed_ = true;
    rate = node->bit_rate_;
  }
  if (rate != 0) bit_ = bit_time_of(rate);
  schedule_integration();
}

void Segment::integrate(Controller& node, std::uint32_t runs) noexcept {
  node.runs_left_ = Controller::nothing;
  // A node of another bit rate samples what the frame under way has left of it.
  const bool other_rate = node.powered_ && runs != Controller::nothing && bit_time_of(node.bit_rate_) != bit_;
  if (state_ == State::busy && (unanswered_ || (other_rate && !frame_.fd))) replay();
  node.runs_left_ = runs;
  node.recessive_since_ = executor_->now();
  node.suspends_ = false;
  refresh();
  if (state_ == State::bitwise) {
    if (node.powered_ && runs != Controller::nothing) put_in_group(node, executor_->now(), false, false);
  } else {
    offer(node);
  }
}

// Recessive bits are counted on the segment's behalf while nothing disturbs: each frame that ends well gives one run
// of 11 (ACK delimiter, end-of-frame, intermission), an idle bus one for each 11 bits.

void Segment::count_recessive(rt::Time dominant_at) noexcept {
  for (Controller* node : nodes_) {
    if (node == nullptr || node->runs_left_ == 0 || node->runs_left_ == Controller::nothing) continue;
    const auto run = 11 * bit_time_of(node->bit_rate_);
    const auto seen = std::max<std::int64_t>(0, (dominant_at - node->recessive_since_) / run);
    node->runs_left_ -= static_cast<std::uint32_t>(std::min<std::int64_t>(seen, node->runs_left_));
    node->recessive_since_ += seen * run;
    if (node->runs_left_ == 0) integrated(*node);
  }
}

void Segment::schedule_integration() noexcept {
  integrator_.cancel();
  if (integrating_ == 0 || state_ == State::busy || state_ == State::bitwise) return;
  rt::Time first = rt::never;
  for (const Controller* node : nodes_) {
    if (node == nullptr || node->runs_left_ == 0 || node->runs_left_ == Controller::nothing || !node->powered_)
      continue;
    first = std::min(first, node->recessive_since_ + node->runs_left_ * 11 * bit_time_of(node->bit_rate_));
  }
  // A frame that begins before that is dominant then: what is left is counted when it has ended.
  if (state_ == State::starting && first > sof_) return;
  executor_->at(first, integrator_);
}

void Segment::integration_due() noexcept {
  if (!idle()) return;
  count_recessive(state_ == State::starting ? std::min(sof_, executor_->now()) : executor_->now());
  refresh();
}

void Segment::integrated(Controller& node) noexcept {
  node.runs_left_ = 0;
  if (node.bus_off_) {
    node.bus_off_ = false;
    node.set_counters(0, 0);
    node.tell_if_changed();
  }
  if (state_ != State::bitwise) offer(node);
}

// Contenders: the nodes with a frame to send, as a heap.

void Segment::heap_place(std::size_t at, Contender contender) noexcept {
  contenders_[at] = contender;
  nodes_[contender.slot()]->heap_at_ = static_cast<std::uint32_t>(at);
}

// Moves the contender at `at` up or down to where it belongs.
void Segment::heap_move(std::size_t at) noexcept {
  const Contender moving = contenders_[at];
  while (at > 0 && moving.order < contenders_[(at - 1) / 2].order) {
    heap_place(at, contenders_[(at - 1) / 2]);
    at = (at - 1) / 2;
  }
  const std::size_t count = contenders_.size();
  for (std::size_t child = 2 * at + 1; child < count; child = 2 * at + 1) {
    if (child + 1 < count) child += contenders_[child + 1].order < contenders_[child].order ? 1 : 0;
    if (contenders_[child].order >= moving.order) break;
    heap_place(at, contenders_[child]);
    at = child;
  }
  heap_place(at, moving);
}

void Segment::heap_put(Controller& node) noexcept {
  const Contender contender{static_cast<std::uint64_t>(node.head().arbitration) << 32U | node.slot_};
  std::size_t at = node.heap_at_;
  if (at == Controller::nothing) {
    node.contends_since_ = starts_;
    at = contenders_.size();
    contenders_.push_back(contender);
  } else if (contenders_[at].order == contender.order) {
    return;
  }
  contenders_[at] = contender;
  heap_move(at);
}

void Segment::heap_remove(Controller& node) noexcept {
  const std::size_t at = node.heap_at_;
  if (at == Controller::nothing) return;
  node.statistics_.arbitration_losses += starts_ - node.contends_since_;
  node.heap_at_ = Controller::nothing;
  const Contender last = contenders_.back();
  contenders_.pop_back();
  if (at == contenders_.size()) return;
  contenders_[at] = last;
  heap_move(at);
}

void Segment::offer(Controller& node) noexcept {
  if (node.sending_) return;
  if (!node.offers()) {
    heap_remove(node);
    if (state_ == State::starting && contenders_.empty()) schedule_start();
    return;
  }
  heap_put(node);
  if (state_ == State::quiet || (state_ == State::starting && sof_ > executor_->now())) schedule_start();
}

rt::Time Segment::earliest(const Controller& node) const noexcept {
  return std::max({executor_->now(), free_at_, node.suspends_ ? node.not_before_ : free_at_});
}

void Segment::schedule_start() noexcept {
  if (contenders_.empty()) {
    cancel();
    state_ = State::quiet;
    if (integrating_ > 0) schedule_integration();
    return;
  }
  rt::Duration bit = bit_;
  sof_ = std::max(executor_->now(), free_at_);
  if (suspended_ > 0 || mixed_) {
    rt::Time first = rt::never;
    for (const auto& contender : contenders_) first = std::min(first, earliest(*nodes_[contender.slot()]));
    sof_ = first;
    for (const Controller* node : nodes_) {
      if (node != nullptr && node->powered_) bit = std::min(bit, bit_time_of(node->bit_rate_));
    }
  }
  state_ = State::starting;
  executor_->at(sof_ + sample_point(bit), *this, rt::Rank::medium);
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

// Takes the winners from the heap into senders_; false when they send different frames.
bool Segment::pick_senders() noexcept {
  senders_.clear();
  std::uint32_t best = 0xFFFF'FFFFU;
  if (suspended_ == 0) {
    best = contenders_.front().arbitration();
  } else {
    for (const auto& contender : contenders_) {
      Controller& node = *nodes_[contender.slot()];
      if (node.suspends_ && node.not_before_ > executor_->now()) {
        ++node.contends_since_;  // this one it does not lose
      } else {
        best = std::min(best, contender.arbitration());
      }
    }
  }
  // Few share the lowest key, and they stand at the top: one that is equal to the least has parents that are.
  if (suspended_ == 0 && (contenders_.size() < 2 || contenders_[1].arbitration() != best) &&
      (contenders_.size() < 3 || contenders_[2].arbitration() != best)) {
    senders_.push_back(nodes_[contenders_.front().slot()]);
    return true;
  }
  for (const auto& contender : contenders_) {
    Controller& node = *nodes_[contender.slot()];
    if (contender.arbitration() == best && !(node.suspends_ && node.not_before_ > executor_->now())) {
      senders_.push_back(&node);
    }
  }
  std::ranges::sort(senders_, {}, &Controller::number_);
  const can::PackedFrame& frame = senders_.front()->head().frame;
  if (frame.fd()) return fd_alike();
  return std::ranges::all_of(
      senders_, [&](const Controller* node) { return !node->head().frame.fd() && node->head().frame == frame; });
}

void Segment::arbitrate() noexcept {
  const bool alike = pick_senders();
  if (integrating_ > 0) {
    integrator_.cancel();
    count_recessive(sof_);
  }
  frame_ = senders_.front()->head_frame();
  note_start(frame_, senders_.front()->number_);
  if (!alike) ++bus_->statistics_.collisions;
  unanswered_ =
      present_ == 1 && !faults_.disturbed() && !frame_.fd && senders_.front()->error_state() == ErrorState::passive;
  if ((!alike || mixed_ || ackers_ <= senders_.size() || faults_.disturbed() || faults_.doomed()) && !unanswered_) {
    start_bitwise();
    return;
  }
  for (Controller* node : senders_) {
    begin_attempt(*node);
    if (node->suspends_) {
      node->suspends_ = false;
      --suspended_;
    }
  }
  if (frame_.fd) [[unlikely]] {
    frame_bits_ = can::exact_fd_bits(frame_).all();
    frame_time_ = place(frame_, static_cast<int>(frame_bits_));
  } else {
    frame_bits_ = can::exact_bits(frame_);
    frame_time_ = frame_bits_ * bit_;
  }
  state_ = State::busy;
  executor_->at(sof_ + frame_time_ + (unanswered_ ? 6 : -3) * bit_, *this, rt::Rank::medium);
}

// Senders of one identifier, the first with an FD frame: is it one frame on the wire? ESI tells a passive sender from
// an active one.
bool Segment::fd_alike() const noexcept {
  const can::Frame first = senders_.front()->head_frame();
  return std::ranges::all_of(senders_, [&](const Controller* node) {
    const can::Frame frame = node->head_frame();
    return frame == first && frame.esi == first.esi;
  });
}

void Segment::note_start(const can::Frame& frame, int sender) {
  faults_.clear();
  failed_ = good_ = false;
  if (bus_->faults_.any()) apply_faults(frame, sender);
  ++starts_;
  bus_->faults_.count_start();
  ++bus_->statistics_.starts;
}

// The node stays among the contenders while it sends.
void Segment::begin_attempt(Controller& node) noexcept {
  node.statistics_.arbitration_losses += starts_ - 1 - node.contends_since_;
  node.contends_since_ = starts_;
  node.sending_ = true;
  ++node.statistics_.attempts;
  if (node.head().tried) ++node.statistics_.retransmissions;
}

void Segment::finish() noexcept {
  const rt::Time now = executor_->now();
  free_at_ = sof_ + frame_time_;
  state_ = State::quiet;
  BusStatistics& statistics = bus_->statistics_;
  statistics.bits += frame_bits_;
  statistics.busy += frame_time_;
  if (senders_.size() > 1) ++statistics.merged;
  bus_->good_frame(frame_, now, senders_.front()->number_);
  deliver(frame_, now);
  for (Controller* node : senders_) {
    node->statistics_.sent_bits += frame_bits_;
    node->confirm(now);
  }
  if (noisy_ > 0) settle_counters(free_at_);
  if (integrating_ > 0) {
    const rt::Time delimiter = free_at_ - 11 * bit_;
    for (Controller* node : nodes_) {
      if (node != nullptr) node->recessive_since_ = std::max(node->recessive_since_, delimiter);
    }
  }
  for (Controller* node : senders_) {
    if (node->offers()) {
      heap_put(*node);
    } else {
      heap_remove(*node);
    }
  }
  if (integrating_ > 0) schedule_integration();
  schedule_start();
}

// A passive node alone on the wire goes on for ever: ACK error, six recessive bits of flag, eight of delimiter, three
// of intermission, no counter touched (rule 3, exception 1), suspend transmission.
void Segment::give_up() noexcept {
  Controller& node = *senders_.front();
  free_at_ = executor_->now();
  state_ = State::quiet;
  bus_->statistics_.busy += free_at_ - sof_;
  ++bus_->statistics_.error_frames;
  ++node.statistics_.transmit_errors;
  node.slots_[node.head_].tried = true;
  node.suspends_ = true;
  node.not_before_ = free_at_ + 8 * bit_;
  ++suspended_;
  attempt_over(node);
  if (state_ == State::quiet) schedule_start();
}

// Rules 7 and 8 of fault confinement, and suspend transmission.
void Segment::settle_counters(rt::Time free) noexcept {
  for (Controller* node : nodes_) {
    if (node == nullptr || !node->participates() || node->listen_only_) continue;
    const bool sent = std::ranges::find(senders_, node) != senders_.end();
    if (sent) {
      if (node->tec_ > 0) node->set_counters(static_cast<std::uint16_t>(node->tec_ - 1), node->rec_);
      if (node->error_state() == ErrorState::passive) {
        node->suspends_ = true;
        node->not_before_ = free + 8 * bit_;
        ++suspended_;
      }
    } else if (node->rec_ > 0) {
      node->set_counters(node->tec_,
                         node->rec_ > 127 ? std::uint16_t{127} : static_cast<std::uint16_t>(node->rec_ - 1));
    }
    node->tell_if_changed();
  }
}

void Segment::deliver(const can::Frame& frame, rt::Time at) noexcept {
  const std::uint64_t* hearing = filters_.find(frame.key());
  for (std::size_t word = 0; word < filters_.words(); ++word) {
    for (std::uint64_t rest = hearing[word]; rest != 0; rest &= rest - 1) {
      Controller& node = *nodes_[word * 64 + static_cast<unsigned>(std::countr_zero(rest))];
      if (node.sending_ || !node.participates()) continue;
      if (faults_.loses(node)) {
        ++node.statistics_.overruns;
        continue;
      }
      node.deliver(frame, at);
    }
  }
}

// Filters.

void Filters::grow(std::size_t slots) {
  const std::size_t words = (slots + 63) / 64;
  if (words <= words_) return;
  std::vector<std::uint64_t> larger(2048 * words);
  for (std::size_t key = 0; words_ > 0 && key < 2048; ++key) {
    std::copy_n(base_.begin() + static_cast<std::ptrdiff_t>(key * words_), words_,
                larger.begin() + static_cast<std::ptrdiff_t>(key * words));
  }
  base_.swap(larger);
  words_ = words;
  for (auto& cached : cache_) cached.key = 0;
}

void Filters::set(std::uint32_t slot, const std::vector<can::IdRange>& before,
                  const std::vector<can::IdRange>& accept) {
  // Only what differs is touched: services add and remove single identifiers. Ranges that overlap are set all anew.
  const std::uint64_t mask = 1ULL << (slot % 64);
  const auto put = [&](const std::vector<can::IdRange>& ranges, const std::vector<can::IdRange>& kept, bool on) {
    for (const auto& range : ranges) {
      if (range.first > can::base_mask || std::ranges::find(kept, range) != kept.end()) continue;
      for (std::uint32_t key = range.first; key <= std::min(range.last, can::base_mask); ++key) {
        auto& word = base_[key * words_ + slot / 64];
        word = on ? word | mask : word & ~mask;
      }
    }
  };
  const auto overlap = [](const can::IdRange& a, const can::IdRange& b) { return b.first <= a.last; };
  const bool plain = std::ranges::adjacent_find(before, overlap) == before.end();
  put(before, plain ? accept : std::vector<can::IdRange>{}, false);
  put(accept, plain ? before : std::vector<can::IdRange>{}, true);
  std::vector<can::IdRange> extended;
  for (const auto& range : accept) {
    if (range.last >= can::extended_flag) extended.push_back(range);
  }
  const auto known = std::ranges::find(extended_, slot, &Extended::slot);
  if (known != extended_.end() ? known->ranges == extended : extended.empty()) return;
  if (known != extended_.end()) extended_.erase(known);
  if (!extended.empty()) extended_.push_back({slot, std::move(extended)});
  for (auto& cached : cache_) cached.key = 0;
}

const std::uint64_t* Filters::find(std::uint32_t key) noexcept {
  if ((key & can::extended_flag) == 0) return base_.data() + key * words_;
  Cached& cached = cache_[(key ^ (key >> 6U) ^ (key >> 18U)) % cache_.size()];
  if (cached.key == key) return cached.nodes.data();
  cached.key = key;
  cached.nodes.assign(words_, 0);
  for (const auto& node : extended_) {
    for (const auto& range : node.ranges) {
      if (range.contains(key)) cached.nodes[node.slot / 64] |= 1ULL << (node.slot % 64);
    }
  }
  return cached.nodes.data();
}

}  // namespace berth::sim
