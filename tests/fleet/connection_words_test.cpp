// One line for each change of the connection, and no fight in the log.
#include "berth/fleet/connection_words.hpp"

#include <gtest/gtest.h>

namespace berth::fleet {
namespace {

using namespace std::chrono_literals;
using mqtt::Why;

mqtt::Disconnected over(Why why, bool was_connected, const std::string& words = "why") {
  return {.why = why, .words = words, .retry_in = 1000ms, .was_connected = was_connected};
}

}  // namespace

TEST(FleetConnectionWords, ABrokerThatIsAwayForANightIsOneLine) {
  ConnectionWords words;
  EXPECT_EQ(words.connected("here", 0ms), "connected to here");
  EXPECT_TRUE(words.lost(over(Why::closed, true), 3600s));
  EXPECT_TRUE(words.lost(over(Why::refused, false, "nothing listens"), 3601s)) << "why it does not come back";
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(words.lost(over(Why::refused, false, "nothing listens"), 3602s));
  EXPECT_TRUE(words.lost(over(Why::certificate_expired, false, "expired"), 3700s)) << "another reason";
  EXPECT_TRUE(words.connected("here", 3800s));
}

TEST(FleetConnectionWords, TheEndThatWasAskedForIsNoLoss) {
  ConnectionWords words;
  EXPECT_FALSE(words.lost(over(Why::ended, true), 1s));
}

TEST(FleetConnectionWords, ASessionThatIsTakenOverMayBeTheSameMachine) {
  ConnectionWords words;
  EXPECT_TRUE(words.connected("here", 0ms));
  EXPECT_NE(words.lost(over(Why::taken_over, true), 1h)->find("runs twice"), std::string::npos);
}

// A broker of MQTT 3.1.1 gives no reason.
TEST(FleetConnectionWords, ConnectionsThatEndAgainAndAgainAreFewLines) {
  ConnectionWords words;
  unsigned said = 0;
  bool hint = false;
  auto now = 0ms;
  for (int i = 0; i < 50; ++i) {
    if (words.connected("here", now)) ++said;
    now += 5s;
    if (const auto line = words.lost(over(Why::closed, true), now)) {
      ++said;
      hint = hint || line->find("runs twice") != std::string::npos;
    }
  }
  EXPECT_TRUE(hint);
  EXPECT_EQ(said, 6U);
  EXPECT_FALSE(words.connected("here", now));
  EXPECT_TRUE(words.lost(over(Why::closed, true), now + 2min)) << "a good one in between";
  EXPECT_TRUE(words.connected("here", now + 3min));
}

}  // namespace berth::fleet
