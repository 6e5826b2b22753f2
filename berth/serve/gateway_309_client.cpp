#include "berth/serve/gateway_309_client.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/command/permission.hpp"
#include "berth/lss/frames.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/notation.hpp"
#include "berth/serve/gateway_309_net.hpp"

namespace berth::serve {

using namespace std::chrono_literals;

namespace {

constexpr std::size_t least_command = 32;
/// Class 2 (PDOs without objects of its own), protocol version 3.0, this implementation's version.
constexpr const char* what_it_is = "2 3.0 1.0";

bool for_all_nodes(Verb309 verb) noexcept {
  using enum Verb309;
  return verb == start || verb == stop || verb == preop || verb == reset_node || verb == reset_comm;
}

bool is_lss(Verb309 verb) noexcept { return verb >= Verb309::lss_switch_global && verb <= Verb309::lss_allnodes; }

/// Changes a device, or sends what devices act on. LSS questions leave everything as it is.
bool changes(Verb309 verb) noexcept {
  using enum Verb309;
  switch (verb) {
    case lss_inquire_address:
    case lss_get_node:
    case lss_identity:
    case lss_identify_non_configured: return false;
    case write:
    case set_tpdo:
    case write_pdo: return true;
    default: return for_all_nodes(verb) || is_lss(verb);
  }
}

}  // namespace

Conversation309::Conversation309(House309& house, std::function<void(std::string_view)> say, std::function<void()> more)
    : house_(&house), say_(std::move(say)), more_(std::move(more)), scope_(house.session->executor()) {
  unsigned number = 0;
  for (const auto& bus : house.session->machine().buses) {
    ++number;
    if (operate::Network* const network = house.session->network(bus.name)) {
      nets_.push_back(std::make_unique<Net>(*network, number, say_));
      house.pdos.push_back(&nets_.back()->pdos);
    }
  }
  executor().after(status_period, watch_);
}

Conversation309::~Conversation309() {
  scope_.cancel();
  for (const auto& net : nets_) release(*net);
  for (const auto& net : nets_) std::erase(house_->pdos, &net->pdos);
}

// ---- one after the other ----

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

bool Conversation309::full() noexcept {
  const bool now = queue_.size() >= most_lines || queued_bytes_ >= longest_command;
  full_ = full_ || now;
  return now;
}

void Conversation309::enqueue(Line309 line) {
  if (line.request.verb == Verb309::nothing && !line.error) return;
  queued_bytes_ += line.request.data.size();
  queue_.push_back(std::move(line));
  if (!busy_ && !next_.ready()) executor().post(next_);
}

void Conversation309::next() {
  if (busy_ || queue_.empty()) return;
  Line309 line = std::move(queue_.front());
  queue_.pop_front();
  queued_bytes_ -= line.request.data.size();
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

rt::Task<void> Conversation309::carry_out() {
  outcome_ = co_await perform(current_);
  executor().post(over_);
}

void Conversation309::out_of_time() {
  scope_.cancel();
  over_.cancel();
  outcome_ = Outcome::refused(Code309::timeout);
  for (const auto& net : nets_) {
    if (!net->selected) release(*net);
  }
  over();
}

void Conversation309::over() {
  out_of_time_.cancel();
  busy_ = false;
  if (std::ranges::any_of(nets_, [](const auto& net) { return net->has_turn; }) && is_lss(current_.verb)) {
    executor().after(lss_patience, release_);
  }
  reply(outcome_);
  if (!queue_.empty()) executor().post(next_);
  if (full_ && queue_.size() <= most_lines / 2 && queued_bytes_ < longest_command) {
    full_ = false;
    more_();
  }
}

void Conversation309::reply(const Outcome& outcome) {
  const auto sequence = current_.sequence;
  if (outcome.abort) return say_(abort_309(sequence, *outcome.abort));
  if (outcome.code) return say_(error_309(sequence, *outcome.code));
  say_(outcome.text + reply_309(sequence, outcome.last));
}

void Conversation309::watch() {
  for (const auto& net : nets_) net->look();
  executor().after(status_period, watch_);
}

void Conversation309::tell(const std::string& text) const {
  if (house_->tell) house_->tell(text);
}

// ---- what a request is for, and whether it may be ----

// Fills in the defaults. A net or node that does not matter to a command is not asked for.
std::optional<Code309> Conversation309::aim(Request309& request) const {
  const Level309 level = level_309(request.verb);
  if (request.net && *request.net > nets_.size()) return Code309::unsupported_net;
  const bool indifferent = request.verb == Verb309::set_node || request.verb == Verb309::info_version;
  if (level == Level309::gateway || indifferent) return std::nullopt;
  if (!request.net) request.net = net_;
  if (!request.net) return Code309::no_default_net;
  if (level == Level309::net) return std::nullopt;
  if (!request.node) request.node = node_;
  if (!request.node) return Code309::no_default_node;
  const Net& net = *nets_[*request.net - 1U];
  const bool all = *request.node == 0;
  if (all ? !for_all_nodes(request.verb) : NodeId(*request.node) == net.network.bus().master) {
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
    default: return !is_lss(verb);
  }
}

command::Request Conversation309::request_for(const Net& net, std::string verb) const {
  command::Request request;
  request.verb = std::move(verb);
  request.arguments["bus"] = net.network.bus().name;
  return request;
}

bool Conversation309::may_send(const Net& net, bool commands) const {
  const auto use = commands ? command::Use::command : command::Use::send;
  const auto network = command::network_for(*house_->session, net.network.bus().name, use);
  if (!network) tell(network.error());
  return network.has_value();
}

bool Conversation309::allowed(const Request309& request, const Net& net) const {
  const bool refused = house_->session->careful() && !house_->commands && changes(request.verb);
  if (refused) {
    tell(
        fmt::format("bus {}: a client wanted to command devices; on a real bus it may only read and ask. Nothing was "
                    "sent. Allow it with --commands (berth gateway) or --gateway-commands (berth up)",
                    net.network.bus().name));
  }
  return !refused;
}

bool Conversation309::undisturbing(const command::Request& wanted) const {
  command::Request request = wanted;
  if (house_->confirmed) request.arguments["yes"] = "1";
  command::Reply reply;
  const bool goes = command::confirmed(*house_->session, request, reply);
  if (!goes) tell(reply.error);
  return goes;
}

Conversation309::Outcome Conversation309::failed(const Error& error, Net& net) const {
  switch (error.code) {
    case Errc::aborted: return Outcome::aborted(error.detail);
    case Errc::timeout: return Outcome::refused(Code309::timeout);
    case Errc::mismatch:
      return Outcome::aborted(error.detail != 0 ? error.detail : static_cast<std::uint32_t>(od::AbortCode::general));
    case Errc::exhausted: return Outcome::refused(Code309::no_memory);
    case Errc::bus: break;
    default: return Outcome::refused(Code309::internal_state);
  }
  const auto status = net.network.services().dispatcher.port().status();
  if (status.bus_off) return Outcome::refused(Code309::bus_off);
  if (!status.up) return Outcome::refused(Code309::can_init);
  if (status.listen_only) return Outcome::refused(Code309::internal_state);
  if (status.error_passive()) return Outcome::refused(Code309::error_passive);
  return Outcome::refused(Code309::buffer_overflow);
}

// ---- what needs no waiting ----

Conversation309::Outcome Conversation309::settle(const Request309& request) {
  const std::uint32_t first = request.numbers[0];
  switch (request.verb) {
    case Verb309::help: return {help_309(), "OK", {}, {}};
    case Verb309::info_version: return Outcome::value(fmt::format("0 0 0.0 0 {}", what_it_is));
    case Verb309::set_network:
      if (first > nets_.size()) return Outcome::refused(Code309::unsupported_net);
      net_ = static_cast<std::uint16_t>(first);
      return {};
    case Verb309::set_node: node_ = static_cast<std::uint8_t>(first); return {};
    case Verb309::set_command_timeout: command_timeout_ = first * 1ms; return {};
    case Verb309::set_command_size:
      if (first > longest_command) return Outcome::refused(Code309::no_memory);
      if (first < least_command) return Outcome::refused(Code309::internal_state);
      command_size_ = first;
      return {};
    default: return of_net(request, *nets_[*request.net - 1U]);
  }
}

Conversation309::Outcome Conversation309::of_net(const Request309& request, Net& net) {
  if (!allowed(request, net)) return Outcome::refused(Code309::internal_state);
  const std::uint32_t first = request.numbers[0];
  const NodeId node(request.node.value_or(NodeId::unconfigured_value));
  switch (request.verb) {
    case Verb309::set_sdo_timeout: net.sdo_timeout = first * 1ms; return {};
    case Verb309::set_sdo_block: net.sdo_block = first == 1; return {};
    case Verb309::boot_up_indication: net.boot_ups = first == 1; return {};
    case Verb309::sync_indication: net.indicate_sync(first == 1); return {};
    case Verb309::enable_heartbeat: net.heartbeats.supervise(node, first * 1ms); return {};
    case Verb309::disable_heartbeat: net.heartbeats.supervise(node, 0ms); return {};
    case Verb309::disable_guarding: net.guards.end(node); return {};
    case Verb309::enable_guarding:
      if (!may_send(net, false)) return Outcome::refused(Code309::internal_state);
      net.guards.guard(node, first * 1ms, static_cast<std::uint8_t>(request.numbers[1]));
      return {};
    case Verb309::init: return init(net, first);
    // Both are the machine file's; a command may only say what is so.
    case Verb309::set_heartbeat:
      if (first * 1ms != net.network.bus().timing.heartbeat_period) return Outcome::refused(Code309::internal_state);
      return {};
    case Verb309::set_id:
      if (first != net.network.bus().master.value()) return Outcome::refused(Code309::internal_state);
      return {};
    case Verb309::set_rpdo:
    case Verb309::set_tpdo: return set_pdo(request, net);
    case Verb309::write_pdo: return write_pdo(request, net);
    default: return Outcome::refused(Code309::not_supported);
  }
}

// The rate that the bus has: a way out of bus-off. Another: only where nothing is disturbed by it.
Conversation309::Outcome Conversation309::init(Net& net, std::uint32_t index) {
  const auto rate = lss::bit_rate(static_cast<lss::BitRateIndex>(index));
  if (!rate || *rate == 0) return Outcome::refused(Code309::lss_bit_rate);
  if (!may_send(net, false)) return Outcome::refused(Code309::internal_state);
  can::Port& port = net.network.services().dispatcher.port();
  const auto status = port.status();
  const auto now = status.bit_rate != 0 ? status.bit_rate : net.network.bus().bitrate;
  if (*rate == now && !status.bus_off) return {};
  const bool in_use = house_->session->started() || (house_->session->careful() && !house_->confirmed);
  if (*rate != now && in_use) return Outcome::refused(Code309::internal_state);
  return port.restart(*rate) ? Outcome() : Outcome::refused(Code309::can_init);
}

// ---- PDO ----

Conversation309::Outcome Conversation309::set_pdo(const Request309& request, Net& net) {
  if (request.verb == Verb309::set_rpdo) {
    const auto wrong = net.pdos.set_rpdo(request.pdo);
    return wrong ? Outcome::refused(*wrong) : Outcome();
  }
  if (!may_send(net, false)) return Outcome::refused(Code309::internal_state);
  const co::CobId id(request.pdo.cob_id);
  for (const Pdos309* const other : house_->pdos) {
    const bool same_net = other != &net.pdos && &other->dispatcher() == &net.network.services().dispatcher;
    if (id.valid() && same_net && other->sends(id.key())) return Outcome::refused(Code309::pdo_used);
  }
  const auto wrong = net.pdos.set_tpdo(request.pdo);
  return wrong ? Outcome::refused(*wrong) : Outcome();
}

Conversation309::Outcome Conversation309::write_pdo(const Request309& request, Net& net) {
  if (!may_send(net, false)) return Outcome::refused(Code309::internal_state);
  const auto written = net.pdos.write(static_cast<std::uint16_t>(request.numbers[0]), request.values);
  if (written.error) return Outcome::refused(*written.error);
  if (written.queued == can::Queued::yes) return {};
  return failed(Error{.code = Errc::bus}, net);
}

rt::Task<Conversation309::Outcome> Conversation309::read_pdo(std::uint16_t number, Net& net) {
  auto state = net.pdos.rpdo(number);
  if (!state) co_return Outcome::refused(Code309::internal_state);
  if (state->by_request) {
    const auto before = state->receptions;
    if (!may_send(net, false)) co_return Outcome::refused(Code309::internal_state);
    if (net.pdos.ask(number) != can::Queued::yes) co_return failed(Error{.code = Errc::bus}, net);
    const rt::Time end = executor().now() + net.sdo_timeout;
    while (state && state->receptions == before && executor().now() < end) {
      co_await rt::sleep_for(1ms);
      state = net.pdos.rpdo(number);
    }
    if (!state || state->receptions == before) co_return Outcome::refused(Code309::timeout);
  }
  if (state->receptions == 0) co_return Outcome::refused(Code309::internal_state);
  co_return Outcome::value(
      fmt::format("{} pdo {}{}", net.number, state->values.size(), Net::pdo_values(state->values)));
}

// ---- SDO, NMT ----

rt::Task<Conversation309::Outcome> Conversation309::perform(const Request309& request) {
  Net& net = *nets_[*request.net - 1U];
  if (!allowed(request, net)) co_return Outcome::refused(Code309::internal_state);
  switch (request.verb) {
    case Verb309::read: co_return co_await read(request, net);
    case Verb309::write: co_return co_await write(request, net);
    case Verb309::read_pdo: {
      const auto number = static_cast<std::uint16_t>(request.numbers[0]);
      co_return co_await read_pdo(number, net);
    }
    case Verb309::start:
    case Verb309::stop:
    case Verb309::preop:
    case Verb309::reset_node:
    case Verb309::reset_comm: co_return co_await command(request, net);
    default: co_return co_await lss(request, net);
  }
}

namespace {

co::SdoOptions sdo_options(operate::Network& network, rt::Duration timeout, bool block) {
  co::SdoOptions options = network.services().sdo.options();
  options.timeout = timeout;
  options.retries = 0;  // the client's to repeat
  options.mode = block ? co::SdoMode::automatic : co::SdoMode::segmented;
  options.longest = Conversation309::longest_value;
  return options;
}

// No answer: CiA 301's abort code, which the device was told, too.
constexpr std::uint32_t no_answer = 0x0504'0000;

}  // namespace

rt::Task<Conversation309::Outcome> Conversation309::read(const Request309& request, Net& net) {
  if (!may_send(net, false)) co_return Outcome::refused(Code309::internal_state);
  const auto options = sdo_options(net.network, net.sdo_timeout, net.sdo_block);
  const NodeId node(*request.node);
  const auto value = co_await net.network.services().sdo.upload(node, request.index, request.sub, options);
  if (!value && value.error().code == Errc::timeout) co_return Outcome::aborted(no_answer);
  if (!value) co_return failed(value.error(), net);
  const auto text = value_text_309(request.type, value->bytes());
  if (!text) co_return Outcome::aborted(static_cast<std::uint32_t>(od::AbortCode::length_mismatch));
  co_return Outcome::value(*text);
}

rt::Task<Conversation309::Outcome> Conversation309::write(const Request309& request, Net& net) {
  if (!may_send(net, false)) co_return Outcome::refused(Code309::internal_state);
  command::Request command = request_for(net, "sdo write");
  command.arguments["node"] = fmt::format("{}", *request.node);
  command.arguments["object"] = od::write_object({request.index, request.sub});
  if (!undisturbing(command)) co_return Outcome::refused(Code309::internal_state);
  const auto options = sdo_options(net.network, net.sdo_timeout, net.sdo_block);
  const NodeId node(*request.node);
  const auto written =
      co_await net.network.services().sdo.download(node, request.index, request.sub, request.data, options);
  if (!written && written.error().code == Errc::timeout) co_return Outcome::aborted(no_answer);
  if (!written) co_return failed(written.error(), net);
  co_return Outcome();
}

rt::Task<Conversation309::Outcome> Conversation309::command(const Request309& request, Net& net) {
  using co::NmtCommand;
  struct Word {
    Verb309 verb;
    NmtCommand command;
    const char* word;
  };
  static constexpr std::array<Word, 5> words{{{Verb309::start, NmtCommand::start, "start"},
                                              {Verb309::stop, NmtCommand::stop, "stop"},
                                              {Verb309::preop, NmtCommand::enter_pre_operational, "preop"},
                                              {Verb309::reset_node, NmtCommand::reset_node, "reset-node"},
                                              {Verb309::reset_comm, NmtCommand::reset_communication, "reset-comm"}}};
  const Word word = *std::ranges::find(words, request.verb, &Word::verb);
  const bool harmless = word.command == NmtCommand::stop || word.command == NmtCommand::enter_pre_operational;
  if (!may_send(net, !harmless)) co_return Outcome::refused(Code309::internal_state);
  command::Request wanted = request_for(net, "nmt");
  wanted.arguments["command"] = word.word;
  wanted.arguments["node"] = *request.node == 0 ? "all" : fmt::format("{}", *request.node);
  if (!undisturbing(wanted)) co_return Outcome::refused(Code309::internal_state);
  co::NmtTarget target = co::NmtTarget::all();
  if (*request.node != 0) target = co::NmtTarget(NodeId(*request.node));
  const auto sent = co_await net.network.services().nmt.send(word.command, target);
  if (!sent) co_return failed(sent.error(), net);
  net.network.commanded(word.command, target);
  co_return Outcome();
}

}  // namespace berth::serve
