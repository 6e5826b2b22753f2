#include "berth/mqtt/outbox.hpp"

#include <algorithm>
#include <utility>

namespace berth::mqtt {

void Outbox::add(Letter letter) { waiting_.push_back(std::move(letter)); }

bool Outbox::may_send(std::size_t window) const noexcept {
  return !waiting_.empty() && (waiting_.front().message.qos == Qos::at_most_once || unacknowledged_ < window);
}

Outbox::Sending& Outbox::send() {
  if (waiting_.front().message.qos == Qos::at_least_once) ++unacknowledged_;
  sending_.push_back({std::move(waiting_.front())});
  waiting_.pop_front();
  return sending_.back();
}

void Outbox::done(const Letter& letter) noexcept {
  if (letter.message.qos == Qos::at_least_once) --unacknowledged_;
}

std::optional<Letter> Outbox::out(int packet) {
  const auto it = std::ranges::find(sending_, packet, &Sending::packet);
  if (it == sending_.end()) return std::nullopt;
  Letter letter = std::move(it->letter);
  sending_.erase(it);
  done(letter);
  return letter;
}

Letter Outbox::failed() {
  Letter letter = std::move(sending_.back().letter);
  sending_.pop_back();
  done(letter);
  return letter;
}

std::optional<Letter> Outbox::take_any() {
  std::optional<Letter> letter;
  if (!sending_.empty()) {
    letter = std::move(sending_.front().letter);
    sending_.pop_front();
    done(*letter);
  } else if (!waiting_.empty()) {
    letter = std::move(waiting_.front());
    waiting_.pop_front();
  }
  return letter;
}

}  // namespace berth::mqtt
