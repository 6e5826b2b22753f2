/// A master's port, for tests that speak to a `berth` by frames.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/io/open_port.hpp"
#include "interface.hpp"

namespace berth::test {

/// A master's port: sends, and waits for what comes.
class Asker final : private can::Listener {
 public:
  explicit Asker(const std::string& interface) : loop_(executor_) {
    auto port = io::open_port(loop_, {can::PortKind::socketcan, interface}, {});
    EXPECT_TRUE(port) << port.error();
    if (!port) return;
    port_ = std::move(*port);
    const std::array all{can::IdRange{0, 0x7FF}};
    port_->listen(this, all);
  }
  ~Asker() { port_.reset(); }
  void send(std::string_view frame) { port_->send(*can::parse_frame(frame), 0); }
  /// Sends it, and waits until this comes. Again after a while: between a boot-up and its SDO server a device's program
  /// may be made to wait.
  bool ask(std::string_view question, const std::string& answer) {
    heard_.clear();
    for (int i = 0; i < 12; ++i) {
      send(question);
      if (hears(answer, std::chrono::seconds(5))) return true;
    }
    return false;
  }
  bool hears(const std::string& frame, std::chrono::seconds most = std::chrono::seconds(60)) {
    return until(
        loop_, [&] { return std::ranges::find(heard_, frame) != heard_.end(); }, most);
  }
  void listen_for(std::chrono::milliseconds time) { idle(loop_, time); }
  [[nodiscard]] std::size_t count() const { return heard_.size(); }
  [[nodiscard]] bool heard(const std::string& frame) const { return std::ranges::find(heard_, frame) != heard_.end(); }

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override { heard_.push_back(can::to_string(frame)); }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}

  rt::Executor executor_;
  io::Loop loop_;
  std::unique_ptr<can::Port> port_;
  std::vector<std::string> heard_;
};

}  // namespace berth::test
