// S2.1, S2.5: negotiation on a controller that takes FD frames too: classic extended frames count, FD frames of the
// same number do not. At the port's level; on a simulated FD bus: tests/plant/negotiation_fd_world_test.cpp.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "rig.hpp"

namespace berth::device::test {
namespace {

/// An FD controller: takes and gives any frame.
struct FdPort final : can::Port {
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    sent.push_back(frame);
    last_tag = tag;
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener* who, std::span<const can::IdRange> ranges) noexcept override {
    listener = who;
    accept.assign(ranges.begin(), ranges.end());
  }
  [[nodiscard]] can::Status status() const noexcept override {
    can::Status s;
    s.bit_rate = 500'000;
    s.up = true;
    s.queued = 1;
    return s;
  }
  bool restart(std::uint32_t) noexcept override { return true; }
  void hear(const can::Frame& frame, rt::Time at) const {
    const auto fits = [&](const can::IdRange& range) { return range.contains(frame.key()); };
    if (listener != nullptr && std::ranges::any_of(accept, fits)) listener->received(frame, at);
  }
  std::vector<can::Frame> sent;
  std::vector<can::IdRange> accept;
  can::Listener* listener = nullptr;
  std::uint32_t last_tag = 0;
};

can::Frame fd(can::Frame frame, std::uint8_t size) {
  frame.fd = frame.brs = true;
  frame.size = size;
  return frame;
}

struct FdNode {
  explicit FdNode(Options options)
      : dispatcher(executor, port), device(dispatcher, minimal_description(), nullptr, std::move(options)) {
    device.power_on();
  }
  void hear(const can::Frame& frame) { port.hear(frame, executor.now()); }
  void run(rt::Duration time) { executor.advance(executor.now() + time); }
  /// The frame that was queued last is on the wire.
  void acknowledge() { port.listener->sent(port.last_tag, executor.now()); }
  rt::Executor executor;
  FdPort port;
  can::Dispatcher dispatcher;
  Device device;
};

Options negotiating() {
  Options o;
  o.address = {0x319, 2, 3, 4};
  o.negotiation = NegotiationMode::on;
  o.negotiator.configured = NodeId(0x20);
  return o;
}

TEST(NegotiationFd, OnlyTheClassicRequestIsAnswered) {
  auto options = negotiating();
  options.source = NodeIdSource::fixed;
  options.node_id = NodeId(0x31);
  FdNode node(options);
  node.run(milliseconds(10));
  node.port.sent.clear();
  const auto request = can::Frame::ext(0x100, {});
  for (const unsigned size : {0U, 8U, 64U}) node.hear(fd(request, static_cast<std::uint8_t>(size)));
  node.hear(fd(can::Frame::base(0x100, {}), 0));
  node.run(milliseconds(200));
  EXPECT_TRUE(node.port.sent.empty());
  node.hear(request);
  node.run(milliseconds(200));
  ASSERT_FALSE(node.port.sent.empty());
  EXPECT_EQ(can::to_string(node.port.sent.front()), "00000231#");
  for (const auto& frame : node.port.sent) EXPECT_FALSE(frame.fd) << "S2.5: classic extended frames only";
}

// FD traffic, whatever its identifiers, stops nobody: bytes that would win, and node-IDs that would be in use.
TEST(NegotiationFd, S2_1_FdTrafficBesideIt) {
  FdNode node(negotiating());
  node.run(milliseconds(110));
  for (unsigned i = 0; i < 200 && !node.device.node_id().configured(); ++i) {
    if (!node.port.sent.empty()) {
      EXPECT_FALSE(node.port.sent.back().fd);
      node.port.sent.clear();
      node.acknowledge();
    }
    node.hear(fd(can::Frame::ext(0x1000, {}), 0));
    node.hear(fd(can::Frame::ext(0x220, {}), 0));
    node.hear(fd(can::Frame::base(0x181, {}), 64));
    node.run(milliseconds(3));
  }
  EXPECT_EQ(node.device.node_id(), NodeId(0x20));
}

}  // namespace
}  // namespace berth::device::test
