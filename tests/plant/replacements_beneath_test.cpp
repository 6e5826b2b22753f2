// Replacements on a bus beneath a gateway: whoever comes in the place of a device that left, blank or used, by whatever
// its master finds it, gets the node-ID that is free; no two devices ever have one in their memories.
#include <gtest/gtest.h>
#include <algorithm>
#include <array>
#include <chrono>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "boom.hpp"

namespace berth::plant::replacement_tests {
namespace {

struct Spare {
  std::string name;
  unsigned serial;
  unsigned node = 0;  // stored; 0: blank
  bool plugged = false;
  std::string speaks = R"(["lss", "rand"])";
  std::string response = R"("500 us")";
  std::string habits = {};
  bool switches = false;  // set `node`
};

std::string text_of(const Spare& s) {
  std::string text = "\n[[device]]\nname = \"" + s.name + "\"\nbus = \"boom\"\ntype = { vendor = 1, product = 3 }\n";
  text += "serial = " + std::to_string(s.serial) + "\nheartbeat = \"100 ms\"\nspeaks = " + s.speaks + "\n";
  text += "response = " + s.response + "\n";
  if (!s.habits.empty()) text += "habits = [\"" + s.habits + "\"]\n";
  if (s.switches) text += "source = \"switches\"\n";
  if (s.node != 0) text += "node_id = " + std::to_string(s.node) + "\n";
  if (!s.plugged) text += "plugged = false\n";
  return text;
}

struct Replacements : Boom {
  void build_with(const std::vector<Spare>& devices, const std::string& state = {}) {
    std::string text = master_beneath;
    names.clear();
    for (const auto& each : devices) {
      text += text_of(each);
      names.push_back(each.name);
    }
    build(text, state);
    failure.clear();
  }
  /// The list has these node-IDs for devices of product 3.
  void commission_for(const std::vector<unsigned>& nodes) {
    std::vector<Row> rows;
    std::uint8_t entry = 0;
    for (const unsigned node : nodes) {
      const auto sub = static_cast<std::uint8_t>(node);
      rows.push_back({{0x1F81, sub}, 0x05});
      rows.push_back({{0x1F85, sub}, 1});
      rows.push_back({{0x1F86, sub}, 3});
      rows.push_back({{0x1016, ++entry}, node * 0x10000U + 400});
    }
    rows.push_back({{0x1010, 1}, 0x65766173});
    rows.push_back({{0x1F82, 1}, 6, 1});
    run(500ms);
    write(rows);
  }
  static bool has(const Truth& t, NodeId id) { return t.active == id || t.pending == id || t.persistent == id; }
  /// Two devices that are switched on have one node-ID, in use or in memory.
  void look() {
    if (!failure.empty()) return;
    for (std::size_t i = 0; i < names.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const Truth a = truth(names[i].c_str()), b = truth(names[j].c_str());
        if (!a.powered || !b.powered) continue;
        for (const NodeId id : {a.active, a.pending, a.persistent}) {
          if (!id.configured() || !has(b, id)) continue;
          const auto at = std::chrono::duration<double>(world->executor().now().time_since_epoch()).count();
          failure = a.name + " and " + b.name + " have node-ID " + std::to_string(id.value()) + " at " +
                    std::to_string(at) + " s";
        }
      }
    }
  }
  void run(rt::Duration time) {
    for (rt::Duration passed{0}; passed < time; passed += 2ms) {
      world->sim().run_for(2ms);
      if (watches) look();
    }
  }
  bool run_until(const auto& condition, rt::Duration longest) {
    for (rt::Duration passed{0}; passed < longest; passed += 2ms) {
      if (condition()) return true;
      world->sim().run_for(2ms);
      if (watches) look();
    }
    return condition();
  }
  bool runs(const char* name, unsigned node) {
    const Truth t = truth(name);
    return t.powered && t.state == NmtState::operational && t.active == NodeId(static_cast<std::uint8_t>(node)) &&
           t.persistent == t.active;
  }
  /// What the master's 5F0Bh says.
  std::uint64_t told(std::uint8_t sub) {
    std::uint64_t value = 0;
    scope->spawn(read(routes->access(*multilevel::parse_path("3/1")), sub, value));
    run_until([&] { return scope->running() == 0; }, 5s);
    return value;
  }
  static rt::Task<void> read(co::SdoAccess& node, std::uint8_t sub, std::uint64_t& into) {
    const auto value = co_await node.read(0x5F0B, sub);
    if (!value || value->bytes().size() != 8) co_return;
    into = load_le<std::uint64_t>(value->bytes().data());
  }
  void reset_gateway() { world->find("boom gateway")->reset(); }

  std::vector<std::string> names;
  std::string failure;
  bool watches = true;
};

// Blank and used spares whose LSS is that of known stacks.
constexpr std::array<const char*, 2> stacks{"canopennode", "lely"};

// What 5F0Bh says of a node-ID (its lowest byte).
constexpr auto doubled = static_cast<unsigned>(manager::NodeIdTrouble::doubled);
constexpr auto refuses = static_cast<unsigned>(manager::NodeIdTrouble::refuses);

constexpr std::array<const char*, 4> languages{R"(["lss", "rand"])", R"(["lss"])", R"(["lss", "fastscan"])",
                                               R"(["lss", "fastscan", "feedback-29"])"};

}  // namespace

// Case `double` of issue 37 and its kin: the slot's device leaves, and two spares come, one second apart; the gateway
// is reset in the end. Each of the spares is blank, or has a node-ID of somewhere stored, or the slot's own.
TEST_F(Replacements, OneOfTwoSparesHasTheNodeIdEver) {
  for (const char* const speaks : languages) {
    for (const unsigned first : {0U, 9U, 5U}) {
      for (const unsigned second : {0U, 7U}) {
        SCOPED_TRACE(std::string(speaks) + " " + std::to_string(first) + " " + std::to_string(second));
        build_with({{"valve", 11, 0, true, speaks}, {"a", 12, first, false, speaks}, {"b", 13, second, false, speaks}});
        commission_for({5});
        ASSERT_TRUE(run_until([&] { return runs("valve", 5); }, 20s));
        run(3s);
        world->find("valve")->unplug();
        run(2s);
        world->find("a")->plug();
        run(1s);
        world->find("b")->plug();
        const auto one = [&] { return runs("a", 5) || runs("b", 5); };
        ASSERT_TRUE(run_until(one, 20s));
        run(3s);
        reset_gateway();
        run(10s);
        EXPECT_EQ(failure, "");
        EXPECT_TRUE(one());
        EXPECT_TRUE(world->duplicates().empty());
        EXPECT_EQ(told(5), 0U);
        run(10s);
        const bool a_sits = runs("a", 5);
        EXPECT_EQ(told(0x80), (a_sits ? 13ULL : 12ULL) << 32U | 1U) << "the other one is named";
      }
    }
  }
}

// A used spare, and a blank one 3 s later: each gets one of two node-IDs.
TEST_F(Replacements, AUsedSpareAndThenABlankOne) {
  for (const char* const speaks : languages) {
    SCOPED_TRACE(speaks);
    build_with({{"v", 10, 0, true, speaks},
                {"w", 11, 0, true, speaks},
                {"a", 12, 9, false, speaks},
                {"b", 13, 0, false, speaks}});
    commission_for({4, 5});
    ASSERT_TRUE(run_until([&] { return runs("v", 4) && runs("w", 5); }, 20s));
    world->find("v")->unplug();
    world->find("w")->unplug();
    run(3s);
    world->find("a")->plug();
    run(3s);
    world->find("b")->plug();
    EXPECT_TRUE(run_until([&] { return runs("a", 4) && runs("b", 5); }, 20s));
    EXPECT_EQ(failure, "");
  }
}

// Twenty pairs of the slot's node-ID and the one that the spare has stored.
TEST_F(Replacements, WhateverNodeIdTheSpareHasStored) {
  for (const char* const speaks : languages) {
    for (const unsigned wanted : {2U, 5U, 8U, 9U}) {
      for (const unsigned stored : {3U, 7U, 32U, 100U, 127U}) {
        SCOPED_TRACE(std::string(speaks) + " " + std::to_string(wanted) + " " + std::to_string(stored));
        build_with({{"valve", 11, 0, true, speaks}, {"spare", 12, stored, false, speaks}});
        commission_for({wanted});
        ASSERT_TRUE(run_until([&] { return runs("valve", wanted); }, 20s));
        world->find("valve")->unplug();
        run(3s);
        world->find("spare")->plug();
        EXPECT_TRUE(run_until([&] { return runs("spare", wanted); }, 20s));
        EXPECT_EQ(failure, "");
      }
    }
  }
}

// Plain LSS: a device that answers late after one that answered early.
TEST_F(Replacements, ASlowSpareAfterAQuickDevice) {
  constexpr std::array<const char*, 7> latencies{
      R"("200 us")",
      R"("1 ms")",
      R"("2 ms")",
      R"("5 ms")",
      R"("9 ms")",
      R"({ min = "200 us", max = "9 ms" })",
      R"({ min = "1 ms", max = "2 ms", outlier = "9 ms", outlier_ppm = 50_000 })"};
  for (const char* const speaks : {languages[1], languages[2]}) {
    for (const char* const before : {latencies[0], latencies[1]}) {
      for (const char* const after : latencies) {
        SCOPED_TRACE(std::string(speaks) + " " + before + " " + after);
        build_with({{"valve", 11, 0, true, speaks, before}, {"spare", 12, 0, false, speaks, after}});
        commission_for({5});
        ASSERT_TRUE(run_until([&] { return runs("valve", 5); }, 20s));
        world->find("valve")->unplug();
        run(3s);
        world->find("spare")->plug();
        EXPECT_TRUE(run_until([&] { return runs("spare", 5); }, 20s));
        EXPECT_EQ(failure, "");
      }
    }
  }
}

TEST_F(Replacements, SparesWithTheHabitsOfKnownStacks) {
  for (const char* const stack : stacks) {
    for (const unsigned stored : {0U, 9U}) {
      SCOPED_TRACE(std::string(stack) + " " + std::to_string(stored));
      build_with({{"valve", 11, 0, true, languages[2], R"("500 us")", stack},
                  {"spare", 12, stored, false, languages[2], R"("500 us")", stack},
                  {"second", 13, 7, false, languages[2], R"("500 us")", stack}});
      commission_for({5});
      ASSERT_TRUE(run_until([&] { return runs("valve", 5); }, 30s));
      run(2s);
      world->find("valve")->unplug();
      run(3s);
      world->find("spare")->plug();
      run(1s);
      world->find("second")->plug();
      const auto one = [&] { return runs("spare", 5) || runs("second", 5); };
      EXPECT_TRUE(run_until(one, 30s));
      run(10s);
      EXPECT_EQ(failure, "");
      EXPECT_TRUE(one());
    }
  }
}

// A device that was given away comes back under the node-ID that is another's now: it is asked for by its LSS address
// and gives the node-ID up. The gateway was reset in between, so that its memory is what tells.
TEST_F(Replacements, ADeviceComesBackUnderWhatWasGivenAway) {
  for (const char* const speaks : languages) {
    SCOPED_TRACE(speaks);
    build_with({{"valve", 11, 0, true, speaks}, {"spare", 12, 0, false, speaks}});
    commission_for({5});
    ASSERT_TRUE(run_until([&] { return runs("valve", 5); }, 20s));
    run(2s);
    world->find("valve")->unplug();
    run(3s);
    world->find("spare")->plug();
    ASSERT_TRUE(run_until([&] { return runs("spare", 5); }, 20s));
    EXPECT_EQ(failure, "");
    reset_gateway();
    ASSERT_TRUE(run_until([&] { return runs("spare", 5); }, 20s));
    run(3s);
    watches = false;  // that it boots under its node-ID no master can prevent
    world->find("valve")->plug();
    EXPECT_TRUE(run_until([&] { return truth("valve").active == NodeId(5); }, 2s));
    EXPECT_TRUE(run_until([&] { return truth("valve").active != NodeId(5); }, 5s));
    for (int i = 0; i < 20; ++i) {
      EXPECT_NE(told(5) & 0xFFU, doubled) << "one of the two has left";
      run(200ms);
    }
    EXPECT_FALSE(truth("valve").persistent.configured());
    EXPECT_TRUE(run_until([&] { return runs("spare", 5); }, 20s));
    EXPECT_TRUE(world->duplicates().empty());
    watches = true;
    run(5s);
    EXPECT_EQ(failure, "");
  }
}

// A device that was told its node-ID and lost before it was heard under it: nobody else gets that, whoever comes, and
// whatever becomes of the master. It is told, and a person may say that the device is gone for good.
TEST_F(Replacements, WhatADeviceWasToldIsKeptForIt) {
  for (const char* const speaks : languages) {
    SCOPED_TRACE(speaks);
    build_with({{"valve", 11, 0, true, speaks}, {"spare", 12, 0, false, speaks}});
    const Record beneath(*world->bus("boom"));
    commission_for({5});
    ASSERT_TRUE(run_until([&] { return truth("valve").persistent == NodeId(5); }, 20s));
    world->find("valve")->unplug();
    run(1s);
    world->find("spare")->plug();
    run(15s);
    EXPECT_FALSE(has(truth("spare"), NodeId(5)));
    EXPECT_EQ(told(5), 11ULL << 32U | 2U);
    reset_gateway();
    run(15s);
    EXPECT_FALSE(has(truth("spare"), NodeId(5)));
    world->find("valve")->plug();
    EXPECT_TRUE(run_until([&] { return runs("valve", 5); }, 20s));
    EXPECT_EQ(failure, "");
  }
}

// It refuses the node-ID: nothing in it has changed, and the next one of its type gets that.
TEST_F(Replacements, WhoRefusesANodeIdKeepsItNot) {
  for (const char* const speaks : languages) {
    SCOPED_TRACE(speaks);
    build_with({{"valve", 11, 9, true, speaks, R"("500 us")", {}, true}, {"spare", 12, 0, false, speaks}});
    commission_for({5});
    EXPECT_TRUE(run_until([&] { return (told(5) & 0xFFU) == refuses; }, 20s)) << std::hex << told(5);
    world->find("spare")->plug();
    EXPECT_TRUE(run_until([&] { return runs("spare", 5); }, 20s)) << std::hex << told(5);
    EXPECT_EQ(failure, "");
  }
}

// It leaves when it has stored its node-ID, and another comes that has the same one stored: that one answers for it. Of
// these two one is there.
TEST_F(Replacements, TheOneThatAnswersForAnotherIsNotTwo) {
  struct Stored final : can::Tap {
    void frame(const can::Frame& f, rt::Time, int) noexcept override {
      seen = seen || (f.id == 0x7E4 && f.size == 8 && f.data[0] == 0x17 && f.data[1] == 0);
    }
    bool seen = false;
  };
  for (const char* const speaks : languages) {
    SCOPED_TRACE(speaks);
    watches = false;
    build_with({{"valve", 11, 0, true, speaks}, {"other", 12, 5, false, speaks}});
    Stored stored;
    world->bus("boom")->add_tap(stored);
    commission_for({5});
    ASSERT_TRUE(run_until([&] { return stored.seen; }, 20s));
    world->bus("boom")->remove_tap(stored);
    world->find("valve")->unplug();
    world->find("other")->plug();
    for (int i = 0; i < 100; ++i) {
      EXPECT_NE(told(5) & 0xFFU, doubled) << i;
      run(100ms);
    }
    EXPECT_TRUE(run_until([&] { return runs("other", 5); }, 40s)) << std::hex << told(5);
  }
}

// It was told its node-ID and heard nothing after that: it is in LSS configuration still, and the next `04 00` would
// bring that node-ID into use, whoever has it by then. It is told to have none first.
TEST_F(Replacements, WhoMayStillListenIsToldToHaveNoneBeforeItIsReleased) {
  struct First final : can::Tap {
    void frame(const can::Frame& f, rt::Time, int) noexcept override {
      const bool lss = f.id == 0x7E5 && f.size == 8 && (f.data[0] == 0x04 || f.data[0] == 0x11);
      if (lss && said.empty()) said = can::to_string(f).substr(0, 8);
    }
    std::string said;
  };
  for (const char* const speaks : languages) {
    SCOPED_TRACE(speaks);
    watches = false;
    build_with({{"valve", 11, 0, true, speaks}});
    commission_for({5});
    ASSERT_TRUE(run_until([&] { return truth("valve").pending == NodeId(5); }, 20s));
    world->find("valve")->deaf(0s);
    ASSERT_TRUE(run_until([&] { return told(5) != 0; }, 20s));
    EXPECT_EQ(truth("valve").pending, NodeId(5));
    First first;
    world->bus("boom")->add_tap(first);
    recover(*world->find("valve"));
    EXPECT_TRUE(run_until([&] { return runs("valve", 5); }, 40s)) << std::hex << told(5);
    EXPECT_EQ(first.said, "7E5#11FF");
    world->bus("boom")->remove_tap(first);
  }
}

// A state file (`--sim-state`) has it too.
TEST_F(Replacements, WhatIsKeptOutlivesTheProcess) {
  const std::vector<Spare> devices{{"valve", 11, 0, true}, {"spare", 12, 0, false}};
  build_with(devices);
  commission_for({5});
  ASSERT_TRUE(run_until([&] { return truth("valve").persistent == NodeId(5); }, 20s));
  world->find("valve")->unplug();
  world->find("spare")->plug();
  const std::string state = world->state();
  build_with(devices, state);
  EXPECT_TRUE(world->state() == state);
  run(20s);
  EXPECT_TRUE(truth("spare").powered);
  EXPECT_FALSE(has(truth("spare"), NodeId(5)));
  EXPECT_EQ(told(5), 11ULL << 32U | 2U);
  world->find("valve")->plug();
  EXPECT_TRUE(run_until([&] { return runs("valve", 5); }, 20s));
  EXPECT_EQ(failure, "");
}

// To the heartbeat consumer of the gateway's master an answer to guarding is a heartbeat, and it would wait for the
// next.
TEST_F(Replacements, WhoAnswersSdoIsNotGuarded) {
  struct Guarding final : can::Tap {
    void frame(const can::Frame& frame, rt::Time, int) noexcept override {
      count += frame.remote && frame.id == 0x705 ? 1U : 0U;
    }
    unsigned count = 0;
  };
  Guarding guarding;
  build_with({{"valve", 11, 5, true}});
  commission_for({5});
  world->bus("boom")->add_tap(guarding);
  reset_gateway();
  EXPECT_TRUE(run_until([&] { return runs("valve", 5); }, 20s));
  run(10s);
  world->bus("boom")->remove_tap(guarding);
  EXPECT_EQ(guarding.count, 0U);
}

TEST_F(Replacements, APersonGivesWhatIsKeptFree) {
  build_with({{"valve", 11, 0, true}, {"spare", 12, 0, false}});
  commission_for({5});
  ASSERT_TRUE(run_until([&] { return truth("valve").persistent == NodeId(5); }, 20s));
  world->find("valve")->unplug();
  world->find("spare")->plug();
  run(20s);
  EXPECT_EQ(told(5), 11ULL << 32U | 2U);
  write({{{0x5F0B, 5}, 0, 8}});
  EXPECT_TRUE(run_until([&] { return runs("spare", 5); }, 20s));
}

// Two of one type under one node-ID of the list, as they leave the factory.
TEST_F(Replacements, TwoThatComeWithOneNodeId) {
  for (const char* const speaks : languages) {
    SCOPED_TRACE(speaks);
    watches = false;
    build_with({{"valve", 11, 5, true, speaks}, {"other", 12, 5, true, speaks}});
    commission_for({4, 5});
    EXPECT_TRUE(run_until([&] { return runs("valve", 4) && runs("other", 5); }, 40s) ||
                (runs("valve", 5) && runs("other", 4)));
    EXPECT_TRUE(world->duplicates().empty());
  }
}

// Of two under one node-ID one was moved, and the other kept it: that one is replaced as any other.
TEST_F(Replacements, OneThatKeptADoubledNodeIdIsReplaced) {
  for (const char* const speaks : languages) {
    for (const unsigned kept : {4U, 5U}) {
      SCOPED_TRACE(std::string(speaks) + std::to_string(kept));
      watches = false;
      build_with({{"valve", 11, 5, true, speaks}, {"other", 12, 5, true, speaks}, {"spare", 13, 0, false, speaks}});
      commission_for({4, 5});
      const auto both = [&] {
        return (runs("valve", 4) && runs("other", 5)) || (runs("valve", 5) && runs("other", 4));
      };
      ASSERT_TRUE(run_until(both, 40s));
      run(30s);
      world->find(runs("valve", kept) ? "valve" : "other")->unplug();
      run(5s);
      world->find("spare")->plug();
      EXPECT_TRUE(run_until([&] { return runs("spare", kept); }, 40s))
          << std::hex << told(static_cast<std::uint8_t>(kept));
    }
  }
}

// The master loses its power in the middle of every write of its memory, while it puts two used spares to work.
TEST_F(Replacements, TheMasterLosesItsPowerAtEveryWrite) {
  unsigned cut = 0;
  for (std::uint64_t byte = 0; byte < 700; byte += 23) {
    SCOPED_TRACE(byte);
    build_with({{"v", 10, 0, true}, {"w", 11, 0, true}, {"a", 12, 9, false}, {"b", 13, 7, false}});
    commission_for({4, 5});
    ASSERT_TRUE(run_until([&] { return runs("v", 4) && runs("w", 5); }, 20s));
    world->find("v")->unplug();
    world->find("w")->unplug();
    run(3s);
    auto& gateway = *world->find("boom gateway");
    bool off = false;
    list_memory(*world->find("boom port"))
        ->cut_after(
            byte,
            [&] {
              world->sim().after(rt::Duration{0}, [&] {
                gateway.power(false);
                off = true;
              });
            },
            byte % 2 == 0 ? -1 : 0x5A);
    world->find("a")->plug();
    world->find("b")->plug();
    run_until([&] { return off || (runs("a", 4) && runs("b", 5)) || (runs("a", 5) && runs("b", 4)); }, 20s);
    cut += off ? 1U : 0U;
    if (off) {
      run(500ms);
      gateway.power(true);
    }
    const auto good = [&] { return (runs("a", 4) && runs("b", 5)) || (runs("a", 5) && runs("b", 4)); };
    EXPECT_TRUE(run_until(good, 30s));
    EXPECT_EQ(failure, "");
  }
  EXPECT_GT(cut, 10U);
}

// The master loses its power, or is reset, between every two frames of LSS that it sends for a replacement.
TEST_F(Replacements, TheMasterIsLostBetweenEveryTwoSteps) {
  struct Count final : can::Tap {
    explicit Count(sim::Bus& line) : bus(line) { bus.add_tap(*this); }
    ~Count() { bus.remove_tap(*this); }
    void frame(const can::Frame& frame, rt::Time, int) noexcept override {
      if (frame.id == 0x7E5 || frame.id == 0x000 || frame.id == 0x7E4) ++frames;
    }
    sim::Bus& bus;
    unsigned frames = 0;
  };
  for (const unsigned stored : {0U, 9U}) {
    bool more = true;
    for (unsigned at = 1; more; at += 3) {
      SCOPED_TRACE(std::to_string(stored) + " " + std::to_string(at));
      build_with({{"valve", 11, 0, true}, {"a", 12, stored, false}, {"b", 13, 7, false}});
      commission_for({5});
      ASSERT_TRUE(run_until([&] { return runs("valve", 5); }, 20s));
      run(1s);
      world->find("valve")->unplug();
      run(4s);
      world->find("a")->plug();
      Count count(*world->bus("boom"));
      auto& gateway = *world->find("boom gateway");
      more = !run_until([&] { return runs("a", 5) || count.frames >= at; }, 20s) || !runs("a", 5);
      if (more && at % 2 == 0) {
        gateway.power(false);
        run(300ms);
        gateway.power(true);
      } else if (more) {
        gateway.reset();
      }
      world->find("b")->plug();
      const auto one = [&] { return runs("a", 5) || runs("b", 5); };
      EXPECT_TRUE(run_until(one, 40s));
      run(3s);
      EXPECT_EQ(failure, "");
      EXPECT_TRUE(one());
      if (at > 400) break;
    }
  }
}

}  // namespace berth::plant::replacement_tests
