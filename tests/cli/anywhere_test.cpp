// Servers for other computers: only where a person says so.
#include <gtest/gtest.h>
#include <signal.h>
#include <string>

#include "command_fixture.hpp"

namespace berth::test {
namespace {

class Anywhere : public Command {
 protected:
  [[nodiscard]] std::vector<Words> servers(const std::string& where) const {
    return {
        {"serve", plant, "-m", machine, "--listen", where, "--for", "1 ms"},
        {"gateway", machine, "--sim", plant, "--listen", where, "--for", "1 ms"},
        {"up", machine, "--sim", plant, "--until", "operational", "--gateway", where, "--control", folder.file("s")}};
  }
};

TEST_F(Anywhere, AnAddressThatOtherComputersReachIsRefusedAndSaysWhy) {
  for (const std::string where : {"0.0.0.0:0", "[::]:0", "[::ffff:0.0.0.0]:0", "192.0.2.1:0", "0:0"}) {
    for (const auto& words : servers(where)) {
      const Outcome outcome = berth(words);
      EXPECT_EQ(outcome.status, 2) << words[0] << " " << where << "\n" << outcome.out << outcome.err;
      EXPECT_TRUE(contains(outcome.err, "anybody who reaches the port can ")) << outcome.err;
      EXPECT_TRUE(contains(outcome.err, "--listen-anywhere")) << outcome.err;
      EXPECT_TRUE(contains(outcome.err, " " + where + ": ")) << outcome.err;
    }
  }
}

TEST_F(Anywhere, ThisComputersOwnAddressesAreFree) {
  for (const std::string where : {"127.0.0.1:0", "127.9.9.9:0", "localhost:0", ":0"}) {
    for (const auto& words : servers(where)) {
      const Outcome outcome = berth(words);
      EXPECT_EQ(outcome.status, 0) << words[0] << " " << where << "\n" << outcome.out << outcome.err;
    }
  }
  // Not every computer has IPv6: then the system says so, and Berth refuses nothing.
  for (const auto& words : servers("[::1]:0")) EXPECT_FALSE(contains(berth(words).err, "--listen-anywhere"));
}

TEST_F(Anywhere, WithTheWordItListens) {
  for (auto words : servers("0.0.0.0:0")) {
    words.emplace_back("--listen-anywhere");
    const Outcome outcome = berth(words);
    EXPECT_EQ(outcome.status, 0) << words[0] << "\n" << outcome.out << outcome.err;
    EXPECT_TRUE(contains(outcome.out, "0.0.0.0:")) << outcome.out;
  }
}

TEST_F(Anywhere, TheErrorNamesWhatWouldBeAllowed) {
  const auto error_of = [&](Words words) { return berth(words).err; };
  EXPECT_TRUE(contains(error_of({"serve", plant, "--listen", "0.0.0.0"}), "send every frame"));
  EXPECT_TRUE(contains(error_of({"serve", plant, "--listen", "0.0.0.0", "--listen-only"}), "can hear every frame"));
  const Words gateway{"gateway", machine, "--sim", plant, "--listen", "0.0.0.0"};
  EXPECT_TRUE(contains(error_of(gateway), "read every object"));
  Words commands = gateway;
  commands.emplace_back("--commands");
  EXPECT_TRUE(contains(error_of(commands), "command the machine"));
  Words up{"up", machine, "--sim", plant, "--gateway", "0.0.0.0", "--gateway-commands"};
  EXPECT_TRUE(contains(error_of(up), "--gateway 0.0.0.0: "));
  EXPECT_TRUE(contains(error_of(up), "command the machine"));
}

}  // namespace
}  // namespace berth::test
