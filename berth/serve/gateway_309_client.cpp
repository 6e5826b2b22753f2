#include "berth/serve/gateway_309_client.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/serve/gateway_309_net.hpp"

namespace berth::serve {

using namespace std::chrono_literals;

namespace {

constexpr std::size_t least_command = 32;
/// Class 2 (PDOs without objects of its own), protocol version 3.0, this implementation's version.
constexpr const char* what_it_is = "2 3.0 1.0";

}  // namespace

Conversation309::Conversation309(House309& house, std::function<void(std::string_view)> say, std::function<void()> more)
    : house_(&house), permits_(house), say_(std::move(say)), more_(std::move(more)), scope_(house.session->executor()) {
  unsigned number = 0;
  for (const auto& bus : house.session->machine().buses) {
    ++number;
    if (operate::Network* const network = house.session->network(bus.name)) {
      nets_.push_back(std::make_unique<Net309>(*network, number, say_));
      house.pdos.push_back(&nets_.back()->pdos);
    }
  }
  executor().after(status_period, watch_);
}

Conversation309::~Conversation309() {
  scope_.cancel();
  for (const auto& net : nets_) net->release();
  for (const auto& net : nets_) std::erase(house_->pdos, &net->pdos);
}

// ---- one after the other ----

void RequestQueue309::push(Line309 line) {
  bytes_ += line.request.data.size();
  lines_.push_back(std::move(line));
}

Line309 RequestQueue309::pop() {
  Line309 line = std::move(lines_.front());
  lines_.pop_front();
  bytes_ -= line.request.data.size();
  return line;
}

bool RequestQueue309::full() noexcept {
  const bool now = lines_.size() >= most_lines || bytes_ >= most_bytes;
  full_ = full_ || now;
  return now;
}

bool RequestQueue309::has_room_again() noexcept {
  if (!full_ || lines_.size() > most_lines / 2 || bytes_ >= most_bytes) return false;
  full_ = false;
  return true;
}

void Conversation309::take(std::string_view line) {
  if (line.size() > command_size_ + 1) return take_too_long(line);  // its CR
  enqueue(parse_309(line));
}

// Its sequence number is all that counts of it.
void Conversation309::take_too_long(std::string_view beginning) {
  constexpr std::size_t enough = 64;
  Line309 line = parse_309(beginning.substr(0, enough));
  line.request.verb = Verb309::nothing;
  line.error = Code309::no_memory;
  enqueue(std::move(line));
}

void Conversation309::enqueue(Line309 line) {
  if (line.request.verb == Verb309::nothing && !line.error) return;
  queue_.push(std::move(line));
  if (!busy_ && !next_.ready()) executor().post(next_);
}

void Conversation309::next() {
  if (busy_ || queue_.empty()) return;
  Line309 line = queue_.pop();
  current_ = std::move(line.request);
  busy_ = true;
  const auto wrong = line.error ? line.error : aim(current_);
  if (wrong) {
    outcome_ = Outcome309::refused(*wrong);
    executor().post(over_);
  } else if (immediate(current_.verb)) {
    outcome_ = settle(current_);
    executor().post(over_);
  } else {
    if (command_timeout_ > 0ns) executor().after(command_timeout_, out_of_time_);
    scope_.spawn(carry_out());
  }
}

rt::Task<void> Conversation309::carry_out() {
  outcome_ = co_await perform(current_);
  executor().post(over_);
}

void Conversation309::out_of_time() {
  scope_.cancel();
  over_.cancel();
  outcome_ = Outcome309::refused(Code309::timeout);
  for (const auto& net : nets_) {
    if (!net->selected) net->release();
  }
  over();
}

void Conversation309::over() {
  out_of_time_.cancel();
  busy_ = false;
  if (std::ranges::any_of(nets_, [](const auto& net) { return net->has_turn; }) && is_lss_309(current_.verb)) {
    executor().after(lss_patience, release_);
  }
  reply(outcome_);
  if (!queue_.empty()) executor().post(next_);
  if (queue_.has_room_again()) more_();
}

void Conversation309::reply(const Outcome309& outcome) {
  const auto sequence = current_.sequence;
  if (outcome.abort) return say_(abort_309(sequence, *outcome.abort));
  if (outcome.code) return say_(error_309(sequence, *outcome.code));
  say_(outcome.text + reply_309(sequence, outcome.last));
}

void Conversation309::release_turns() {
  if (busy_) return static_cast<void>(executor().after(lss_patience, release_));
  for (const auto& net : nets_) net->release();
}

void Conversation309::watch() {
  for (const auto& net : nets_) net->look();
  executor().after(status_period, watch_);
}

// ---- what a request is for, and whether it may be ----

// Fills in the defaults. A net or node that does not matter to a command is not asked for.
std::optional<Code309> Conversation309::aim(Request309& request) const {
  const Level309 level = level_309(request.verb);
  if (request.net && *request.net > nets_.size()) return Code309::unsupported_net;
  const bool indifferent = request.verb == Verb309::set_node || request.verb == Verb309::info_version;
  if (level == Level309::gateway || indifferent) return std::nullopt;
  if (!request.net) request.net = defaults_.net;
  if (!request.net) return Code309::no_default_net;
  if (level == Level309::net) return std::nullopt;
  if (!request.node) request.node = defaults_.node;
  if (!request.node) return Code309::no_default_node;
  const Net309& net = *nets_[*request.net - 1U];
  const bool all = *request.node == 0;
  if (all ? !for_all_nodes_309(request.verb) : NodeId(*request.node) == net.network.bus().master) {
    return Code309::unsupported_node;
  }
  return std::nullopt;
}

bool Conversation309::immediate(Verb309 verb) const noexcept {
  using enum Verb309;
  switch (verb) {
    case read:
    case write:
    case read_pdo:
    case start:
    case stop:
    case preop:
    case reset_node:
    case reset_comm: return false;
    default: return !is_lss_309(verb);
  }
}

// ---- what needs no waiting ----

Outcome309 Conversation309::settle(const Request309& request) {
  const std::uint32_t first = request.numbers[0];
  switch (request.verb) {
    case Verb309::help: return {help_309(), "OK", {}, {}};
    case Verb309::info_version: return Outcome309::value(fmt::format("0 0 0.0 0 {}", what_it_is));
    case Verb309::set_network:
      if (first > nets_.size()) return Outcome309::refused(Code309::unsupported_net);
      defaults_.net = static_cast<std::uint16_t>(first);
      return {};
    case Verb309::set_node: defaults_.node = static_cast<std::uint8_t>(first); return {};
    case Verb309::set_command_timeout: command_timeout_ = first * 1ms; return {};
    case Verb309::set_command_size:
      if (first > longest_command) return Outcome309::refused(Code309::no_memory);
      if (first < least_command) return Outcome309::refused(Code309::internal_state);
      command_size_ = first;
      return {};
    default: break;
  }
  Net309& net = *nets_[*request.net - 1U];
  if (!permits_.allowed(request, net)) return Outcome309::refused(Code309::internal_state);
  return commands_.settle(request, net);
}

// ---- what takes its time ----

rt::Task<Outcome309> Conversation309::perform(const Request309& request) {
  Net309& net = *nets_[*request.net - 1U];
  if (!permits_.allowed(request, net)) co_return Outcome309::refused(Code309::internal_state);
  if (is_lss_309(request.verb)) co_return co_await lss_.run(request, net);
  co_return co_await commands_.perform(request, net);
}

}  // namespace berth::serve
