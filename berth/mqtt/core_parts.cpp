#include "berth/mqtt/core_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/mqtt/login.hpp"

namespace berth::mqtt {
namespace {

constexpr std::size_t largest_packet = 268'435'455;  // MQTT 5.0 §1.5.5
constexpr std::size_t packet_head = 16;              // of a PUBLISH: what is neither topic nor payload
constexpr std::size_t early_packets = 4;             // of the largest size

Milliseconds since(Time begin, Time now) noexcept { return std::chrono::duration_cast<Milliseconds>(now - begin); }

std::string seconds(Milliseconds time) { return fmt::format("{:g} s", static_cast<double>(time.count()) / 1000); }

// All clients look at their keep-alive in one wake of the thread.
Time next_second(Time now) noexcept { return std::chrono::floor<std::chrono::seconds>(now) + std::chrono::seconds(1); }

}  // namespace

Core::Core(Hub& hub, Options options, Random random, Handler& handler)
    : hub_(&hub),
      options_(std::move(options)),
      handler_(&handler),
      postbox_(options_.limits),
      attempts_(options_, random),
      early_(options_.limits.incoming * early_packets) {}

void Core::enter(State state, Time until) noexcept {
  state_ = state;
  times_.until = until;
}

Stage Core::stage() const noexcept {
  if (state_ == State::connected || state_ == State::parting) return Stage::connected;
  return connection_ && connection_->has_asked() ? Stage::asked : Stage::before_broker;
}

void Core::ready(Time now) noexcept {
  if (const auto cause = connection_->ready()) {
    over(*cause, now);
  } else {
    proceed(now);
  }
  send(now);
  settle();
}

void Core::work(Time now) noexcept {
  if (postbox_.asked_to_part()) begin_to_part(now);
  take_posts();
  if (state_ != State::ended && now >= times_.until) time_over(now);
  if (state_ == State::looking_up) look_up(now);
  if (state_ == State::connected && now >= times_.tick) {
    times_.tick = next_second(now);
    if (const auto cause = connection_->tick()) over(*cause, now);
  }
  send(now);
  settle();
}

void Core::take_posts() noexcept {
  while (auto letter = postbox_.take()) {
    if (state_ == State::connected && letter->message.connection == number_) {
      outbox_.add(std::move(*letter));
    } else {
      hand_back(*letter, "the connection that it was for is over");
    }
  }
}

void Core::begin_to_part(Time now) noexcept {
  if (state_ == State::ended || state_ == State::parting) return;
  if (state_ != State::connected) {
    over({Why::ended, "this client was ended before it was connected"}, now);
  } else if (times_.until == Time::max()) {
    postbox_.open(0, 0);
    times_.until = now + options_.farewell;
  }
}

void Core::time_over(Time now) noexcept {
  const std::string patience = seconds(options_.answer_within);
  switch (state_) {
    case State::pausing: enter(State::looking_up, now + options_.answer_within); break;
    case State::looking_up:
      over({Why::name_not_found, fmt::format("no name server answered within {}: look at the network", patience)}, now);
      break;
    case State::connecting:
    case State::subscribing:
      over(connection_->has_reached()
               ? Cause{Why::no_answer, fmt::format("the broker accepted the connection and did not answer within {}: "
                                                   "look whether it hangs, and whether this is its port",
                                                   patience)}
               : Cause{Why::no_answer,
                       fmt::format("the host did not answer within {}: look whether it runs, and at firewalls",
                                   patience)},
           now);
      break;
    case State::connected:
      over({Why::ended,
            fmt::format("the broker did not take within {} what was to be sent", seconds(options_.farewell))},
           now);
      break;
    case State::parting: over({Why::ended, "the broker did not close the connection"}, now); break;
    case State::ended: break;
  }
}

void Core::look_up(Time now) noexcept {
  const auto answer = hub_->names().ask(options_.where.host, now);
  if (!answer) {
    hub_->await_name();
    return;
  }
  if (!*answer) {
    over(of_lookup(options_.where.host, answer->error()), now);
  } else if (const auto cause = connect(**answer)) {
    over(*cause, now);
  }
}

std::optional<Cause> Core::connect(const std::vector<std::string>& addresses) noexcept {
  std::shared_ptr<Tls> tls;
  if (options_.where.tls) {
    auto loaded = hub_->tls().get(options_.tls, options_.where.host);
    if (!loaded) return Cause{Why::own_computer, loaded.error()};
    tls = std::move(*loaded);
  }
  auto opened = Connection::open(options_, attempts_.version(), attempts_.address(addresses), std::move(tls), *this);
  if (!opened) return opened.error();
  connection_ = std::move(*opened);
  watched_ = connection_->events();
  if (!hub_->watch(*this, connection_->descriptor(), watched_)) return of_system_error(ENOMEM);
  enter(State::connecting, times_.until);
  return std::nullopt;
}

std::optional<Cause> Core::ask() noexcept {
  const auto login = options_.login_file.empty() ? Login() : read_login(options_.login_file);
  if (!login) return Cause{Why::own_computer, login.error()};
  return connection_->ask(options_, handler_->connecting(), *login, hub_->dock());
}

void Core::proceed(Time now) noexcept {
  std::optional<Cause> cause;
  if (state_ == State::connecting && connection_->is_open() && !connection_->has_asked()) cause = ask();
  if (state_ == State::connecting && answers_.granted && !options_.subscriptions.empty()) {
    enter(State::subscribing, times_.until);
    cause = connection_->subscribe(options_.subscriptions, options_.subscription_qos);
  }
  if (cause) return over(*cause, now);
  const bool all_answered = answers_.granted && (options_.subscriptions.empty() || answers_.subscriptions);
  if (all_answered && state_ != State::connected && state_ != State::parting) tell_connected(now);
}

void Core::tell_connected(Time now) noexcept {
  Connected told{
      .connection = ++number_, .session_present = answers_.granted->session_present, .version = attempts_.version()};
  const auto codes = answers_.subscriptions.value_or(std::vector<int>());
  for (std::size_t i = 0; i < std::min(codes.size(), options_.subscriptions.size()); ++i) {
    const auto code = static_cast<unsigned>(codes[i]);
    if (code >= 128) told.refused.push_back({options_.subscriptions[i], of_reason_code(code).words});
  }
  const std::size_t packet = answers_.granted->largest_packet;
  const std::size_t largest = packet == 0 ? largest_packet : std::max(packet, packet_head);
  enter(State::connected, Time::max());
  times_.connected = now;
  times_.tick = next_second(now);
  postbox_.open(number_, largest - packet_head);
  handler_->connected(told);
  early_.tell(*handler_);
}

void Core::send(Time now) noexcept {
  if (!connection_) return;
  const std::size_t window =
      answers_.granted ? std::min<std::size_t>(options_.limits.unacknowledged, answers_.granted->unacknowledged) : 0;
  while (state_ == State::connected && outbox_.may_send(window) && !connection_->is_writing()) {
    auto& sending = outbox_.send();
    if (const auto sent = connection_->publish(sending.letter.message, sending.packet); !sent)
      hand_back(outbox_.failed(), sent.error());
    if (const auto cause = connection_->say()) return over(*cause, now);
  }
  const auto parting = postbox_.asked_to_part();
  if (parting && state_ == State::connected && times_.until != Time::max() && outbox_.is_empty() &&
      !connection_->is_writing()) {
    enter(State::parting, times_.until);
    connection_->disconnect(*parting);
  }
  if (const auto cause = connection_->say()) over(*cause, now);
}

// Before the thread waits again: for what, and until when.
void Core::settle() noexcept {
  if (connection_) {
    const std::uint32_t events = connection_->events();
    if (events != watched_) hub_->change(*this, connection_->descriptor(), events);
    watched_ = events;
  }
  times_.due = state_ == State::ended ? Time::max() : times_.until;
  if (state_ == State::connected) times_.due = std::min(times_.due, times_.tick);
  hub_->due(times_.due);
}

void Core::over(const Cause& cause, Time now) noexcept {
  const Stage reached = stage();
  postbox_.open(0, 0);
  if (connection_) hub_->forget(connection_->descriptor());
  connection_.reset();
  answers_ = {};
  early_.clear();
  while (const auto letter = outbox_.take_any()) hand_back(*letter, cause.words);
  while (const auto letter = postbox_.take()) hand_back(*letter, cause.words);
  Disconnected told{.why = cause.why,
                    .words = fmt::format("{}: {}", to_string(options_.where), cause.words),
                    .was_connected = reached == Stage::connected};
  if (postbox_.asked_to_part()) {
    told.why = Why::ended;
    enter(State::ended, Time::max());
  } else {
    const auto lasted = reached == Stage::connected ? since(times_.connected, now) : Milliseconds(0);
    told.retry_in = attempts_.after(cause, reached, lasted);
    enter(State::pausing, now + *told.retry_in);
  }
  handler_->disconnected(told);
  if (state_ == State::ended) postbox_.set_ended();
}

void Core::hand_back(const Letter& letter, std::string_view why) noexcept {
  postbox_.give_back(letter);
  handler_->unpublished(letter.id, why);
}

void Core::subscribed(std::span<const int> codes) noexcept {
  answers_.subscriptions.emplace(codes.begin(), codes.end());
}

void Core::message(std::string_view topic, std::span<const std::uint8_t> payload, bool retained) noexcept {
  if (state_ == State::connected) {
    handler_->message(topic, payload, retained);
  } else if (state_ != State::parting && !early_.keep(topic, payload, retained)) {
    postbox_.dropped_incoming();
  }
}

void Core::out(int packet, unsigned code) noexcept {
  const auto letter = outbox_.out(packet);
  if (!letter) return;
  if (code >= 128) return hand_back(*letter, of_reason_code(code).words);
  postbox_.give_back(*letter);
  handler_->published(letter->id);
}

}  // namespace berth::mqtt
