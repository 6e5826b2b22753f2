// Hosts' commands, and values that are read by SDO.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/command/rights.hpp"
#include "berth/fleet/commands.hpp"
#include "berth/fleet/reporter.hpp"
#include "berth/fleet/reporter_parts.hpp"
#include "berth/od/data_type.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/printable.hpp"

namespace berth::fleet {

using namespace std::chrono_literals;

namespace {

// For the audit log: a host may send any name.
std::string what_of(const sparkplug::Command& command) {
  constexpr std::size_t longest = 100;
  const auto cut = [](const std::string& text) { return text::one_line(text.substr(0, longest)); };
  const std::string value = words_of(command.value);
  return fmt::format("{} {}{}{}", command.device.empty() ? "NCMD" : "DCMD " + cut(command.device), cut(command.metric),
                     value.empty() ? "" : " = ", value);
}

}  // namespace

void Reporter::take_orders() {
  while (auto order = link_->orders.take()) {
    switch (order->kind) {
      case Order::Kind::command: begin(std::move(order->command)); break;
      case Order::Kind::refused:
        if (may_go_on()) refuse(order->command, order->words);
        break;
      case Order::Kind::said: say(operate::EventKind::step, order->words); break;
      case Order::Kind::trouble: say(operate::EventKind::error, order->words); break;
    }
  }
}

// Each takes a line of the audit log, which is written to the disk.
bool Reporter::may_go_on() {
  const rt::Time now = session_->executor().now();
  const auto more = static_cast<unsigned>(std::min<std::int64_t>((now - refilled_) / 1s, burst));
  if (more > 0) {
    left_ = std::min(left_ + more, burst);
    refilled_ = now;
  }
  if (left_ == 0) {
    ++left_out_;
    return false;
  }
  --left_;
  if (const auto count = std::exchange(left_out_, 0); count > 0)
    say(operate::EventKind::error, fmt::format("{} commands of hosts came too quickly and were dropped", count));
  return true;
}

void Reporter::begin(sparkplug::Command command) {
  if (!may_go_on()) return;
  const auto asked = request_of(command, session_->machine(), signals_);
  if (!asked) return refuse(command, asked.error());
  const design::BusCommands the_write{{"sdo write"}};
  const auto refused = command::why_refused(command::Face::mqtt, asked->request,
                                            {.listed = asked->writes_signal ? &the_write : &options_.allowed});
  if (!refused.empty()) return refuse(command, refused);
  if (works_.size() >= most_requests)
    return refuse(command, fmt::format("{} commands are under way: try again when one is done", works_.size()));
  works_.push_back(std::make_unique<Work>(std::move(command), asked->request, *session_, options_.who));
  Work& work = *works_.back();
  work.scope.spawn(rt::told(carry_(work.request, work.reply), work.done, session_->executor(), done_));
}

void Reporter::refuse(const sparkplug::Command& command, const std::string& why) {
  command::audit(*session_, options_.who, what_of(command), "refused: " + why);
  end(refused_metric, command, why);
}

void Reporter::end(const char* metric, const sparkplug::Command& command, const std::string& answer) {
  const auto at = clock_->now().utc;
  say(operate::EventKind::step, fmt::format("{}: {}", what_of(command), text::one_line(answer)));
  // If there is no room the log has it.
  static_cast<void>(put({.metric = metric,
                         .value = end_of(command.device, command.metric, words_of(command.value), answer, at),
                         .at = at}));
}

void Reporter::finish() noexcept {
  for (const auto& work : works_) {
    if (!work->done) continue;
    work->audit.answered(work->reply);
    const bool good = work->reply.status == 0;
    const std::string first = work->reply.error.substr(0, work->reply.error.find('\n'));
    end(good ? done_metric : refused_metric, work->command,
        good || first.empty() ? command::word_of_status(work->reply.status) : first);
  }
  std::erase_if(works_, [](const auto& work) { return work->done; });
  look_ = true;
}

// ---- values that no PDO carries

// One after the other: no more than one request of this room is under way on all buses.
rt::Task<void> Reporter::poll() {
  std::vector<rt::Time> due(signals_.size(), session_->executor().now());
  for (;;) {
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      if (!signals_[i].polled() || session_->executor().now() < due[i]) continue;
      const auto& slot = slots_[signals_[i].slot].slot;
      if (!slot || slot->state != places::SlotState::operational) continue;
      due[i] = session_->executor().now() + signals_[i].wanted.every;
      co_await poll_one(i);
    }
    co_await rt::sleep_for(period);
  }
}

rt::Task<void> Reporter::poll_one(std::size_t index) {
  const auto& signal = signals_[index];
  const auto& spec = session_->machine().slots[signal.slot].spec;
  polled_request_ = {"sdo read",
                     {{"node", spec.name.bus + "/" + spec.name.name}, {"object", od::write_object(signal.object)}}};
  polled_ = {};
  co_await carry_(polled_request_, polled_);
  SignalTable::State state = table_.state(index);
  state.failed = true;
  const auto bytes = bytes_in(polled_.json);
  const std::size_t size = od::byte_size(signal.type);
  if (polled_.status == 0 && bytes && (size == 0 || bytes->size() == size)) {
    state = {.at = session_->executor().now(), .known = true};
    if (size == 0) state.text = text::one_line(std::string(bytes->begin(), bytes->end()));
    if (size > 0) state.raw = od::load(signal.type, bytes->data());
  }
  table_.set(index, std::move(state));
}

}  // namespace berth::fleet
