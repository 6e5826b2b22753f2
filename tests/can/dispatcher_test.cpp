// The dispatcher against a port that writes down what it is told.
#include "berth/can/dispatcher.hpp"

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "berth/base/random.hpp"

using namespace berth;
using can::Confirmation;
using can::Frame;
using can::IdRange;
using can::Queued;
using rt::Time;
using namespace std::chrono_literals;

namespace {

struct FakePort final : can::Port {
  Queued send(const Frame& frame, std::uint32_t tag) noexcept override {
    if (answer == Queued::yes) queue.emplace_back(tag, frame);
    return answer;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    withdrawn.push_back(tag);
    std::erase_if(queue, [&](const auto& entry) { return entry.first == tag; });
  }
  void listen(can::Listener* who, std::span<const IdRange> ranges) noexcept override {
    listener = who;
    accept.assign(ranges.begin(), ranges.end());
  }
  [[nodiscard]] can::Status status() const noexcept override { return {}; }
  bool restart(std::uint32_t) noexcept override {
    queue.clear();
    return true;
  }

  // A frame from the bus: through the filter as a controller would.
  bool hear(const Frame& frame, Time at = Time(1ms)) {
    const auto passes = std::ranges::any_of(accept, [&](IdRange r) { return r.contains(frame.key()); });
    if (passes && listener != nullptr) listener->received(frame, at);
    return passes;
  }
  // The oldest queued frame is on the wire now.
  void put_on_wire(Time at = Time(1ms)) {
    const auto tag = queue.front().first;
    queue.erase(queue.begin());
    if (tag != 0 && listener != nullptr) listener->sent(tag, at);
  }

  Queued answer = Queued::yes;
  can::Listener* listener = nullptr;
  std::vector<IdRange> accept;
  std::vector<std::pair<std::uint32_t, Frame>> queue;
  std::vector<std::uint32_t> withdrawn;
};

struct Ear final : can::Handler {
  explicit Ear(std::function<void(const Frame&, Time)> f) : what(std::move(f)) {}
  void received(const Frame& frame, Time at) noexcept override { what(frame, at); }
  std::function<void(const Frame&, Time)> what;
};

struct Receipt final : Confirmation {
  explicit Receipt(std::function<void(Time)> f) : what(std::move(f)) {}
  void sent(Time at) noexcept override { what(at); }
  std::function<void(Time)> what;
};

struct DispatcherTest : ::testing::Test {
  rt::Executor executor;
  FakePort port;
  can::Dispatcher dispatcher{executor, port};
  std::vector<int> log;

  std::unique_ptr<Ear> ear(int name) {
    return std::make_unique<Ear>([this, name](const Frame&, Time) { log.push_back(name); });
  }
  static Frame base(std::uint32_t id) { return Frame::base(id, {1, 2}); }
};

TEST_F(DispatcherTest, EachHearsWhatItAskedForWithFrameAndTime) {
  Frame got;
  Time when{};
  Ear one([&](const Frame& f, Time t) {
    got = f;
    when = t;
  });
  auto other = ear(2);
  dispatcher.add(can::only(0x581), one);
  dispatcher.add({0x700, 0x77F}, *other);
  EXPECT_TRUE(port.hear(Frame::base(0x581, {9, 8, 7}), Time(3ms)));
  EXPECT_EQ(got, Frame::base(0x581, {9, 8, 7}));
  EXPECT_EQ(when, Time(3ms));
  EXPECT_FALSE(port.hear(base(0x582)));
  EXPECT_TRUE(port.hear(base(0x705)));
  EXPECT_EQ(log, std::vector{2});
}

TEST_F(DispatcherTest, SeveralHandlersOfOneKeyInTheOrderOfAdding) {
  auto a = ear(1), b = ear(2), c = ear(3), d = ear(4);
  dispatcher.add({0x700, 0x7FF}, *c);
  dispatcher.add(can::only(0x705), *a);
  dispatcher.add({0x000, 0x7FF}, *d);
  dispatcher.add({0x705, 0x706}, *b);
  port.hear(base(0x705));
  EXPECT_EQ(log, (std::vector{3, 1, 4, 2}));
}

TEST_F(DispatcherTest, BaseAndExtendedAreDifferentKeys) {
  auto a = ear(1), b = ear(2);
  dispatcher.add(can::only(0x100), *a);
  dispatcher.add(can::only(0x100 | can::extended_flag), *b);
  port.hear(base(0x100));
  port.hear(Frame::ext(0x100, {1}));
  EXPECT_EQ(log, (std::vector{1, 2}));
}

TEST_F(DispatcherTest, FilterIsSortedAndMerged) {
  auto a = ear(1), b = ear(2);
  dispatcher.add(can::only(0x705), *a);
  dispatcher.add(can::only(0x702), *b);
  dispatcher.add({0x703, 0x704}, *a);
  dispatcher.add(can::only(0x080), *a);
  EXPECT_EQ(port.accept, (std::vector<IdRange>{{0x080, 0x080}, {0x702, 0x705}}));
  dispatcher.add({0x9F500000, 0x9F53FFFC}, *a);
  dispatcher.add({0x9F53FFFD, 0x9F940000}, *b);
  dispatcher.add({0x9F500000, 0x9F500001}, *b);
  EXPECT_EQ(port.accept, (std::vector<IdRange>{{0x080, 0x080}, {0x702, 0x705}, {0x9F500000, 0x9F940000}}));
  dispatcher.remove(*b);
  EXPECT_EQ(port.accept, (std::vector<IdRange>{{0x080, 0x080}, {0x703, 0x705}, {0x9F500000, 0x9F53FFFC}}));
  b.reset();
  a.reset();
  EXPECT_TRUE(port.accept.empty());
}

TEST_F(DispatcherTest, FilterAtTheEdges) {
  auto a = ear(1), b = ear(2);
  dispatcher.add({0, UINT32_MAX}, *a);
  dispatcher.add(can::all_extended, *b);
  dispatcher.add(can::only(0), *b);
  dispatcher.add(can::only(UINT32_MAX), *b);
  EXPECT_EQ(port.accept, (std::vector<IdRange>{{0, UINT32_MAX}}));
  dispatcher.remove(*a);
  EXPECT_EQ(port.accept, (std::vector<IdRange>{can::only(0), can::all_extended, can::only(UINT32_MAX)}));
  EXPECT_TRUE(port.hear(base(0)));
  EXPECT_TRUE(port.hear(Frame::ext(can::extended_mask, {})));
  EXPECT_EQ(log, (std::vector{2, 2}));
}

TEST_F(DispatcherTest, RemoteFramesGoByTheirKeyToo) {
  auto a = ear(1);
  dispatcher.add(can::only(0x705), *a);
  EXPECT_TRUE(port.hear(Frame::request(0x705, 1)));
  EXPECT_EQ(log, std::vector{1});
}

TEST_F(DispatcherTest, AHandlerRemovesItselfAndOthersWhileItIsCalled) {
  auto b = ear(2), c = ear(3), d = ear(4);
  std::unique_ptr<Ear> a;
  a = std::make_unique<Ear>([&](const Frame&, Time) {
    log.push_back(1);
    dispatcher.remove(*b);
    c.reset();
    dispatcher.remove(*a);
  });
  for (auto* e : {a.get(), b.get(), c.get(), d.get()}) dispatcher.add(can::only(0x80), *e);
  port.hear(base(0x80));
  port.hear(base(0x80));
  EXPECT_EQ(log, (std::vector{1, 4, 4}));
}

TEST_F(DispatcherTest, WhatIsAddedInACallbackHearsTheNextFrame) {
  std::unique_ptr<Ear> late;
  Ear adds([&](const Frame&, Time) {
    log.push_back(1);
    if (!late) {
      late = ear(2);
      dispatcher.add(can::only(0x80), *late);
      dispatcher.add({0x00, 0x7FF}, *late);
    }
  });
  auto last = ear(3);
  dispatcher.add(can::only(0x80), adds);
  dispatcher.add(can::only(0x80), *last);
  port.hear(base(0x80));
  EXPECT_EQ(log, (std::vector{1, 3}));
  port.hear(base(0x80));
  EXPECT_EQ(log, (std::vector{1, 3, 1, 3, 2, 2}));
}

// A procedure's next step registers anew in the callback of the last one: that must not loop.
TEST_F(DispatcherTest, RegisteringAnewInACallbackEnds) {
  std::unique_ptr<Ear> self;
  int calls = 0;
  self = std::make_unique<Ear>([&](const Frame&, Time) {
    if (++calls > 100) return;
    dispatcher.remove(*self);
    dispatcher.add(can::only(0x80), *self);
  });
  dispatcher.add(can::only(0x80), *self);
  port.hear(base(0x80));
  EXPECT_EQ(calls, 1);
  port.hear(base(0x80));
  EXPECT_EQ(calls, 2);
}

TEST_F(DispatcherTest, AHandlerDestroysItselfWhileItIsCalled) {
  std::unique_ptr<Ear> self;
  auto b = ear(2);
  self = std::make_unique<Ear>([&](const Frame&, Time) {
    auto& owner = self;
    log.push_back(1);
    owner.reset();
  });
  dispatcher.add(can::only(0x80), *self);
  dispatcher.add(can::only(0x80), *b);
  port.hear(base(0x80));
  EXPECT_EQ(log, (std::vector{1, 2}));
}

TEST_F(DispatcherTest, AHandlerBelongsToOneDispatcher) {
  FakePort second_port;
  auto a = ear(1);
  {
    can::Dispatcher second(executor, second_port);
    dispatcher.add(can::only(0x80), *a);
    second.add(can::only(0x81), *a);
    EXPECT_TRUE(port.accept.empty());
    EXPECT_TRUE(second_port.hear(base(0x81)));
  }
  EXPECT_EQ(second_port.listener, nullptr);
  dispatcher.add(can::only(0x80), *a);
  EXPECT_TRUE(port.hear(base(0x80)));
  EXPECT_EQ(log, (std::vector{1, 1}));
}

TEST_F(DispatcherTest, ConfirmationIsToldOnceAndAtTheRightTime) {
  std::vector<Time> told;
  Receipt receipt([&](Time at) {
    EXPECT_FALSE(receipt.pending());
    told.push_back(at);
  });
  EXPECT_EQ(dispatcher.send(base(1), receipt), Queued::yes);
  EXPECT_EQ(dispatcher.send(base(2)), Queued::yes);
  EXPECT_TRUE(receipt.pending());
  port.put_on_wire(Time(5ms));
  port.put_on_wire(Time(6ms));
  EXPECT_EQ(told, std::vector{Time(5ms)});
}

TEST_F(DispatcherTest, ConfirmationsComeForTheirOwnFrames) {
  std::vector<std::unique_ptr<Receipt>> receipts;
  for (int i = 0; i < 40; ++i) {
    receipts.push_back(std::make_unique<Receipt>([this, i](Time) { log.push_back(i); }));
    dispatcher.send(base(static_cast<std::uint32_t>(i)), *receipts.back());
  }
  std::vector<int> expected;
  Random random(3);
  while (!port.queue.empty()) {
    const auto pick = random.below(port.queue.size());  // a port that sends by priority confirms in any order
    std::swap(port.queue[0], port.queue[pick]);
    expected.push_back(static_cast<int>(port.queue[0].second.id));
    port.put_on_wire();
  }
  EXPECT_EQ(log, expected);
  EXPECT_EQ(log.size(), 40U);
}

TEST_F(DispatcherTest, WithdrawnIsNotToldEvenWhenTheFrameWasOnTheWireAlready) {
  Receipt receipt([&](Time) { log.push_back(1); });
  dispatcher.send(base(1), receipt);
  const auto on_wire = port.queue.front().first;
  dispatcher.withdraw(receipt);
  EXPECT_FALSE(receipt.pending());
  EXPECT_EQ(port.withdrawn, std::vector{on_wire});
  EXPECT_TRUE(port.queue.empty());
  port.listener->sent(on_wire, Time(1ms));
  EXPECT_TRUE(log.empty());
  dispatcher.withdraw(receipt);
  EXPECT_EQ(port.withdrawn.size(), 1U);
}

TEST_F(DispatcherTest, ConfirmationDestroyedWhileItIsPending) {
  auto receipt = std::make_unique<Receipt>([&](Time) { log.push_back(1); });
  dispatcher.send(base(1), *receipt);
  const auto tag = port.queue.front().first;
  receipt.reset();
  EXPECT_EQ(port.withdrawn, std::vector{tag});
  port.listener->sent(tag, Time(1ms));
  EXPECT_TRUE(log.empty());
}

TEST_F(DispatcherTest, SendingAgainWithOneConfirmationForgetsTheFirstFrame) {
  Receipt receipt([&](Time) { log.push_back(1); });
  dispatcher.send(base(1), receipt);
  dispatcher.send(base(2), receipt);
  ASSERT_EQ(port.queue.size(), 1U);
  EXPECT_EQ(port.queue[0].second.id, 2U);
  port.put_on_wire();
  EXPECT_EQ(log, std::vector{1});
}

TEST_F(DispatcherTest, AFrameThatIsNotQueuedIsNeverConfirmed) {
  Receipt receipt([&](Time) { log.push_back(1); });
  for (const auto answer : {Queued::full, Queued::bus_off, Queued::listen_only, Queued::closed}) {
    port.answer = answer;
    EXPECT_EQ(dispatcher.send(base(1), receipt), answer);
    EXPECT_FALSE(receipt.pending());
  }
}

TEST_F(DispatcherTest, SendsAgainFromItsConfirmation) {
  std::unique_ptr<Receipt> receipt;
  int left = 3;
  receipt = std::make_unique<Receipt>([&](Time) {
    log.push_back(left);
    if (--left > 0) dispatcher.send(base(1), *receipt);
  });
  dispatcher.send(base(1), *receipt);
  while (!port.queue.empty()) port.put_on_wire();
  EXPECT_EQ(log, (std::vector{3, 2, 1}));
}

TEST_F(DispatcherTest, HandlersAndConfirmationsOutliveTheDispatcher) {
  FakePort second_port;
  auto a = ear(1);
  auto receipt = std::make_unique<Receipt>([&](Time) { log.push_back(1); });
  {
    can::Dispatcher second(executor, second_port);
    second.add(can::only(0x80), *a);
    second.send(base(1), *receipt);
  }
  EXPECT_FALSE(receipt->pending());
  a.reset();
  receipt.reset();
  EXPECT_TRUE(log.empty());
}

TEST_F(DispatcherTest, StatusGoesToItsHandler) {
  struct Watch final : can::StatusHandler {
    void changed(const can::Status& s, Time t) noexcept override {
      tec = s.tec;
      at = t;
    }
    int tec = 0;
    Time at{};
  } watch;
  can::Status status;
  status.tec = 128;
  port.listener->changed(status, Time(1ms));
  dispatcher.on_status(&watch);
  port.listener->changed(status, Time(2ms));
  EXPECT_EQ(watch.tec, 128);
  EXPECT_EQ(watch.at, Time(2ms));
  dispatcher.on_status(nullptr);
  port.listener->changed(status, Time(3ms));
  EXPECT_EQ(watch.at, Time(2ms));
}

// Random registrations against the plain definition: everyone whose range holds the key, in the order of adding.
TEST_F(DispatcherTest, RandomRangesAgainstTheDefinition) {
  Random random(11);
  for (int round = 0; round < 300; ++round) {
    std::vector<std::unique_ptr<Ear>> ears;
    std::vector<std::pair<IdRange, int>> registered;
    for (int i = 0; i < 12; ++i) ears.push_back(ear(i));
    const auto draw = [&] {
      const auto number = static_cast<std::uint32_t>(random.below(24));
      return random.below(2) == 0 ? number : (number | can::extended_flag);
    };
    for (int i = 0; i < 20; ++i) {
      const auto name = static_cast<int>(random.below(ears.size()));
      if (random.below(5) == 0) {
        dispatcher.remove(*ears[static_cast<std::size_t>(name)]);
        std::erase_if(registered, [&](const auto& r) { return r.second == name; });
        continue;
      }
      auto first = draw(), last = draw();
      if (first > last) std::swap(first, last);
      dispatcher.add({first, last}, *ears[static_cast<std::size_t>(name)]);
      registered.emplace_back(IdRange{first, last}, name);
    }
    for (int i = 0; i < 48; ++i) {
      const auto id = static_cast<std::uint32_t>(i / 2);
      const auto frame = i % 2 == 0 ? Frame::base(id, {}) : Frame::ext(id, {});
      std::vector<int> expected;
      for (const auto& [range, name] : registered) {
        if (range.contains(frame.key())) expected.push_back(name);
      }
      log.clear();
      EXPECT_EQ(port.hear(frame), !expected.empty());
      ASSERT_EQ(log, expected) << "round " << round << ' ' << can::to_string(frame);
    }
  }
}

}  // namespace
