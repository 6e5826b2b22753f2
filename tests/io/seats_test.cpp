// The rule by which servers keep their clients, on a clock that only the test moves.
#include "berth/io/seats.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "../pch.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;

struct Somebody final : Seat::Sitter {
  explicit Somebody(Seats& seats, std::string peer = "a") : seat(seats, *this, std::move(peer)) {}
  [[nodiscard]] bool owed() const noexcept override { return is_owed; }
  void seat_lost(Seat::End end) noexcept override { lost.push_back(end); }
  bool is_owed = false;
  std::vector<Seat::End> lost;
  Seat seat;
};

using Lost = std::vector<Seat::End>;

struct Room {
  explicit Room(const SeatRules& rules) : seats(executor, rules) {}
  void pass(rt::Duration time) { executor.advance(executor.now() + time); }
  rt::Executor executor;
  Seats seats;
};

TEST(Seats, WithoutAWholeRequestOneEnds) {
  Room room({.most = 8, .patience = 30s});
  Somebody silent(room.seats);
  Somebody half(room.seats);
  Somebody good(room.seats);
  good.seat.whole_request();
  room.pass(20s);
  half.seat.begun(true);
  room.pass(9s);
  EXPECT_EQ(silent.lost, Lost{});
  room.pass(1s);
  EXPECT_EQ(silent.lost, Lost{Seat::End::silent});
  EXPECT_EQ(half.lost, Lost{Seat::End::silent}) << "half a line is no request";
  room.pass(10h);
  EXPECT_EQ(good.lost, Lost{}) << "it may listen as long as it likes";
  EXPECT_EQ(room.seats.taken(), 1U);
}

TEST(Seats, ARequestThatHasBegunIsToBeWholeInTime) {
  Room room({.most = 8, .patience = 30s});
  Somebody trickles(room.seats);
  Somebody ends(room.seats);
  for (auto* const each : {&trickles, &ends}) {
    each->seat.whole_request();
    each->seat.begun(true);
  }
  for (int i = 0; i < 29; ++i) {
    room.pass(1s);
    trickles.seat.begun(true);
  }
  ends.seat.whole_request();
  ends.seat.begun(false);
  room.pass(1s);
  EXPECT_EQ(trickles.lost, Lost{Seat::End::unfinished});
  room.pass(10h);
  EXPECT_EQ(ends.lost, Lost{});
}

TEST(Seats, OutputThatIsNotTakenEndsOne) {
  Room room({.most = 8, .untaken = 60s});
  Somebody takes_nothing(room.seats);
  Somebody slow(room.seats);
  takes_nothing.seat.whole_request();
  slow.seat.whole_request();
  for (unsigned i = 1; i <= 100; ++i) {
    takes_nothing.seat.output(0, i);  // more and more waits
    slow.seat.output(i, 1000);
    room.pass(59s);
  }
  EXPECT_EQ(takes_nothing.lost, Lost{Seat::End::untaken});
  EXPECT_EQ(slow.lost, Lost{});
  slow.seat.output(101, 0);
  room.pass(10h);
  EXPECT_EQ(slow.lost, Lost{}) << "all is taken";
}

TEST(Seats, TheOneThatWasIdleLongestMakesRoom) {
  Room room({.most = 3, .idle = 10s});
  Somebody first(room.seats);
  Somebody second(room.seats);
  Somebody third(room.seats);
  for (auto* const each : {&first, &second, &third}) {
    room.pass(1s);
    each->seat.whole_request();
  }
  room.pass(5s);
  EXPECT_FALSE(room.seats.make_room("a")) << "nobody was idle for 10 s";
  room.pass(10s);
  first.is_owed = true;
  second.seat.output(1, 0);
  EXPECT_TRUE(room.seats.make_room("a"));
  EXPECT_EQ(first.lost, Lost{}) << "it is owed an answer";
  EXPECT_EQ(second.lost, Lost{}) << "it takes what it asked for";
  EXPECT_EQ(third.lost, Lost{Seat::End::displaced});
  EXPECT_EQ(room.seats.taken(), 2U);
  EXPECT_TRUE(room.seats.make_room("a")) << "there is room";
}

TEST(Seats, APeerHasABoundOfItsOwn) {
  Room room({.most = 8, .most_per_peer = 2, .idle = 10s});
  Somebody other(room.seats, "b");
  Somebody one(room.seats);
  Somebody two(room.seats);
  room.pass(20s);
  EXPECT_TRUE(room.seats.make_room("b"));
  EXPECT_EQ(other.lost, Lost{});
  EXPECT_TRUE(room.seats.make_room("a"));
  EXPECT_EQ(one.lost, Lost{Seat::End::displaced}) << "not that of another peer";
}

TEST(BoundedLines, AreFewHoweverManyComeAndSayHowManyWereLeftOut) {
  rt::Executor executor;
  std::vector<std::string> told;
  BoundedLines lines(executor, [&](const std::string& line) { told.push_back(line); });
  for (int i = 0; i < 10'000; ++i) lines("connected");
  EXPECT_EQ(told.size(), BoundedLines::burst);
  executor.advance(executor.now() + 1s);
  lines("connected");
  lines("connected");
  ASSERT_EQ(told.size(), BoundedLines::burst + 2U);
  EXPECT_EQ(told[BoundedLines::burst], "9900 lines about connections were left out");
}

}  // namespace
}  // namespace berth::io
