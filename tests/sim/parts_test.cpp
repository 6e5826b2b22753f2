// The parts of a simulated controller and of the wire, each without the others.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "berth/sim/contenders.hpp"
#include "berth/sim/error_counters.hpp"
#include "berth/sim/host_queue.hpp"
#include "berth/sim/participation.hpp"
#include "berth/sim/segment_nodes.hpp"
#include "berth/sim/transmit_queue.hpp"

namespace berth::sim {
namespace {

using namespace std::chrono_literals;

rt::Time at(rt::Duration since_start) { return rt::Time{} + since_start; }

// ---- the transmit queue

TEST(TransmitQueue, TheOldestGoesFirstOrTheMostImportant) {
  for (const auto order : {TxOrder::in_order, TxOrder::priority}) {
    TransmitQueue queue(order, 3, false);
    EXPECT_TRUE(queue.push(can::Frame::base(0x300, {}), 1)) << "the first is the head";
    EXPECT_EQ(queue.push(can::Frame::base(0x200, {}), 2), order == TxOrder::priority);
    EXPECT_FALSE(queue.push(can::Frame::base(0x400, {}), 3));
    EXPECT_TRUE(queue.full());
    EXPECT_EQ(queue.head_frame(false).id, order == TxOrder::priority ? 0x200U : 0x300U);
  }
}

TEST(TransmitQueue, AFrameOnTheWireKeepsItsPlaceAndIsRepeated) {
  TransmitQueue queue(TxOrder::priority, 3, false);
  ASSERT_TRUE(queue.push(can::Frame::base(0x300, {}), 1));
  queue.begin();
  EXPECT_FALSE(queue.push(can::Frame::base(0x100, {}), 2)) << "it must wait for the end of the attempt";
  queue.mark_tried();
  queue.attempt_over();
  EXPECT_EQ(queue.head().tag, 2U);
  EXPECT_FALSE(queue.head().tried);
  EXPECT_EQ(queue.sent(), 2U);
  EXPECT_TRUE(queue.head().tried);
  EXPECT_EQ(queue.sent(), 1U);
  EXPECT_FALSE(queue.has_head());
}

TEST(TransmitQueue, AWithdrawnFrameOnTheWireIsNotRepeated) {
  TransmitQueue queue(TxOrder::in_order, 3, false);
  for (int i = 0; i < 2; ++i) static_cast<void>(queue.push(can::Frame::base(0x300, {}), 7));
  static_cast<void>(queue.push(can::Frame::base(0x301, {}), 8));
  queue.begin();
  EXPECT_FALSE(queue.withdraw(7)) << "the head stays while it is on the wire";
  EXPECT_EQ(queue.size(), 2U) << "the other one of that tag is gone";
  queue.attempt_over();
  EXPECT_EQ(queue.head().tag, 8U);
  EXPECT_TRUE(queue.withdraw(8));
  EXPECT_FALSE(queue.has_head());
}

// What the queue is to be: a list, oldest first, and which of it is the head.
class QueueModel {
 public:
  explicit QueueModel(TxOrder order) : order_(order) {}
  bool push(std::uint32_t id, std::uint32_t tag) {
    waiting_.push_back({id, tag, next_++});
    const bool first = head_ == none || (order_ == TxOrder::priority && !sending_ && id < find(head_)->id);
    if (first) head_ = waiting_.back().number;
    return first;
  }
  bool withdraw(std::uint32_t tag) {
    const auto before = head_;
    std::erase_if(waiting_, [&](const Frame& f) {
      if (f.tag != tag) return false;
      const bool on_the_wire = sending_ && f.number == head_;
      abandoned_ = abandoned_ || on_the_wire;
      return !on_the_wire;
    });
    if (find(head_) == waiting_.end()) choose();
    return head_ != before;
  }
  void begin() { sending_ = true; }
  void attempt_over() {
    if (abandoned_) waiting_.erase(find(head_));
    sending_ = abandoned_ = false;
    choose();
  }
  std::uint32_t sent() {
    const auto tag = find(head_)->tag;
    abandoned_ = true;
    attempt_over();
    return tag;
  }
  void clear() {
    waiting_.clear();
    abandoned_ = false;
    choose();
  }
  [[nodiscard]] bool sending() const { return sending_; }
  [[nodiscard]] std::size_t size() const { return waiting_.size(); }
  [[nodiscard]] std::uint32_t head_id() { return find(head_)->id; }
  [[nodiscard]] std::uint32_t head_tag() { return find(head_)->tag; }

 private:
  static constexpr int none = -1;
  struct Frame {
    std::uint32_t id;
    std::uint32_t tag;
    int number;
  };
  std::vector<Frame>::iterator find(int number) { return std::ranges::find(waiting_, number, &Frame::number); }
  void choose() {
    head_ = none;
    if (waiting_.empty()) return;
    // The first of the smallest: min_element gives the oldest of equals.
    head_ =
        (order_ == TxOrder::in_order ? waiting_.begin() : std::ranges::min_element(waiting_, {}, &Frame::id))->number;
  }
  TxOrder order_;
  std::vector<Frame> waiting_;
  int head_ = none;
  int next_ = 0;
  bool sending_ = false;
  bool abandoned_ = false;
};

TEST(TransmitQueue, KeepsItsOrderUnderAnyUse) {
  constexpr unsigned depth = 5;
  for (const auto order : {TxOrder::in_order, TxOrder::priority}) {
    TransmitQueue queue(order, depth, false);
    QueueModel model(order);
    std::uint32_t draw = 1;
    const auto below = [&](std::uint32_t limit) {
      draw = draw * 1'664'525U + 1'013'904'223U;
      return (draw >> 16U) % limit;
    };
    unsigned withdrawn = 0;
    for (int i = 0; i < 20'000; ++i) {
      SCOPED_TRACE(i);
      switch (below(16)) {
        case 0:
          if (queue.sending()) break;
          queue.clear();
          model.clear();
          break;
        case 1:
        case 2: {
          const auto tag = below(4);
          withdrawn += queue.withdraw(tag) ? 1U : 0U;
          model.withdraw(tag);
          break;
        }
        case 3:
        case 4:
        case 5:
        case 6:
          if (!queue.sending()) break;
          queue.attempt_over();
          model.attempt_over();
          break;
        case 7:
        case 8:
        case 9:
          if (!queue.sending()) break;
          ASSERT_EQ(queue.sent(), model.sent());
          break;
        case 10:
        case 11:
          if (!queue.has_head()) break;
          queue.begin();
          model.begin();
          break;
        default: {
          if (queue.full()) break;
          const auto id = 0x100 + below(6);
          const auto tag = below(4);
          ASSERT_EQ(queue.push(can::Frame::base(id, {}), tag), model.push(id, tag));
          break;
        }
      }
      ASSERT_EQ(queue.size(), model.size());
      ASSERT_EQ(queue.full(), model.size() == depth);
      ASSERT_EQ(queue.sending(), model.sending());
      ASSERT_EQ(queue.has_head(), model.size() > 0);
      if (!queue.has_head()) continue;
      ASSERT_EQ(queue.head_frame(false).id, model.head_id());
      ASSERT_EQ(queue.head().tag, model.head_tag());
    }
    EXPECT_GT(withdrawn, 100U);
  }
}

TEST(TransmitQueue, APassiveSendersFdFrameHasEsi) {
  TransmitQueue queue(TxOrder::in_order, 1, true);
  auto frame = can::Frame::base(0x300, {1});
  frame.fd = true;
  static_cast<void>(queue.push(frame, 0));
  EXPECT_FALSE(queue.head_frame(false).esi);
  EXPECT_TRUE(queue.head_frame(true).esi);
}

// ---- arbitration

TEST(Contenders, TheLowestFieldWinsAndTheOthersLose) {
  Contenders contenders;
  contenders.grow(3);
  contenders.put(0, 30);
  contenders.put(1, 10);
  contenders.put(2, 20);
  EXPECT_EQ(contenders.first().slot(), 1U);
  EXPECT_TRUE(contenders.one_wins());
  for (int i = 0; i < 2; ++i) {
    contenders.count_start();
    EXPECT_EQ(contenders.begin(1), 0U);
  }
  EXPECT_EQ(contenders.remove(1), 0U);
  EXPECT_EQ(contenders.first().slot(), 2U);
  EXPECT_EQ(contenders.take_losses(2), 2U);
  EXPECT_EQ(contenders.take_losses(2), 0U) << "each loss is told once";
  EXPECT_EQ(contenders.remove(0), 2U);
  EXPECT_FALSE(contenders.contains(0));
}

TEST(Contenders, WhatMayNotBeginYetLosesNothing) {
  Contenders contenders;
  contenders.grow(2);
  contenders.put(0, 30);
  contenders.put(1, 30);
  EXPECT_FALSE(contenders.one_wins());
  contenders.excuse(1);
  contenders.count_start();
  EXPECT_EQ(contenders.begin(0), 0U);
  EXPECT_EQ(contenders.remove(1), 0U);
}

TEST(Contenders, AnOfferBehindTheStartIsTooLateForIt) {
  Contenders contenders;
  contenders.grow(1);
  contenders.count_start();
  contenders.put(0, 30);
  EXPECT_FALSE(contenders.was_in_time(0));
  contenders.in_time(0);
  EXPECT_TRUE(contenders.was_in_time(0));
}

TEST(Contenders, KeepTheirOrderUnderAnyChange) {
  Contenders contenders;
  contenders.grow(64);
  std::vector<std::uint32_t> offered(64, 0);  // 0: nothing
  std::uint32_t draw = 1;
  for (int i = 0; i < 5000; ++i) {
    draw = draw * 1'664'525U + 1'013'904'223U;
    const std::uint32_t slot = draw >> 26U;
    if (offered[slot] != 0 && (draw >> 20U & 1U) != 0) {
      static_cast<void>(contenders.remove(slot));
      offered[slot] = 0;
    } else {
      offered[slot] = 1 + (draw >> 8U & 0xFFU);
      contenders.put(slot, offered[slot]);
    }
    std::uint64_t best = ~0ULL;
    unsigned count = 0;
    for (std::uint32_t s = 0; s < 64; ++s) {
      if (offered[s] == 0) continue;
      best = std::min(best, static_cast<std::uint64_t>(offered[s]) << 32U | s);
      ++count;
    }
    ASSERT_EQ(contenders.all().size(), count);
    if (count > 0) {
      ASSERT_EQ(contenders.first().order, best);
    }
  }
}

// ---- error counters

TEST(ErrorCounters, EachLevelIsToldOnce) {
  ErrorCounters counters;
  EXPECT_FALSE(counters.level_changed());
  counters.set(95, 0);
  EXPECT_FALSE(counters.level_changed());
  counters.set(0, 96);
  EXPECT_TRUE(counters.level_changed());
  EXPECT_FALSE(counters.level_changed());
  EXPECT_EQ(counters.state(), ErrorState::active);
  counters.set(128, 0);
  EXPECT_TRUE(counters.level_changed());
  EXPECT_TRUE(counters.passive());
  counters.set_bus_off(true);
  EXPECT_TRUE(counters.level_changed());
  EXPECT_EQ(counters.state(), ErrorState::bus_off);
  EXPECT_FALSE(counters.passive());
}

// ---- participation

TEST(Participation, CountsWholeRunsOfElevenBits) {
  Participation access;
  EXPECT_TRUE(access.takes_part());
  access.integrate(3, at(100us));
  EXPECT_TRUE(access.integrating());
  EXPECT_EQ(access.due(1us), at(133us));
  EXPECT_FALSE(access.count(at(115us), 1us));
  EXPECT_EQ(access.runs_left(), 2U);
  EXPECT_EQ(access.bits_of_run(at(115us), 1us), 4U);
  access.dominant_until(at(120us));
  EXPECT_FALSE(access.count(at(141us), 1us)) << "what was not over begins anew";
  EXPECT_TRUE(access.count(at(142us), 1us));
  EXPECT_TRUE(access.takes_part());
}

TEST(Participation, ASuspendedNodeMayNotBegin) {
  Participation access;
  access.suspend(at(8us));
  EXPECT_TRUE(access.suspended(at(7us)));
  EXPECT_FALSE(access.suspended(at(8us)));
  EXPECT_TRUE(access.end_suspension());
  EXPECT_FALSE(access.suspended(at(7us)));
  EXPECT_FALSE(access.end_suspension());
}

// ---- nodes of a segment, and the host's side

struct Host final : can::Port, can::Listener {
  can::Queued send(const can::Frame&, std::uint32_t) noexcept override { return can::Queued::closed; }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener*, std::span<const can::IdRange>) noexcept override {}
  [[nodiscard]] can::Status status() const noexcept override { return {}; }
  bool restart(std::uint32_t) noexcept override { return false; }
  void received(const can::Frame&, rt::Time) noexcept override { ++frames; }
  void sent(std::uint32_t tag, rt::Time) noexcept override { tags.push_back(tag); }
  void changed(const can::Status&, rt::Time) noexcept override { ++changes; }

  rt::Executor executor;
  unsigned frames = 0;
  unsigned changes = 0;
  std::vector<std::uint32_t> tags;
};

TEST(HostQueue, ASlowHostLosesWhatItsBufferCannotHold) {
  Host host;
  HostQueue queue(host.executor, host, 2, 10us);
  queue.listen(&host);
  const auto frame = can::Frame::base(0x100, {});
  EXPECT_TRUE(queue.received(frame, at(0us)));
  EXPECT_TRUE(queue.received(frame, at(0us)));
  EXPECT_FALSE(queue.received(frame, at(0us)));
  host.executor.advance(at(10us));
  EXPECT_EQ(host.frames, 1U);
  EXPECT_TRUE(queue.received(frame, at(10us)));
  queue.deaf(true);
  host.executor.advance(at(100us));
  EXPECT_EQ(host.frames, 3U);
  EXPECT_FALSE(queue.received(frame, at(100us)));
}

TEST(HostQueue, TellsTagsInOrderAndForgetsForAnotherListener) {
  Host host;
  HostQueue queue(host.executor, host, 2, 0us);
  queue.changed();
  queue.listen(&host);
  queue.sent(7, at(0us));
  queue.sent(0, at(0us));
  queue.sent(8, at(0us));
  queue.changed();
  host.executor.advance(at(0us));
  EXPECT_EQ(host.tags, (std::vector<std::uint32_t>{7, 8}));
  EXPECT_EQ(host.changes, 1U) << "none without a listener";
  queue.sent(9, at(0us));
  queue.listen(nullptr);
  host.executor.advance(at(1us));
  EXPECT_EQ(host.tags.size(), 2U);
}

// Puts a frame by as long as it may.
struct PuttingHost final : can::Port, can::Listener {
  can::Queued send(const can::Frame&, std::uint32_t) noexcept override { return can::Queued::closed; }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener*, std::span<const can::IdRange>) noexcept override {}
  [[nodiscard]] can::Status status() const noexcept override { return {}; }
  bool restart(std::uint32_t) noexcept override { return false; }
  bool put_by(const can::Frame& frame, rt::Time) noexcept override {
    if (puts) heard.push_back(frame.id);
    return puts;
  }
  void received(const can::Frame& frame, rt::Time) noexcept override { heard.push_back(frame.id); }
  void sent(std::uint32_t tag, rt::Time) noexcept override { heard.push_back(tag); }
  void changed(const can::Status&, rt::Time) noexcept override {}

  rt::Executor executor;
  bool puts = true;
  std::vector<std::uint32_t> heard;  // identifiers and tags
};

TEST(HostQueue, AFrameThatIsPutByNeedsNoJobAndTakesNoRoom) {
  PuttingHost host;
  HostQueue queue(host.executor, host, 1, 0us);
  queue.listen(&host);
  for (const std::uint32_t id : {0x101U, 0x102U, 0x103U}) {
    EXPECT_TRUE(queue.received(can::Frame::base(id, {}), at(0us)));
  }
  EXPECT_EQ(host.heard, (std::vector<std::uint32_t>{0x101, 0x102, 0x103}));
  host.executor.advance(at(1us));
  EXPECT_EQ(host.heard.size(), 3U) << "none comes twice";
  EXPECT_EQ(host.executor.jobs_run(), 0U);
}

TEST(HostQueue, WhatWaitsIsNotOvertakenByAFrameThatCouldBePutBy) {
  PuttingHost host;
  HostQueue queue(host.executor, host, 4, 0us);
  queue.listen(&host);
  host.puts = false;
  EXPECT_TRUE(queue.received(can::Frame::base(0x101, {}), at(0us)));
  host.puts = true;
  EXPECT_TRUE(queue.received(can::Frame::base(0x102, {}), at(0us)));
  host.executor.advance(at(0us));
  EXPECT_EQ(host.heard, (std::vector<std::uint32_t>{0x101, 0x102}));
  queue.sent(7, at(1us));
  EXPECT_TRUE(queue.received(can::Frame::base(0x103, {}), at(1us)));
  host.executor.advance(at(1us));
  EXPECT_EQ(host.heard, (std::vector<std::uint32_t>{0x101, 0x102, 7, 0x103}));
}

TEST(HostQueue, ASlowOrDeafHostPutsNothingBy) {
  PuttingHost host;
  HostQueue queue(host.executor, host, 1, 10us);
  queue.listen(&host);
  EXPECT_TRUE(queue.received(can::Frame::base(0x101, {}), at(0us)));
  EXPECT_TRUE(host.heard.empty());
  EXPECT_FALSE(queue.received(can::Frame::base(0x102, {}), at(0us)));
  host.executor.advance(at(10us));
  EXPECT_EQ(host.heard, (std::vector<std::uint32_t>{0x101}));
  HostQueue deaf(host.executor, host, 1, 0us);
  deaf.listen(&host);
  deaf.deaf(true);
  EXPECT_FALSE(deaf.received(can::Frame::base(0x103, {}), at(10us)));
  EXPECT_EQ(host.heard.size(), 1U);
}

TEST(SegmentNodes, AGoodFrameCountsForItsSenderAndItsReceivers) {
  Host host;
  const auto node = [&](int number) {
    return std::unique_ptr<BusNode>(new BusNode{.controller = nullptr,
                                                .number = number,
                                                .bit_rate = 1'000'000,
                                                .powered = true,
                                                .listen_only = false,
                                                .transmit{TxOrder::in_order, 1, false},
                                                .host{host.executor, host, 1, 0us}});
  };
  const auto sender = node(0);
  const auto receiver = node(1);
  SegmentNodes nodes;
  nodes.join(*sender);
  nodes.join(*receiver);
  nodes.recount();
  EXPECT_EQ(nodes.acknowledgers(), 2U);
  EXPECT_FALSE(nodes.any_noisy());
  sender->set_counters(129, 0);
  receiver->set_counters(0, 200);
  EXPECT_TRUE(nodes.any_noisy());
  BusNode* const senders[] = {sender.get()};
  nodes.count_good_frame(senders, at(500us));
  EXPECT_EQ(sender->errors.tec(), 128);
  EXPECT_TRUE(sender->access.suspended(at(507us))) << "still passive: 8 bits";
  EXPECT_FALSE(sender->access.suspended(at(508us)));
  EXPECT_TRUE(nodes.any_suspended());
  EXPECT_EQ(receiver->errors.rec(), 127) << "rule 8";
  nodes.leave(*sender);
  receiver->set_counters(0, 0);
  EXPECT_FALSE(nodes.any_noisy());
}

}  // namespace
}  // namespace berth::sim
