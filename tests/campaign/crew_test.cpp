// Processes that work on seeds: each seed once, whatever becomes of them.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <map>
#include <string>

#include "berth/campaign/crew.hpp"

namespace berth::campaign {
namespace {

using How = Ended::How;

// Seeds 1 to `last`, one after the other.
NextSeed up_to(std::uint64_t last) {
  return [next = std::uint64_t{1}, last]() mutable -> std::optional<std::uint64_t> {
    if (next > last) return std::nullopt;
    return next++;
  };
}

std::map<std::uint64_t, Ended> run_all(CrewOptions options, const SeedWork& work, std::uint64_t last) {
  std::map<std::uint64_t, Ended> all;
  const auto ran = run_crew(options, work, up_to(last), [&](const Ended& ended) {
    EXPECT_TRUE(all.emplace(ended.seed, ended).second) << ended.seed << " ended twice";
    return true;
  });
  EXPECT_TRUE(ran && *ran);
  EXPECT_EQ(all.size(), last);
  return all;
}

TEST(CampaignCrew, DoesEachSeedOnceWhateverTheNumberOfJobs) {
  const auto work = [](std::uint64_t seed) { return std::string(seed * 7, 'x'); };
  for (const unsigned jobs : {1U, 2U, 7U}) {
    const auto all = run_all({.jobs = jobs}, work, 40);
    for (const auto& [seed, ended] : all) {
      EXPECT_EQ(ended.how, How::done);
      EXPECT_EQ(ended.text.size(), seed * 7);
    }
  }
  EXPECT_TRUE(run_all({.jobs = 3}, work, 0).empty());
}

TEST(CampaignCrew, ASeedThatEndsItsProcessEndsThatOneAlone) {
  const auto work = [](std::uint64_t seed) {
    if (seed == 3) ::raise(SIGUSR1);
    if (seed == 4) ::raise(SIGKILL);
    if (seed == 5) ::_exit(4);
    return std::to_string(seed);
  };
  for (const unsigned jobs : {1U, 2U}) {
    const auto all = run_all({.jobs = jobs}, work, 8);
    for (const auto& [seed, ended] : all) {
      const How how = seed == 4 ? How::killed : seed == 3 || seed == 5 ? How::died : How::done;
      EXPECT_EQ(ended.how, how) << seed;
    }
    EXPECT_TRUE(all.at(3).text.starts_with("signal 10 (")) << all.at(3).text;
    EXPECT_TRUE(all.at(4).text.starts_with("signal 9 (")) << all.at(4).text;
    EXPECT_EQ(all.at(5).text, "exit status 4");
    EXPECT_EQ(all.at(8).text, "8");
  }
}

TEST(CampaignCrew, ASeedThatNeverEndsIsEnded) {
  const auto work = [](std::uint64_t seed) {
    while (seed == 2) ::pause();
    return std::to_string(seed);
  };
  const auto all = run_all({.jobs = 1, .limit = std::chrono::milliseconds(300)}, work, 3);
  EXPECT_EQ(all.at(1).how, How::done);
  EXPECT_EQ(all.at(2).how, How::too_long);
  EXPECT_EQ(all.at(3).how, How::done);
}

// The descriptor is that of a signal, in `berth study`.
TEST(CampaignCrew, StopsWhenToldAndLeavesNoProcess) {
  int ends[2];
  ASSERT_EQ(::pipe(ends), 0);
  const auto work = [](std::uint64_t seed) {
    while (seed > 2) ::pause();
    return std::to_string(seed);
  };
  std::uint64_t done = 0;
  const auto ran = run_crew({.jobs = 2, .stop = ends[0]}, work, up_to(100), [&](const Ended&) {
    if (++done == 2) {
      EXPECT_EQ(::write(ends[1], "x", 1), 1);
    }
    return true;
  });
  ASSERT_TRUE(ran);
  EXPECT_FALSE(*ran);
  EXPECT_EQ(done, 2U);
  EXPECT_EQ(::waitpid(-1, nullptr, WNOHANG), -1);
  EXPECT_EQ(errno, ECHILD);
  ::close(ends[0]);
  ::close(ends[1]);
}

TEST(CampaignCrew, StopsWhenALineCannotBeKept) {
  std::uint64_t taken = 0;
  const auto ran = run_crew(
      {.jobs = 2}, [](std::uint64_t seed) { return std::to_string(seed); }, up_to(100),
      [&](const Ended&) { return ++taken < 5; });
  EXPECT_TRUE(ran && !*ran);
  EXPECT_EQ(taken, 5U);
}

// Ctrl-C at a terminal reaches the whole group.
TEST(CampaignCrew, WorkersLeaveSignalsToTheirParent) {
  const auto work = [](std::uint64_t seed) {
    ::raise(SIGINT);
    ::raise(SIGTERM);
    ::raise(SIGHUP);
    return std::to_string(seed);
  };
  EXPECT_EQ(run_all({.jobs = 1}, work, 2).at(2).how, How::done);
}

}  // namespace
}  // namespace berth::campaign
