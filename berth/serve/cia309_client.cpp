#include "berth/serve/cia309_client.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

using namespace std::chrono_literals;

namespace {

constexpr std::size_t least_command = 32;
/// Class 2 (PDOs without objects of its own), protocol version 3.0, this implementation's version.
constexpr const char* what_it_is = "2 3.0 1.0";

}  // namespace

Conversation::Conversation(House& house, std::function<void(std::string_view)> say, std::function<void()> more)
    : house_(&house), permits_(house), say_(std::move(say)), more_(std::move(more)), scope_(house.session->executor()) {
  unsigned number = 0;
  for (const auto& bus : house.session->machine().buses) {
    ++number;
    if (operate::Network* const network = house.session->network(bus.name)) {
      nets_.push_back(std::make_unique<Net>(*network, number, say_));
      house.pdos.push_back(&nets_.back()->pdos);
    }
  }
  // A command need not name the only net.
  if (house.session->machine().buses.size() == 1 && !nets_.empty()) defaults_.net = 1;
  executor().after(status_period, watch_);
}

Conversation::~Conversation() {
  scope_.cancel();
  for (const auto& net : nets_) net->release();
  for (const auto& net : nets_) std::erase(house_->pdos, &net->pdos);
}

// ---- the queue of requests ----

void RequestQueue::push(Line line) {
  bytes_ += line.request.data.size();
  lines_.push_back(std::move(line));
}

Line RequestQueue::pop() {
  Line line = std::move(lines_.front());
  lines_.pop_front();
  bytes_ -= line.request.data.size();
  return line;
}

bool RequestQueue::full() noexcept {
  const bool now = lines_.size() >= most_lines || bytes_ >= most_bytes;
  full_ = full_ || now;
  return now;
}

bool RequestQueue::has_room_again() noexcept {
  if (!full_ || lines_.size() > most_lines / 2 || bytes_ >= most_bytes) return false;
  full_ = false;
  return true;
}

void Conversation::take(std::string_view line) {
  if (line.size() > command_size_ + 1) return take_too_long(line);  // 1: the CR
  enqueue(parse_line(line));
}

// Only its sequence number is used.
void Conversation::take_too_long(std::string_view beginning) {
  constexpr std::size_t enough = 64;
  Line line = parse_line(beginning.substr(0, enough));
  line.request.verb = Verb::nothing;
  line.error = Code::no_memory;
  enqueue(std::move(line));
}

void Conversation::enqueue(Line line) {
  if (line.request.verb == Verb::nothing && !line.error) return;
  queue_.push(std::move(line));
  if (!busy_ && !next_.ready()) executor().post(next_);
}

void Conversation::next() {
  if (busy_ || queue_.empty()) return;
  Line line = queue_.pop();
  current_ = std::move(line.request);
  busy_ = true;
  const auto wrong = line.error ? line.error : aim(current_);
  if (wrong) {
    outcome_ = Outcome::refused(*wrong);
    executor().post(over_);
  } else if (immediate(current_.verb)) {
    outcome_ = settle(current_);
    executor().post(over_);
  } else {
    if (command_timeout_ > 0ns) executor().after(command_timeout_, out_of_time_);
    scope_.spawn(carry_out());
  }
}

rt::Task<void> Conversation::carry_out() {
  outcome_ = co_await perform(current_);
  executor().post(over_);
}

void Conversation::out_of_time() {
  scope_.cancel();
  over_.cancel();
  outcome_ = Outcome::refused(Code::timeout);
  for (const auto& net : nets_) {
    if (!net->selected) net->release();
  }
  over();
}

void Conversation::over() {
  out_of_time_.cancel();
  busy_ = false;
  if (std::ranges::any_of(nets_, [](const auto& net) { return net->has_turn; }) && is_lss(current_.verb)) {
    executor().after(lss_patience, release_);
  }
  reply(outcome_);
  if (!queue_.empty()) executor().post(next_);
  if (queue_.has_room_again()) more_();
}

void Conversation::reply(const Outcome& outcome) {
  const auto sequence = current_.sequence;
  if (outcome.abort) return say_(abort_line(sequence, *outcome.abort));
  if (outcome.code) return say_(error_line(sequence, *outcome.code));
  say_(outcome.text + reply_line(sequence, outcome.last));
}

void Conversation::release_turns() {
  if (busy_) return static_cast<void>(executor().after(lss_patience, release_));
  for (const auto& net : nets_) net->release();
}

void Conversation::watch() {
  for (const auto& net : nets_) net->look();
  executor().after(status_period, watch_);
}

// ---- the net and node of a request, and its permission ----

// Fills in the default net and node, if the command uses them.
std::optional<Code> Conversation::aim(Request& request) const {
  const Level level = level_of(request.verb);
  if (request.net && *request.net > nets_.size()) return Code::unsupported_net;
  const bool indifferent = request.verb == Verb::set_node || request.verb == Verb::info_version;
  if (level == Level::gateway || indifferent) return std::nullopt;
  if (!request.net) request.net = defaults_.net;
  if (!request.net) return Code::no_default_net;
  if (level == Level::net) return std::nullopt;
  if (!request.node) request.node = defaults_.node;
  if (!request.node) return Code::no_default_node;
  const Net& net = *nets_[*request.net - 1U];
  const bool all = *request.node == 0;
  if (all ? !is_for_all_nodes(request.verb) : NodeId(*request.node) == net.network.bus().master) {
    return Code::unsupported_node;
  }
  return std::nullopt;
}

bool Conversation::immediate(Verb verb) const noexcept {
  using enum Verb;
  switch (verb) {
    case read:
    case write:
    case read_pdo:
    case start:
    case stop:
    case preop:
    case reset_node:
    case reset_comm: return false;
    default: return !is_lss(verb);
  }
}

// ---- requests that are answered at once ----

Outcome Conversation::settle(const Request& request) {
  const std::uint32_t first = request.numbers[0];
  switch (request.verb) {
    case Verb::help: return {help_text(), "OK", {}, {}};
    case Verb::info_version: return Outcome::value(fmt::format("0 0 0.0 0 {}", what_it_is));
    case Verb::set_network:
      if (first > nets_.size()) return Outcome::refused(Code::unsupported_net);
      defaults_.net = static_cast<std::uint16_t>(first);
      return {};
    case Verb::set_node: defaults_.node = static_cast<std::uint8_t>(first); return {};
    case Verb::set_command_timeout: command_timeout_ = first * 1ms; return {};
    case Verb::set_command_size:
      if (first > longest_command) return Outcome::refused(Code::no_memory);
      if (first < least_command) return Outcome::refused(Code::internal_state);
      command_size_ = first;
      return {};
    default: break;
  }
  Net& net = *nets_[*request.net - 1U];
  if (!permits_.allowed(request, net)) return Outcome::refused(Code::internal_state);
  return commands_.settle(request, net);
}

// ---- requests that take time ----

rt::Task<Outcome> Conversation::perform(const Request& request) {
  Net& net = *nets_[*request.net - 1U];
  if (!permits_.allowed(request, net)) co_return Outcome::refused(Code::internal_state);
  if (is_lss(request.verb)) co_return co_await lss_.run(request, net);
  co_return co_await commands_.perform(request, net);
}

}  // namespace berth::serve::cia309
