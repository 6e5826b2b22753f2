/// The executor's side of Studio: takes the clients' orders, has them carried out, and reports changes. It never waits.
/// Data that the server's thread did not take is merged with later data (slots), or dropped and counted (events).
/// Internal to room `studio`.
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/command/reply.hpp"
#include "berth/io/loop.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/task.hpp"
#include "berth/studio/link.hpp"
#include "berth/studio/stock.hpp"
#include "berth/tree/session.hpp"

namespace berth::studio {

/// Carries one request out, like in `command::ControlServer`: both outlive the task.
using Carry = std::function<rt::Task<void>(const command::Request& request, command::Reply& reply)>;

class Desk final : private io::Watcher {
 public:
  static constexpr std::size_t most_requests = 32;  ///< under way at once, of all clients
  static constexpr std::size_t most_events = 1000;  ///< waiting for the server's thread
  static constexpr rt::Duration period = std::chrono::milliseconds(100);

  /// All must outlive this; the loop drives the session's executor.
  Desk(io::Loop& loop, tree::Session& session, Carry carry, Link& link);
  ~Desk();
  Desk(const Desk&) = delete;
  Desk& operator=(const Desk&) = delete;

  /// To be called by `Session::on_event`.
  void event(const operate::Event& event);
  /// Between two turns of the loop.
  void look();
  /// A frame of a bus; frames of unknown buses are not kept. No heap, no lock.
  void frame(std::string_view bus, const can::Frame& frame, rt::Time at, bool own) noexcept;
  /// A report of an error on a bus, and more that is known of it. Beyond `most_errors` a second on one bus, reports are
  /// only counted: a node without acknowledgement repeats its frame forever.
  void error(std::string_view bus, const can::Frame& report, rt::Time at, std::string_view about);
  static constexpr unsigned most_errors = 200;

 private:
  struct Work;
  void ready(std::uint32_t events) noexcept override;
  void take(Order order);
  void begin(Order order);
  void finish() noexcept;
  void answer(Answer answer);
  void tick() noexcept;
  void tell();
  void flush();
  void look_at_ports();
  [[nodiscard]] bool turned_away(const Order& order);
  void note_written(const command::Request& request, const command::Reply& reply);
  [[nodiscard]] bool may_change() const;
  void set_lock(const Order& order, std::optional<rt::Time> until, const std::string& words);
  void say(const std::string& bus, const std::string& text);
  [[nodiscard]] std::vector<operate::SlotReport> changed();
  [[nodiscard]] Lock lock() const;

  io::Loop* loop_;
  tree::Session* session_;
  Carry carry_;
  Link* link_;
  struct Errors {
    std::int64_t second = -1;  // of the executor's time
    unsigned count = 0;        // in it
  };
  std::map<std::string, std::uint8_t, std::less<>> buses_;
  std::vector<Errors> errors_;  // by bus
  std::vector<std::unique_ptr<Work>> works_;
  std::deque<News> waiting_;  // answers without room; limited by `most_requests` and the refused orders
  std::vector<operate::SlotReport> told_;
  std::vector<operate::Event> told_questions_;
  std::vector<operate::Event> events_;
  std::uint64_t left_out_ = 0;
  std::vector<std::string> written_;  // JSON, since the last change
  std::optional<rt::Time> unlocked_until_;
  std::optional<Lock> told_lock_;
  Pace told_pace_;
  Stock stock_;
  unsigned ticks_ = 0;
  rt::Later<Desk, &Desk::tick> tick_;
  rt::Later<Desk, &Desk::finish> done_;
};

}  // namespace berth::studio
