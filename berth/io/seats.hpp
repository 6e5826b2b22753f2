/// Decides which clients may stay connected: one rule for all of Berth's servers that accept connections (CiA 309-3
/// gateway, socketcand, control socket, `berth plant --listen`). It reads no socket: servers report events.
///
/// A client loses its seat, and its connection ends,
/// - when its first whole request has not come `patience` after its connection (End::silent),
/// - when a request that it has begun is not whole `patience` later (End::unfinished),
/// - when it takes none of its waiting output for `untaken` (End::untaken),
/// - when every seat is taken and another client comes: the one that has been idle longest, if for at least `idle` and
///   if it is owed nothing (End::displaced). Idle means that it sent no whole request and took no output.
/// So a client that only listens may stay as long as there is room. TCP's keep-alive (`tune_tcp`) detects a machine
/// that vanished.
///
///     io::Seats seats(executor, {.most = 16});
///     if (!seats.make_room("127.0.0.1")) return refuse(fd);
///     io::Seat seat(seats, sitter, "127.0.0.1");
///     seat.whole_request();
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::io {

struct SeatRules {
  std::size_t most = 64;          ///< clients at once
  std::size_t most_per_peer = 0;  ///< from one address; 0: unlimited
  rt::Duration patience = std::chrono::seconds(30);
  rt::Duration idle = std::chrono::seconds(10);
  rt::Duration untaken = std::chrono::minutes(1);
};

class Seats;

/// One client's seat. Its owner reports input and output, and calls nothing for a client that has ended.
class Seat final : private rt::Job {
 public:
  enum class End : std::uint8_t { silent, unfinished, untaken, displaced };
  class Sitter {
   public:
    /// True if an answer is under way, or something else that it requested.
    [[nodiscard]] virtual bool owed() const noexcept = 0;
    /// End its connection. Called from a job or from `make_room`; must not destroy the seat.
    virtual void seat_lost(End end) noexcept = 0;

   protected:
    ~Sitter() = default;
  };

  /// Takes a seat without a check: call `Seats::make_room` before. `peer`: its address without its port.
  Seat(Seats& seats, Sitter& sitter, std::string peer);
  ~Seat();
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;

  void whole_request() noexcept;
  /// `is`: bytes of an incomplete request have come.
  void begun(bool is) noexcept;
  /// `taken`: total that the peer took; `waiting`: what it has not taken yet. Bytes, or packets.
  void output(std::uint64_t taken, std::size_t waiting) noexcept;
  /// Frees the seat, though its owner still exists. Nothing ends any more.
  void leave() noexcept;

 private:
  friend class Seats;
  void run() noexcept override;
  void arm() noexcept;
  [[nodiscard]] std::optional<End> overdue() const noexcept;
  [[nodiscard]] std::optional<rt::Time> deadline() const noexcept;
  void lose(End end) noexcept;

  Seats* seats_;
  Sitter* sitter_;
  std::string peer_;
  rt::Time active_;                ///< time of the last whole request or taken output
  std::optional<rt::Time> begun_;  ///< when a request was begun; at first the one that has not come yet
  std::optional<rt::Time> stuck_;  ///< since when output waits untaken
  std::uint64_t taken_ = 0;
  bool asked_ = false;  ///< a whole request has come
  bool over_ = false;
};

class Seats {
 public:
  Seats(rt::Executor& executor, const SeatRules& rules) : executor_(&executor), rules_(rules) {}
  Seats(const Seats&) = delete;
  Seats& operator=(const Seats&) = delete;

  /// Makes room for one more client of `peer`; an idle one may lose its seat. False: there is none.
  [[nodiscard]] bool make_room(std::string_view peer);
  [[nodiscard]] std::size_t taken() const noexcept { return seats_.size(); }
  [[nodiscard]] const SeatRules& rules() const noexcept { return rules_; }
  /// "no whole request in 30 s": why a connection ended, for messages.
  [[nodiscard]] std::string why(Seat::End end) const;

 private:
  friend class Seat;
  rt::Executor* executor_;
  SeatRules rules_;
  std::vector<Seat*> seats_;
};

/// Limits messages about connections, since strangers can cause any number: `burst` at once, then one per `pause`; the
/// next message gives the number of omitted ones.
class BoundedLines {
 public:
  static constexpr unsigned burst = 100;
  static constexpr rt::Duration pause = std::chrono::seconds(1);

  BoundedLines(rt::Executor& executor, std::function<void(const std::string&)> tell);
  void operator()(const std::string& line);

 private:
  rt::Executor* executor_;
  std::function<void(const std::string&)> tell_;  // may be empty
  unsigned left_ = burst;
  rt::Time refilled_;
  std::uint64_t left_out_ = 0;
};

/// "127.0.0.1:40022" without its port.
[[nodiscard]] std::string_view without_port(std::string_view peer) noexcept;

}  // namespace berth::io
