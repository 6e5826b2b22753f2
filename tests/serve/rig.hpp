/// A simulated bus in real time, a socketcand server before it, and clients that are plain sockets, in one thread.
#pragma once

#include <gtest/gtest.h>
#include <poll.h>
#include <chrono>
#include <cstdint>

#include <string>
#include <vector>

#include "berth/io/stream.hpp"
#include "berth/serve/socketcand_server.hpp"
#include "berth/sim/world.hpp"
#include "client_socket.hpp"

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

  // By the executor's clock alone.
  void pass(rt::Duration time) { world_.executor().advance(world_.executor().now() + time); }

  class Socket : public ClientSocket {
   public:
    explicit Socket(Rig& rig, int receive_buffer = 0)
        : ClientSocket([&rig](const std::function<bool()>& done) { return rig.run_until(done, 20s); },
                       {"127.0.0.1", rig.port_}, receive_buffer) {}
    // As python-can does it.
    void join(const std::string& bus = "backbone", bool raw = true) {
      ASSERT_TRUE(hear("< hi >"));
      say("< open " + bus + " >");
      ASSERT_TRUE(hear("< ok >"));
      if (!raw) return;
      say("< rawmode >");
      ASSERT_TRUE(hear("< ok >"));
    }
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
