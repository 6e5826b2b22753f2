/// Values that no PDO carries, read by SDO: `poll = true`. One after the other, so that no more than one such request
/// is under way on all buses. Internal to room `fleet`.
#pragma once

#include <vector>

#include "berth/fleet/command_desk.hpp"
#include "berth/fleet/signals.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"

namespace berth::fleet {

class Poller {
 public:
  /// All must outlive it. It reads operational slots only: a booting device is left alone.
  Poller(tree::Session& session, const std::vector<Signal>& signals, SignalTable& table, Carry carry);
  Poller(const Poller&) = delete;
  Poller& operator=(const Poller&) = delete;

 private:
  [[nodiscard]] rt::Task<void> run();
  [[nodiscard]] rt::Task<void> read(std::size_t index);
  [[nodiscard]] bool may_ask(std::size_t index) const;

  tree::Session* session_;
  const std::vector<Signal>* signals_;
  SignalTable* table_;
  Carry carry_;
  command::Request request_;  // the one under way
  command::Reply reply_;
  rt::Scope scope_;  // last: its task uses the rest
};

}  // namespace berth::fleet
