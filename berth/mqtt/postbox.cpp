#include "berth/mqtt/postbox.hpp"

#include <utility>

namespace berth::mqtt {
namespace {

constexpr std::size_t longest_topic = 65'535;  // MQTT 5.0 §1.5.4

// Of MQTT 5.0 §4.7.1 and §4.7.3; that it is UTF-8 is looked at when it is sent.
bool is_topic(std::string_view topic) noexcept {
  constexpr std::string_view wrong("+#\0", 3);
  return !topic.empty() && topic.size() <= longest_topic && topic.find_first_of(wrong) == std::string_view::npos;
}

}  // namespace

const char* name(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::not_connected: return "not-connected";
    case Refusal::no_room: return "no-room";
    case Refusal::too_large: return "too-large";
    case Refusal::wrong_topic: return "wrong-topic";
  }
  return "";
}

Postbox::Postbox(const Limits& limits)
    : most_messages_(limits.outgoing_messages), most_bytes_(limits.outgoing_bytes), posts_(limits.outgoing_messages) {}

// Room is taken first and counted after: of two threads at the limit both may be refused, but never both accepted.
bool Postbox::take_room(std::size_t bytes, Need need) noexcept {
  const std::size_t most = need == Need::must ? most_messages_ : most_messages_ - most_messages_ / 4;
  const std::size_t most_bytes = need == Need::must ? most_bytes_ : most_bytes_ - most_bytes_ / 4;
  const std::size_t messages = waiting_.fetch_add(1, std::memory_order_relaxed) + 1;
  const std::size_t all_bytes = waiting_bytes_.fetch_add(bytes, std::memory_order_relaxed) + bytes;
  if (messages <= most && all_bytes <= most_bytes) return true;
  waiting_.fetch_sub(1, std::memory_order_relaxed);
  waiting_bytes_.fetch_sub(bytes, std::memory_order_relaxed);
  return false;
}

tl::expected<Letter, Refusal> Postbox::accept(Message message) noexcept {
  if (!is_topic(message.topic)) return tl::unexpected(Refusal::wrong_topic);
  const bool open = message.connection != 0 && message.connection == open_.load(std::memory_order_acquire);
  if (!open || asked_to_part()) return tl::unexpected(Refusal::not_connected);
  const std::size_t bytes = message.topic.size() + message.payload.size();
  if (bytes > largest_.load(std::memory_order_relaxed)) return tl::unexpected(Refusal::too_large);
  if (!take_room(bytes, message.need)) {
    (message.need == Need::must ? no_room_must_ : no_room_may_).fetch_add(1, std::memory_order_relaxed);
    return tl::unexpected(Refusal::no_room);
  }
  return Letter{accepted_.fetch_add(1, std::memory_order_relaxed) + 1, bytes, std::move(message)};
}

void Postbox::put(Letter letter) noexcept { static_cast<void>(posts_.put(letter)); }

void Postbox::give_back(const Letter& letter) noexcept {
  waiting_.fetch_sub(1, std::memory_order_relaxed);
  waiting_bytes_.fetch_sub(letter.bytes, std::memory_order_relaxed);
}

void Postbox::open(ConnectionNumber connection, std::size_t largest) noexcept {
  largest_.store(largest, std::memory_order_relaxed);
  open_.store(connection, std::memory_order_release);
}

bool Postbox::ask_to_part(Parting parting) noexcept {
  int none = no_parting;
  return parting_.compare_exchange_strong(none, static_cast<int>(parting), std::memory_order_acq_rel);
}

std::optional<Parting> Postbox::asked_to_part() const noexcept {
  const int parting = parting_.load(std::memory_order_acquire);
  if (parting == no_parting) return std::nullopt;
  return static_cast<Parting>(parting);
}

void Postbox::set_gone() noexcept {
  gone_.store(true, std::memory_order_release);
  gone_.notify_all();
}

Counts Postbox::counts() const noexcept {
  return {.accepted = accepted_.load(std::memory_order_relaxed),
          .no_room_must = no_room_must_.load(std::memory_order_relaxed),
          .no_room_may = no_room_may_.load(std::memory_order_relaxed),
          .incoming_dropped = incoming_dropped_.load(std::memory_order_relaxed),
          .waiting = waiting_.load(std::memory_order_relaxed),
          .waiting_bytes = waiting_bytes_.load(std::memory_order_relaxed)};
}

}  // namespace berth::mqtt
