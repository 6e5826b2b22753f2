// Output whose reader has stopped: who prints does not wait, what is lost is said, and the rest comes in order.
#include "berth/io/write_behind.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cerrno>
#include <string>

#include "../pch.hpp"

namespace berth::io {
namespace {

using namespace std::chrono_literals;

// A pipe that holds a page; only the test reads it.
class Stopped {
 public:
  Stopped() {
    EXPECT_EQ(::pipe2(ends_.data(), O_CLOEXEC), 0);
    EXPECT_GE(::fcntl(ends_[1], F_SETPIPE_SZ, 4096), 4096);
  }
  ~Stopped() {
    close_reader();
    ::close(ends_[1]);
  }
  Stopped(const Stopped&) = delete;
  Stopped& operator=(const Stopped&) = delete;
  [[nodiscard]] int descriptor() const { return ends_[1]; }
  [[nodiscard]] std::string read(std::size_t bytes) const {
    std::string all;
    std::array<char, 4096> piece{};
    while (all.size() < bytes) {
      const auto got = ::read(ends_[0], piece.data(), std::min(piece.size(), bytes - all.size()));
      if (got <= 0) break;
      all.append(piece.data(), static_cast<std::size_t>(got));
    }
    return all;
  }
  [[nodiscard]] std::string read_line() const {
    std::string line;
    while (!line.ends_with('\n')) {
      const auto byte = read(1);
      if (byte.empty()) break;
      line += byte;
    }
    return line;
  }
  void close_reader() {
    if (ends_[0] >= 0) ::close(ends_[0]);
    ends_[0] = -1;
  }

 private:
  std::array<int, 2> ends_{-1, -1};
};

std::string line(int number) {
  return std::string(99 - std::to_string(number).size(), '.') + std::to_string(number) + "\n";
}

TEST(WriteBehind, ManyLinesForAReaderThatHasStoppedComeInOrder) {
  const Stopped pipe;
  WriteBehind writes({});
  ASSERT_TRUE(writes.good());
  std::string all;
  for (int n = 0; n < 1000; ++n) {  // 25 times what the pipe holds
    writes.add(pipe.descriptor(), line(n));
    all += line(n);
  }
  EXPECT_EQ(pipe.read(all.size()), all);
  writes.finish();
  EXPECT_EQ(writes.broken(pipe.descriptor()), 0);
}

// The words stand where the lines would be, and what comes when there is room again is written.
TEST(WriteBehind, WhatIsLostIsSaidInItsPlace) {
  const Stopped pipe;
  WriteBehind::Options options;
  options.most_bytes = 1000;
  options.told_at = pipe.descriptor();
  options.lost = [](std::size_t lines) { return "lost " + std::to_string(lines) + "\n"; };
  WriteBehind writes(options);
  // The pipe is full and the thread waits: from now on it is known what is kept.
  const std::string full(4096 + 500, 'x');
  for (std::size_t at = 0; at < full.size(); at += 500) {
    writes.add(pipe.descriptor(), full.substr(at, 500));
    const auto end = std::chrono::steady_clock::now() + 50ms;
    while (std::chrono::steady_clock::now() < end) ::usleep(1000);
  }
  for (int n = 0; n < 20; ++n) writes.add(pipe.descriptor(), line(n));
  EXPECT_EQ(pipe.read(full.size()), full);
  int kept = 0;
  std::string next = pipe.read_line();
  for (; next == line(kept); next = pipe.read_line()) ASSERT_LT(++kept, 20) << "nothing is lost";
  EXPECT_EQ(next, "lost " + std::to_string(20 - kept) + "\n");
  writes.add(pipe.descriptor(), "after\n");
  EXPECT_EQ(pipe.read(6), "after\n");
}

TEST(WriteBehind, AReaderThatTakesNothingDoesNotKeepItFromEnding) {
  const Stopped pipe;
  WriteBehind::Options options;
  options.patience = 50ms;
  WriteBehind writes(options);
  for (int n = 0; n < 1000; ++n) writes.add(pipe.descriptor(), line(n));
  writes.finish();
  EXPECT_FALSE(writes.good());
}

TEST(WriteBehind, AReaderThatHasLeftIsAnErrorOfItsDescriptorAlone) {
  ::signal(SIGPIPE, SIG_IGN);
  Stopped gone;
  const Stopped there;
  gone.close_reader();
  WriteBehind writes({});
  writes.add(gone.descriptor(), "to nobody\n");
  writes.add(there.descriptor(), "to somebody\n");
  EXPECT_EQ(there.read(12), "to somebody\n");
  writes.finish();
  EXPECT_EQ(writes.broken(gone.descriptor()), EPIPE);
  EXPECT_EQ(writes.broken(there.descriptor()), 0);
}

}  // namespace
}  // namespace berth::io
