/// The command interface of a manager (paper 5 §4, by Etschberger and Schlegel): two command buffers, one for the
/// application in the same process and one for clients that write 1023h of the manager's device by SDO. Both take the
/// command line's requests, carry them out one after the other, and confirm each.
///
///     command::CommandBuffer commands(session);
///     const auto number = commands.put({"configure", {{"slot", "press"}}});
///     ...                                             // the executor runs
///     while (const auto done = commands.take()) use(done->number, done->reply.status, done->reply.json);
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "berth/command/reply.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"

namespace berth::command {

class CommandBuffer {
 public:
  static constexpr std::size_t most = 16;  ///< waiting commands, and confirmations not taken

  struct Confirmation {
    std::uint32_t number = 0;
    Reply reply;
  };

  /// `session` must outlive this.
  explicit CommandBuffer(tree::Session& session) : session_(session), scope_(session.executor()) {}
  CommandBuffer(const CommandBuffer&) = delete;
  CommandBuffer& operator=(const CommandBuffer&) = delete;

  /// Returns its number, from 1. Empty: the buffer is full, or too many confirmations were not taken.
  std::optional<std::uint32_t> put(Request request);
  /// The oldest confirmation not taken yet.
  std::optional<Confirmation> take();
  /// Called when a confirmation arrives. From a job; it may call `take`.
  void on_confirmation(std::function<void()> handler) { on_confirmation_ = std::move(handler); }
  /// Commands that wait or are being carried out.
  [[nodiscard]] std::size_t waiting() const noexcept { return waiting_.size(); }

 private:
  struct Entry {
    std::uint32_t number = 0;
    Request request;
  };
  rt::Task<void> work();

  tree::Session& session_;
  std::function<void()> on_confirmation_;
  std::deque<Entry> waiting_;  // the first is being carried out
  std::deque<Confirmation> confirmed_;
  std::uint32_t last_ = 0;
  bool works_ = false;
  rt::Scope scope_;
};

/// Takes commands written to 1023h:01 of the master's device of each bus: a line of JSON as on the control socket,
/// `{"verb": "sdo read", "arguments": {"node": "5", "object": "1018h:04"}}`. Only commands listed in
/// `[bus.NAME.commands]` are carried out, without arguments that name a file of this computer or confirm something
/// ("yes"). A command without "bus" is for the bus by which it came; one for another bus is refused. The confirmation
/// in 1023h:03 is the reply as JSON.
class RemoteCommands {
 public:
  /// `session` must outlive this.
  explicit RemoteCommands(tree::Session& session);
  ~RemoteCommands();
  RemoteCommands(const RemoteCommands&) = delete;
  RemoteCommands& operator=(const RemoteCommands&) = delete;

 private:
  bool came(const std::string& bus, const std::string& text, operate::NetworkObserver::Confirm confirm);
  void confirmed();

  tree::Session& session_;
  CommandBuffer buffer_;
  std::map<std::uint32_t, operate::NetworkObserver::Confirm> confirms_;
};

}  // namespace berth::command
