#include "berth/co/tpdo.hpp"

#include "berth/co/mpdo.hpp"
#include "berth/co/retry_parts.hpp"

namespace berth::co {
namespace {

// A frame that the port has had for this long counts as lost: a port that was restarted forgets its queue.
constexpr auto lost_after = std::chrono::seconds(1);
constexpr ObjectRef time_stamp{0x1013, 0};

can::Frame empty_frame(std::uint32_t key, unsigned size) noexcept {
  can::Frame frame;
  frame.id = key & ~can::extended_flag;
  frame.extended = (key & can::extended_flag) != 0;
  frame.size = static_cast<std::uint8_t>(size);
  return frame;
}

// 1013h is an ordinary value. A device that transmits it sends the time of sampling.
void stamp(const PdoContext& context) noexcept {
  const auto since = std::chrono::duration_cast<std::chrono::microseconds>(context.now().time_since_epoch()).count();
  context.values->set(time_stamp, static_cast<std::uint32_t>(since));
}

}  // namespace

// --- What it is ------------------------------------------------------------------------------------------------------

void Tpdo::set_up(PdoContext& context, std::uint16_t number, std::span<PdoField> room) noexcept {
  context_ = &context;
  number_ = number;
  mapping_ = PdoMapping(room);
}

void Tpdo::end() noexcept {
  if (pending()) {
    context_->dispatcher->withdraw(*this);
    free_at_ = context_->now();
  }
  active_ = event_ = sampled_ = waiting_ = quick_ = false;
  due_ = rt::never;
}

void Tpdo::configure() noexcept {
  end();
  const PdoRecords records(*context_->values, PdoKind::tpdo, number_);
  const CobId cob = records.cob_id();
  key_ = cob.key();
  answers_ = (cob.raw() & CobId::second_bit) == 0;
  type_ = records.type();
  start_at_ = records.sync_start();
  syncs_ = 0;
  const bool events = event_driven(type_);
  inhibit_ = events ? records.time(pdo_sub::inhibit) : std::uint16_t{0};
  event_time_ = events ? records.time(pdo_sub::timer) : std::uint16_t{0};
  if (!records.usable()) return;
  mode_ = records.mode();
  if (mode_ == PdoMode::mapped) {
    const od::AbortCode code = records.resolve(records.mapped(), mapping_);
    if (code != od::AbortCode::none || mapping_.empty()) return;
    const auto* const stamp = context_->values->description().find(time_stamp);
    stamped_ = stamp != nullptr && mapping_.contains(stamp->offset);
  } else if (records.other_producer()) {
    return;
  }
  active_ = true;
  restart_event_timer();
}

// --- Events ----------------------------------------------------------------------------------------------------------

bool Tpdo::note_event() noexcept {
  if (!active_ || mode_ != PdoMode::mapped) return false;
  if (event_driven(type_)) {
    attempt();
    return true;
  }
  if (type_ != 0) return false;
  event_ = true;
  return true;
}

bool Tpdo::changed(ObjectRef object, std::uint32_t offset) noexcept {
  if (!active_) return false;
  if (mode_ != PdoMode::sam) return mapping_.contains(offset) && event();
  if (context_->sam == nullptr || !context_->sam->put(*context_->values, object)) return false;
  if (!waiting_) send_scanned();
  return true;
}

void Tpdo::attempt() noexcept {
  if (inhibit_ != 0 && !may_go()) return;
  can::Frame frame = empty_frame(key_, mapping_.size());
  if (stamped_) stamp(*context_);
  mapping_.pack(context_->base, frame.data.data());
  const can::Queued queued = submit(frame);
  if (queued != can::Queued::yes) return failed(queued);
  waiting_ = false;
  if (event_time_ != 0) restart_event_timer();
}

// The previous PDO must have left the port, and the inhibit time after it must be over.
bool Tpdo::may_go() noexcept {
  if (free_at_ <= context_->now()) return true;
  waiting_ = true;
  context_->arm(free_at_);
  return false;
}

can::Queued Tpdo::submit(const can::Frame& frame) noexcept {
  if (inhibit_ == 0) return context_->dispatcher->send(frame);
  const can::Queued queued = context_->dispatcher->send(frame, *this);
  if (queued == can::Queued::yes) free_at_ = context_->now() + lost_after;  // until `sent` sets the right time
  return queued;
}

void Tpdo::failed(can::Queued why) noexcept {
  waiting_ = true;
  free_at_ = context_->now() + (why == can::Queued::full ? full_retry : dead_port_retry);
  context_->arm(free_at_);
}

void Tpdo::sent(rt::Time at) noexcept {
  if (inhibit_ != 0) {
    free_at_ = at + context_->owner->in_world(std::chrono::microseconds(100) * inhibit_);
    if (waiting_) context_->arm(free_at_);
    return;
  }
  for (Tpdo& each : std::span(context_->tpdos, context_->tpdo_count)) {  // the port has room again
    if (each.waiting_ && synchronous(each.type_)) return each.send_sample();
  }
}

void Tpdo::run(rt::Time now) noexcept {
  if (waiting_ && free_at_ <= now) {
    if (mode_ == PdoMode::sam) {
      send_scanned();
    } else if (event_driven(type_)) {
      attempt();
    } else {
      send_sample();
    }
  }
  if (due_ > now) return;
  due_ = rt::never;
  event();
}

void Tpdo::restart_event_timer() noexcept {
  // Event-driven, without times and time stamp: each event is one frame.
  quick_ = active_ && mode_ == PdoMode::mapped && event_driven(type_) && inhibit_ == 0 && event_time_ == 0 && !stamped_;
  due_ = rt::never;
  if (event_time_ == 0 || mode_ != PdoMode::mapped) return;
  due_ = context_->now() + context_->owner->in_world(std::chrono::milliseconds(event_time_));
  context_->arm(due_);
}

void Tpdo::set_event_time(std::uint16_t milliseconds) noexcept {
  if (!active_ || !event_driven(type_)) return;
  event_time_ = milliseconds;
  restart_event_timer();
}

// --- MPDO ------------------------------------------------------------------------------------------------------------

can::Queued Tpdo::send_dam(std::uint8_t node, ObjectRef object, std::span<const std::uint8_t> data) noexcept {
  if (!active_ || mode_ != PdoMode::dam) return can::Queued::closed;
  if (inhibit_ != 0 && free_at_ > context_->now()) return can::Queued::full;
  return submit(mpdo::make_dam(key_, node, object, data));
}

void Tpdo::send_scanned() noexcept {
  SamProducer& sam = *context_->sam;
  while (!sam.empty()) {
    if (inhibit_ != 0 && !may_go()) return;
    const ObjectRef object = sam.front();
    const auto frame = mpdo::make_sam(key_, context_->node, object, context_->values->bytes(object));
    const can::Queued queued = submit(frame);
    if (queued != can::Queued::yes) return failed(queued);
    sam.pop();
  }
  waiting_ = false;
}

// --- SYNC ------------------------------------------------------------------------------------------------------------

void Tpdo::sync(std::uint8_t counter) noexcept {
  if (!active_) return;
  if (type_ == rtr_sampled_at_sync) return sample();
  if (!synchronous(type_)) return;
  if (start_at_ != 0 && counter != 0) {
    if (start_at_ != counter) return;
    start_at_ = 0;
  }
  if (type_ == 0) {
    if (!event_) return;
    event_ = false;
  } else {
    if (++syncs_ < type_) return;
    syncs_ = 0;
  }
  sample();
  send_sample();
}

void Tpdo::sample() noexcept {
  if (stamped_) stamp(*context_);
  mapping_.pack(context_->base, data_.data());
  sampled_ = true;
}

// It has a confirmation, so that it can be withdrawn when the window closes.
void Tpdo::send_sample() noexcept {
  can::Frame frame = empty_frame(key_, mapping_.size());
  std::memcpy(frame.data.data(), data_.data(), data_.size());
  const can::Queued queued = context_->dispatcher->send(frame, *this);
  if (queued != can::Queued::yes) return failed(queued);
  waiting_ = false;
}

void Tpdo::close_window() noexcept {
  if (!synchronous(type_)) return;
  waiting_ = false;
  if (pending()) context_->dispatcher->withdraw(*this);
}

void Tpdo::requested(std::uint32_t key) noexcept {
  if (!active_ || !answers_ || key_ != key || mode_ != PdoMode::mapped) return;
  if (event_driven(type_)) {
    attempt();
  } else if (!synchronous(type_)) {
    if (type_ == rtr_only || !sampled_) sample();
    send_sample();
  }
}

}  // namespace berth::co
