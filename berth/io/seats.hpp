/// Who may stay connected to a server: the one rule for every server of this repository that takes connections (CiA
/// 309-3 gateway, socketcand, control socket, `berth plant --listen`). It reads no socket: servers say what they see.
///
/// A client loses its seat, and its connection ends,
/// - when its first whole request is not there `patience` after it came (End::silent),
/// - when a request that it has begun is not whole `patience` later (End::unfinished),
/// - when it takes nothing of what waits for it for `untaken` (End::untaken),
/// - when every seat is taken and another comes: the one that has been idle longest, if it was so for `idle` and is
/// owed
///   nothing (End::displaced). Idle is a client of which no whole request came and which took no output.
/// So a client that listens may stay as long as it likes while there is room. A machine that vanished is for TCP's
/// keep-alive (`tune_tcp`).
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
  std::size_t most_per_peer = 0;  ///< from one address; 0: as many as there are seats
  rt::Duration patience = std::chrono::seconds(30);
  rt::Duration idle = std::chrono::seconds(10);
  rt::Duration untaken = std::chrono::minutes(1);
};

class Seats;

/// One client's. Its owner tells what comes and goes; nothing here is called for a client that is over.
class Seat final : private rt::Job {
 public:
  enum class End : std::uint8_t { silent, unfinished, untaken, displaced };
  class Sitter {
   public:
    /// An answer is under way, or something that it has asked for.
    [[nodiscard]] virtual bool owed() const noexcept = 0;
    /// Its connection is to end. From a job or from `make_room`; must not destroy the seat.
    virtual void seat_lost(End end) noexcept = 0;

   protected:
    ~Sitter() = default;
  };

  /// Takes a seat, whether there is one or not: `Seats::make_room` comes before. `peer`: its address without its port.
  Seat(Seats& seats, Sitter& sitter, std::string peer);
  ~Seat();
  Seat(const Seat&) = delete;
  Seat& operator=(const Seat&) = delete;

  void whole_request() noexcept;
  /// Bytes of a request that is not whole are there, or none.
  void begun(bool is) noexcept;
  /// `taken`: what the peer took since it came; `waiting`: what it has not taken yet. Bytes, or packets.
  void output(std::uint64_t taken, std::size_t waiting) noexcept;
  /// The seat is free, though its owner is here yet. Nothing ends any more.
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
  rt::Time active_;                ///< a whole request or output that was taken
  std::optional<rt::Time> begun_;  ///< a request; at first the one that is not there yet
  std::optional<rt::Time> stuck_;  ///< output waits and is not taken
  std::uint64_t taken_ = 0;
  bool asked_ = false;  ///< a whole request came
  bool over_ = false;
};

class Seats {
 public:
  Seats(rt::Executor& executor, const SeatRules& rules) : executor_(&executor), rules_(rules) {}
  Seats(const Seats&) = delete;
  Seats& operator=(const Seats&) = delete;

  /// Room for one more of `peer`; an idle one may lose its seat for it. False: there is none.
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

/// Lines about connections, of which strangers make as many as they like: `burst` at once, then one in `pause`; how
/// many were left out comes with the next.
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
