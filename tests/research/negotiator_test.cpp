// The negotiation's state machine by itself, against holders that the test plays.
#include "berth/research/negotiator.hpp"
#include "berth/research/negotiation_frames.hpp"

#include <gtest/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>

#include <set>

#include "berth/sim/world.hpp"

namespace berth::research {
namespace {

using namespace std::chrono_literals;

/// One device on a bus where whoever is in `holders` answers ReqUsedNodeId.
class Alone : public ::testing::Test, private NegotiatorOwner {
 protected:
  // Each millisecond what is queued goes onto the wire, and a request is answered.
  void run(rt::Duration time) {
    for (rt::Duration done{0}; done < time; done += 1ms) {
      world_.run_for(1ms);
      const auto frame = std::exchange(queued_, std::nullopt);
      if (!frame) continue;
      negotiator_.sent();
      if (!(*frame == request_used())) continue;
      for (const auto id : holders_) negotiator_.received(used(NodeId(id)));
    }
  }

  sim::World world_{1};
  std::set<std::uint8_t> holders_;
  unsigned exhausted_ = 0;
  Negotiator negotiator_{world_.executor(), *this, {.address = {1, 2, 3, 4}, .configured = NodeId(5)}};

 private:
  bool send(const can::Frame& frame) noexcept override {
    queued_ = frame;
    return true;
  }
  void withdraw() noexcept override { queued_.reset(); }
  bool nothing_queued() const noexcept override { return !queued_; }
  std::uint32_t bit_rate() const noexcept override { return 125'000; }
  void node_id_taken(NodeId) noexcept override {}
  void node_id_lost(NodeId, IdLoss) noexcept override {}
  void all_taken() noexcept override { ++exhausted_; }
  void node_id_kept(NodeId) noexcept override {}

  std::optional<can::Frame> queued_;
};

// S2.29: a device that yielded a node-ID to its holder takes it when the holder is gone and no other is free.
TEST_F(Alone, ANodeIdThatWasLostIsTakenWhenItIsFreeAgain) {
  negotiator_.start();
  run(500ms);
  ASSERT_EQ(negotiator_.node_id(), NodeId(5));
  for (std::uint8_t id = 1; id <= 127; ++id) holders_.insert(id);
  negotiator_.received(used(NodeId(5)));
  ASSERT_EQ(negotiator_.lost(), IdLoss::defended);
  run(60s);
  ASSERT_GT(exhausted_, 0U);
  ASSERT_FALSE(negotiator_.node_id().configured());
  holders_.erase(5);
  run(60s);
  EXPECT_EQ(negotiator_.node_id(), NodeId(5));
}

// S2.25: right behind the loss it takes another, though nobody was heard to have the lost one: the holder's answer may
// have been lost.
TEST_F(Alone, RightBehindALossAnotherIsTaken) {
  negotiator_.start();
  run(500ms);
  ASSERT_EQ(negotiator_.node_id(), NodeId(5));
  negotiator_.received(used(NodeId(5)));
  ASSERT_FALSE(negotiator_.node_id().configured());
  run(2s);
  EXPECT_EQ(negotiator_.node_id(), NodeId(6));
}

}  // namespace
}  // namespace berth::research
