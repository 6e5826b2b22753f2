/// One conversation of CiA 309-3 with the networks of a session: takes lines, carries them out, one after the other in
/// the order in which they came, and says a reply for each, with indications between them.
///
///     serve::Conversation309 client(house, [&](std::string_view text) { stream.put(text); }, [&] { more(); });
///     client.take("[1] 5 read 0x1000 0 u32");
///
/// Every conversation is a gateway of its own: default net and node, time-outs, PDOs, guarding and heartbeat
/// supervision are its own and end with it. Net n is the n-th bus of the machine file.
///
/// It does nothing that `operate`'s commands would not: roles hold, LSS waits for its turn. On a real bus it only reads
/// and asks unless `House309::commands`; what disturbs operational devices there is refused (102) unless
/// `House309::confirmed`. A conversation that has put devices into LSS
/// configuration state keeps the turn until `lss_switch_glob 0`, for `lss_patience` after the last LSS command, or
/// until the conversation ends; then all are told to wait.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/rt/scope.hpp"
#include "berth/serve/gateway_309.hpp"
#include "berth/serve/gateway_309_commands.hpp"
#include "berth/serve/gateway_309_lss.hpp"
#include "berth/serve/gateway_309_permits.hpp"

namespace berth::serve {

/// Requests that wait, in the order in which they came.
class RequestQueue309 {
 public:
  static constexpr std::size_t most_lines = 64;
  static constexpr std::size_t most_bytes = std::size_t{1} << 20U;  ///< of values

  void push(Line309 line);
  Line309 pop();
  [[nodiscard]] bool empty() const noexcept { return lines_.empty(); }
  [[nodiscard]] bool full() noexcept;
  /// Once after it was `full`, when half of it is free again.
  [[nodiscard]] bool has_room_again() noexcept;

 private:
  std::deque<Line309> lines_;
  std::size_t bytes_ = 0;
  bool full_ = false;
};

class Conversation309 {
 public:
  static constexpr std::size_t most_lines = RequestQueue309::most_lines;  ///< that wait; then it is `full`
  static constexpr std::size_t longest_command = std::size_t{1} << 20U;   ///< bytes, as far as `set command_size` goes
  static constexpr std::size_t usual_command = std::size_t{1} << 16U;     ///< before it
  static constexpr rt::Duration lss_patience = std::chrono::seconds(30);
  static constexpr rt::Duration status_period = std::chrono::milliseconds(250);

  /// `say` gets whole lines with their CR LF, from the executor or from within `take`; `more` says that it takes
  /// lines again. Neither may destroy the conversation.
  Conversation309(House309& house, std::function<void(std::string_view)> say, std::function<void()> more);
  ~Conversation309();
  Conversation309(const Conversation309&) = delete;
  Conversation309& operator=(const Conversation309&) = delete;

  /// A line without its end. Not while it is `full`.
  void take(std::string_view line);
  /// A line that was longer than `command_size`; `beginning` is what was kept of it.
  void take_too_long(std::string_view beginning);
  /// Too much waits: no line before `more` is called.
  [[nodiscard]] bool full() noexcept { return queue_.full(); }
  [[nodiscard]] std::size_t command_size() const noexcept { return command_size_; }
  /// Nothing waits and nothing is under way.
  [[nodiscard]] bool idle() const noexcept { return queue_.empty() && !busy_; }

 private:
  template <void (Conversation309::*Method)()>
  class Call final : public rt::Job {
   public:
    explicit Call(Conversation309& owner) noexcept : owner_(owner) {}
    void run() noexcept override { (owner_.*Method)(); }

   private:
    Conversation309& owner_;
  };
  /// What a command is for that does not say so.
  struct Defaults {
    std::optional<std::uint16_t> net{};
    std::optional<std::uint8_t> node{};
  };
  void enqueue(Line309 line);
  void next();
  void over();
  void out_of_time();
  void watch();
  void reply(const Outcome309& outcome);
  void release_turns();
  rt::Task<void> carry_out();
  rt::Task<Outcome309> perform(const Request309& request);
  Outcome309 settle(const Request309& request);
  [[nodiscard]] std::optional<Code309> aim(Request309& request) const;
  [[nodiscard]] bool immediate(Verb309 verb) const noexcept;
  [[nodiscard]] rt::Executor& executor() const noexcept { return house_->session->executor(); }

  House309* house_;
  Permits309 permits_;
  NetCommands309 commands_{permits_};
  LssCommands309 lss_{permits_};
  std::function<void(std::string_view)> say_;
  std::function<void()> more_;
  std::vector<std::unique_ptr<Net309>> nets_;
  Defaults defaults_;
  std::size_t command_size_ = usual_command;
  rt::Duration command_timeout_{0};  // 0: none
  RequestQueue309 queue_;
  bool busy_ = false;
  Request309 current_;
  Outcome309 outcome_;
  Call<&Conversation309::next> next_{*this};
  Call<&Conversation309::over> over_{*this};
  Call<&Conversation309::out_of_time> out_of_time_{*this};
  Call<&Conversation309::watch> watch_{*this};
  Call<&Conversation309::release_turns> release_{*this};
  rt::Scope scope_;  // last: its task uses the rest
};

}  // namespace berth::serve
