/// The hosts' commands on the executor's side: checked, carried out, and written into the audit log. Internal to room
/// `fleet`.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "berth/command/reply.hpp"
#include "berth/fleet/clock.hpp"
#include "berth/fleet/link_parts.hpp"
#include "berth/fleet/signals.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/task.hpp"
#include "berth/tree/session.hpp"

namespace berth::fleet {

/// Carries one request out, as in `command::ControlServer`: both outlive the task.
using Carry = std::function<rt::Task<void>(const command::Request& request, command::Reply& reply)>;

class CommandDesk {
 public:
  static constexpr rt::Duration period = std::chrono::milliseconds(100);
  static constexpr std::size_t most_requests = 8;  ///< under way at once
  /// Commands and refusals: so many at once, then one a second. Each is a line in the audit log, on the disk.
  static constexpr unsigned burst = 20;

  struct Options {
    std::string who{};  ///< in the audit log: "mqtt, mqtts://broker:8883"
    design::BusCommands allowed{};
  };
  /// All must outlive it. `ended`: a command was carried out, so that a slot may have changed.
  CommandDesk(tree::Session& session, const std::vector<Signal>& signals, Carry carry, Link& link, const Clock& clock,
              Options options, std::function<void()> ended);
  ~CommandDesk();
  CommandDesk(const CommandDesk&) = delete;
  CommandDesk& operator=(const CommandDesk&) = delete;

 private:
  struct Work;
  void tick() noexcept;
  void finish() noexcept;
  void begin(sparkplug::Command command);
  void refuse(const sparkplug::Command& command, const std::string& why);
  void end(const char* metric, const sparkplug::Command& command, const std::string& answer);
  [[nodiscard]] bool may_go_on();
  void say(operate::EventKind kind, const std::string& words);

  tree::Session* session_;
  const std::vector<Signal>* signals_;
  Carry carry_;
  Link* link_;
  const Clock* clock_;
  Options options_;
  std::function<void()> ended_;
  std::vector<std::unique_ptr<Work>> works_;
  unsigned left_ = burst;
  rt::Time refilled_;
  std::uint64_t left_out_ = 0;
  rt::Later<CommandDesk, &CommandDesk::tick> tick_;
  rt::Later<CommandDesk, &CommandDesk::finish> done_;
};

}  // namespace berth::fleet
