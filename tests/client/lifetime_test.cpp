// Ends and nestings: nodes and networks that go while something is pending, callbacks that do what callbacks must not,
// many things at once, several networks.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::client::test {
namespace {

// How often something ended, and how.
struct Ends {
  int count = 0;
  std::optional<Errc> code;
  template <class T>
  void note(const Outcome<T>& outcome) {
    ++count;
    code = outcome ? std::nullopt : std::optional(outcome.error().code);
  }
};

rt::Task<void> read_and_note(RemoteNode& node, const char* name, Ends& ends) {
  const auto value = co_await node.read<std::uint32_t>(name);
  ends.note(value);
}

rt::Task<void> write_and_note(RemoteNode& node, Ends& ends) {
  const Bytes much(800, 1);
  const auto done = co_await node.write("DOMAIN", much);
  ends.note(done);
}

rt::Task<void> subscribe_and_note(RemoteNode& node, Ends& ends) {
  const auto pdo = co_await node.subscribe(1);
  ends.note(pdo);
}

rt::Task<void> command_and_note(RemoteNode& node, Ends& ends) {
  const auto sent = co_await node.nmt(co::NmtCommand::stop);
  ends.note(sent);
}

rt::Task<void> wait_for_emcy(RemoteNode& node, Ends& ends) {
  const auto event = co_await node.next_emcy(rt::never);
  ++ends.count;
  if (!event) ends.code = event.error().code;
}

// Everything that can be pending, begun `before` the node is destroyed; each ends once, no callback comes.
struct Pending {
  explicit Pending(Rig& rig) : scope(rig.world.executor()) {
    scope.spawn(read_and_note(*rig.node, "UNSIGNED32", ends[0]));
    scope.spawn(write_and_note(*rig.node, ends[1]));
    scope.spawn(subscribe_and_note(*rig.node, ends[2]));
    scope.spawn(read_and_note(*rig.node, "Read only", ends[3]));
    scope.spawn(command_and_note(*rig.node, ends[4]));
    scope.spawn(wait_for_emcy(*rig.node, ends[5]));
    rig.run(0ms);  // each has begun
    rig.node->read<std::uint32_t>("UNSIGNED32", [this](const auto&) { ++called, ++answered[0]; });
    rig.node->write("UNSIGNED8", 1, [this](const auto&) { ++called, ++answered[1]; });
    rig.node->subscribe(2, [this](const auto&) { ++called, ++answered[2]; });
    rig.node->nmt(co::NmtCommand::stop, [this](const auto&) { ++called, ++answered[3]; });
    rig.node->on_emcy([this](const auto&) { ++called; });
    rig.node->on_state([this](const auto&) { ++called; });
  }
  rt::Scope scope;
  std::array<Ends, 6> ends{};
  std::array<int, 4> answered{};  // calls back of each operation
  int called = 0;                 // all calls back
};

// HC5.2: at every instant of what is pending, in several orders of what happens at once.
TEST(ClientLifetime, HC5_2_ANodeDestroyedWhileAllIsPending) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    for (int step = 0; step < 60; ++step) {
      Rig rig({}, seed);
      Pending pending(rig);
      for (int i = 0; i < step; ++i) rig.world.step(rig.world.now() + 1s);
      const int called = pending.called;
      const auto before = pending.ends;
      rig.node.reset();
      EXPECT_EQ(pending.called, called) << "no callback inside the destructor";
      for (std::size_t i = 0; i < 6; ++i)
        EXPECT_EQ(pending.ends[i].count, before[i].count) << "nobody resumes inside it";
      rig.run(0ms);
      for (std::size_t i = 0; i < 6; ++i) {
        ASSERT_EQ(pending.ends[i].count, 1) << "seed " << seed << " step " << step << " operation " << i;
        if (before[i].count == 0) {
          EXPECT_EQ(pending.ends[i].code, Errc::cancelled) << step << " " << i;
        }
      }
      rig.device->device.errors().raise(0x1000, 0);
      rig.run(3s);
      EXPECT_EQ(pending.called, called) << "none calls back afterwards";
      for (const auto& ends : pending.ends) EXPECT_EQ(ends.count, 1);
      EXPECT_EQ(pending.scope.running(), 0U);
    }
  }
}

// Destroys the node some jobs after the n-th frame, in the same instant: between an answer and who waits for it.
struct Destroyer final : rt::Job, can::Tap {
  Destroyer(Rig& r, int n, int hops) : rig(r), frames(n), jobs(hops) { rig.bus.bus.add_tap(*this); }
  ~Destroyer() { rig.bus.bus.remove_tap(*this); }
  void frame(const can::Frame&, rt::Time, int) noexcept override {
    if (frames-- == 0) rig.world.executor().post(*this);
  }
  void run() noexcept override {
    if (jobs-- > 0) return rig.world.executor().post(*this);
    rig.node.reset();
  }
  Rig& rig;
  int frames;
  int jobs;
};

// HC5.2: and at every job of every instant.
TEST(ClientLifetime, HC5_2_ANodeDestroyedBetweenTwoJobs) {
  for (int frames = 0; frames < 20; ++frames) {
    for (int jobs = 0; jobs < 10; ++jobs) {
      Rig rig;
      Ends ends;
      int called = 0;
      rt::Scope scope(rig.world.executor());
      scope.spawn(subscribe_and_note(*rig.node, ends));
      rig.node->open(1, [&](const auto&) { called += rig.node != nullptr ? 1 : 100; });
      Destroyer destroyer(rig, frames, jobs);
      rig.run(50ms);
      ASSERT_EQ(ends.count, 1) << frames << " " << jobs;
      EXPECT_LE(called, 1);
      EXPECT_EQ(rig.node, nullptr);
      EXPECT_EQ(scope.running(), 0U);
    }
  }
}

TEST(ClientLifetime, ANetworkDestroyedWhileAllIsPending) {
  for (int step = 0; step < 60; ++step) {
    Rig rig({}, static_cast<std::uint64_t>(step % 3));
    Pending pending(rig);
    for (int i = 0; i < step; ++i) rig.world.step(rig.world.now() + 1s);
    rig.network.reset();
    rig.run(1ms);
    for (const auto& ends : pending.ends) EXPECT_EQ(ends.count, 1);
    EXPECT_EQ(pending.answered, (std::array{1, 1, 1, 1})) << step;
    EXPECT_EQ(pending.scope.running(), 0U);
    EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>("Device type")).error().code, Errc::cancelled);
    EXPECT_EQ(rig.get(rig.node->nmt(co::NmtCommand::start)).error().code, Errc::cancelled);
    EXPECT_EQ(rig.get(rig.node->subscribe(1)).error().code, Errc::cancelled);
    EXPECT_EQ(rig.get(rig.node->next_emcy(rt::never)).error().code, Errc::cancelled);
    rig.node.reset();
    rig.run(1s);
  }
}

// Who awaits may also go first: destroying the scope cancels, and the node goes on.
TEST(ClientLifetime, ATaskDestroyedWhileItAwaits) {
  for (int step = 0; step < 40; ++step) {
    Rig rig;
    Ends ends;
    {
      rt::Scope scope(rig.world.executor());
      scope.spawn(write_and_note(*rig.node, ends));
      scope.spawn(subscribe_and_note(*rig.node, ends));
      scope.spawn(wait_for_emcy(*rig.node, ends));
      for (int i = 0; i < step; ++i) rig.world.step(rig.world.now() + 1s);
    }
    EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>("Read only")), 7U) << step;
    EXPECT_TRUE(rig.get(rig.node->subscribe(1)).has_value());
  }
}

TEST(ClientLifetime, ANodeDestroyedInItsOwnCallbacks) {
  const auto run = [](const auto& arrange) {
    Rig rig({.heartbeat = 250ms});
    rig.start();
    int called = 0;
    arrange(rig, [&] {
      ++called;
      rig.node.reset();
    });
    if (rig.node) rig.node->read<std::uint32_t>("UNSIGNED32", [&](const auto&) { called += rig.node ? 0 : 100; });
    rig.device->device.errors().raise(0x1000, 0);
    rig.run(2s);
    EXPECT_EQ(called, 1);
    EXPECT_EQ(rig.node, nullptr);
  };
  run([](Rig& rig, auto end) { rig.node->read<std::uint32_t>("Read only", [end](const auto&) { end(); }); });
  run([](Rig& rig, auto end) { rig.node->read<std::uint32_t>("no such name", [end](const auto&) { end(); }); });
  run([](Rig& rig, auto end) { rig.node->write("UNSIGNED8", 1, [end](const auto&) { end(); }); });
  run([](Rig& rig, auto end) { rig.node->on_emcy([end](const auto&) { end(); }); });
  run([](Rig& rig, auto end) { rig.node->on_state([end](const auto&) { end(); }); });
  run([](Rig& rig, auto end) { rig.node->nmt(co::NmtCommand::start, [end](const auto&) { end(); }); });
  run([](Rig& rig, auto end) { rig.node->subscribe(1, [end](const auto&) { end(); }); });
  run([](Rig& rig, auto end) {
    const auto pdo = rig.node->subscribe_as_described(1);
    (*pdo)->on_pdo([end](const auto&) { end(); });
    rig.device->device.services().event(1);
  });
}

TEST(ClientLifetime, TheNetworkDestroyedInACallback) {
  Rig rig;
  int called = 0;
  rig.node->on_emcy([&](const auto&) {
    ++called;
    rig.node.reset();
    rig.network.reset();
  });
  rig.device->device.errors().raise(0x1000, 0);
  rig.device->device.errors().raise(0x2000, 0);
  rig.run(1s);
  EXPECT_EQ(called, 1);
}

// HC5.3, HU.25: an access from a callback neither runs inside it nor locks up.
TEST(ClientLifetime, HC5_3_HU_25_AnAccessFromACallback) {
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    Rig rig({}, seed);
    int depth = 0;
    int deepest = 0;
    std::vector<std::uint32_t> values;
    const auto inside = [&](const auto& what) {
      deepest = std::max(deepest, ++depth);
      what();
      --depth;
    };
    // The typical ones: an EMCY's callback reads the error field; a read's callback reads again; a name that is not
    // there.
    rig.node->on_emcy([&](const Emergency&) {
      inside([&] {
        rig.node->read<std::uint32_t>("1003h:01", [&](const Outcome<std::uint32_t>& field) {
          inside([&] {
            values.push_back(field.value_or(0));
            rig.node->read<std::uint32_t>("no such name", [&](const Outcome<std::uint32_t>& none) {
              inside([&] { values.push_back(none ? 1 : 2); });
            });
            rig.node->write("UNSIGNED8", 300,
                            [&](const Outcome<void>& refused) { inside([&] { values.push_back(refused ? 3 : 4); }); });
          });
        });
      });
    });
    rig.device->device.errors().raise(0x1234, 0);
    rig.run(100ms);
    EXPECT_EQ(deepest, 1);
    std::sort(values.begin(), values.end());
    EXPECT_EQ(values, (std::vector<std::uint32_t>{2, 4, 0x1234}));
  }
}

rt::Task<void> add_one(RemoteNode& node, int times, int& failures) {
  for (int i = 0; i < times; ++i) {
    const auto value = co_await node.read<std::uint32_t>("UNSIGNED32");
    if (!value) {
      ++failures;
      continue;
    }
    const auto done = co_await node.write("UNSIGNED32", *value + 1);
    if (!done) ++failures;
  }
}

rt::Task<void> write_own(RemoteNode& node, std::uint8_t number, int& failures) {
  static constexpr const char* names[] = {"UNSIGNED8", "UNSIGNED16", "UNSIGNED24", "UNSIGNED64"};
  for (std::uint8_t i = 0; i < 25; ++i) {
    const auto value = static_cast<std::uint8_t>(number * 25 + i);
    const auto done = co_await node.write(names[number], value);
    const auto back = co_await node.read<std::uint64_t>(names[number]);
    if (!done || !back || *back != value) ++failures;
  }
}

// HU.26: without threads: each of many accesses at once gets its own answer, and no update is lost.
TEST(ClientLifetime, HU_26_ManyAtOnce) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    Rig rig({}, seed);
    rt::Scope scope(rig.world.executor());
    int failures = 0;
    for (std::uint8_t n = 0; n < 4; ++n) scope.spawn(write_own(*rig.node, n, failures));
    scope.spawn(add_one(*rig.node, 50, failures));
    int answers = 0;
    for (int i = 0; i < 100; ++i) {
      rig.node->read<std::uint32_t>("Read only", [&](const auto& v) { answers += v == 7U ? 1 : 1000; });
    }
    rig.run(10s);
    EXPECT_EQ(scope.running(), 0U);
    EXPECT_EQ(failures, 0);
    EXPECT_EQ(answers, 100);
    EXPECT_EQ(rig.device->value<std::uint32_t>({0x2007, 0}), 50U);
  }
}

// HU.27, HC5.4: several networks, each with devices of the same node-IDs, in one process and even one world.
TEST(ClientLifetime, HU_27_TwoNetworksOfTheSameNodeIds) {
  sim::World world;
  Bus one(world, "one");
  Bus two(world, "two");
  std::vector<std::unique_ptr<SimDevice>> devices;
  Network first(one.dispatcher);
  Network second(two.dispatcher);
  const auto names = std::make_shared<const Names>(dictionary());
  std::vector<std::unique_ptr<RemoteNode>> nodes;
  for (std::uint8_t id = 1; id <= 5; ++id) {
    for (Bus* bus : {&one, &two}) {
      devices.push_back(std::make_unique<SimDevice>(*bus, id, names->description()));
      nodes.push_back(std::make_unique<RemoteNode>(bus == &one ? first : second, NodeId(id), names));
    }
  }
  world.run_for(20ms);
  std::vector<int> emergencies(nodes.size());
  std::size_t done = 0;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    nodes[i]->on_emcy([&, i](const Emergency& e) { emergencies[i] += e.emcy.code; });
    nodes[i]->write("UNSIGNED32", 100 + i, [&, i](const auto& written) {
      ASSERT_TRUE(written.has_value());
      nodes[i]->read<std::uint32_t>("UNSIGNED32", [&, i](const auto& back) { done += back == 100 + i ? 1U : 0U; });
    });
    devices[i]->device.errors().raise(static_cast<std::uint16_t>(0x1000 + i), 0);
  }
  world.run_for(1s);
  EXPECT_EQ(done, nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    EXPECT_EQ(devices[i]->value<std::uint32_t>({0x2007, 0}), 100 + i);
    EXPECT_EQ(emergencies[i], 0x1000 + static_cast<int>(i));
  }
  // Two worlds: nothing is shared at all.
  Rig other;
  EXPECT_EQ(other.get(other.node->read<std::uint32_t>("UNSIGNED32")), 0U);
}

// HC5.1: a device that boots in the middle does not answer any more: what was asked ends at once, and once.
TEST(ClientLifetime, HC5_1_ABootUpEndsWhatIsPending) {
  Rig rig;
  Ends ends;
  rt::Scope scope(rig.world.executor());
  scope.spawn(write_and_note(*rig.node, ends));
  rig.run(2ms);
  ASSERT_EQ(ends.count, 0);
  rig.device->device.power_off();
  rig.device->device.power_on();
  rig.run(20ms);
  EXPECT_EQ(ends.count, 1);
  EXPECT_EQ(ends.code, Errc::cancelled);
  EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>("Read only")), 7U);
}

// Two objects for one device: the second is as good as the first, and outlives it.
TEST(ClientLifetime, TwoObjectsForOneDevice) {
  Rig rig({.heartbeat = 250ms});
  auto second = std::make_unique<RemoteNode>(*rig.network, NodeId(5), dictionary());
  int first_told = 0;
  int second_told = 0;
  rig.node->on_state([&](const auto&) { ++first_told; });
  second->on_state([&](const auto&) { ++second_told; });
  EXPECT_EQ(rig.get(second->read<std::uint32_t>("Read only")), 7U);
  rig.node.reset();
  rig.run(300ms);
  EXPECT_EQ(first_told, 0);
  EXPECT_EQ(second_told, 1);
  EXPECT_EQ(second->state(), NmtState::pre_operational);
}

}  // namespace
}  // namespace berth::client::test
