/// A simulated bus in real time, a socketcand server before it, and clients that are plain sockets, in one thread.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>
#include <vector>

#include "berth/io/stream.hpp"
#include "berth/serve/socketcand_server.hpp"
#include "berth/sim/world.hpp"

namespace berth::serve {

using namespace std::chrono_literals;

inline constexpr can::IdRange everything[] = {can::all_base, can::all_extended};

class Ear final : public can::Listener {
 public:
  void received(const can::Frame& f, rt::Time) noexcept override { frames.push_back(f); }
  void sent(std::uint32_t tag, rt::Time) noexcept override { tags.push_back(tag); }
  void changed(const can::Status& s, rt::Time) noexcept override { ups.push_back(s.up); }
  std::vector<can::Frame> frames;
  std::vector<std::uint32_t> tags;
  std::vector<bool> ups;
};

class Rig : public ::testing::Test {
 protected:
  Rig() {
    bus_ = &world_.add_bus("backbone", 1'000'000);
    peer_ = bus_->attach({.name = "peer", .queue_depth = 4096});
    peer_->listen(&ear_, everything);
  }
  void serve(ServerOptions options = {}) {
    options.epoch = 1'700'000'000s;
    options.tell = [this](const std::string& text) { told_.push_back(text); };
    auto made = SocketcandServer::listen(
        loop_, {"127.0.0.1", port_},
        [this](const std::string& name, std::string& why) -> std::unique_ptr<can::Port> {
          why = "none of this name";
          if (name != "backbone" && name != "left side") return nullptr;
          return bus_->attach({.name = "client"});
        },
        std::move(options));
    ASSERT_TRUE(made) << made.error();
    server_ = std::move(*made);
    port_ = server_->where().port;
  }
  // Until `done`; a loaded machine may take long.
  template <class Done>
  bool run_until(Done done, std::chrono::seconds limit = 60s) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!done()) {
      if (std::chrono::steady_clock::now() > end) return false;
      loop_.turn(1ms);
      other_loop_.serve();
    }
    return true;
  }
  void run_for(std::chrono::milliseconds time) {
    const auto end = std::chrono::steady_clock::now() + time;
    run_until([&] { return std::chrono::steady_clock::now() > end; });
  }

  /// Its socket does not block.
  class Socket {
   public:
    explicit Socket(Rig& rig, int receive_buffer = 0) : rig_(&rig) {
      fd_ = io::begin_connect(io::look_up({"127.0.0.1", rig.port_}).value().front());
      if (receive_buffer > 0) ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    }
    ~Socket() { close(); }
    Socket(const Socket&) = delete;
    Socket& operator=(const Socket&) = delete;
    void close() {
      if (fd_ >= 0) ::close(fd_);
      fd_ = -1;
    }
    // All of it, however long the server makes it wait.
    void say(std::string_view text) {
      ASSERT_TRUE(rig_->run_until([&] {
        const auto n = ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
        if (n > 0) text.remove_prefix(static_cast<std::size_t>(n));
        return text.empty() || (n < 0 && errno != EAGAIN);
      }));
    }
    // What came so far.
    const std::string& heard() {
      std::array<char, 65536> buffer;
      for (;;) {
        const auto n = ::recv(fd_, buffer.data(), buffer.size(), MSG_DONTWAIT);
        if (n == 0 || (n < 0 && errno != EAGAIN)) ended = true;
        if (n <= 0) return text_;
        text_.append(buffer.data(), static_cast<std::size_t>(n));
      }
    }
    bool hear(const std::string& expected) {
      const bool good = rig_->run_until([&] { return heard().size() >= expected.size() || ended; }, 20s);
      EXPECT_EQ(text_, expected);
      const bool equal = good && text_ == expected;
      text_.clear();
      return equal;
    }
    bool contains(const std::string& expected) {
      return rig_->run_until([&] { return heard().find(expected) != std::string::npos; }, 20s);
    }
    bool hung_up() {
      return rig_->run_until(
          [&] {
            heard();
            return ended;
          },
          20s);
    }
    // As python-can does it.
    void join(const std::string& bus = "backbone", bool raw = true) {
      ASSERT_TRUE(hear("< hi >"));
      say("< open " + bus + " >");
      ASSERT_TRUE(hear("< ok >"));
      if (!raw) return;
      say("< rawmode >");
      ASSERT_TRUE(hear("< ok >"));
    }
    void forget() { text_.clear(); }
    [[nodiscard]] int fd() const { return fd_; }
    bool ended = false;

   private:
    Rig* rig_;
    int fd_ = -1;
    std::string text_;
  };

  sim::World world_;
  sim::Bus* bus_ = nullptr;
  Ear ear_;
  std::unique_ptr<sim::Controller> peer_;
  io::Loop loop_{world_.executor()};
  rt::Executor other_;
  io::Loop other_loop_{other_};
  std::uint16_t port_ = 0;
  std::vector<std::string> told_;
  std::unique_ptr<SocketcandServer> server_;
};

}  // namespace berth::serve
