#include "berth/fleet/command_desk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/command/audit.hpp"
#include "berth/command/rights.hpp"
#include "berth/fleet/commands.hpp"
#include "berth/rt/scope.hpp"
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

/// A command under way.
struct CommandDesk::Work {
  Work(sparkplug::Command what, command::Request asked, tree::Session& session, const std::string& who)
      : command(std::move(what)), request(std::move(asked)), audit(session, who, request), scope(session.executor()) {}
  sparkplug::Command command;
  command::Request request;
  command::Audit audit;
  command::Reply reply{};
  bool done = false;
  rt::Scope scope;  // last: its task uses the other members
};

CommandDesk::CommandDesk(tree::Session& session, const std::vector<Signal>& signals, Carry carry, Link& link,
                         const Clock& clock, Options options, std::function<void()> ended)
    : session_(&session),
      signals_(&signals),
      carry_(std::move(carry)),
      link_(&link),
      clock_(&clock),
      options_(std::move(options)),
      ended_(std::move(ended)),
      refilled_(session.executor().now()),
      tick_(*this, session.executor()),
      done_(*this, session.executor()) {
  tick_.post();
}

CommandDesk::~CommandDesk() = default;

void CommandDesk::tick() noexcept {
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
  tick_.arm(period);
}

// Each takes a line of the audit log, which is written to the disk.
bool CommandDesk::may_go_on() {
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

void CommandDesk::begin(sparkplug::Command command) {
  if (!may_go_on()) return;
  const auto asked = request_of(command, session_->machine(), *signals_);
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

void CommandDesk::refuse(const sparkplug::Command& command, const std::string& why) {
  command::audit(*session_, options_.who, what_of(command), "refused: " + why);
  end(refused_metric, command, why);
}

void CommandDesk::end(const char* metric, const sparkplug::Command& command, const std::string& answer) {
  const auto at = clock_->now().utc;
  say(operate::EventKind::step, fmt::format("{}: {}", what_of(command), text::one_line(answer)));
  // If there is no room the log has it.
  News news{
      .metric = metric, .value = end_of(command.device, command.metric, words_of(command.value), answer, at), .at = at};
  static_cast<void>(link_->news.put(news));
  ended_();
}

void CommandDesk::finish() noexcept {
  for (const auto& work : works_) {
    if (!work->done) continue;
    work->audit.answered(work->reply);
    const bool good = work->reply.status == 0;
    const std::string first = work->reply.error.substr(0, work->reply.error.find('\n'));
    end(good ? done_metric : refused_metric, work->command,
        good || first.empty() ? command::word_of_status(work->reply.status) : first);
  }
  std::erase_if(works_, [](const auto& work) { return work->done; });
}

void CommandDesk::say(operate::EventKind kind, const std::string& words) {
  session_->tell(session_->machine().buses.front().name, kind, "mqtt: " + words);
}

}  // namespace berth::fleet
