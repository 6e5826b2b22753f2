// The CiA 309-3 gateway over TCP, with clients that are plain sockets: pieces, floods, slow, half closed, gone.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include <array>

#include "berth/serve/cia309_server.hpp"
#include "client_socket.hpp"
#include "gateway_309_rig.hpp"

namespace berth::serve {
namespace {

class Gateway309Tcp : public ::testing::Test {
 protected:
  void serve(cia309::ServerOptions options = {}) {
    options.tell = [this](const std::string& text) { told_.push_back(text); };
    auto made = cia309::Server::listen(loop_, {"127.0.0.1", 0}, rig_.session(), std::move(options));
    ASSERT_TRUE(made) << made.error();
    server_ = std::move(*made);
  }
  // Until `done`; a loaded machine may take long.
  template <class Done>
  bool until(Done done) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!done()) {
      if (std::chrono::steady_clock::now() > end) return false;
      loop_.turn(1ms);
    }
    return true;
  }

  class Socket : public ClientSocket {
   public:
    explicit Socket(Gateway309Tcp& test, int receive_buffer = 0)
        : ClientSocket([&test](const std::function<bool()>& done) { return test.until(done); }, test.server_->where(),
                       receive_buffer) {}
  };

  Rig309 rig_;
  io::Loop loop_{rig_.world().executor()};
  std::vector<std::string> told_;
  std::unique_ptr<cia309::Server> server_;
};

TEST_F(Gateway309Tcp, LinesInPiecesAndManyAtOnce) {
  serve();
  Socket client(*this);
  for (const char c : std::string("[1] 1 5 r 0x1000 0 u32\r\n")) client.say({&c, 1});
  ASSERT_TRUE(client.hear("[1] 74565\r\n"));
  client.say("[2] set network 1\n[3] set node 5\n\n# c\n[4] r 0x1000 0 u32\n[5] r 0x10");
  ASSERT_TRUE(client.hear("[2] OK\r\n[3] OK\r\n[4] 74565\r\n"));
  client.say("00 0 u32\n");
  EXPECT_TRUE(client.hear("[5] 74565\r\n"));
  EXPECT_EQ(server_->counters().lines, 7U);
}

TEST_F(Gateway309Tcp, ClientsHaveTheirOwnDefaultsAndAllHearTheIndications) {
  serve();
  Socket a(*this);
  Socket b(*this);
  a.say("[1] set network 1\n[2] 5 start\n");
  ASSERT_TRUE(a.hear("[1] OK\r\n[2] OK\r\n"));
  b.say("[1] 5 start\n");
  ASSERT_TRUE(b.hear("[1] ERROR:104\r\n"));
  a.say("[3] 5 reset node\n");
  EXPECT_TRUE(a.hear("[3] OK\r\n1 5 BOOT_UP\r\n"));
  EXPECT_TRUE(b.hear("1 5 BOOT_UP\r\n"));
  EXPECT_EQ(server_->clients(), 2U);
}

// printf '...' | nc
TEST_F(Gateway309Tcp, WhoHasClosedHisHalfGetsHisReplies) {
  serve();
  Socket client(*this);
  client.say("[1] 1 6 r 0x1000 0\n[2] 1 5 r 0x1000 0 u32");  // no end of line
  client.shut();
  EXPECT_TRUE(client.hung_up());
  EXPECT_EQ(client.heard(), "[1] ERROR:0x05040000\r\n[2] 74565\r\n");
  EXPECT_TRUE(until([&] { return server_->clients() == 0; }));
}

TEST_F(Gateway309Tcp, ALineWithoutEnd) {
  serve();
  Socket client(*this);
  client.say("[1] set command_size 100\n[77] 1 5 w 0x2000 0 d " + std::string(200'000, 'A'));
  ASSERT_TRUE(client.hear("[1] OK\r\n[77] ERROR:600\r\n"));
  client.say(std::string(200'000, 'B') + "\n[2] set network 1\n");
  EXPECT_TRUE(client.hear("[2] OK\r\n"));
}

// More commands than the bus can do: they wait in TCP, in order, and nothing is lost.
TEST_F(Gateway309Tcp, AFloodOfCommands) {
  serve();
  Socket client(*this);
  std::string all;
  std::string expected;
  for (int i = 0; i < 3000; ++i) {
    all += fmt::format("[{}] 1 5 r 0x1000 0 u32\n", i);
    expected += fmt::format("[{}] 74565\r\n", i);
  }
  client.say(all);
  EXPECT_TRUE(client.hear(expected));
}

// It asks and asks and never takes a reply. The other one is served meanwhile.
TEST_F(Gateway309Tcp, WhoTakesNothingIsLetGo) {
  serve({.most_waiting = 20'000});
  Socket good(*this);
  Socket slow(*this, 4096);
  std::string flood;
  for (int i = 0; i < 1000; ++i) flood += "[1] help\n";
  ASSERT_TRUE(until([&] {
    slow.push(flood);
    return server_->counters().too_slow == 1;
  }));
  good.say("[1] 1 5 r 0x1000 0 u32\n");
  EXPECT_TRUE(good.hear("[1] 74565\r\n"));
  EXPECT_TRUE(until([&] { return server_->clients() == 1; }));
}

TEST_F(Gateway309Tcp, GarbageAfterAValidCommandIsAnsweredWithErrorsAndHarmsNobody) {
  serve();
  Socket client(*this);
  client.say("[1] info version\nHost: x\r\n\r\n" + std::string("\x00\xFF\x80\n", 4));
  EXPECT_TRUE(client.hear("[1] 0 0 0.0 0 2 3.0 1.0\r\n[0] ERROR:101\r\n[0] ERROR:101\r\n"));
  client.say("[2] set network 1\n");
  EXPECT_TRUE(client.hear("[2] OK\r\n"));
}

// A web page may post text/plain to any port of the person's own machine without being asked first: the header lines
// are syntax errors, and a line of the body would be a command.
TEST_F(Gateway309Tcp, AWebPageCommandsNothing) {
  serve();
  for (const std::string first :
       {"POST / HTTP/1.1\r\n", "GET /?[1] HTTP/1.0\n", "Host: 127.0.0.1\n", "\r\n \r\nHEAD x HTTP/2\n"}) {
    Socket page(*this);
    page.say(first + "Host: 127.0.0.1:7000\r\nContent-Type: text/plain\r\n\r\n[2] 1 0 start\r\n[3] 1 5 start\r\n");
    ASSERT_TRUE(page.hung_up()) << first;
    EXPECT_EQ(page.heard(), "[0] ERROR:101\r\n") << first;
  }
  EXPECT_NE(std::ranges::find_if(told_, [](const auto& text) { return text.find("HTTP") != std::string::npos; }),
            told_.end());
  rig_.run_for(1s);
  EXPECT_TRUE(rig_.heard().frames.empty()) << rig_.heard().frames.front();
  EXPECT_TRUE(until([&] { return server_->clients() == 0; }));
}

TEST_F(Gateway309Tcp, ALineThatIsTooLongBeforeTheFirstCommandEndsTheConnection) {
  serve();
  Socket client(*this);
  client.say("[77] 1 5 w 0x2000 0 d " + std::string(200'000, 'A') + "\n[2] 1 0 start\n");
  EXPECT_TRUE(client.hung_up());
  rig_.run_for(1s);
  EXPECT_TRUE(rig_.heard().frames.empty());
}

TEST_F(Gateway309Tcp, WhoSaysNothingIsLetGo) {
  serve({.seats = {.patience = 50ms}});
  Socket silent(*this);
  Socket listener(*this);
  listener.say("[1] set network 1\n");
  ASSERT_TRUE(listener.hear("[1] OK\r\n"));
  EXPECT_TRUE(silent.hung_up());
  rig_.run_for(1s);
  loop_.turn(1ms);
  EXPECT_FALSE(listener.ended) << "after a command it may listen as long as it likes";
  EXPECT_EQ(server_->clients(), 1U);
}

// By the executor's clock: the test moves it.
TEST_F(Gateway309Tcp, HalfALineDoesNotHoldASeat) {
  serve();
  Socket half(*this);
  Socket listener(*this);
  for (auto* const each : {&half, &listener}) {
    each->say("[1] set network 1\n");
    ASSERT_TRUE(each->hear("[1] OK\r\n"));
  }
  half.say("[2] set netw");
  for (int i = 0; i < 10; ++i) loop_.turn(1ms);
  rig_.run_for(31s);
  EXPECT_TRUE(half.hung_up());
  EXPECT_EQ(server_->counters().silent, 1U);
  rig_.run_for(60s);
  EXPECT_EQ(server_->clients(), 1U);
}

TEST_F(Gateway309Tcp, WhoTakesNothingLosesItsSeat) {
  serve({.most_waiting = std::size_t{64} << 20U});
  Socket slow(*this, 4096);
  const std::string line = "[1] help\n";
  std::size_t pushed = 0;
  int stood_still = 0;
  ASSERT_TRUE(until([&] {  // until the answers do not go any more, and all that was said are whole lines
    const auto before = server_->counters().lines;
    if (before < 4000 || pushed % line.size() != 0) pushed += slow.push(line.substr(pushed % line.size()));
    loop_.turn(1ms);
    stood_still = server_->counters().lines == before ? stood_still + 1 : 0;
    return stood_still > 20 || server_->clients() == 0;
  }));
  ASSERT_EQ(server_->clients(), 1U);
  rig_.run_for(61s);
  EXPECT_EQ(server_->clients(), 0U);
  ASSERT_FALSE(told_.empty());
  EXPECT_NE(told_.back().find("did not read its answers"), std::string::npos) << told_.back();
}

// All are of one peer here, so its own bound counts.
TEST_F(Gateway309Tcp, SilentConnectionsLockNobodyOut) {
  serve({.seats = {.most = 16, .most_per_peer = 8, .idle = 0ms}});
  std::vector<std::unique_ptr<Socket>> silent;
  for (int i = 0; i < 16; ++i) {
    silent.push_back(std::make_unique<Socket>(*this));
    silent.back()->say("[1] set network 1\n");
    ASSERT_TRUE(silent.back()->hear("[1] OK\r\n"));
    EXPECT_LE(server_->clients(), 8U);
  }
  EXPECT_TRUE(silent.front()->hung_up()) << "silent for the longest";
  Socket late(*this);
  late.say("[1] 1 5 r 0x1000 0 u32\n");
  EXPECT_TRUE(late.hear("[1] 74565\r\n"));
}

TEST_F(Gateway309Tcp, OneTooManyIsLetGo) {
  serve({.seats = {.most = 1}});
  Socket a(*this);
  a.say("[1] set network 1\n");
  ASSERT_TRUE(a.hear("[1] OK\r\n"));
  Socket b(*this);
  EXPECT_TRUE(b.hung_up());
  EXPECT_EQ(server_->counters().too_many, 1U);
  a.say("[2] set node 5\n");
  EXPECT_TRUE(a.hear("[2] OK\r\n"));
}

TEST_F(Gateway309Tcp, WhoVanishesInMidCommandLeavesNothingBehind) {
  serve();
  for (int i = 0; i < 3; ++i) {
    Socket client(*this);
    client.say("[1] 1 lss_switch_glob 1\n");
    ASSERT_TRUE(client.hear("[1] OK\r\n"));
    client.say("[2] 1 _lss_fastscan 100\n");
    client.close();
    ASSERT_TRUE(until([&] { return server_->clients() == 0; }));
  }
  ASSERT_TRUE(until([&] { return !rig_.session().network("backbone")->services().turn.taken(); }));
}

TEST_F(Gateway309Tcp, TheServerGoesWhileCommandsAreUnderWay) {
  serve();
  Socket client(*this);
  client.say("[1] 1 6 r 0x1000 0\n[2] 1 lss_switch_glob 1\n");
  ASSERT_TRUE(until([&] { return server_->counters().lines == 2; }));
  server_.reset();
  EXPECT_TRUE(client.hung_up());
}

TEST_F(Gateway309Tcp, APortThatIsTaken) {
  serve();
  const auto second = cia309::Server::listen(loop_, server_->where(), rig_.session(), {});
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().find(std::to_string(server_->where().port)), std::string::npos) << second.error();
}

}  // namespace
}  // namespace berth::serve
