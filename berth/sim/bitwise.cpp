// The segment while something is wrong: every node bit by bit, nodes in one state together, until all are idle again.
#include <algorithm>
#include <utility>

#include "berth/can/length.hpp"
#include "berth/sim/segment.hpp"
#include "berth/sim/world.hpp"

namespace berth::sim {

/// Nodes that see and do the same.
struct Segment::Group {
  BitNode bits;
  std::vector<Controller*> members;
  bool open = false;   // others in the same state may still join
  bool sees = false;   // the level of the bit
  bool drove = false;  // dominant in the bit before
};

/// The nodes of one bit rate and their common bit clock.
struct Segment::Domain final : rt::Job {
  Domain(Segment& s, std::uint32_t rate, rt::Time begin)
      : segment(s), bit_rate(rate), bit(bit_time_of(rate)), start(begin) {}
  void run() noexcept override {
    if (at_edge) {
      segment.edge(*this);
    } else {
      segment.tick(*this, false);
    }
  }
  /// Beside others the beginning of the bit comes first: they see what begins there before it is sampled here.
  void set_clock() noexcept {
    at_edge = !segment.one_rate() && start >= segment.executor_->now();
    segment.executor_->at(at_edge ? start : start + sample_point(bit), *this, rt::Rank::medium);
  }
  [[nodiscard]] bool drives() const noexcept {
    return std::ranges::any_of(groups, [](const auto& group) { return group->bits.drives(); });
  }
  /// Behind its sample point a node still drives the bit that it sampled.
  [[nodiscard]] bool drives(rt::Time at) const noexcept {
    return at < start ? std::ranges::any_of(groups, [](const auto& group) { return group->drove; }) : drives();
  }
  [[nodiscard]] bool quiet() const noexcept {
    return std::ranges::all_of(groups, [](const auto& group) { return group->bits.quiet(); });
  }

  Segment& segment;
  std::uint32_t bit_rate;
  rt::Duration bit;
  rt::Time start;        // of the bit that is sampled next
  bool at_edge = false;  // what comes next is its beginning
  std::vector<std::unique_ptr<Group>> groups;
};

Segment::Segment(Bus& bus) noexcept : bus_(&bus), executor_(&bus.executor()) {}
Segment::~Segment() = default;

// Into the play and out of it.

void Segment::start_bitwise() {
  ++bus_->statistics_.bitwise;
  play_from(sof_, true);
}

// All nodes as they are at the beginning of the bit at `start`; those that contend send their start of frame in it.
void Segment::play_from(rt::Time start, bool sending) {
  cancel();
  integrator_.cancel();
  state_ = State::bitwise;
  played_since_ = start;
  for (Controller* node : nodes_) {
    if (node != nullptr && node->powered_ && node->runs_left_ != Controller::nothing) {
      put_in_group(*node, start, sending, start < free_at_);
    }
  }
}

void Segment::put_in_group(Controller& node, rt::Time start, bool sending, bool pauses) {
  Domain& domain = domain_of(node.bit_rate_, start);
  BitNode bits;
  bits.tec = node.tec_;
  bits.rec = node.rec_;
  bits.bus_off = node.bus_off_;
  bits.listen_only = node.listen_only_;
  const bool suspended = node.suspends_ && node.not_before_ > start + sample_point(domain.bit);
  const bool sent_passive = std::exchange(node.suspends_, false);
  bool contends = sending && !suspended && node.heap_at_ != Controller::nothing && node.contends_since_ < starts_;
  if (contends) begin_attempt(node);
  contends = contends || node.sending_;
  bool alone = contends || suspended || node.runs_left_ > 0 || pauses;
  if (contends) {
    bits.begin_sending(node.head_frame(), false);
  } else if (node.runs_left_ > 0) {
    bits.integrate(node.runs_left_);
    bits.count = static_cast<unsigned>(std::max<std::int64_t>(0, (start - node.recessive_since_) / domain.bit) % 11);
  } else if (pauses) {  // a frame has just ended well
    bits.activity = BitNode::Activity::intermission;
    const auto left = (free_at_ - start + domain.bit - rt::Duration(1)) / domain.bit;
    bits.count = 3U - static_cast<unsigned>(std::clamp<std::int64_t>(left, 1, 3));
    bits.transmitter = sent_passive;
  } else if (suspended) {
    bits.activity = BitNode::Activity::suspend;
    const auto left = (node.not_before_ - start + domain.bit - rt::Duration(1)) / domain.bit;
    bits.count = 8U - static_cast<unsigned>(std::clamp<std::int64_t>(left, 1, 8));
  }
  alone = alone || faults_.victim(node);
  if (!alone) {
    for (auto& group : domain.groups) {
      const BitNode& other = group->bits;
      if (group->open && other.activity == BitNode::Activity::idle && other.tec == bits.tec && other.rec == bits.rec &&
          other.listen_only == bits.listen_only) {
        group->members.push_back(&node);
        return;
      }
    }
  }
  domain.groups.push_back(std::make_unique<Group>(Group{bits, {&node}, !alone, false}));
}

Segment::Domain& Segment::domain_of(std::uint32_t bit_rate, rt::Time start) {
  for (auto& domain : domains_) {
    if (domain->bit_rate != bit_rate) continue;
    if (domain->groups.empty()) {
      domain->start = start;
      domain->set_clock();
    }
    return *domain;
  }
  domains_.push_back(std::make_unique<Domain>(*this, bit_rate, start));
  domains_.back()->set_clock();
  return *domains_.back();
}

// A frame under way has lost what it was computed on: play again what has happened of it, and on from here.
void Segment::replay() {
  ++bus_->statistics_.bitwise;
  play_from(sof_, true);
  for (auto& domain : domains_) {
    while (domain->start + sample_point(domain->bit) < executor_->now()) tick(*domain, true);
    domain->set_clock();
  }
}

void Segment::end_bitwise() noexcept {
  free_at_ = rt::Time{};
  for (const auto& domain : domains_) {
    free_at_ = std::max(free_at_, domain->start);
    for (const auto& group : domain->groups) {
      for (Controller* node : group->members) {
        if (group->bits.activity == BitNode::Activity::suspend) {
          node->suspends_ = true;
          node->not_before_ = domain->start + (8 - group->bits.count) * domain->bit;
        } else if (group->bits.activity == BitNode::Activity::integrating) {
          node->runs_left_ = group->bits.runs;
          node->recessive_since_ = domain->start - group->bits.count * domain->bit;
        }
      }
    }
  }
  bus_->statistics_.busy += free_at_ - played_since_;
  domains_.clear();
  faults_.end_flaws();
  state_ = State::quiet;
  refresh();
  schedule_start();
}

void Segment::edge(Domain& domain) {
  begin_frames(domain);
  domain.at_edge = false;
  executor_->at(domain.start + sample_point(domain.bit), domain, rt::Rank::medium);
}

// One bit of one domain, at its sample point. `again`: it is played a second time and no further node begins.
void Segment::tick(Domain& domain, bool again) {
  if (!again && one_rate()) begin_frames(domain);
  const bool dominant = domain.drives() || level_of_others(domain, domain.start + sample_point(domain.bit));
  // What a bit means may begin a frame, with disturbances and groups of its own: they do not concern this bit any more.
  for (auto& group : domain.groups) {
    group->sees = seen(domain, *group, dominant);
    group->drove = group->bits.drives();
  }
  const std::size_t count = domain.groups.size();
  for (std::size_t i = 0; i < count; ++i) {
    Group& group = *domain.groups[i];
    if (const auto outcome = group.bits.sample(group.sees); outcome.any()) note(domain, group, outcome);
  }
  domain.start += domain.bit;
  if (again) return;
  if (std::ranges::all_of(domains_, [](const auto& each) { return each->quiet(); })) return end_bitwise();
  domain.set_clock();
}

bool Segment::level_of_others(const Domain& domain, rt::Time at) const noexcept {
  return domains_.size() > 1 &&
         std::ranges::any_of(domains_, [&](const auto& other) { return other.get() != &domain && other->drives(at); });
}

bool Segment::one_rate() const noexcept {
  return std::ranges::count_if(domains_, [](const auto& domain) { return !domain->groups.empty(); }) < 2;
}

bool Segment::seen(const Domain& domain, const Group& group, bool dominant) const noexcept {
  if (!faults_.disturbed()) return dominant;
  const Controller& node = *group.members.front();
  return faults_.seen(node, node.sending_, (domain.start - sof_) / domain.bit, dominant);
}

// Beginnings of frames.

void Segment::begin_frames(Domain& domain) {
  for (std::size_t i = 0; i < domain.groups.size(); ++i) {
    if (domain.groups[i]->bits.activity != BitNode::Activity::idle) continue;
    const auto members = domain.groups[i]->members;
    for (Controller* node : members) {
      if (!node->offers() || node->sending_) continue;
      Group& own = alone(domain, *node);
      frame_begun(domain, *node);
      own.bits.begin_sending(node->head_frame(), false);
    }
  }
}

// Dominant in the third bit of intermission: a node that waits sends on from the bit behind it.
void Segment::join_started(Domain& domain, Group& group) {
  const auto members = group.members;
  for (Controller* node : members) {
    if (!node->offers() || node->sending_) continue;
    Group& own = alone(domain, *node);
    frame_begun(domain, *node);
    own.bits.begin_sending(node->head_frame(), true);
  }
}

void Segment::frame_begun(Domain& domain, Controller& node) {
  if (sof_ != domain.start || starts_ == 0) {
    sof_ = domain.start;
    note_start(node.head_frame(), node.number_);
    single_out_victims();
    synchronise_others(domain);
  }
  node.contends_since_ = std::min(node.contends_since_, starts_ - 1);
  begin_attempt(node);
}

void Segment::synchronise_others(const Domain& domain) noexcept {
  for (auto& other : domains_) {
    if (other.get() == &domain || !other->quiet()) continue;
    other->start = domain.start;
    other->set_clock();
  }
}

// What a bit meant.

void Segment::note(Domain& domain, Group& group, const BitNode::Outcome& outcome) {
  if (outcome.lost) {
    for (Controller* node : group.members) {
      ++node->statistics_.arbitration_losses;
      --node->statistics_.attempts;
      if (node->head().tried) --node->statistics_.retransmissions;
      attempt_over(*node);
    }
  }
  if (outcome.fd_destroyed) ++bus_->statistics_.fd_destroyed;
  if (outcome.failed) {
    if (!std::exchange(failed_, true)) ++bus_->statistics_.error_frames;
    for (Controller* node : group.members) {
      ++(outcome.as_transmitter ? node->statistics_.transmit_errors : node->statistics_.receive_errors);
      if (!node->sending_) continue;
      node->slots_[node->head_].tried = true;
      attempt_over(*node);
    }
  }
  if (outcome.overload && domain.start - overload_at_ > 12 * domain.bit) {
    overload_at_ = domain.start;
    ++bus_->statistics_.overload_frames;
  }
  if (outcome.took_part) {
    for (Controller* node : group.members) {
      node->runs_left_ = 0;
      offer(*node);
    }
  }
  if (outcome.counters) note_counters(group);
  if (outcome.accepted) {
    const can::Frame frame = group.bits.frame();
    const std::uint64_t* hearing = filters_.find(frame.key());
    for (Controller* node : group.members) {
      if ((hearing[node->slot_ / 64] >> (node->slot_ % 64) & 1U) == 0) continue;
      if (faults_.loses(*node)) {
        ++node->statistics_.overruns;
      } else {
        pending_.push_back({node, frame, domain.start + 2 * domain.bit, false});
      }
    }
  }
  if (outcome.sent) {
    for (Controller* node : group.members) note_sent(domain, *node);
  }
  if (!pending_.empty()) executor_->at(pending_.front().at, deliverer_);
  if (outcome.start) join_started(domain, group);
}

void Segment::note_counters(Group& group) {
  for (Controller* node : group.members) {
    node->set_counters(group.bits.tec, group.bits.rec);
    if (group.bits.bus_off && !node->bus_off_) {
      ++node->statistics_.bus_offs;
      node->runs_left_ = Controller::nothing;
      attempt_over(*node);
      heap_remove(*node);
    }
    node->bus_off_ = group.bits.bus_off;
    node->tell_if_changed();
  }
}

void Segment::attempt_over(Controller& node) noexcept {
  node.attempt_failed();
  offer(node);
}

void Segment::note_sent(Domain& domain, Controller& node) {
  const can::Frame frame = node.head().frame.unpacked();
  const unsigned bits = can::exact_bits(frame);
  const rt::Time end = domain.start + domain.bit;
  pending_.push_back({&node, {}, end, true});
  node.statistics_.sent_bits += bits;
  if (std::exchange(good_, true)) return;
  bus_->statistics_.bits += bits;
  bus_->good_frame(frame, end, node.number_);
}

void Segment::deliver_pending() noexcept {
  std::size_t done = 0;
  for (; done < pending_.size() && pending_[done].at <= executor_->now(); ++done) {
    const Pending& due = pending_[done];
    Controller& node = *due.node;
    if (!due.sent) {
      if (node.listener_ != nullptr) node.deliver(due.frame, due.at);
      continue;
    }
    heap_remove(node);
    node.confirm(due.at);
    offer(node);
  }
  pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(done));
  if (!pending_.empty()) executor_->at(pending_.front().at, deliverer_);
}

// Nodes that come, go and part.

void Segment::disturb(Controller& node) noexcept {
  if (state_ == State::busy) {
    const bool sends = node.sending_;
    const bool acknowledges = node.participates() && !node.listen_only_;
    if (sends || (acknowledges && ackers_ <= senders_.size() + 1)) {
      replay();
    } else if (acknowledges) {
      --ackers_;
    }
  }
  if (state_ == State::bitwise) take_out(node);
  const auto sent = std::ranges::find_if(pending_, [&](const Pending& p) { return p.node == &node && p.sent; });
  if (sent != pending_.end()) node.confirm(sent->at);  // it is on the wire whole
  std::erase_if(pending_, [&](const Pending& pending) { return pending.node == &node; });
  node.sending_ = false;
  node.suspends_ = false;
  heap_remove(node);
  if (state_ == State::starting && contenders_.empty()) schedule_start();
}

std::unique_ptr<Segment::Group> Segment::take_out(Controller& node) {
  for (auto& domain : domains_) {
    for (auto it = domain->groups.begin(); it != domain->groups.end(); ++it) {
      auto& members = (*it)->members;
      if (std::erase(members, &node) == 0) continue;
      auto own = std::make_unique<Group>(Group{(*it)->bits, {&node}, false, false, (*it)->drove});
      if (members.empty()) domain->groups.erase(it);
      return own;
    }
  }
  return nullptr;
}

// Wherever it is: the first that begins in a bit may have parted the group that it was in.
Segment::Group& Segment::alone(Domain& domain, Controller& node) {
  const auto its = std::ranges::find_if(domain.groups, [&](const auto& group) {
    return std::ranges::find(group->members, &node) != group->members.end();
  });
  return split(domain, **its, node);
}

Segment::Group& Segment::split(Domain& domain, Group& group, Controller& node) {
  if (group.members.size() == 1) return group;
  std::erase(group.members, &node);
  domain.groups.push_back(std::make_unique<Group>(Group{group.bits, {&node}, false, false, group.drove}));
  return *domain.groups.back();
}

void Segment::counters_preset(Controller& node) {
  for (auto& domain : domains_) {
    for (std::size_t i = 0; i < domain->groups.size(); ++i) {
      if (std::ranges::find(domain->groups[i]->members, &node) == domain->groups[i]->members.end()) continue;
      Group& own = split(*domain, *domain->groups[i], node);
      own.bits.tec = node.tec_;
      own.bits.rec = node.rec_;
      return;
    }
  }
}

void Segment::single_out_victims() {
  for (const auto& flaw : faults_.flaws()) {
    for (const Controller* victim : flaw.victims) {
      for (auto& domain : domains_) {
        for (std::size_t i = 0; i < domain->groups.size(); ++i) {
          auto& members = domain->groups[i]->members;
          const auto found = std::ranges::find(members, victim);
          if (found != members.end()) split(*domain, *domain->groups[i], **found);
        }
      }
    }
  }
}

void Segment::hand_over(Controller& node, Segment& to) {
  if (this == &to) return;
  if (state_ == State::busy) replay();
  if (to.state_ == State::busy) to.replay();
  const bool playing = state_ == State::bitwise;
  const rt::Time grid = playing ? domain_of(node.bit_rate_, executor_->now()).start : executor_->now();
  auto group = playing ? take_out(node) : nullptr;
  const bool sends = node.sending_;
  node.sending_ = false;
  heap_remove(node);
  if (state_ == State::starting && contenders_.empty()) schedule_start();
  for (auto& pending : pending_) {
    if (pending.node == &node) to.pending_.push_back(pending);
  }
  std::erase_if(pending_, [&](const Pending& pending) { return pending.node == &node; });
  if (!to.pending_.empty()) executor_->at(to.pending_.front().at, to.deliverer_);
  if (to.count_ == 0) to.free_at_ = free_at_;
  detach(node);
  if (playing && to.state_ != State::bitwise) {
    to.play_from(grid, false);
    to.sof_ = sof_;
  }
  to.join(node);
  if (to.state_ != State::bitwise) return to.offer(node);
  if (group == nullptr) {
    if (node.powered_ && node.runs_left_ != Controller::nothing) to.put_in_group(node, grid, false, false);
  } else {
    to.domain_of(node.bit_rate_, grid).groups.push_back(std::move(group));
  }
  if (sends) {
    to.heap_put(node);
    node.sending_ = true;
  } else {
    to.offer(node);
  }
}

// Planned and random faults.

// Where bit `bit` of a frame begins, from its start.
rt::Duration Segment::place(const can::Frame& frame, int bit) const noexcept {
  if (!frame.fd || !frame.brs) return bit * bit_;
  const can::FdBits parts = can::exact_fd_bits(frame);
  const int fast = std::clamp(bit - static_cast<int>(parts.head), 0, static_cast<int>(parts.data));
  return (bit - fast) * bit_ + fast * bus_->data_bit_time();
}

void Segment::apply_faults(const can::Frame& frame, int sender) {
  const int length = static_cast<int>(frame.fd ? can::exact_fd_bits(frame).all() : can::exact_bits(frame)) - 3;
  FaultPlan& plan = bus_->faults_;
  plan.strike({frame, plan.started(), sof_, sender}, [&](const Fault& fault) {
    const int first = fault.where.from_end ? length - 1 - fault.where.bit : fault.where.bit;
    if (fault.kind == Fault::Kind::overrun) {
      for (const Controller* node :
           fault.victims.empty() ? std::vector<const Controller*>(nodes_.begin(), nodes_.end()) : fault.victims) {
        if (node != nullptr) faults_.lose(*node);
      }
    } else if (fault.kind == Fault::Kind::act) {
      bus_->world().at(sof_ + place(frame, first), fault.act);
    } else if (frame.fd) {
      const auto here = [this](const Controller* node) { return node->segment_ == this; };
      if (fault.victims.empty() || std::ranges::any_of(fault.victims, here)) faults_.doom();
    } else {
      faults_.disturb(
          {fault.kind, first, first + static_cast<int>(fault.bits) - 1, fault.victims, fault.spare_senders});
    }
  });
  std::vector<const Controller*> present;
  for (const Controller* node : nodes_) {
    if (node != nullptr && node->participates()) present.push_back(node);
  }
  if (present.empty()) return;
  if (auto flip = plan.draw_flip(present, length)) {
    if (frame.fd) {
      faults_.doom();
    } else {
      faults_.disturb({Fault::Kind::flip, flip->bit, flip->bit, std::move(flip->victims), false});
    }
  }
  if (const Controller* const loser = plan.draw_overrun(present)) faults_.lose(*loser);
}

}  // namespace berth::sim
