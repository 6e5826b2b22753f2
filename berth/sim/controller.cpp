#include "berth/sim/controller.hpp"

#include <algorithm>
#include <utility>

#include "berth/can/length.hpp"
#include "berth/sim/bus.hpp"
#include "berth/sim/segment.hpp"
#include "berth/sim/world.hpp"

namespace berth::sim {

Controller::Controller(Bus& bus, int number, const ControllerOptions& options)
    : bus_(&bus),
      bit_rate_(options.bit_rate != 0 ? options.bit_rate : bus.bit_rate()),
      number_(number),
      order_kind_(options.queue),
      powered_(options.powered),
      listen_only_(options.listen_only),
      rx_depth_(std::max(1U, options.rx_depth)),
      rx_service_(options.rx_service),
      slots_(std::max(1U, options.queue_depth)),
      fd_queue_(bus.fd() ? slots_.size() : 0),
      events_(4),
      name_(options.name.empty() ? "node" + std::to_string(number) : options.name) {
  order_.reserve(slots_.size());
  free_.reserve(slots_.size());
  for (auto i = static_cast<std::uint32_t>(slots_.size()); i > 0; --i) free_.push_back(i - 1);
}

Controller::~Controller() {
  listener_ = nullptr;
  bus_->detach(*this);
}

bool Controller::sends_fd(const can::Frame& frame) const noexcept {
  return bus_->fd() && !frame.remote && can::fd_dlc(frame.size).has_value();
}

can::Frame Controller::head_fd_frame() const noexcept {
  can::Frame frame = fd_queue_[head_];
  frame.esi = frame.esi || error_state() == ErrorState::passive;
  return frame;
}

can::Queued Controller::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  const bool fits = (frame.fd ? sends_fd(frame) : frame.size <= 8) &&
                    frame.id <= (frame.extended ? can::extended_mask : can::base_mask);
  if (!powered_ || !fits) return can::Queued::closed;
  if (listen_only_) return can::Queued::listen_only;
  if (bus_off_) return can::Queued::bus_off;
  if (free_.empty()) return can::Queued::full;
  const std::uint32_t at = free_.back();
  free_.pop_back();
  order_.push_back(at);
  Waiting& waiting = slots_[at];
  waiting.frame = can::PackedFrame(frame);
  waiting.arbitration = arbitration_field(frame);
  waiting.tag = tag;
  waiting.tried = false;
  if (frame.fd) [[unlikely]]
    fd_queue_[at] = frame;
  const bool goes_first =
      head_ == nothing || (order_kind_ == TxOrder::priority && !sending_ && waiting.arbitration < head().arbitration);
  if (goes_first) {
    head_ = at;
    segment_->offer(*this);
  }
  return can::Queued::yes;
}

void Controller::withdraw(std::uint32_t tag) noexcept {
  if (tag == 0) return;
  for (auto it = order_.begin(); it != order_.end();) {
    const std::uint32_t at = *it;
    if (slots_[at].tag != tag || (sending_ && at == head_)) {
      if (slots_[at].tag == tag) abandoned_ = true;
      ++it;
      continue;
    }
    it = order_.erase(it);
    free_.push_back(at);
    if (at == head_) {
      choose_head();
      segment_->offer(*this);
    }
  }
}

void Controller::choose_head() noexcept {
  head_ = order_.empty() ? nothing : order_.front();
  if (order_kind_ == TxOrder::in_order) return;
  for (const auto at : order_) {
    if (slots_[at].arbitration < slots_[head_].arbitration) head_ = at;
  }
}

// The frame stays queued, unless it was withdrawn, and may give way to another one.
void Controller::attempt_failed() noexcept {
  sending_ = false;
  if (std::exchange(abandoned_, false)) {
    std::erase(order_, head_);
    free_.push_back(head_);
  }
  choose_head();
}

void Controller::clear_queue() noexcept {
  abandoned_ = false;
  for (const auto at : order_) free_.push_back(at);
  order_.clear();
  head_ = nothing;
}

// The head went out.
void Controller::confirm(rt::Time at) noexcept {
  const std::uint32_t tag = head().tag;
  ++statistics_.sent;
  if (order_.size() == 1) {
    order_.clear();
  } else {
    std::erase(order_, head_);
  }
  free_.push_back(head_);
  sending_ = abandoned_ = false;
  choose_head();
  if (tag != 0 && listener_ != nullptr) push_event(What::sent, at).tag = tag;
}

void Controller::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  if (listener != listener_) forget_events();
  listener_ = listener;
  auto before = std::exchange(accept_, {});
  if (listener != nullptr) accept_.assign(accept.begin(), accept.end());
  std::ranges::sort(accept_, {}, &can::IdRange::first);
  segment_->set_filter(*this, before);
}

can::Status Controller::status() const noexcept {
  can::Status s;
  s.bit_rate = bit_rate_;
  s.tec = tec_;
  s.rec = rec_;
  s.queued = static_cast<std::uint16_t>(order_.size());
  s.errors = static_cast<std::uint32_t>(statistics_.transmit_errors + statistics_.receive_errors);
  s.listen_only = listen_only_;
  s.bus_off = bus_off_;
  s.up = powered_ && cable_;
  s.knows_counters = true;
  s.knows_sent = true;
  s.knows_errors = true;
  return s;
}

const NodeStatistics& Controller::statistics() const noexcept {
  if (heap_at_ != nothing) {
    auto* self = const_cast<Controller*>(this);  // brings a counter up to date that is kept lazily
    self->statistics_.arbitration_losses += segment_->starts() - contends_since_;
    self->contends_since_ = segment_->starts();
  }
  return statistics_;
}

// What the host is told. One call per job; the host needs `rx_service_` for each received frame.

Controller::Event& Controller::push_event(What what, rt::Time at) noexcept {
  if (event_count_ == events_.size()) {
    std::vector<Event> larger(events_.size() * 2);
    for (std::size_t i = 0; i < event_count_; ++i) larger[i] = events_[(first_event_ + i) & (events_.size() - 1)];
    events_.swap(larger);
    first_event_ = 0;
  }
  Event& event = events_[(first_event_ + event_count_) & (events_.size() - 1)];
  event.what = what;
  event.at = at;
  if (event_count_++ == 0) schedule_host();
  return event;
}

void Controller::schedule_host() noexcept {
  if (event_count_ == 0) return;
  if (rx_service_.count() == 0 || events_[first_event_].what != What::received) {
    bus_->executor().post(*this);
  } else {
    bus_->executor().after(rx_service_, *this);
  }
}

void Controller::deliver(const can::Frame& frame, rt::Time at) noexcept {
  if (deaf_ || rx_waiting_ >= rx_depth_) {
    ++statistics_.overruns;
    return;
  }
  ++statistics_.received;
  ++rx_waiting_;
  push_event(What::received, at).frame = can::PackedFrame(frame);
  if (frame.fd) [[unlikely]]
    keep_fd(frame);
}

void Controller::keep_fd(const can::Frame& frame) { fd_received_.push_back(frame); }

void Controller::receive_fd(rt::Time at) noexcept {
  const can::Frame frame = fd_received_.front();
  fd_received_.pop_front();
  listener_->received(frame, at);
}

void Controller::announce() noexcept {
  if (listener_ != nullptr) push_event(What::changed, bus_->executor().now());
}

void Controller::forget_events() noexcept {
  cancel();
  event_count_ = first_event_ = rx_waiting_ = 0;
  fd_received_.clear();
}

void Controller::run() noexcept {
  const Event& event = events_[first_event_];
  const What what = event.what;
  const rt::Time at = event.at;
  const std::uint32_t tag = event.tag;
  // The callback may push events, or destroy this controller.
  const can::Frame frame = event.frame.unpacked();
  if (what == What::received) --rx_waiting_;
  first_event_ = (first_event_ + 1) & (events_.size() - 1);
  --event_count_;
  schedule_host();
  if (what == What::received) {
    if (frame.fd) [[unlikely]]
      return receive_fd(at);
    listener_->received(frame, at);
  } else if (what == What::sent) {
    listener_->sent(tag, at);
  } else {
    listener_->changed(status(), at);
  }
}

// What happens to the node.

void Controller::set_counters(std::uint16_t tec, std::uint16_t rec) noexcept {
  const bool was_clean = (tec_ | rec_) == 0;
  tec_ = tec;
  rec_ = rec;
  const bool is_clean = (tec_ | rec_) == 0;
  if (was_clean != is_clean) segment_->counters_changed(was_clean, is_clean);
}

void Controller::tell_if_changed() noexcept {
  const auto most = std::max(tec_, rec_);
  const std::uint8_t level = bus_off_ ? 3 : most > 127 ? 2 : most >= 96 ? 1 : 0;
  if (level == told_) return;
  told_ = level;
  announce();
}

void Controller::preset_counters(std::uint16_t tec, std::uint16_t rec) noexcept {
  set_counters(std::min<std::uint16_t>(tec, 255), std::min<std::uint16_t>(rec, 255));
  segment_->counters_preset(*this);
  tell_if_changed();
}

bool Controller::restart(std::uint32_t bit_rate) noexcept {
  if (!powered_ || bit_rate == 0) return false;
  segment_->disturb(*this);
  clear_queue();
  const bool was_off = bus_off_;
  set_counters(0, 0);
  told_ = was_off ? 3 : 0;
  bit_rate_ = bit_rate;
  segment_->integrate(*this, was_off ? 128 : 1);
  return true;
}

void Controller::power(bool on) noexcept {
  if (on == powered_) return;
  segment_->disturb(*this);
  clear_queue();
  forget_events();
  set_counters(0, 0);
  bus_off_ = false;
  told_ = 0;
  powered_ = on;
  segment_->integrate(*this, on ? 1 : 0);
  announce();
}

void Controller::set_bit_rate(std::uint32_t bit_rate) noexcept {
  if (bit_rate == 0 || bit_rate == bit_rate_) return;
  segment_->disturb(*this);
  bit_rate_ = bit_rate;
  if (bus_off_) {
    segment_->refresh();
  } else {
    segment_->integrate(*this, powered_ ? 1 : 0);
  }
  announce();
}

void Controller::listen_only(bool on) noexcept {
  if (on == listen_only_) return;
  segment_->disturb(*this);
  listen_only_ = on;
  if (on) clear_queue();
  if (bus_off_) {
    segment_->refresh();
  } else {
    segment_->integrate(*this, powered_ ? 1 : 0);
  }
  announce();
}

void Controller::silent(bool on) noexcept {
  silent_ = on;
  if (!sending_) segment_->offer(*this);
}

void Controller::cable(bool in) noexcept {
  if (in == cable_) return;
  cable_ = in;
  bus_->move(*this, in);
  announce();
}

}  // namespace berth::sim
