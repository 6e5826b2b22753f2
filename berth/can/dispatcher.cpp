#include "berth/can/dispatcher.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace berth::can {
namespace {

// The last of the sorted `firsts` that is `key` or less, or the first one if all are greater. It has no branches: the
// processor could not predict them.
inline std::size_t last_from(const std::vector<std::uint32_t>& firsts, std::uint32_t key) noexcept {
  const std::uint32_t* base = firsts.data();
  std::size_t length = firsts.size();
  while (length > 1) {
    const std::size_t half = length / 2;
    base += base[half] <= key ? half : 0;
    length -= half;
  }
  return static_cast<std::size_t>(base - firsts.data());
}

}  // namespace

Handler::~Handler() {
  if (dispatcher_ != nullptr) dispatcher_->remove(*this);
}

// `place` is the link of the list that leads to the confirmation.
inline void Dispatcher::forget(Confirmation*& place) noexcept {
  Confirmation& confirmation = *place;
  place = confirmation.next_;
  confirmation.dispatcher_ = nullptr;
  confirmation.tag_ = 0;
}

Dispatcher::Dispatcher(rt::Executor& executor, Port& port) noexcept : executor_(&executor), port_(&port) {
  entries_.reserve(12);
  firsts_.reserve(12);
  accept_.reserve(12);
  refresh();
}

Dispatcher::~Dispatcher() {
  port_->listen(nullptr, {});
  for (const auto& entry : entries_) entry.handler->dispatcher_ = nullptr;
  while (waiting_ != nullptr) forget(waiting_);
}

void Dispatcher::add(IdRange range, Handler& handler) {
  if (handler.dispatcher_ != nullptr && handler.dispatcher_ != this) handler.dispatcher_->remove(handler);
  handler.dispatcher_ = this;
  const auto at = std::ranges::upper_bound(firsts_, range.first) - firsts_.begin();
  assert(entries_.size() < 0xFFFF);
  const auto order = static_cast<std::uint16_t>(entries_.size());
  entries_.insert(entries_.begin() + at, {&handler, range.last, order, false});
  firsts_.insert(firsts_.begin() + at, range.first);
  refresh();
}

void Dispatcher::remove(Handler& handler) noexcept {
  if (handler.dispatcher_ != this) return;
  handler.dispatcher_ = nullptr;
  for (std::size_t i = entries_.size(); i-- > 0;) {
    if (entries_[i].handler == &handler) erase(i);
  }
  refresh();
}

// Handlers that were added later move up in the order. `heard_` and `end_` move with them: a frame may be on its way
// through the handlers.
void Dispatcher::erase(std::size_t i) noexcept {
  const std::uint32_t gone = entries_[i].order;
  entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(i));
  firsts_.erase(firsts_.begin() + static_cast<std::ptrdiff_t>(i));
  for (auto& e : entries_) {
    if (e.order > gone) --e.order;
  }
  if (heard_ > gone) --heard_;
  if (end_ > gone) --end_;
}

// The port's filter is the sorted, merged list of what the handlers hear.
void Dispatcher::refresh() noexcept {
  widest_ = 0;
  accept_.clear();
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const auto r = range(i);
    const bool overlaps = !accept_.empty() && r.first <= accept_.back().last;
    entries_[i].alone = !overlaps;
    if (i > 0 && r.first <= entries_[i - 1].last) entries_[i - 1].alone = false;
    widest_ = std::max(widest_, r.last - r.first);
    // `- 1` and not `last + 1`: a range may end at the highest number there is.
    if (!accept_.empty() && (r.first == 0 || r.first - 1 <= accept_.back().last)) {
      accept_.back().last = std::max(accept_.back().last, r.last);
    } else {
      accept_.push_back(r);
    }
  }
  port_->listen(this, accept_);
}

// How many ranges begin at `key` or before.
inline std::size_t Dispatcher::after(std::uint32_t key) const noexcept {
  if (firsts_.empty()) return 0;
  const auto last = last_from(firsts_, key);
  return last + (firsts_[last] <= key ? 1 : 0);
}

void Dispatcher::received(const Frame& frame, rt::Time at) noexcept {
  if (firsts_.empty()) [[unlikely]]
    return;
  const auto key = frame.key();
  const auto last = last_from(firsts_, key);
  const Entry& entry = entries_[last];
  if (entry.alone && key <= entry.last) [[likely]] {
    if (key >= firsts_[last]) entry.handler->received(frame, at);
    return;
  }
  received_by_order(frame, at);
}

void Dispatcher::received_by_order(const Frame& frame, rt::Time at) noexcept {
  const auto key = frame.key();
  end_ = static_cast<std::uint32_t>(entries_.size());
  heard_ = 0;
  for (;;) {
    const auto low = key > widest_ ? key - widest_ : 0;
    const Entry* next = nullptr;
    int left = 0;
    for (auto i = after(key); i > 0 && firsts_[i - 1] >= low; --i) {
      const Entry& e = entries_[i - 1];
      if (key > e.last || e.order < heard_ || e.order >= end_) continue;
      ++left;
      if (next == nullptr || e.order < next->order) next = &e;
    }
    if (next == nullptr) return;
    heard_ = next->order + 1;
    next->handler->received(frame, at);
    if (left == 1) return;
  }
}

Queued Dispatcher::send(const Frame& frame, Confirmation& confirmation) noexcept {
  if (confirmation.dispatcher_ != nullptr) [[unlikely]]
    confirmation.dispatcher_->withdraw(confirmation);
  if (++next_tag_ == 0) next_tag_ = 1;
  const auto tag = next_tag_;
  confirmation.dispatcher_ = this;
  confirmation.tag_ = tag;
  confirmation.next_ = std::exchange(waiting_, &confirmation);
  const auto queued = port_->send(frame, tag);
  if (queued != Queued::yes && confirmation.tag_ == tag) [[unlikely]]
    withdraw(confirmation);
  return queued;
}

void Dispatcher::withdraw(Confirmation& confirmation) noexcept {
  if (confirmation.dispatcher_ != this) return;
  port_->withdraw(confirmation.tag_);
  Confirmation** place = &waiting_;
  while (*place != &confirmation) place = &(*place)->next_;
  forget(*place);
}

void Dispatcher::sent(std::uint32_t tag, rt::Time at) noexcept {
  for (Confirmation** place = &waiting_; *place != nullptr; place = &(*place)->next_) {
    Confirmation& confirmation = **place;
    if (confirmation.tag_ != tag) continue;
    forget(*place);
    return confirmation.sent(at);
  }
}

void Dispatcher::changed(const Status& status, rt::Time at) noexcept {
  if (status_handler_ != nullptr) status_handler_->changed(status, at);
}

}  // namespace berth::can
