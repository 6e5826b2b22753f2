// The control socket's seats, with clients that are plain sockets, on a clock that only the test moves.
#include "berth/command/control.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "../no_descriptors.hpp"
#include "../pch.hpp"

namespace berth::command {
namespace {

using namespace std::chrono_literals;

class Client {
 public:
  explicit Client(const std::string& path) : fd_(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    EXPECT_EQ(::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0) << std::strerror(errno);
  }
  ~Client() { ::close(fd_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  void say(std::string_view text) const { ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL); }
  /// What came; `ended` when the server has hung up.
  const std::string& heard() {
    std::array<char, 4096> buffer;
    for (;;) {
      const auto n = ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT);
      ended = ended || n == 0 || (n < 0 && errno != EAGAIN);
      if (n <= 0) return text_;
      text_.append(buffer.data(), static_cast<std::size_t>(n));
    }
  }
  bool hung_up() {
    static_cast<void>(heard());
    return ended;
  }
  bool ended = false;

 private:
  int fd_;
  std::string text_;
};

class ControlSeats : public ::testing::Test {
 protected:
  ControlSeats() {
    auto made = ControlServer::listen(path_, loop_,
                                      [this](const Request& request, Reply& reply) { return answer(request, reply); });
    EXPECT_TRUE(made) << made.error();
    server_ = std::move(*made);
  }
  rt::Task<void> answer(const Request& request, Reply& reply) {
    if (request.verb == "wait") co_await rt::sleep_for(10h);
    reply.json = "{}";
    reply.lines.push_back("done");
  }
  void turn() {
    for (int i = 0; i < 10; ++i) loop_.serve();
  }
  void pass(rt::Duration time) {
    turn();
    executor_.advance(executor_.now() + time);
    turn();
  }

  std::string path_ = fmt::format("{}/control_{}.sock", ::testing::TempDir(), ::getpid());
  rt::Executor executor_;
  io::Loop loop_{executor_};
  std::unique_ptr<ControlServer> server_;
};

const std::string ask = to_json(Request{"ask", {}}) + "\n";

TEST_F(ControlSeats, SilenceAndHalfALineEnd) {
  Client silent(path_);
  Client half(path_);
  Client half_later(path_);
  Client good(path_);
  half.say("{\"verb\"");
  half_later.say(ask + "{\"verb\"");
  good.say(ask);
  turn();
  EXPECT_NE(good.heard().find("done"), std::string::npos);
  pass(29s);
  EXPECT_FALSE(silent.hung_up() || half.hung_up() || half_later.hung_up());
  pass(2s);
  EXPECT_TRUE(silent.hung_up());
  EXPECT_TRUE(half.hung_up());
  EXPECT_TRUE(half_later.hung_up());
  pass(10h);
  EXPECT_FALSE(good.hung_up());
}

TEST_F(ControlSeats, WhenAllAreTakenTheIdleOneGoesAndTheBusyStay) {
  std::vector<std::unique_ptr<Client>> busy;
  Client idle(path_);
  idle.say(ask);
  for (std::size_t i = 1; i < ControlServer::seat_rules.most; ++i) {
    busy.push_back(std::make_unique<Client>(path_));
    busy.back()->say(to_json(Request{"wait", {}}) + "\n");
    turn();
  }
  pass(20s);
  Client late(path_);
  late.say(ask);
  turn();
  EXPECT_NE(late.heard().find("done"), std::string::npos) << late.heard();
  EXPECT_TRUE(idle.hung_up());
  for (const auto& each : busy) EXPECT_FALSE(each->hung_up());
  const auto refused = [&] {
    Client one_too_many(path_);
    turn();
    return one_too_many.heard();
  }();
  EXPECT_NE(refused.find("16 commands are under way already"), std::string::npos) << refused;
}

TEST_F(ControlSeats, AFollowerThatTakesNothingEnds) {
  Client follower(path_);
  follower.say(to_json(Request{"frames", {}}) + "\n");
  turn();
  ASSERT_TRUE(server_->followed());
  const std::string line(1000, 'x');
  for (int i = 0; i < 500; ++i) server_->frame(line + "\n");
  pass(59s);
  EXPECT_TRUE(server_->followed());
  pass(2s);
  EXPECT_FALSE(server_->followed());
}

// A loop that is told of a connection again and again never sleeps; what pauses has a timer.
TEST_F(ControlSeats, WithoutDescriptorsTheListenerPauses) {
  Client waits(path_);
  std::optional<rt::Time> pauses;
  std::optional<rt::Time> later;
  {
    const test::NoDescriptors none;
    turn();
    pauses = executor_.next();
    pass(300ms);
    later = executor_.next();
  }
  EXPECT_TRUE(pauses);
  EXPECT_EQ(later, pauses) << "it was told of the connection again";
  waits.say(ask);
  pass(2s);
  EXPECT_NE(waits.heard().find("done"), std::string::npos) << "it is taken when there is room again";
}

}  // namespace
}  // namespace berth::command
