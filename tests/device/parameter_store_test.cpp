// Stored parameters by themselves: what is stored, group by group; a power loss at any byte, also a second one, leaves
// the old image or the new one; another firmware's image is laid over only where it fits.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/base/random.hpp"
#include "berth/device/parameter_store.hpp"

namespace berth::device {
namespace {

using od::Access;
using od::DataType;
using od::Literal;
using std::chrono::milliseconds;

void every_device(od::DescriptionBuilder& b) {
  b.variable(0x1000, {.access = Access::ro, .initial = Literal::number(7)});
  b.object(0x1003, od::ObjectCode::array, "Errors");
  b.sub(0x1003, {.sub = 0, .type = DataType::unsigned8});
  b.variable(0x1014, {.initial = Literal::node_id_plus(0x80)});
  b.variable(0x1017, {.type = DataType::unsigned16, .initial = Literal::number(100)});
  b.variable(0x1F51, {.type = DataType::unsigned8});
}

std::shared_ptr<const od::Description> description(bool separate) {
  od::DescriptionBuilder b;
  every_device(b);
  b.object(0x1010, od::ObjectCode::array, "Store");
  for (std::uint8_t i = 1; i <= (separate ? 4 : 3); ++i) b.sub(0x1010, {.sub = i});
  b.variable(0x2000, {.type = DataType::integer16, .initial = Literal::number(0)});
  b.variable(0x2001, {.type = DataType::visible_string, .initial = Literal::text("abc"), .capacity = 40});
  b.variable(0x2002, {.type = DataType::domain, .capacity = 8});
  b.variable(0x2003, {.access = Access::wo});
  b.variable(0x6000, {.type = DataType::real32,
                      .low = Literal::real(DataType::real32, -5.0),
                      .high = Literal::real(DataType::real32, 5.0)});
  b.variable(0x6200, {.type = DataType::unsigned8, .access = Access::rww, .mappable = true});
  b.variable(0x6201, {.type = DataType::unsigned8, .access = Access::rww});
  b.variable(0x1006, {.access = Access::rww, .mappable = true});
  b.variable(0x6300, {.type = DataType::unsigned8, .obj_flags = od::refuse_write_on_download});
  return b.build();
}

struct Bench final : ParameterStore::Owner, SimFlash::Watcher {
  explicit Bench(std::size_t size = 400) : flash(executor, size, milliseconds(1)) { flash.watch(this); }
  void parameters_written(bool good) noexcept override { ok = good; }
  void write_began() noexcept override { ++writes; }
  void write_ended() noexcept override {}
  void cut() noexcept override {
    was_cut = true;
    if (store != nullptr) store->forget();
  }
  /// Runs to the end; false: ended badly. Empty: nobody was told.
  std::optional<bool> finish() {
    ok.reset();
    executor.advance(executor.now() + milliseconds(100));
    return ok;
  }
  rt::Executor executor;
  SimFlash flash;
  ParameterStore* store = nullptr;
  std::optional<bool> ok;
  int writes = 0;
  bool was_cut = false;
};

constexpr std::size_t at = 16;

// A9.1: what belongs to which sub-index of 1010h.
TEST(ParameterStore, A9_1_GroupsOfObjects) {
  for (const bool separate : {false, true}) {
    const auto d = description(separate);
    const auto group = [&](std::uint16_t index, std::uint8_t sub = 0) {
      return default_parameter_group(*d, *d->find(index), *d->find({index, sub}));
    };
    EXPECT_EQ(group(0x1000), parameter_group::none) << "read only";
    EXPECT_EQ(group(0x1003), parameter_group::none) << "a history";
    EXPECT_EQ(group(0x1010, 1), parameter_group::none) << "a command";
    EXPECT_EQ(group(0x1014), parameter_group::communication);
    EXPECT_EQ(group(0x1017), parameter_group::communication);
    EXPECT_EQ(group(0x1F51), parameter_group::none) << "program control";
    EXPECT_EQ(group(0x2000), separate ? parameter_group::manufacturer : parameter_group::application);
    EXPECT_EQ(group(0x2002), parameter_group::none) << "DOMAIN";
    EXPECT_EQ(group(0x2003), parameter_group::none) << "write only";
    EXPECT_EQ(group(0x6000), parameter_group::application);
    EXPECT_EQ(group(0x6200), parameter_group::none) << "an output must not come back by itself at power-on";
    EXPECT_EQ(group(0x6201), parameter_group::application) << "no PDO carries it";
    EXPECT_EQ(group(0x1006), parameter_group::communication) << "whatever a description calls it";
    EXPECT_EQ(group(0x6300), parameter_group::none) << "ObjFlags: tools leave it alone";
  }
}

TEST(ParameterStore, BlankMemoryHoldsNothingAndTooSmallOneIsNotUsed) {
  Bench bench;
  od::Values values(description(true), NodeId(3));
  ParameterStore store(bench.flash, at, {}, bench);
  EXPECT_TRUE(store.usable());
  EXPECT_FALSE(store.load());
  store.apply(values, od::Area::all);
  EXPECT_EQ(values.get_or<std::uint16_t>({0x1017, 0}, 0), 100);
  Bench small(at + 64);
  ParameterStore none(small.flash, at, {}, small);
  EXPECT_FALSE(none.usable());
  EXPECT_FALSE(none.save(values, 1));
  Bench tiny(4);
  EXPECT_FALSE(ParameterStore(tiny.flash, at, {}, tiny).usable());
}

struct Stored {
  explicit Stored(bool separate = true) : values(description(separate), NodeId(3)) {}
  /// A new start: what a device has after power-on as `id`.
  od::Values& start(NodeId id = NodeId(3)) {
    store.forget();
    store.load();
    values.reset(id);
    store.apply(values, od::Area::all);
    return values;
  }
  bool save(std::uint8_t group) { return store.save(values, group) && bench.finish() == true; }
  bool restore(std::uint8_t group) { return store.restore(values, group) && bench.finish() == true; }
  std::int64_t get(std::uint16_t index) { return values.get_or<std::int64_t>({index, 0}, -99); }
  Bench bench;
  od::Values values;
  ParameterStore store{bench.flash, at, {}, bench};
};

// A9.1, OD.1010: each group by itself, what the others have stored stays.
TEST(ParameterStore, A9_1_OD_1010_GroupsAreStoredByThemselves) {
  Stored s;
  s.values.set({0x1017, 0}, 500U);
  s.values.set({0x2000, 0}, -2);
  s.values.set({0x6000, 0}, 1.5F);
  s.values.set_text({0x2001, 0}, "left sensor");
  ASSERT_TRUE(s.save(parameter_group::communication));
  s.start();
  EXPECT_EQ(s.get(0x1017), 500);
  EXPECT_EQ(s.get(0x2000), 0);
  s.values.set({0x1017, 0}, 600U);  // not stored again
  s.values.set({0x2000, 0}, -3);
  s.values.set_text({0x2001, 0}, "right");
  ASSERT_TRUE(s.save(parameter_group::manufacturer));
  s.start();
  EXPECT_EQ(s.get(0x1017), 500) << "of the communication group, as stored before";
  EXPECT_EQ(s.get(0x2000), -3);
  EXPECT_EQ(s.values.get_text({0x2001, 0}), "right");
  EXPECT_EQ(s.values.get_or<float>({0x6000, 0}, 9), 0.0F);
  s.values.set({0x6000, 0}, 2.5F);
  ASSERT_TRUE(s.save(parameter_group::application));
  s.start();
  EXPECT_EQ(s.values.get_or<float>({0x6000, 0}, 9), 2.5F);
  EXPECT_EQ(s.get(0x2000), -3);
  s.values.set({0x2000, 0}, 0);  // back at its default, and stored so
  s.values.set_text({0x2001, 0}, "");
  ASSERT_TRUE(s.save(parameter_group::all));
  s.start();
  EXPECT_EQ(s.get(0x2000), 0);
  EXPECT_EQ(s.values.get_text({0x2001, 0}), "");
  EXPECT_EQ(s.get(0x1017), 500);
}

// A value of any length that a `GroupOf` asks for, old or new as a whole; by the rules above none that may be so long.
TEST(ParameterStore, LongValues) {
  od::DescriptionBuilder b;
  every_device(b);
  b.object(0x1010, od::ObjectCode::array, "Store");
  b.sub(0x1010, {.sub = 1});
  b.variable(0x2000, {.type = DataType::octet_string, .capacity = 3000});
  b.variable(0x2001, {.type = DataType::unsigned16, .initial = Literal::number(0)});
  b.variable(0x2002, {.type = DataType::domain, .capacity = 16'000});
  const auto d = b.build();
  EXPECT_EQ(default_parameter_group(*d, *d->find(0x2000), *d->find({0x2000, 0})), parameter_group::none);
  EXPECT_EQ(ParameterStore::room_for(*d), ParameterStore::usual);
  const GroupOf all = [](const od::Description& of, const od::Object& object, const od::SubObject& sub) noexcept {
    return object.index >= 0x2000 ? parameter_group::application : default_parameter_group(of, object, sub);
  };
  EXPECT_EQ(ParameterStore::room_for(*d, all), 16'000U);
  Bench bench(at + ParameterStore::footprint(*d, all));
  od::Values values(d, NodeId(3));
  ParameterStore store(bench.flash, at, {}, bench, all, ParameterStore::room_for(*d, all));
  const auto bytes = [](std::size_t count, unsigned seed) {
    std::vector<std::uint8_t> made(count);
    for (std::size_t i = 0; i < count; ++i) made[i] = static_cast<std::uint8_t>(i * 31 + (i >> 8U) + seed);
    return made;
  };
  const auto has = [&](std::uint16_t index, const std::vector<std::uint8_t>& wanted) {
    const auto there = values.bytes({index, 0});
    return std::ranges::equal(there, wanted);
  };
  for (const std::size_t count : {16'000U, 251U, 250U, 1U, 8'000U}) {
    values.set_bytes({0x2000, 0}, bytes(count / 6, 1));
    values.set({0x2001, 0}, static_cast<std::uint16_t>(count));
    values.set_bytes({0x2002, 0}, bytes(count, 2));
    ASSERT_TRUE(store.save(values, parameter_group::all) && bench.finish() == true) << count;
    // Cut in the middle of the next one: what was there before.
    values.set_bytes({0x2002, 0}, bytes(15'000, 9));
    bench.store = &store;
    bench.flash.cut_after(700);
    if (store.save(values, parameter_group::all)) bench.finish();
    EXPECT_TRUE(bench.was_cut);
    bench.was_cut = false;
    bench.store = nullptr;
    bench.flash.never_cut();
    ASSERT_TRUE(store.load());
    values.reset(NodeId(3));
    store.apply(values, od::Area::all);
    EXPECT_TRUE(has(0x2000, bytes(count / 6, 1))) << count;
    EXPECT_EQ(values.get_or<std::uint16_t>({0x2001, 0}, 0), count);
    EXPECT_TRUE(has(0x2002, bytes(count, 2))) << count;
  }
}

// A9.2, OD.1011: restore forgets a group; the present values stay until the next reset.
TEST(ParameterStore, A9_2_OD_1011_RestoreForgetsAGroup) {
  Stored s;
  s.values.set({0x1017, 0}, 500U);
  s.values.set({0x2000, 0}, -2);
  ASSERT_TRUE(s.save(1));
  ASSERT_TRUE(s.restore(parameter_group::communication));
  EXPECT_EQ(s.get(0x1017), 500);
  s.start();
  EXPECT_EQ(s.get(0x1017), 100);
  EXPECT_EQ(s.get(0x2000), -2);
  ASSERT_TRUE(s.restore(1));
  s.start();
  EXPECT_EQ(s.get(0x2000), 0);
  EXPECT_EQ(s.store.stored_bytes(), 0U);
}

// What depends on $NODEID is stored as it is, also when it has its default.
TEST(ParameterStore, StoredCobIdStaysWhenTheNodeIdChanges) {
  Stored s;
  s.start(NodeId(5));
  EXPECT_EQ(s.get(0x1014), 0x85);
  s.start(NodeId(3));
  ASSERT_TRUE(s.save(1));
  s.start(NodeId(5));
  EXPECT_EQ(s.get(0x1014), 0x83);
  ASSERT_TRUE(s.restore(1));
  s.start(NodeId(5));
  EXPECT_EQ(s.get(0x1014), 0x85);
}

// A preset is the device's default: its value need not be stored, the description's must.
TEST(ParameterStore, PresetsCountAsDefaults) {
  Bench bench;
  const std::array<Preset, 1> presets{{{{0x1017, 0}, 250}}};
  od::Values values(description(true), NodeId(3));
  ParameterStore store(bench.flash, at, presets, bench);
  const auto start = [&] {
    store.load();
    values.reset(NodeId(3));
    values.set({0x1017, 0}, 250U);
    store.apply(values, od::Area::all);
    return values.get_or<std::uint16_t>({0x1017, 0}, 0);
  };
  EXPECT_EQ(start(), 250);
  values.set({0x1017, 0}, 100U);  // the description's
  ASSERT_TRUE(store.save(values, 1));
  ASSERT_EQ(bench.finish(), true);
  EXPECT_EQ(start(), 100);
}

TEST(ParameterStore, ResetsTakeTheirArea) {
  Stored s;
  s.values.set({0x1017, 0}, 500U);
  s.values.set({0x2000, 0}, -2);
  ASSERT_TRUE(s.save(1));
  s.values.reset(NodeId(3));
  s.store.apply(s.values, od::Area::communication);
  EXPECT_EQ(s.get(0x1017), 500);
  EXPECT_EQ(s.get(0x2000), 0);
  s.values.reset(NodeId(3));
  s.store.apply(s.values, od::Area::application);
  EXPECT_EQ(s.get(0x1017), 100);
  EXPECT_EQ(s.get(0x2000), -2);
}

// Another firmware on the same memory: types, lengths and limits have changed; what does not fit keeps its default.
TEST(ParameterStore, AnotherFirmwaresImageIsLaidOverOnlyWhereItFits) {
  Stored s;
  s.values.set({0x1017, 0}, 500U);
  s.values.set({0x2000, 0}, -2);
  s.values.set_text({0x2001, 0}, "twelve chars");
  s.values.set({0x6000, 0}, 4.0F);
  ASSERT_TRUE(s.save(1));
  od::DescriptionBuilder b;
  every_device(b);
  b.variable(0x2000, {.type = DataType::unsigned16, .initial = Literal::number(9)});  // another type, same length
  b.variable(0x2001, {.type = DataType::visible_string, .capacity = 11});             // too short now
  b.variable(0x6000, {.type = DataType::real32, .high = Literal::real(DataType::real32, 3.0)});
  od::Values values(b.build(), NodeId(3));
  s.store.apply(values, od::Area::all);
  EXPECT_EQ(values.get_or<std::uint16_t>({0x1017, 0}, 0), 500);
  EXPECT_EQ(values.get_or<std::uint16_t>({0x2000, 0}, 0), 9);
  EXPECT_EQ(values.get_text({0x2001, 0}), "");
  EXPECT_EQ(values.get_or<float>({0x6000, 0}, 9), 0.0F);
  od::DescriptionBuilder other;
  other.variable(0x1017, {.type = DataType::unsigned16, .access = Access::ro, .initial = Literal::number(100)});
  od::Values read_only(other.build(), NodeId(3));
  s.store.apply(read_only, od::Area::all);
  EXPECT_EQ(read_only.get_or<std::uint16_t>({0x1017, 0}, 0), 100) << "nothing that this firmware would not store";
}

TEST(ParameterStore, AnImageWithoutRoomFailsAndTheOldOneHolds) {
  const auto d = description(true);
  const auto need = ParameterStore::footprint(*d);
  EXPECT_EQ(need, 2 * (16 + (6 + 4) + (6 + 4) + (6 + 2) + (6 + 2) + (6 + 40) + (6 + 4) + (6 + 1)));
  for (const int history : {1, 2}) {  // into the second slot, and into the first, behind which the second begins
    for (const bool room : {false, true}) {
      Bench bench(at + need - (room ? 0 : 2));
      od::Values values(d, NodeId(3));
      ParameterStore store(bench.flash, at, {}, bench);
      store.load();
      values.set({0x1017, 0}, 500U);
      values.set_text({0x2001, 0}, "short");
      for (int i = 0; i < history; ++i) {
        ASSERT_TRUE(store.save(values, 1));
        ASSERT_EQ(bench.finish(), true);
      }
      values.set({0x1017, 0}, 600U);
      values.set({0x2000, 0}, -2);
      values.set({0x6000, 0}, 1.0F);
      values.set({0x1006, 0}, 1U);
      values.set({0x6201, 0}, 1U);
      values.set_text({0x2001, 0}, "0123456789012345678901234567890123456789");
      const bool begun = store.save(values, 1);
      EXPECT_EQ(begun && bench.finish() == true, room);
      EXPECT_FALSE(store.busy());
      store.load();
      values.reset(NodeId(3));
      store.apply(values, od::Area::all);
      EXPECT_EQ(values.get_or<std::uint16_t>({0x1017, 0}, 0), room ? 600 : 500);
      EXPECT_EQ(values.get_text({0x2001, 0}).size(), room ? 40U : 5U);
    }
  }
}

TEST(ParameterStore, BrokenMediumIsToldAndTheOldImageHolds) {
  Stored s;
  s.values.set({0x1017, 0}, 500U);
  ASSERT_TRUE(s.save(1));
  s.bench.flash.broken(true);
  s.values.set({0x1017, 0}, 600U);
  ASSERT_TRUE(s.store.save(s.values, 1));
  EXPECT_TRUE(s.store.busy());
  EXPECT_FALSE(s.store.save(s.values, 1)) << "one at a time";
  EXPECT_EQ(s.bench.finish(), false);
  s.bench.flash.broken(false);
  s.start();
  EXPECT_EQ(s.get(0x1017), 500);
  s.values.set({0x1017, 0}, 700U);
  EXPECT_TRUE(s.save(1));
  EXPECT_EQ(s.start().get_or<std::uint16_t>({0x1017, 0}, 0), 700);
}

// A reset in the middle: nobody is told, the old values come back, and the next save works.
TEST(ParameterStore, AbandonedAtAnyWriteLeavesOldOrNew) {
  for (int after = 0; after < 60; ++after) {
    Stored s;
    s.values.set({0x1017, 0}, 500U);
    ASSERT_TRUE(s.save(1));
    s.values.set({0x1017, 0}, 600U);
    s.values.set({0x2000, 0}, -2);
    ASSERT_TRUE(s.store.save(s.values, 1));
    s.bench.ok.reset();
    s.bench.executor.advance(s.bench.executor.now() + milliseconds(1) * after / 20);
    s.store.abandon();
    s.values.reset(NodeId(3));
    const bool told = s.bench.ok.has_value();
    s.bench.executor.advance(s.bench.executor.now() + milliseconds(5));
    EXPECT_EQ(s.bench.ok.has_value(), told) << "nobody is told after that";
    EXPECT_FALSE(s.store.busy());
    const auto counts = s.store.stored_bytes();
    s.store.load();
    EXPECT_EQ(s.store.stored_bytes(), counts) << "what the running device believes is what the next start finds";
    const auto now = s.start().get_or<std::uint16_t>({0x1017, 0}, 0);
    EXPECT_TRUE(now == 500 || now == 600);
    EXPECT_EQ(s.get(0x2000), now == 600 ? -2 : 0) << "never a mixture";
    s.values.set({0x1017, 0}, 700U);
    ASSERT_TRUE(s.save(1));
    EXPECT_EQ(s.start().get_or<std::uint16_t>({0x1017, 0}, 0), 700);
  }
}

// A power loss at every byte of a save, with bytes left torn, after histories of 0..3 saves, and a second loss at every
// fourth byte of the save that follows: old or new, never mixed, never lost.
TEST(ParameterStore, CutAtEveryByteTwiceLeavesOldOrNew) {
  unsigned old_seen = 0;
  unsigned new_seen = 0;
  const auto write = [](Stored& s, unsigned value) {
    s.values.set({0x1017, 0}, value);
    s.values.set({0x2000, 0}, -static_cast<int>(value));
    s.values.set_text({0x2001, 0}, std::string(value % 37, static_cast<char>('a' + value % 26)));
  };
  /// 0 = defaults.
  const auto read = [](Stored& s) -> int {
    s.start();
    const auto value = s.values.get_or<std::uint16_t>({0x1017, 0}, 0);
    const auto text = s.values.get_text({0x2001, 0});
    if (value == 100 && s.get(0x2000) == 0 && text == "abc") return 0;
    const bool whole =
        s.get(0x2000) == -int{value} && text == std::string(value % 37u, static_cast<char>('a' + value % 26));
    return whole ? value : -1;
  };
  const auto cut_save = [](Stored& s, std::uint64_t bytes, int torn) {
    s.bench.was_cut = false;
    s.bench.store = &s.store;
    s.bench.flash.cut_after(bytes, torn);
    EXPECT_TRUE(s.store.save(s.values, 1));
    s.bench.finish();
    s.bench.flash.never_cut();
    return s.bench.was_cut;
  };
  for (int history = 0; history <= 3; ++history) {
    for (const int torn : {-1, 0x00, 0x5A, 0xFF}) {
      for (std::uint64_t cut = 0;; ++cut) {
        Stored s;
        for (int i = 0; i < history; ++i) {
          write(s, 1000 + static_cast<unsigned>(i));
          ASSERT_TRUE(s.save(1));
        }
        const int before = history == 0 ? 0 : 999 + history;
        write(s, 2000);
        const bool was_cut = cut_save(s, cut, torn);
        const int found = read(s);
        ASSERT_TRUE(found == before || found == 2000) << "history " << history << " cut " << cut << " found " << found;
        ASSERT_TRUE(was_cut || found == 2000);
        ++(found == before ? old_seen : new_seen);
        for (const std::uint64_t second : {cut / 2, cut, cut + 4}) {
          write(s, 3000);
          cut_save(s, second, torn);
          const int then = read(s);
          ASSERT_TRUE(then == found || then == 3000)
              << "history " << history << " cuts " << cut << ", " << second << " found " << then;
          if (then != found) break;
        }
        write(s, 4000);
        ASSERT_TRUE(s.save(1));
        ASSERT_EQ(read(s), 4000);
        if (!was_cut) break;
      }
    }
  }
  EXPECT_GT(old_seen, 500U);
  EXPECT_GE(new_seen, 16U);
}

// Any values, any order of saves, restores and power losses in time: what a start finds is a model's old or new state,
// group by group.
RC_GTEST_PROP(ParameterStore, AnyMixOfSavesRestoresAndPowerLosses, (std::uint64_t seed)) {
  struct State {
    unsigned heartbeat = 100;
    int manufacturer = 0;
    float application = 0;
    bool operator==(const State&) const = default;
  };
  Random random(seed);
  Stored s;
  State stored;
  for (int round = 0; round < 60; ++round) {
    State now{static_cast<unsigned>(random.below(65536)), static_cast<int>(random.below(30000)),
              static_cast<float>(random.below(5))};
    s.values.set({0x1017, 0}, now.heartbeat);
    s.values.set({0x2000, 0}, now.manufacturer);
    s.values.set({0x6000, 0}, now.application);
    const auto group = static_cast<std::uint8_t>(random.between(1, 4));
    const bool saves = random.chance(700'000);
    State wanted = stored;
    const State from = saves ? now : State{};
    if (group == 1 || group == 2) wanted.heartbeat = from.heartbeat;
    if (group == 1 || group == 3) wanted.application = from.application;
    if (group == 1 || group == 4) wanted.manufacturer = from.manufacturer;
    const bool begun = saves ? s.store.save(s.values, group) : s.store.restore(s.values, group);
    RC_ASSERT(begun);
    s.bench.ok.reset();
    s.bench.executor.advance(s.bench.executor.now() + std::chrono::microseconds(random.below(4000)));
    const bool done = s.bench.ok.has_value();
    s.bench.flash.forget();
    s.start();
    const State found{s.values.get_or<std::uint16_t>({0x1017, 0}, 0), static_cast<int>(s.get(0x2000)),
                      s.values.get_or<float>({0x6000, 0}, 0)};
    RC_ASSERT(found == wanted || (!done && found == stored));
    stored = found;
  }
}

// Bytes from elsewhere on the memory: no crash, and nothing that the dictionary forbids.
RC_GTEST_PROP(ParameterStore, AnyBytesOnTheMemoryAreSurvived, (std::uint64_t seed)) {
  Random random(seed);
  Stored s;
  s.values.set({0x2000, 0}, -7);
  s.values.set_text({0x2001, 0}, "some text");
  RC_ASSERT(s.save(1));
  std::vector<std::uint8_t> bytes(s.bench.flash.image().begin(), s.bench.flash.image().end());
  for (auto n = random.between(1, 8); n > 0; --n)
    bytes[random.below(bytes.size())] = static_cast<std::uint8_t>(random.next());
  s.bench.flash.restore(bytes);
  s.start();
  const auto value = s.get(0x2000);
  RC_ASSERT(value == 0 || value == -7);
}

}  // namespace
}  // namespace berth::device
