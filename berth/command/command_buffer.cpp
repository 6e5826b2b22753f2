#include "berth/command/command_buffer.hpp"
#include "berth/command/confirm.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/command/execute.hpp"
#include "berth/command/rights.hpp"
#include "berth/command/verbs.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {

std::optional<std::uint32_t> CommandBuffer::put(Request request) {
  if (waiting_.size() >= most || confirmed_.size() >= most) return std::nullopt;
  waiting_.push_back({++last_, std::move(request)});
  if (!std::exchange(works_, true)) scope_.spawn(work());
  return last_;
}

std::optional<CommandBuffer::Confirmation> CommandBuffer::take() {
  if (confirmed_.empty()) return std::nullopt;
  auto oldest = std::move(confirmed_.front());
  confirmed_.pop_front();
  return oldest;
}

rt::Task<void> CommandBuffer::work() {
  while (!waiting_.empty()) {
    Confirmation done{.number = waiting_.front().number, .reply = {}};
    co_await execute(session_, waiting_.front().request, done.reply);
    waiting_.pop_front();
    confirmed_.push_back(std::move(done));
    if (on_confirmation_) on_confirmation_();
  }
  works_ = false;
}

RemoteCommands::RemoteCommands(tree::Session& session) : session_(session), buffer_(session) {
  buffer_.on_confirmation([this] { confirmed(); });
  session_.on_command(
      [this](const std::string& bus, const std::string& text, operate::NetworkObserver::Confirm confirm) {
        return came(bus, text, std::move(confirm));
      });
}

RemoteCommands::~RemoteCommands() { session_.on_command({}); }

namespace {

// Empty: a node of this bus may command it.
std::string why_not(const design::Machine& machine, const std::string& bus, const Request& request) {
  const auto it = std::ranges::find(machine.buses, bus, &design::Bus::name);
  return why_refused(Face::node, request, {.bus = bus, .listed = it == machine.buses.end() ? nullptr : &it->commands});
}

}  // namespace

bool RemoteCommands::came(const std::string& bus, const std::string& text, operate::NetworkObserver::Confirm confirm) {
  std::string error;
  Request request = parse_request(text, error);
  const Verb* const known = verb(request.verb);
  if (error.empty() && known == nullptr) error = fmt::format("there is no command {}", text::quoted(request.verb));
  if (error.empty()) error = why_not(session_.machine(), bus, request);
  if (error.empty() && known->parameter("bus") != nullptr) {
    const auto [named, fresh] = request.arguments.try_emplace("bus", bus);
    if (!fresh && named->second != bus) error = "a command from a bus is only for that bus";
  }
  if (!error.empty()) {
    confirm(false, refusal(2, error).json);
    return true;
  }
  const auto number = buffer_.put(std::move(request));
  if (number) confirms_.emplace(*number, std::move(confirm));
  return number.has_value();
}

void RemoteCommands::confirmed() {
  while (const auto done = buffer_.take()) {
    const auto confirm = confirms_.extract(done->number);
    if (!confirm.empty()) confirm.mapped()(done->reply.status == 0, done->reply.json);
  }
}

}  // namespace berth::command
