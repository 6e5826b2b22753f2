/// One CiA 309-3 conversation with the networks of a session: takes lines, carries them out in order, and sends a reply
/// for each, with indications in between.
///
///     serve::Conversation client(house, [&](std::string_view text) { stream.put(text); }, [&] { more(); });
///     client.take("[1] 5 read 0x1000 0 u32");
///
/// Every conversation is a gateway of its own: default net and node, timeouts, PDOs, guarding and heartbeat supervision
/// belong to it and end with it. Net n is the n-th bus of the machine file.
///
/// It does only what `operate`'s commands would: roles apply, LSS waits for its turn. On a real bus it only reads and
/// asks unless `House::commands`; commands that disturb operational devices there are refused (102) unless
/// `House::confirmed`. A conversation that put devices into LSS configuration state keeps the turn until
/// `lss_switch_glob 0`, until `lss_patience` after the last LSS command, or until it ends; then all devices are
/// switched to LSS waiting.
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
#include "berth/serve/cia309.hpp"
#include "berth/serve/cia309_commands.hpp"
#include "berth/serve/cia309_lss.hpp"
#include "berth/serve/cia309_permits.hpp"

namespace berth::serve::cia309 {

/// Waiting requests, in order of arrival.
class RequestQueue {
 public:
  static constexpr std::size_t most_lines = 64;
  static constexpr std::size_t most_bytes = std::size_t{1} << 20U;  ///< of values

  void push(Line line);
  Line pop();
  [[nodiscard]] bool empty() const noexcept { return lines_.empty(); }
  [[nodiscard]] bool full() noexcept;
  /// True once after it was `full`, when half of it is free again.
  [[nodiscard]] bool has_room_again() noexcept;

 private:
  std::deque<Line> lines_;
  std::size_t bytes_ = 0;
  bool full_ = false;
};

class Conversation {
 public:
  static constexpr std::size_t most_lines = RequestQueue::most_lines;    ///< waiting lines; then it is `full`
  static constexpr std::size_t longest_command = std::size_t{1} << 20U;  ///< bytes, the most for `set command_size`
  static constexpr std::size_t usual_command = std::size_t{1} << 16U;    ///< the default
  static constexpr rt::Duration lss_patience = std::chrono::seconds(30);
  static constexpr rt::Duration status_period = std::chrono::milliseconds(250);

  /// `say` gets whole lines with their CR LF, from the executor or within `take`; `more` is called when lines are
  /// accepted again. Neither may destroy the conversation.
  Conversation(House& house, std::function<void(std::string_view)> say, std::function<void()> more);
  ~Conversation();
  Conversation(const Conversation&) = delete;
  Conversation& operator=(const Conversation&) = delete;

  /// A line without its end. Not while it is `full`.
  void take(std::string_view line);
  /// A line longer than `command_size`; `beginning` is the part that was kept.
  void take_too_long(std::string_view beginning);
  /// Too much is waiting: send no line before `more` is called.
  [[nodiscard]] bool full() noexcept { return queue_.full(); }
  [[nodiscard]] std::size_t command_size() const noexcept { return command_size_; }
  /// Nothing waits and nothing is under way.
  [[nodiscard]] bool idle() const noexcept { return queue_.empty() && !busy_; }

 private:
  template <void (Conversation::*Method)()>
  class Call final : public rt::Job {
   public:
    explicit Call(Conversation& owner) noexcept : owner_(owner) {}
    void run() noexcept override { (owner_.*Method)(); }

   private:
    Conversation& owner_;
  };
  /// The target of commands that do not name one.
  struct Defaults {
    std::optional<std::uint16_t> net{};
    std::optional<std::uint8_t> node{};
  };
  void enqueue(Line line);
  void next();
  void over();
  void out_of_time();
  void watch();
  void reply(const Outcome& outcome);
  void release_turns();
  rt::Task<void> carry_out();
  rt::Task<Outcome> perform(const Request& request);
  Outcome settle(const Request& request);
  [[nodiscard]] std::optional<Code> aim(Request& request) const;
  [[nodiscard]] bool immediate(Verb verb) const noexcept;
  [[nodiscard]] rt::Executor& executor() const noexcept { return house_->session->executor(); }

  House* house_;
  Permits permits_;
  NetCommands commands_{permits_};
  LssCommands lss_{permits_};
  std::function<void(std::string_view)> say_;
  std::function<void()> more_;
  std::vector<std::unique_ptr<Net>> nets_;
  Defaults defaults_;
  std::size_t command_size_ = usual_command;
  rt::Duration command_timeout_{0};  // 0: none
  RequestQueue queue_;
  bool busy_ = false;
  Request current_;
  Outcome outcome_;
  Call<&Conversation::next> next_{*this};
  Call<&Conversation::over> over_{*this};
  Call<&Conversation::out_of_time> out_of_time_{*this};
  Call<&Conversation::watch> watch_{*this};
  Call<&Conversation::release_turns> release_{*this};
  rt::Scope scope_;  // last: its task uses the rest
};

}  // namespace berth::serve::cia309
