#include "berth/can/dispatcher.hpp"

#include <algorithm>

namespace berth::can {

Handler::~Handler() {
  if (dispatcher_ != nullptr) dispatcher_->remove(*this);
}

Confirmation::~Confirmation() {
  if (dispatcher_ != nullptr) dispatcher_->withdraw(*this);
}

Dispatcher::Dispatcher(rt::Executor& executor, Port& port) noexcept : executor_(&executor), port_(&port) {
  waiting_.reserve(4);
  entries_.reserve(12);
  accept_.reserve(12);
  refresh();
}

Dispatcher::~Dispatcher() {
  port_->listen(nullptr, {});
  for (const auto& entry : entries_) entry.handler->dispatcher_ = nullptr;
  for (auto* confirmation : waiting_) {
    confirmation->dispatcher_ = nullptr;
    confirmation->tag_ = 0;
  }
}

void Dispatcher::add(IdRange range, Handler& handler) {
  if (handler.dispatcher_ != nullptr && handler.dispatcher_ != this) handler.dispatcher_->remove(handler);
  const Entry entry{range, &handler, next_order_++};
  handler.dispatcher_ = this;
  const auto at = std::ranges::upper_bound(entries_, range.first, {}, [](const Entry& e) { return e.range.first; });
  entries_.insert(at, entry);
  refresh();
}

void Dispatcher::remove(Handler& handler) noexcept {
  if (handler.dispatcher_ != this) return;
  handler.dispatcher_ = nullptr;
  std::erase_if(entries_, [&](const Entry& e) { return e.handler == &handler; });
  refresh();
}

// The port's filter is the sorted, merged list of what the handlers hear.
void Dispatcher::refresh() noexcept {
  widest_ = 0;
  accept_.clear();
  for (const auto& e : entries_) {
    widest_ = std::max(widest_, e.range.last - e.range.first);
    // `- 1` and not `last + 1`: a range may end at the highest number there is.
    if (!accept_.empty() && (e.range.first == 0 || e.range.first - 1 <= accept_.back().last)) {
      accept_.back().last = std::max(accept_.back().last, e.range.last);
    } else {
      accept_.push_back(e.range);
    }
  }
  port_->listen(this, accept_);
}

void Dispatcher::received(const Frame& frame, rt::Time at) noexcept {
  const auto key = frame.key();
  const auto end = next_order_;  // what a handler adds now is not called for this frame
  std::uint64_t heard = 0;       // order of the last handler called, plus one
  for (;;) {
    const auto low = key > widest_ ? key - widest_ : 0;
    auto it = std::ranges::lower_bound(entries_, low, {}, [](const Entry& e) { return e.range.first; });
    Entry* next = nullptr;
    int left = 0;
    for (; it != entries_.end() && it->range.first <= key; ++it) {
      if (!it->range.contains(key) || it->order < heard || it->order >= end) continue;
      ++left;
      if (next == nullptr || it->order < next->order) next = &*it;
    }
    if (next == nullptr) return;
    heard = next->order + 1;
    next->handler->received(frame, at);
    if (left == 1) return;
  }
}

Queued Dispatcher::send(const Frame& frame, Confirmation& confirmation) noexcept {
  if (confirmation.dispatcher_ != nullptr) confirmation.dispatcher_->withdraw(confirmation);
  if (++next_tag_ == 0) next_tag_ = 1;
  const auto queued = port_->send(frame, next_tag_);
  if (queued != Queued::yes) return queued;
  confirmation.dispatcher_ = this;
  confirmation.tag_ = next_tag_;
  waiting_.push_back(&confirmation);
  return Queued::yes;
}

void Dispatcher::forget(Confirmation& confirmation) noexcept {
  std::erase(waiting_, &confirmation);
  confirmation.dispatcher_ = nullptr;
  confirmation.tag_ = 0;
}

void Dispatcher::withdraw(Confirmation& confirmation) noexcept {
  if (confirmation.dispatcher_ != this) return;
  port_->withdraw(confirmation.tag_);
  forget(confirmation);
}

void Dispatcher::sent(std::uint32_t tag, rt::Time at) noexcept {
  const auto it = std::ranges::find(waiting_, tag, [](const Confirmation* c) { return c->tag_; });
  if (it == waiting_.end()) return;
  Confirmation& confirmation = **it;
  waiting_.erase(it);
  confirmation.dispatcher_ = nullptr;
  confirmation.tag_ = 0;
  confirmation.sent(at);
}

void Dispatcher::changed(const Status& status, rt::Time at) noexcept {
  if (status_handler_ != nullptr) status_handler_->changed(status, at);
}

}  // namespace berth::can
