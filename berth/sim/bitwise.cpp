#include "berth/sim/bitwise.hpp"

#include <algorithm>
#include <utility>

#include "berth/can/length.hpp"

namespace berth::sim {

/// The nodes of one bit rate and their common bit clock.
struct BitwisePlay::Domain final : rt::Job {
  Domain(BitwisePlay& p, std::uint32_t rate, rt::Time begin)
      : play(p), bit_rate(rate), bit(bit_time_of(rate)), start(begin) {}
  void run() noexcept override {
    if (at_edge) {
      play.edge(*this);
    } else {
      play.tick(*this, false);
    }
  }
  /// Beside other bit rates, the beginning of each bit comes first: the others see what begins there before it is
  /// sampled here.
  void set_clock() noexcept {
    at_edge = !play.one_rate() && start >= play.medium_->executor.now();
    play.medium_->executor.at(at_edge ? start : sampled_at(), *this, rt::Rank::medium);
  }
  [[nodiscard]] rt::Time sampled_at() const noexcept { return start + sample_point(bit); }
  [[nodiscard]] bool drives() const noexcept {
    return std::ranges::any_of(groups, [](const auto& group) { return group->bits.drives(); });
  }
  /// After its sample point, a node still drives the bit that it sampled.
  [[nodiscard]] bool drives(rt::Time at) const noexcept {
    return at < start ? std::ranges::any_of(groups, [](const auto& group) { return group->drove; }) : drives();
  }
  [[nodiscard]] bool quiet() const noexcept {
    return std::ranges::all_of(groups, [](const auto& group) { return group->bits.quiet(); });
  }
  /// A node here that sends the frame under way; null if there is none.
  [[nodiscard]] const BusNode* sender() const noexcept {
    for (const auto& group : groups) {
      if (group->bits.transmitter && group->members.front()->transmit.sending()) return group->members.front();
    }
    return nullptr;
  }
  /// The group that contains the node; groups.end(): it is in none here.
  auto find(const BusNode& node) noexcept {
    return std::ranges::find_if(
        groups, [&](const auto& group) { return std::ranges::find(group->members, &node) != group->members.end(); });
  }
  /// Takes the node out of its group here unless it is alone in it. The group is looked up: the first node that begins
  /// in a bit may have split it.
  BitGroup& alone(BusNode& node) {
    BitGroup& group = **find(node);
    if (group.members.size() == 1) return group;
    std::erase(group.members, &node);
    groups.push_back(std::make_unique<BitGroup>(BitGroup{group.bits, {&node}, false, false, group.drove}));
    return *groups.back();
  }

  BitwisePlay& play;
  std::uint32_t bit_rate;
  rt::Duration bit;
  rt::Time start;        // of the bit that is sampled next
  bool at_edge = false;  // the beginning of that bit comes next
  std::vector<std::unique_ptr<BitGroup>> groups;
};

BitwisePlay::BitwisePlay(Medium& medium, Deliveries& deliveries, Owner& owner) noexcept
    : medium_(&medium), deliveries_(&deliveries), owner_(&owner) {}
BitwisePlay::~BitwisePlay() = default;

// Entering and leaving the play.

void BitwisePlay::begin(rt::Time start, bool sending) {
  since_ = start;
  for (BusNode* node : medium_->nodes.slots()) {
    if (node != nullptr && node->powered && !node->access.excluded()) {
      put(*node, start, sending, start < medium_->free_at);
    }
  }
}

void BitwisePlay::catch_up() {
  for (auto& domain : domains_) {
    while (domain->sampled_at() < medium_->executor.now()) tick(*domain, true);
    domain->set_clock();
  }
}

void BitwisePlay::put(BusNode& node, rt::Time start, bool sending, bool pauses) {
  Domain& domain = domain_of(node.bit_rate, start);
  Participation& access = node.access;
  BitNode bits;
  bits.tec = node.errors.tec();
  bits.rec = node.errors.rec();
  bits.bus_off = node.errors.bus_off();
  bits.listen_only = node.listen_only;
  const bool suspended = access.suspended(start + sample_point(domain.bit));
  const bool sent_passive = access.end_suspension();
  const Contenders& contenders = medium_->contenders;
  bool contends = sending && !suspended && contenders.contains(node.slot) && contenders.was_in_time(node.slot);
  if (contends) medium_->begin_attempt(node);
  contends = contends || node.transmit.sending();
  bool alone = contends || suspended || !access.takes_part() || pauses;
  // The number of bits until `end`, with the one under way; at most `most`.
  const auto left = [&](rt::Time end, std::int64_t most) {
    return static_cast<unsigned>(
        std::clamp<std::int64_t>((end - start + domain.bit - rt::Duration(1)) / domain.bit, 1, most));
  };
  if (contends) {
    bits.begin_sending(node.head_frame(), false);
  } else if (!access.takes_part()) {
    bits.integrate(access.runs_left());
    bits.count = access.bits_of_run(start, domain.bit);
  } else if (pauses) {  // a frame has just ended well
    bits.activity = BitNode::Activity::intermission;
    bits.count = 3U - left(medium_->free_at, 3);
    bits.transmitter = sent_passive;
  } else if (suspended) {
    bits.activity = BitNode::Activity::suspend;
    bits.count = 8U - left(access.not_before(), 8);
  }
  alone = alone || medium_->faults.victim(*node.controller);
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
  domain.groups.push_back(std::make_unique<BitGroup>(BitGroup{bits, {&node}, !alone, false}));
}

void BitwisePlay::put(std::unique_ptr<BitGroup> group, std::uint32_t bit_rate, rt::Time start) {
  domain_of(bit_rate, start).groups.push_back(std::move(group));
}

std::unique_ptr<BitGroup> BitwisePlay::take_out(BusNode& node) {
  for (auto& domain : domains_) {
    const auto found = domain->find(node);
    if (found == domain->groups.end()) continue;
    std::erase((*found)->members, &node);
    auto own = std::make_unique<BitGroup>(BitGroup{(*found)->bits, {&node}, false, false, (*found)->drove});
    if ((*found)->members.empty()) domain->groups.erase(found);
    return own;
  }
  return nullptr;
}

rt::Time BitwisePlay::grid(std::uint32_t bit_rate) { return domain_of(bit_rate, medium_->executor.now()).start; }

BitwisePlay::Domain& BitwisePlay::domain_of(std::uint32_t bit_rate, rt::Time start) {
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

void BitwisePlay::end() noexcept {
  rt::Time free{};
  for (const auto& domain : domains_) {
    free = std::max(free, domain->start);
    for (const auto& group : domain->groups) {
      for (BusNode* node : group->members) {
        if (group->bits.activity == BitNode::Activity::suspend) {
          node->access.suspend(domain->start + (8 - group->bits.count) * domain->bit);
        } else if (group->bits.activity == BitNode::Activity::integrating) {
          node->access.integrate(group->bits.runs, domain->start - group->bits.count * domain->bit);
        }
      }
    }
  }
  medium_->free_at = free;
  medium_->statistics.busy += free - since_;
  medium_->faults.end_flaws();
  domains_.clear();
  owner_->play_over();
}

void BitwisePlay::edge(Domain& domain) {
  begin_frames(domain);
  domain.at_edge = false;
  medium_->executor.at(domain.sampled_at(), domain, rt::Rank::medium);
}

// One bit of one domain, at its sample point. `again`: it is played a second time and no further node begins.
void BitwisePlay::tick(Domain& domain, bool again) {
  if (!again && one_rate()) begin_frames(domain);
  const bool dominant = domain.drives() || level_of_others(domain, domain.sampled_at());
  // `note` may begin a frame, with disturbances and groups of its own: they do not concern this bit any more.
  for (auto& group : domain.groups) {
    group->sees = seen(domain, *group, dominant);
    group->drove = group->bits.drives();
  }
  const std::size_t count = domain.groups.size();
  for (std::size_t i = 0; i < count; ++i) {
    BitGroup& group = *domain.groups[i];
    if (const auto outcome = group.bits.sample(group.sees); outcome.any()) note(domain, group, outcome);
  }
  domain.start += domain.bit;
  if (again) return;
  if (std::ranges::all_of(domains_, [](const auto& each) { return each->quiet(); })) return end();
  domain.set_clock();
}

bool BitwisePlay::level_of_others(const Domain& domain, rt::Time at) const noexcept {
  return domains_.size() > 1 &&
         std::ranges::any_of(domains_, [&](const auto& other) { return other.get() != &domain && other->drives(at); });
}

bool BitwisePlay::one_rate() const noexcept {
  return std::ranges::count_if(domains_, [](const auto& domain) { return !domain->groups.empty(); }) < 2;
}

bool BitwisePlay::seen(const Domain& domain, const BitGroup& group, bool dominant) const noexcept {
  if (!medium_->faults.disturbed()) return dominant;
  const BusNode& node = *group.members.front();
  return medium_->faults.seen(*node.controller, node.transmit.sending(), (domain.start - medium_->sof) / domain.bit,
                              dominant);
}

// Starts of frames.

void BitwisePlay::begin_frames(Domain& domain) {
  for (std::size_t i = 0; i < domain.groups.size(); ++i) {
    if (domain.groups[i]->bits.activity != BitNode::Activity::idle) continue;
    const auto members = domain.groups[i]->members;
    for (BusNode* node : members) {
      if (!node->offers() || node->transmit.sending()) continue;
      BitGroup& own = domain.alone(*node);
      frame_begun(domain, *node);
      own.bits.begin_sending(node->head_frame(), false);
    }
  }
}

// A dominant third bit of intermission starts a frame: a waiting node sends from the next bit on.
void BitwisePlay::join_started(Domain& domain, BitGroup& group) {
  const auto members = group.members;
  for (BusNode* node : members) {
    if (!node->offers() || node->transmit.sending()) continue;
    BitGroup& own = domain.alone(*node);
    frame_begun(domain, *node);
    own.bits.begin_sending(node->head_frame(), true);
  }
}

void BitwisePlay::frame_begun(Domain& domain, BusNode& node) {
  if (medium_->sof != domain.start || medium_->contenders.starts() == 0) {
    medium_->sof = domain.start;
    medium_->begin_frame(node.head_frame(), node.number);
    single_out_victims();
    synchronise_others(domain);
  }
  medium_->contenders.in_time(node.slot);
  medium_->begin_attempt(node);
}

void BitwisePlay::synchronise_others(const Domain& domain) noexcept {
  for (auto& other : domains_) {
    if (other.get() == &domain || !other->quiet()) continue;
    other->start = domain.start;
    other->set_clock();
  }
}

// The outcome of a bit.

void BitwisePlay::note(Domain& domain, BitGroup& group, const BitNode::Outcome& outcome) {
  if (outcome.lost) {
    for (BusNode* node : group.members) {
      ++node->statistics.arbitration_losses;
      --node->statistics.attempts;
      if (node->transmit.head().tried) --node->statistics.retransmissions;
      attempt_over(*node);
    }
  }
  if (outcome.fd_destroyed) ++medium_->statistics.fd_destroyed;
  if (outcome.failed) note_failed(domain, group, outcome);
  if (outcome.overload && domain.start - overload_at_ > 12 * domain.bit) {
    overload_at_ = domain.start;
    ++medium_->statistics.overload_frames;
  }
  if (outcome.took_part) {
    for (BusNode* node : group.members) {
      node->access.take_part();
      if (!node->transmit.sending()) medium_->contend(*node);
    }
  }
  if (outcome.counters) note_counters(group);
  if (outcome.accepted) note_accepted(domain, group);
  if (outcome.sent) {
    for (BusNode* node : group.members) note_sent(domain, *node);
  }
  deliveries_->schedule();
  if (outcome.start) join_started(domain, group);
}

void BitwisePlay::note_failed(const Domain& domain, BitGroup& group, const BitNode::Outcome& outcome) {
  if (medium_->faults.fail()) {
    can::BusError error;
    error.report = can::error_report(outcome.kind, outcome.place, outcome.unacknowledged, outcome.as_transmitter,
                                     group.bits.tec, group.bits.rec);
    const BusNode* const front = group.members.front();
    error.first = front->number;
    error.beside_first = static_cast<unsigned>(group.members.size() - 1);
    // After its frame a node still counts as its transmitter, but may have nothing more to send.
    const BusNode* sender = outcome.as_transmitter && front->transmit.sending() ? front : nullptr;
    for (const auto& each : domains_) sender = sender != nullptr ? sender : each->sender();
    if (sender != nullptr) {
      error.sender = sender->number;
      error.frame = sender->head_frame();
    }
    medium_->count_error(error, domain.start + domain.bit);
  }
  for (BusNode* node : group.members) {
    ++(outcome.as_transmitter ? node->statistics.transmit_errors : node->statistics.receive_errors);
    if (!node->transmit.sending()) continue;
    node->transmit.mark_tried();
    attempt_over(*node);
  }
}

void BitwisePlay::note_counters(BitGroup& group) {
  for (BusNode* node : group.members) {
    node->set_counters(group.bits.tec, group.bits.rec);
    if (group.bits.bus_off && !node->errors.bus_off()) {
      ++node->statistics.bus_offs;
      node->access.exclude();
      attempt_over(*node);
      medium_->withdraw(*node);
    }
    node->errors.set_bus_off(group.bits.bus_off);
    node->tell_if_changed();
  }
}

void BitwisePlay::note_accepted(Domain& domain, BitGroup& group) {
  const can::Frame frame = group.bits.frame();
  const std::uint64_t* hearing = medium_->filters.find(frame.key());
  for (BusNode* node : group.members) {
    if ((hearing[node->slot / 64] >> (node->slot % 64) & 1U) == 0) continue;
    if (medium_->faults.loses(*node->controller)) {
      ++node->statistics.overruns;
    } else {
      deliveries_->received(*node, frame, domain.start + 2 * domain.bit);
    }
  }
}

void BitwisePlay::note_sent(Domain& domain, BusNode& node) {
  const can::Frame frame = node.transmit.head().frame.unpacked();
  const unsigned bits = can::exact_bits(frame);
  const rt::Time end = domain.start + domain.bit;
  deliveries_->sent(node, end);
  node.statistics.sent_bits += bits;
  if (medium_->faults.pass()) medium_->count_good(frame, bits, end, node.number);
}

void BitwisePlay::attempt_over(BusNode& node) noexcept {
  node.transmit.attempt_over();
  medium_->contend(node);
}

// Single nodes.

void BitwisePlay::preset_counters(BusNode& node) {
  for (auto& domain : domains_) {
    if (domain->find(node) == domain->groups.end()) continue;
    BitGroup& own = domain->alone(node);
    own.bits.tec = node.errors.tec();
    own.bits.rec = node.errors.rec();
    return;
  }
}

void BitwisePlay::single_out_victims() {
  for (const auto& flaw : medium_->faults.flaws()) {
    for (const Controller* victim : flaw.victims) {
      const auto slot = medium_->nodes.find(victim);
      if (slot == BusNode::no_slot) continue;
      BusNode& node = medium_->nodes.at(slot);
      for (auto& domain : domains_) {
        if (domain->find(node) != domain->groups.end()) domain->alone(node);
      }
    }
  }
}

}  // namespace berth::sim
