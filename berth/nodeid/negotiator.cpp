#include "berth/nodeid/negotiator.hpp"

#include <algorithm>
#include <utility>

#include "berth/can/length.hpp"

namespace berth::nodeid {
namespace {

constexpr std::uint32_t usual_bit_rate = 125'000;  // where the port does not know
constexpr unsigned patience = 3;         // frame times that a frame may wait to be acknowledged, up to twice as long
constexpr unsigned shortest_frame = 67;  // bits of an extended frame without data and without stuff bits
constexpr unsigned longest_frame = 78;   // bits of an extended frame without data, reachable
constexpr rt::Duration again = std::chrono::milliseconds(10);        // a frame could not be queued
constexpr rt::Duration lost_frame = std::chrono::milliseconds(500);  // looks whether the controller has forgotten it
constexpr unsigned coin_after = 2;  // insistences that are met by a defence; then it is a coin
constexpr unsigned yield_after = 8;

// An FD frame's data phase may be faster, which a port does not tell: at most so many nominal bit times.
unsigned load_bits(const can::Frame& frame) noexcept {
  return frame.fd ? longest_frame + 10U * frame.size : can::exact_bits(frame);
}

}  // namespace

const char* name(Negotiating state) noexcept {
  switch (state) {
    case Negotiating::off: return "off";
    case Negotiating::suspended: return "suspended";
    case Negotiating::listening: return "listening";
    case Negotiating::asking: return "asking";
    case Negotiating::asked: return "asked";
    case Negotiating::competing: return "competing";
    case Negotiating::waiting: return "waiting";
    case Negotiating::announcing: return "announcing";
    case Negotiating::settled: return "settled";
    case Negotiating::exhausted: return "all node-IDs in use";
  }
  return "?";
}

const char* name(IdLoss why) noexcept {
  switch (why) {
    case IdLoss::none: return "none";
    case IdLoss::defended: return "its holder defended the node-ID";
    case IdLoss::contested: return "two devices held the node-ID";
    case IdLoss::literal: return "another device announced the node-ID";
  }
  return "?";
}

Negotiator::Negotiator(rt::Executor& executor, NegotiatorOwner& owner, const NegotiatorOptions& options) noexcept
    : executor_(&executor), owner_(&owner), options_(options), random_(options.seed) {}

// --- From the device ------------------------------------------------------------------------------------------------

void Negotiator::start(NodeId last) noexcept {
  stop();
  last_ = last;
  listen();
}

void Negotiator::begin_anew() noexcept {
  if (state_ != Negotiating::off && state_ != Negotiating::settled) listen();
}

void Negotiator::listen() noexcept {
  window_ends_ = executor_->now() + owner_->in_world(options_.quiet);
  enter(Negotiating::listening, options_.quiet + random(options_.jitter));
}

void Negotiator::settle(NodeId id, bool firm) noexcept {
  stop();
  node_id_ = id;
  firm_ = firm;
  since_ = executor_->now() - owner_->in_world(options_.probation);  // past its probation
  state_ = Negotiating::settled;
  schedule_check();
}

void Negotiator::stop() noexcept {
  drop();
  step_.cancel();
  speak_.cancel();
  calm_.cancel();
  state_ = Negotiating::off;
  node_id_ = candidate_ = avoid_ = NodeId();
  used_.reset();
  insisted_ = 0;
  firm_ = owes_ = defended_ = rival_ = false;
}

void Negotiator::suspend(rt::Duration time) noexcept {
  if (state_ == Negotiating::off || state_ == Negotiating::settled) return;
  drop();
  enter(Negotiating::suspended, time);
}

// --- Frames ---------------------------------------------------------------------------------------------------------

void Negotiator::received(const can::Frame& frame) noexcept {
  count_load(load_bits(frame));
  const auto message = decode_negotiation(frame);
  if (!message) return;
  using Kind = NegotiationMessage::Kind;
  switch (message->kind) {
    case Kind::request_used: return heard_request();
    case Kind::used: return heard_used(message->node);
    case Kind::identity: return heard_identity(message->byte, message->value);
  }
}

void Negotiator::heard_request() noexcept {
  switch (state_) {
    case Negotiating::settled:
      if (queued_ || owes_) return;
      owes_ = true;
      if (options_.literal) return speak_at({});
      return speak_at(2 * frame_time() + (node_id_.value() - 1) * options_.answer_slot + random(options_.answer_slot));
    case Negotiating::asking:
    case Negotiating::listening:
    case Negotiating::waiting:
    case Negotiating::exhausted:
      drop();
      used_.reset();
      leads_ = false;
      return join();
    case Negotiating::asked:  // all that asked begin at the last of them: then they are in phase
      leads_ = false;
      window_ends_ = executor_->now() + owner_->in_world(options_.answers);
      return restart_step(options_.answers + behind());
    default: return;
  }
}

void Negotiator::heard_used(NodeId id) noexcept {
  const bool mine = state_ == Negotiating::announcing && id == choose();
  used_.set(id.value());
  switch (state_) {
    case Negotiating::settled:
      if (id == node_id_) return conflict();
      // Answers go round in the order of the node-IDs, with a gap behind each.
      if (owes_ && !queued_ && !options_.literal) {
        const unsigned turn = (node_id_.value() + 127U - id.value()) % 127U - 1U;
        speak_at(2 * frame_time() + turn * options_.answer_slot + random(options_.answer_slot));
      }
      return;
    case Negotiating::listening:
    case Negotiating::asked:
      if (!options_.literal) {
        const auto end = executor_->now() + owner_->in_world(options_.straggler);
        if (end > window_ends_) restart_step(options_.straggler);
      }
      return;
    case Negotiating::announcing:
      if (mine) rival_ = true;  // another device has won this cycle too, and takes what this one would take
      if (queued_ && mine) {
        drop();
        announce();
      }
      return;
    default: return;
  }
}

void Negotiator::heard_identity(unsigned byte, std::uint8_t value) noexcept {
  const auto own = identity_byte(options_.address, byte);
  switch (state_) {
    case Negotiating::asked:
    case Negotiating::competing:
    case Negotiating::announcing:
      if (value < own) return lose_cycle();
      if (value != own || options_.literal) return;
      if (state_ == Negotiating::asked && byte == 0 && choose().configured()) {
        state_ = Negotiating::competing;
        byte_ = 0;
      }
      if (state_ == Negotiating::competing && byte == byte_) {
        drop();
        leads_ = false;
        byte_done();
      }
      return;
    case Negotiating::asking: drop(); [[fallthrough]];
    case Negotiating::listening:
    case Negotiating::waiting: return wait();
    default: return;
  }
}

void Negotiator::sent() noexcept {
  queued_ = false;
  leads_ = true;
  switch (state_) {
    case Negotiating::asking: return join();
    case Negotiating::competing: return byte_done();
    case Negotiating::announcing: return take();
    case Negotiating::settled:
      owes_ = false;
      defended_ = true;
      return schedule_check();
    default: return;  // the last word of a device that lost its node-ID
  }
}

// --- The negotiation ------------------------------------------------------------------------------------------------

void Negotiator::step() noexcept {
  switch (state_) {
    case Negotiating::suspended: return listen();
    case Negotiating::listening:
    case Negotiating::waiting:
    case Negotiating::exhausted: return ask();
    case Negotiating::asked:
      byte_ = 0;
      if (!choose().configured()) return announce();
      state_ = Negotiating::competing;
      return send_byte();
    case Negotiating::asking:
    case Negotiating::competing:
    case Negotiating::announcing:
      // Queued, and still not sent: the bus is busy, all others send the same at the same instant so that none
      // acknowledges, or the controller was restarted and has forgotten it.
      if (queued_) {
        drop();
        return restart_step(rt::Duration(random_.between(0, 2 * patience * frame_time().count())));
      }
      if (state_ == Negotiating::asking) return ask();
      return state_ == Negotiating::competing ? send_byte() : announce();
    default: return;
  }
}

void Negotiator::ask() noexcept {
  state_ = Negotiating::asking;
  used_.reset();
  offer(request_used());
}

// A cycle begins, by the own request or another's.
void Negotiator::join() noexcept {
  ++cycles_;
  candidate_ = NodeId();
  window_ends_ = executor_->now() + owner_->in_world(options_.answers);
  enter(Negotiating::asked, options_.answers + behind());
}

void Negotiator::send_byte() noexcept { offer(identity(options_.address, byte_)); }

void Negotiator::offer(const can::Frame& frame) noexcept {
  if (!put(frame)) return restart_step(again);
  const auto least = patience * frame_time();
  restart_step(least + rt::Duration(random_.between(0, least.count())));
}

// It is on the wire, by this device or another with the same.
void Negotiator::byte_done() noexcept {
  if (++byte_ < identity_bytes) return restart_step(pace() + behind());
  enter(Negotiating::announcing, options_.pause + random(options_.jitter));
}

void Negotiator::announce() noexcept {
  candidate_ = choose();
  if (!candidate_.configured()) {
    enter(Negotiating::exhausted, options_.retry + random(options_.retry));
    return owner_->all_taken();
  }
  offer(used(candidate_));
}

void Negotiator::take() noexcept {
  step_.cancel();
  state_ = Negotiating::settled;
  node_id_ = last_ = std::exchange(candidate_, NodeId());
  avoid_ = NodeId();
  firm_ = owes_ = defended_ = false;
  insisted_ = 0;
  since_ = executor_->now();
  schedule_check();
  owner_->node_id_taken(node_id_);
}

void Negotiator::lose_cycle() noexcept {
  drop();
  wait();
}

void Negotiator::wait() noexcept {
  enter(Negotiating::waiting, options_.quiet + options_.after_pause + random(options_.jitter));
}

NodeId Negotiator::preferred() const noexcept {
  if (last_.configured()) return last_;
  if (options_.configured.configured()) return options_.configured;
  std::uint32_t hash = 2166136261U;  // FNV-1a over the bytes in the order of sending
  for (unsigned i = 0; i < identity_bytes; ++i) hash = (hash ^ identity_byte(options_.address, i)) * 16777619U;
  return NodeId(static_cast<std::uint8_t>(1 + hash % 127));
}

NodeId Negotiator::choose() const noexcept {
  const unsigned first = preferred().value();
  for (unsigned i = 0; i < 127; ++i) {
    const NodeId id(static_cast<std::uint8_t>(1 + (first - 1 + i) % 127));
    const bool avoided = id == avoid_ && executor_->now() < avoided_until_;
    if (!used_.test(id.value()) && !avoided) return id;
  }
  return {};
}

// --- With a node-ID --------------------------------------------------------------------------------------------------

void Negotiator::doubled() noexcept {
  if (state_ == Negotiating::settled && !options_.literal) conflict();
}

void Negotiator::conflict() noexcept {
  if (options_.literal) {
    drop();
    put(used(node_id_));
    if (!firm_) lose_id(IdLoss::literal);
    return;
  }
  if (!firm_ && executor_->now() < since_ + owner_->in_world(options_.probation)) return lose_id(IdLoss::defended);
  executor_->after(owner_->in_world(options_.contest), calm_);
  if (std::exchange(defended_, false)) ++insisted_;
  if (!firm_ && insisted_ > coin_after && (insisted_ > yield_after || random_.below(2) == 0)) {
    return lose_id(IdLoss::contested);
  }
  if (firm_ && insisted_ > yield_after) return;  // it has been said often enough
  if (queued_) return;
  owes_ = true;
  speak_at(random(options_.jitter));
}

void Negotiator::lose_id(IdLoss why) noexcept {
  const auto id = std::exchange(node_id_, NodeId());
  lost_ = why;
  if (why != IdLoss::literal) {
    drop();
    // Its holder's answer may be lost in the next cycle; when the quarrel is over, a holder that is silent is gone.
    avoid_ = id;
    avoided_until_ = executor_->now() + owner_->in_world(options_.contest);
  }
  speak_.cancel();
  calm_.cancel();
  owes_ = defended_ = false;
  insisted_ = 0;
  last_ = id;
  wait();
  owner_->node_id_lost(id, why);
}

void Negotiator::speak() noexcept {
  if (state_ != Negotiating::settled) return;
  if (queued_ && !owner_->nothing_queued()) return executor_->after(owner_->in_world(lost_frame), speak_);
  executor_->after(owner_->in_world(put(used(node_id_)) ? lost_frame : again), speak_);
}

void Negotiator::speak_at(rt::Duration own) noexcept { executor_->after(owner_->in_world(own), speak_); }

void Negotiator::schedule_check() noexcept {
  speak_.cancel();
  if (options_.literal || options_.check <= rt::Duration::zero()) return;
  speak_at(options_.check / 2 + random(options_.check));
}

void Negotiator::calm() noexcept {
  insisted_ = 0;
  defended_ = false;
  if (state_ == Negotiating::settled) owner_->node_id_kept(node_id_);
}

// --- Parts
// ------------------------------------------------------------------------------------------------------------

void Negotiator::enter(Negotiating state, rt::Duration own) noexcept {
  state_ = state;
  restart_step(own);
}

void Negotiator::restart_step(rt::Duration own) noexcept { executor_->after(owner_->in_world(own), step_); }

bool Negotiator::put(const can::Frame& frame) noexcept {
  queued_ = owner_->send(frame);
  if (queued_) ++frames_;
  return queued_;
}

void Negotiator::drop() noexcept {
  if (std::exchange(queued_, false)) owner_->withdraw();
}

rt::Duration Negotiator::frame_time() const noexcept {
  const auto rate = owner_->bit_rate();
  return rt::Duration(longest_frame * std::int64_t{1'000'000'000} / (rate != 0 ? rate : usual_bit_rate));
}

// From the end of one byte to the next one's start: from start to start it is the spacing, never less.
rt::Duration Negotiator::pace() noexcept {
  const auto frame = frame_time();
  auto spacing = std::max(options_.spacing, 2 * frame);
  if (!options_.literal && load() > options_.load_limit) spacing *= 2;
  return spacing - frame * shortest_frame / longest_frame;
}

// Behind the one that leads, so that its byte is heard first and counts for all that have the same.
rt::Duration Negotiator::behind() const noexcept {
  return options_.literal || leads_ ? rt::Duration::zero() : 2 * frame_time();
}

rt::Duration Negotiator::random(rt::Duration most) noexcept {
  return options_.literal ? rt::Duration::zero() : rt::Duration(random_.between(0, most.count()));
}

void Negotiator::roll_load() noexcept {
  const auto now = executor_->now();
  for (unsigned i = 0; i <= buckets && now >= bucket_ends_; ++i) {
    bucket_ = (bucket_ + 1) % buckets;
    bits_[bucket_] = 0;
    bucket_ends_ = i == buckets ? now + bucket : bucket_ends_ + bucket;
  }
}

void Negotiator::count_load(unsigned bits) noexcept {
  roll_load();
  bits_[bucket_] += bits;
}

double Negotiator::load() noexcept {
  roll_load();
  std::uint64_t sum = 0;
  for (const auto bits : bits_) sum += bits;
  const auto rate = owner_->bit_rate();
  const double seconds =
      std::chrono::duration<double>((buckets - 1) * bucket + (bucket - (bucket_ends_ - executor_->now()))).count();
  return static_cast<double>(sum) / (seconds * (rate != 0 ? rate : usual_bit_rate));
}

}  // namespace berth::nodeid
