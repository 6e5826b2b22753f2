#include "berth/operate/network_bitrate.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/lss/select_alone.hpp"
#include "berth/operate/master_device.hpp"

namespace berth::operate {
namespace {

using namespace std::chrono_literals;
using Node = BitRateReport::Node;
using End = BitRateReport::End;

constexpr rt::Duration settle = 50ms;
constexpr std::int64_t crowd = 100;  // frames of other nodes that a request waits for at most, at 135 bits

/// One move. Lives in the coroutine's frame.
class Move {
 public:
  Move(Network& network, const BitRateOptions& options, BitRateReport& report)
      : network_(network), options_(options), report_(report), usual_(network.services().lss.options()) {}
  ~Move() { network_.services().lss.set_options(usual_); }
  Move(const Move&) = delete;
  Move& operator=(const Move&) = delete;

  rt::Task<void> who_is_there();
  rt::Task<void> check();
  rt::Task<void> carry_out();

 private:
  void allow();
  [[nodiscard]] bool late() const noexcept { return network_.services().executor.now() >= until_; }
  rt::Task<void> state_of(Node& node);
  rt::Task<bool> alone(Node& node);
  rt::Task<bool> answers(Node& node);
  rt::Task<bool> all_waiting();
  rt::Task<bool> prepare(Node& node, std::uint32_t rate);
  rt::Task<bool> prepare_all(std::uint32_t rate);
  rt::Task<bool> together(std::uint32_t rate);
  rt::Task<bool> select(Node& node);
  rt::Task<void> revive();
  rt::Task<bool> hear_all();
  rt::Task<bool> store_all();
  rt::Task<void> prepare_back();
  rt::Task<void> bring_back();

  Network& network_;
  const BitRateOptions& options_;
  BitRateReport& report_;
  lss::MasterOptions usual_;
  rt::Time until_{};  // of the step under way
};

std::string refusal(const Error& error, const char* code1) {
  if (error.code == Errc::timeout) return "it does not answer";
  if (error.code != Errc::aborted) return describe(error);
  return (error.detail & 0xFFU) == 1 ? code1 : fmt::format("it refuses with error code {}", error.detail & 0xFFU);
}

// Only a pre-operational node is moved: an operational one is at work, and a stopped one answers no SDO and cannot be
// identified.
std::optional<std::string> wrong_state(NmtState state) {
  constexpr const char* advice = "make it pre-operational first (`berth nmt preop`)";
  if (state == NmtState::operational) return fmt::format("it is operational: {}", advice);
  if (state == NmtState::stopped) return fmt::format("it is stopped and answers no SDO: {}", advice);
  return std::nullopt;
}

// A step begins: sets its time limit, and the timeout for sending a request. On a jammed bus, every second spent on one
// request delays the restart of the port.
void Move::allow() {
  const auto& timing = network_.bus().timing;
  const auto nodes = static_cast<std::int64_t>(report_.nodes.size());
  until_ = network_.services().executor.now() + timing.boot_timeout + nodes * timing.tries * timing.lss_timeout;
  const auto rate = std::max<std::int64_t>(1, network_.services().dispatcher.port().status().bit_rate);
  const rt::Duration others = crowd * 135 * rt::Duration(1s) / rate;
  lss::MasterOptions options = usual_;
  options.send_timeout = std::min(usual_.send_timeout, timing.lss_timeout + others);
  network_.services().lss.set_options(options);
}

rt::Task<void> Move::who_is_there() {
  const auto seen = co_await network_.scan(ScanRange::all);
  if (!seen) {
    report_.reason = "the bus could not be scanned: " + describe(seen.error());
    co_return;
  }
  for (const auto& s : *seen) {
    Node node;
    node.id = s.id;
    const bool whole = s.device && s.device->unknown == 0;
    if (whole) node.device = s.device->address;
    if (s.duplicate) node.problem = "two devices answer here: they cannot be distinguished";
    if (!whole) node.problem = "it does not report its LSS address (1018h)";
    if (s.state) node.problem = wrong_state(*s.state).value_or(node.problem);
    report_.nodes.push_back(node);
  }
  if (report_.nodes.empty()) report_.reason = "no device is there";
}

// The state of a node without heartbeat is read by guarding.
rt::Task<void> Move::state_of(Node& node) {
  if (!node.id.configured() || !node.problem.empty()) co_return;
  const auto heard = network_.services().boots.heard(node.id);
  const auto silence = network_.bus().timing.heartbeat_timeout;
  const bool lately = heard && network_.services().executor.now() - *heard < silence;
  NmtState state = network_.services().boots.state(node.id);
  if (!lately || state == NmtState::initialising) {
    const auto window = network_.bus().timing.guard_timeout;
    const auto asked = co_await co::guard_once(network_.services().dispatcher, node.id, window, 2);
    if (!asked) {
      node.problem = "it does not report whether it is operational: neither heartbeat nor guarding";
      co_return;
    }
    state = asked->state;
  }
  node.problem = wrong_state(state).value_or("");
}

// All nodes hear the bus, and none is selected. A stray device may drive the port to bus-off until it is passive
// itself. The port is only restarted from bus-off: otherwise the stray device's counters would never let it become
// passive.
rt::Task<bool> Move::all_waiting() {
  can::Port& port = network_.services().dispatcher.port();
  while (!late()) {
    const auto told = co_await network_.services().lss.switch_global(lss::State::waiting);
    if (told) co_return true;
    const auto status = port.status();
    if (status.bus_off && !port.restart(status.bit_rate)) co_return false;
    co_await rt::sleep_for(settle);
  }
  co_return false;
}

// The only device in configuration state.
rt::Task<bool> Move::alone(Node& node) {
  const auto quiet = co_await all_waiting();
  if (!quiet) {
    node.problem = "no request gets onto the bus";
    co_return false;
  }
  const LssAddress device = *node.device;
  const auto selected = co_await network_.services().lss.switch_selective(device);
  if (selected) co_return true;
  node.problem = "it does not speak LSS: " + refusal(selected.error(), "refused");
  co_return false;
}

rt::Task<bool> Move::answers(Node& node) {
  const auto selected = co_await alone(node);
  if (!selected) co_return false;
  lss::Master& lss = network_.services().lss;
  const LssAddress device = *node.device;
  const lss::ServiceOptions service = lss.options().service;
  const auto id = co_await lss::ask_node_id(lss, device, service);
  if (!id) {
    node.problem = "it does not speak LSS: " + refusal(id.error(), "refused");
    co_return false;
  }
  // It reported its address under this node-ID by SDO.
  if (!*id) co_return true;
  if ((*id)->differ) {
    node.problem = "two devices have its LSS address";
    co_return false;
  }
  if ((*id)->byte() == node.id.value()) co_return true;
  node.problem = fmt::format("by LSS its node-ID is {}", (*id)->byte());
  co_return false;
}

rt::Task<void> Move::check() {
  allow();
  for (auto& node : report_.nodes) {
    co_await state_of(node);
    if (!node.problem.empty()) continue;
    const auto good = co_await answers(node);
    static_cast<void>(good);  // reported in `problem`
  }
  const auto quiet = co_await all_waiting();
  if (!quiet) report_.reason = "no request gets onto the bus";
}

rt::Task<bool> Move::prepare(Node& node, std::uint32_t rate) {
  const auto selected = co_await alone(node);
  if (!selected) co_return false;
  const auto index = lss::bit_rate_index(rate);
  const auto set = co_await network_.services().lss.configure_bit_timing(*index);
  if (set) co_return true;
  node.problem = refusal(set.error(), "it does not support this bit rate");
  co_return false;
}

rt::Task<bool> Move::prepare_all(std::uint32_t rate) {
  allow();
  for (auto& node : report_.nodes) {
    const auto ready = co_await prepare(node, rate);
    if (!ready) co_return false;
  }
  co_return true;
}

// Selects all that are to change, one after the other; then sends one command. False: it could not be sent.
rt::Task<bool> Move::together(std::uint32_t rate) {
  const auto quiet = co_await all_waiting();
  if (!quiet) co_return false;
  for (auto& node : report_.nodes) {
    if (!node.heard) continue;
    const auto there = co_await select(node);
    if (!there) node.problem = "it did not answer before the change";
  }
  bool told = false;
  while (!told && !late()) {
    const auto delay = static_cast<std::uint16_t>(options_.delay.count());
    const auto sent = co_await network_.services().lss.activate_bit_timing(delay);
    told = sent.has_value();
    if (!told) co_await revive();
  }
  if (!told) co_return false;
  const rt::Duration pause = options_.delay;
  co_await rt::sleep_for(pause);
  if (!network_.services().dispatcher.port().restart(rate)) {
    report_.reason = fmt::format("Berth's own port does not change to {} bit/s", rate);
    co_return false;
  }
  co_await rt::sleep_for(pause);
  co_await rt::sleep_for(settle);
  co_return true;
}

// Puts it into configuration, in addition to those already there.
rt::Task<bool> Move::select(Node& node) {
  const LssAddress device = *node.device;
  for (unsigned i = 0; i < network_.bus().timing.tries && !late(); ++i) {
    const auto selected = co_await network_.services().lss.switch_selective(device);
    if (selected) co_return true;
    co_await revive();
  }
  co_return false;
}

// Leaves bus-off after a request that could not be sent.
rt::Task<void> Move::revive() {
  can::Port& port = network_.services().dispatcher.port();
  const auto status = port.status();
  if (status.bus_off) port.restart(status.bit_rate);
  co_await rt::sleep_for(settle);
}

// In rounds, so that a missing node does not use up the others' time.
rt::Task<bool> Move::hear_all() {
  allow();
  std::vector<std::string> before;
  for (auto& node : report_.nodes) {
    node.heard = false;
    before.push_back(std::exchange(node.problem, {}));
  }
  bool all = false;
  for (unsigned round = 0; round < network_.bus().timing.tries && !all && !late(); ++round) {
    all = true;
    for (auto& node : report_.nodes) {
      if (node.heard) continue;
      node.problem.clear();
      const auto there = co_await answers(node);
      node.heard = there;
      all = all && there;
    }
  }
  for (std::size_t i = 0; i < before.size(); ++i) {
    auto& node = report_.nodes[i];
    node.problem = node.heard ? before[i] : "not heard";
  }
  co_return all;
}

rt::Task<bool> Move::store_all() {
  for (auto& node : report_.nodes) {
    allow();
    const auto selected = co_await alone(node);
    if (!selected) co_return false;
    const auto stored = co_await network_.services().lss.store();
    // A node that did not answer may still have stored.
    node.stored = stored.has_value() || stored.error().code == Errc::timeout;
    if (stored) continue;
    node.problem = "it does not store: " + refusal(stored.error(), "it does not support it");
    co_return false;
  }
  const auto quiet = co_await all_waiting();
  co_return quiet;
}

// A node that was not heard may still have changed: it is asked, too. `heard`: has the old rate pending.
rt::Task<void> Move::prepare_back() {
  allow();
  for (auto& node : report_.nodes) node.heard = false;
  bool all = false;
  for (unsigned round = 0; round < network_.bus().timing.tries && !all && !late(); ++round) {
    all = true;
    for (auto& node : report_.nodes) {
      if (node.heard) continue;
      const std::string why = std::exchange(node.problem, {});
      const auto ready = co_await prepare(node, report_.before);
      node.heard = ready;
      node.problem = why;
      all = all && ready;
      if (!ready || !node.stored) continue;
      const auto stored = co_await network_.services().lss.store();
      if (stored) node.stored = false;
      allow();
    }
  }
}

rt::Task<void> Move::bring_back() {
  co_await prepare_back();
  std::vector<std::string> why;
  for (const auto& node : report_.nodes) why.push_back(node.problem);
  allow();
  const auto back = co_await together(report_.before);
  if (!back) network_.services().dispatcher.port().restart(report_.before);
  const auto all = co_await hear_all();
  for (std::size_t i = 0; i < why.size(); ++i) {
    auto& node = report_.nodes[i];
    if (node.heard) {
      node.problem = why[i];
    } else if (why[i].empty()) {
      node.problem = "not heard again at the old rate";
    } else {
      node.problem = why[i] + " at the new rate, and not heard at the old one";
    }
  }
  report_.end = all ? End::brought_back : End::lost;
}

rt::Task<void> Move::carry_out() {
  const auto ready = co_await prepare_all(options_.rate);
  if (!ready) {
    // The pending rate is not active: it is reset, so that no later activation or store uses it.
    allow();
    for (auto& node : report_.nodes) {
      const std::string why = std::exchange(node.problem, {});
      if (!why.empty()) {
        node.problem = why;
        break;
      }
      const auto back = co_await prepare(node, report_.before);
      static_cast<void>(back);
    }
    const auto quiet = co_await all_waiting();
    static_cast<void>(quiet);
    report_.end = End::refused;
    co_return;
  }
  allow();
  const auto changed = co_await together(options_.rate);
  if (!changed && network_.services().dispatcher.port().status().bit_rate != options_.rate) {
    if (report_.reason.empty()) report_.reason = "the command to change did not get onto the bus";
    co_await bring_back();
    co_return;
  }
  const auto all = co_await hear_all();
  for (auto& node : report_.nodes) node.moved = node.heard;
  bool stored = false;
  if (all) stored = co_await store_all();
  if (stored) {
    report_.end = End::moved;
    co_return;
  }
  co_await bring_back();
}

}  // namespace

const char* name(BitRateReport::End end) noexcept {
  switch (end) {
    case End::moved: return "moved";
    case End::unconfirmed: return "unconfirmed";
    case End::refused: return "refused";
    case End::brought_back: return "brought back";
    case End::lost: break;
  }
  return "lost";
}

rt::Task<BitRateReport> move_bit_rate(Network& network, const BitRateOptions& options) {
  BitRateReport report;
  report.before = report.rate = network.services().dispatcher.port().status().bit_rate;
  if (report.before == 0) report.before = report.rate = network.bus().bitrate;
  const auto known = lss::bit_rate_index(options.rate);
  const auto old = lss::bit_rate_index(report.before);
  if (!known || !old || options.rate == report.before) {
    report.reason = options.rate == report.before
                        ? fmt::format("the bus is at {} bit/s", report.before)
                        : fmt::format("LSS has no index for {} bit/s", known ? report.before : options.rate);
    co_return report;
  }
  Move move(network, options, report);
  co_await move.who_is_there();
  co_await network.services().turn.take();
  const rt::Held held(network.services().turn);
  if (report.reason.empty()) co_await move.check();
  const bool in_the_way =
      !report.reason.empty() || std::ranges::any_of(report.nodes, [](const Node& n) { return !n.problem.empty(); });
  if (in_the_way) co_return report;
  report.end = End::unconfirmed;
  if (!options.confirmed) co_return report;
  network.fall_silent();
  co_await move.carry_out();
  report.rate = network.services().dispatcher.port().status().bit_rate;
  co_return report;
}

}  // namespace berth::operate
