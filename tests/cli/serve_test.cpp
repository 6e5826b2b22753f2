// `berth serve` in a process of its own, and clients of it in this one.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "berth/io/socketcand_port.hpp"
#include "berth/io/stream.hpp"
#include "process.hpp"

namespace berth::test::serve_tests {
namespace {

using namespace std::chrono_literals;

constexpr can::IdRange everything[] = {can::all_base, can::all_extended};

std::string free_port() {
  const int fd = io::listen_tcp({"127.0.0.1", 0}).value();
  const auto where = io::to_string(*io::local_endpoint(fd));
  ::close(fd);
  return where;
}

class Ear final : public can::Listener {
 public:
  void received(const can::Frame& f, rt::Time) noexcept override { frames.push_back(f); }
  void sent(std::uint32_t tag, rt::Time) noexcept override { tags.push_back(tag); }
  void changed(const can::Status&, rt::Time) noexcept override {}
  [[nodiscard]] bool heard(const std::string& frame) const {
    return std::ranges::find(frames, *can::parse_frame(frame)) != frames.end();
  }
  std::vector<can::Frame> frames;
  std::vector<std::uint32_t> tags;
};

/// A node on a bus of a server that listens already. How long it waits for the server is no figure of the product: a
/// machine that does much else needs some of it.
struct Node {
  explicit Node(const std::string& where, const std::string& bus, rt::Duration patience = 2min) {
    auto opened = io::SocketcandPort::connect(loop, where + "/" + bus, {.bit_rate = 125'000, .timeout = patience});
    if (opened) port = std::move(*opened);
    if (port) port->listen(&ear, everything);
  }
  /// The connection that stands, and those that failed or ended before it: a port connects anew by itself.
  [[nodiscard]] std::uint64_t connections() const { return 1 + port->faults().count; }
  template <class Done>
  bool until(Done done) {
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (!done()) {
      if (std::chrono::steady_clock::now() > end) return false;
      loop.turn(10ms);
    }
    return true;
  }
  /// A request before its boot-up would be lost.
  [[nodiscard]] bool hears_heartbeat_of_1() const {
    return std::ranges::any_of(ear.frames, [](const can::Frame& f) { return f.id == 0x701; });
  }
  bool says(const std::string& frame, const std::string& answer) {
    ear.frames.clear();
    return port->send(*can::parse_frame(frame), 1) == can::Queued::yes && until([&] { return ear.heard(answer); });
  }
  rt::Executor executor;
  io::Loop loop{executor};
  Ear ear;
  std::unique_ptr<io::SocketcandPort> port;
};

nlohmann::json last_line(const Outcome& outcome) {
  std::istringstream lines(outcome.out);
  nlohmann::json last;
  for (std::string line; std::getline(lines, line);) last = nlohmann::json::parse(line);
  return last;
}

TEST(Serve, APlantInAnotherProcessAnswersThroughSocketcand) {
  const auto where = free_port();
  Background server({"serve", example("ailing.plant.toml"), "--listen", where, "--json"});
  ASSERT_TRUE(server.says("listening"));
  Node node(where, "line");
  ASSERT_TRUE(node.port);
  ASSERT_TRUE(node.port->status().up);
  // "sound" is node 1: its heartbeat comes, and 1018h:00 has four entries. The bus is the first: can0.
  EXPECT_TRUE(node.until([&] { return node.hears_heartbeat_of_1(); }));
  EXPECT_TRUE(node.says("601#4018100000000000", "581#4F18100004000000"));
  Node other(where, "can0");
  ASSERT_TRUE(other.port);
  EXPECT_TRUE(other.says("601#4018100100000000", "581#4318100101000000"));          // vendor 1
  EXPECT_TRUE(node.until([&] { return node.ear.heard("601#4018100100000000"); }));  // clients hear each other
  Node busy(where, "busy");
  ASSERT_TRUE(busy.port);
  server.signal(SIGTERM);
  const auto outcome = server.end();
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  std::istringstream lines(outcome.out);
  std::string line;
  ASSERT_TRUE(std::getline(lines, line));
  const auto first = nlohmann::json::parse(line);
  EXPECT_EQ(first.at("listening"), where);
  EXPECT_EQ(first.at("buses"), (nlohmann::json{"line", "mixed", "busy"}));
  const auto last = last_line(outcome);
  EXPECT_EQ(last.at("clients"), node.connections() + other.connections() + busy.connections());
  EXPECT_EQ(last.at("frames_in"), 2);
  EXPECT_GE(last.at("frames_out"), 3);
}

// Every connection is a client, also one that its maker gave up before the server came to say a word.
TEST(Serve, WhoGaveUpWaitingIsCountedAsAClientToo) {
  const auto where = free_port();
  Background server({"serve", example("ailing.plant.toml"), "--listen", where, "--json"});
  ASSERT_TRUE(server.says("listening"));
  server.signal(SIGSTOP);
  int status = 0;
  ASSERT_EQ(::waitpid(server.pid(), &status, WUNTRACED), server.pid());
  ASSERT_TRUE(WIFSTOPPED(status));
  for (int i = 0; i < 2; ++i) EXPECT_FALSE(Node(where, "line", 10ms).port) << "it is asleep";
  server.signal(SIGCONT);
  Node node(where, "line");
  ASSERT_TRUE(node.port);
  ASSERT_EQ(node.connections(), 1U);
  server.signal(SIGTERM);
  EXPECT_EQ(last_line(server.end()).at("clients"), 3);
}

TEST(Serve, APortOfAnotherServerIsPassedOn) {
  const auto first = free_port();
  const auto second = free_port();
  Background plant({"serve", example("ailing.plant.toml"), "--listen", first});
  ASSERT_TRUE(plant.says("socketcand://"));
  std::optional<Background> relay;
  const Words words{"serve", "--port", "passed on=socketcand://" + first + "/line", "--listen", second};
  ASSERT_TRUE(eventually([&] {  // it gives up after three seconds, in which a busy machine may not run the other
    relay.emplace(words);
    return relay->says("socketcand://");
  }));
  Node node(second, "passed on");
  ASSERT_TRUE(node.port);
  EXPECT_TRUE(node.until([&] { return node.hears_heartbeat_of_1(); })) << "before that, node 1 is still booting";
  EXPECT_TRUE(node.says("601#4018100000000000", "581#4F18100004000000"));
}

// The main job, in a third process.
TEST(Serve, AMachineComesUpFromBlankToOperationalOverSocketcand) {
  const auto where = free_port();
  const Folder folder;
  auto machine = contents(example("five-slaves.toml"));
  const std::string simulated = "port      = \"sim\"";
  const auto at = machine.find(simulated);
  ASSERT_NE(at, std::string::npos);
  machine.replace(at, simulated.size(), "port = \"socketcand://" + where + "/field\"");
  const auto file = folder.write("machine.toml", machine);
  Background server(
      {"serve", example("five-slaves.plant.toml"), "--machine", example("five-slaves.toml"), "--listen", where});
  ASSERT_TRUE(server.says("socketcand://"));
  const auto outcome = berth({"up", file, "--until", "operational", "--pace", "--yes", "--json", "--store",
                              folder.file("store.db"), "--control", folder.file("up.sock")});
  EXPECT_EQ(outcome.status, 0) << outcome.out << outcome.err;
  EXPECT_NE(outcome.out.find("\"operational\""), std::string::npos) << outcome.out;
}

TEST(Serve, ItEndsByItself) {
  const auto outcome = berth({"serve", example("ailing.plant.toml"), "--listen", "127.0.0.1:0", "--for", "100 ms"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_EQ(outcome.out.find("socketcand://127.0.0.1:"), 0U) << outcome.out;
  EXPECT_NE(outcome.out.find("/mixed\n"), std::string::npos) << outcome.out;
}

TEST(Serve, TheHarvesterAsItIsShipped) {
  const auto outcome = berth({"serve", example("harvester/plant.toml"), "--machine", example("harvester/machine.toml"),
                              "--listen", "127.0.0.1:0", "--for", "100 ms"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("/reel\n"), std::string::npos) << outcome.out;
}

TEST(Serve, WhatIsWrongIsTold) {
  const auto says = [](const Words& words, int status, const std::string& what) {
    const auto outcome = berth(words);
    EXPECT_EQ(outcome.status, status) << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
  };
  const auto plant = example("ailing.plant.toml");
  says({"serve"}, 2, "what is to be served?");
  says({"serve", "/no/such/plant.toml"}, 2, "/no/such/plant.toml");
  says({"serve", plant, "--listen", "127.0.0.1:99999"}, 2, "HOST:PORT");
  says({"serve", plant, "--for", "soon"}, 2, "is not a time");
  says({"serve", "--port", "can987"}, 3, "socketcan:can987: there is no such interface");
  says({"serve", "--port", "slcan:/dev/no-such-device"}, 3, "no such device");
  says({"serve", "--machine", example("ailing.toml")}, 2, "give the plant file");
  says({"serve", plant, "--listen", "no.such.host.invalid:1"}, 3, "no such host");
  const auto taken = io::listen_tcp({"127.0.0.1", 0}).value();
  says({"serve", plant, "--listen", io::to_string(*io::local_endpoint(taken))}, 3, "another program listens there");
  ::close(taken);
}

}  // namespace
}  // namespace berth::test::serve_tests
