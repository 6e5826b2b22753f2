#include "trace_order.hpp"

#include <algorithm>

namespace berth::cli {

void RowQueue::add(rt::Duration at, Kind kind) {
  const Held held{at, begun_, text_.size() - begun_, kind};
  begun_ = text_.size();
  const auto place = std::upper_bound(held_.begin() + static_cast<std::ptrdiff_t>(first_), held_.end(), at,
                                      [](rt::Duration wanted, const Held& h) { return wanted < h.at; });
  held_.insert(place, held);
  if (kind == Kind::row) {
    newest_ = std::max(newest_.value_or(at), at);
    if (at < emitted_) ++late_;
  }
  if (held_.size() - first_ > most) emit_first();
}

void RowQueue::release(const std::optional<rt::Duration>& pending) {
  if (!newest_) return release_all();
  const rt::Duration sure = *newest_ - slack_;
  release_until(pending ? std::max(std::min(sure, *pending), *newest_ - patience_) : sure);
}

void RowQueue::release_until(rt::Duration at) {
  while (!empty() && held_[first_].at <= at) emit_first();
  if (!empty()) return;
  held_.clear();
  text_.clear();
  first_ = begun_ = 0;
}

void RowQueue::emit_first() {
  const Held& held = held_[first_++];
  if (held.kind == Kind::row) emitted_ = std::max(emitted_, held.at);
  emit_(std::string_view(text_).substr(held.from, held.size), held.kind);
  if (first_ < most) return;
  // Emitted text is removed, so that memory does not grow while the queue is never empty.
  held_.erase(held_.begin(), held_.begin() + static_cast<std::ptrdiff_t>(first_));
  first_ = 0;
  std::string kept;
  for (Held& each : held_) {
    const std::size_t from = kept.size();
    kept.append(text_, each.from, each.size);
    each.from = from;
  }
  begun_ = kept.size();
  text_ = std::move(kept);
}

}  // namespace berth::cli
