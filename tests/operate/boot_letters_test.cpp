// Devices that misbehave while they boot, and what the slot says of them: CiA 302-2's letters, and one patience for
// slow answers. tests/peers/test_boot_up.py tries the same by raw sockets.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/harness/master_ear.hpp"
#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using manager::BootStatus;
using places::SlotState;

namespace boot_letters_tests {
namespace {

constexpr NodeId node{5};

// A port that loses what a test says: frames that come in, and what it sees go out.
class Sieve final : public can::Port, private can::Listener {
 public:
  explicit Sieve(can::Port& beneath) : beneath_(&beneath) {}
  std::function<bool(const can::Frame&)> loses;
  std::function<void(const can::Frame&)> goes_out;
  std::function<void(can::Frame&)> alters;

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (goes_out) goes_out(frame);
    can::Frame sent = frame;
    if (alters) alters(sent);
    return beneath_->send(sent, tag);
  }
  void withdraw(std::uint32_t tag) noexcept override { beneath_->withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    beneath_->listen(listener == nullptr ? nullptr : this, accept);
  }
  [[nodiscard]] can::Status status() const noexcept override { return beneath_->status(); }
  bool restart(std::uint32_t bit_rate) noexcept override { return beneath_->restart(bit_rate); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    if (!loses || !loses(frame)) listener_->received(frame, at);
  }
  void sent(std::uint32_t tag, rt::Time at) noexcept override { listener_->sent(tag, at); }
  void changed(const can::Status& status, rt::Time at) noexcept override { listener_->changed(status, at); }
  can::Port* beneath_;
  can::Listener* listener_ = nullptr;
};

struct World {
  design::Machine machine = one_bus(125'000);
  plant::PlantFile plant = one_bus_plant(1);
};

plant::PlantDevice& add_fixed(World& w, const std::string& name, TypeCode type, unsigned id) {
  auto& d = add_device(w.plant, name, type, 0x70 + id);
  d.source = plant::NodeIdSource::switches;
  d.node_id = NodeId(static_cast<std::uint8_t>(id));
  d.speaks = {};
  return d;
}

void add_fixed_slot(World& w, unsigned id, TypeCode type = type_b) {
  add_slot(w.machine, id, type);
  w.machine.slots.back().spec.assign = places::Assign::fixed;
}

// One slot and its device.
World one() {
  World w;
  add_fixed_slot(w, node.value());
  add_fixed(w, "d", type_b, node.value());
  return w;
}

operate::SlotReport slot(Rig& rig) {
  const auto all = rig.network(0).report();
  return *std::ranges::find(all, node, &operate::SlotReport::id);
}

bool says(Rig& rig, const std::string& words) { return slot(rig).reason.find(words) != std::string::npos; }

bool is_heartbeat(const can::Frame& frame) { return frame.id == 0x700U + node.value() && frame.data[0] != 0; }

bool answers(const can::Frame& frame, std::uint16_t index) {
  return frame.id == 0x580U + node.value() && frame.data[1] == (index & 0xFFU) && frame.data[2] == index >> 8U;
}

bool writes(const can::Frame& frame, std::uint16_t index) {
  return frame.id == 0x600U + node.value() && (frame.data[0] & 0xE0U) == 0x20 && frame.data[1] == (index & 0xFFU) &&
         frame.data[2] == index >> 8U;
}

bool starts(const can::Frame& frame) {
  return frame.id == 0 && frame.size == 2 && frame.data[0] == 0x01 &&
         (frame.data[1] == node.value() || frame.data[1] == 0);
}

// A world whose master hears through a sieve.
struct Sieved {
  explicit Sieved(const World& w) : rig(w.machine, w.plant) {
    rig.put_between([this](can::Port& port, const std::string&) {
      sieve = std::make_unique<Sieve>(port);
      sieve->loses = [this](const can::Frame& frame) { return loses && loses(frame); };
      sieve->goes_out = [this](const can::Frame& frame) {
        if (goes_out) goes_out(frame);
      };
      sieve->alters = [this](can::Frame& frame) {
        if (alters) alters(frame);
      };
      return sieve.get();
    });
  }
  std::function<bool(const can::Frame&)> loses;
  std::function<void(const can::Frame&)> goes_out;
  std::function<void(can::Frame&)> alters;
  std::unique_ptr<Sieve> sieve;
  Rig rig;
};

}  // namespace

// ---- one patience

// A device that answers late is there, however many slots of the bus are empty, and these take no minutes.
TEST(BootLetters, ASlowAnswerIsAnAnswerOnAFullAndOnAnEmptyBus) {
  struct Case {
    std::uint32_t rate;
    unsigned slots;
    std::chrono::milliseconds response;
  };
  for (const auto& [rate, slots, response] :
       {Case{125'000, 1, 50ms}, Case{125'000, 1, 100ms}, Case{125'000, 1, 250ms}, Case{125'000, 1, 450ms},
        Case{125'000, 1, 900ms}, Case{125'000, 30, 450ms}, Case{20'000, 30, 900ms}, Case{20'000, 126, 450ms},
        Case{1'000'000, 126, 100ms}}) {
    World w;
    w.machine.buses.front().bitrate = rate;
    for (unsigned id = 1; id <= slots; ++id) {
      if (id == node.value() || slots == 1) continue;
      add_fixed_slot(w, id);
      w.machine.slots.back().spec.optional = true;
    }
    add_fixed_slot(w, node.value());
    add_fixed(w, "d", type_b, node.value()).response = {response, response, 0, 0ms};
    Rig rig(w.machine, w.plant);
    rig.begin();
    EXPECT_TRUE(rig.run_until([&] { return slot(rig).state == SlotState::operational; }, 40s))
        << rate << " bit/s, " << slots << " slots, " << response.count() << " ms\n"
        << rig.log();
  }
}

// What a late answer taught holds for every question after it.
TEST(BootLetters, WhatALateAnswerTaughtIsWaitedFor) {
  World w = one();
  w.plant.devices.front().response = {900ms, 900ms, 0, 0ms};
  Rig rig(w.machine, w.plant);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig).state == SlotState::operational; }, 60s)) << rig.log();
  const auto late = rig.network(0).services().sdo.late(node);
  EXPECT_GT(late, 0U);
  EXPECT_LE(late, 6U) << "one question is enough to learn from\n" << rig.log();
  EXPECT_GE(rig.network(0).services().patience.times[node.value()], 900ms);
}

// It boots between the answer that says who it is and the end of the wait for a second one: what it was heard to be
// before is no longer its state.
TEST(BootLetters, LIsNotTheLetterOfOneThatBootedWhileItWasAskedWhoItIs) {
  World w = one();
  w.plant.devices[0].reset = 3ms;
  Sieved s(w);
  s.rig.begin();
  ASSERT_TRUE(s.rig.until_operational(30s)) << s.rig.log();
  s.rig.kill();
  bool asked = false;
  const can::Frame serial = can::Frame::base(0x600U + node.value(), {0x40, 0x18, 0x10, 4, 0, 0, 0, 0});
  s.goes_out = [&](const can::Frame& frame) { asked = asked || frame == serial; };
  s.rig.begin();
  ASSERT_TRUE(s.rig.run_until([&] { return asked; }, 30s)) << s.rig.log();
  s.rig.run_for(5ms);  // it has answered
  s.rig.device("d").reset();
  ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).state == SlotState::operational; }, 60s)) << s.rig.log();
  EXPECT_EQ(s.rig.device("d").truth().state, NmtState::operational) << s.rig.log();
}

// ---- K

// It booted at the moment it was started, and its boot-up message was lost: 1017h is what it was, and keeps what is
// written again. That is a boot-up, and no device that sends no heartbeat.
TEST(BootLetters, KIsNotTheLetterOfOneThatBootedUnheard) {
  Sieved s(one());
  bool started = false;
  s.goes_out = [&](const can::Frame& frame) { started = started || starts(frame); };
  s.loses = [](const can::Frame& frame) { return frame.id == 0x700U + node.value() && frame.data[0] == 0; };
  s.rig.begin();
  ASSERT_TRUE(s.rig.run_until([&] { return started; }, 30s)) << s.rig.log();
  s.rig.device("d").reset();
  ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).state == SlotState::operational; }, 60s)) << s.rig.log();
  EXPECT_EQ(s.rig.device("d").truth().state, NmtState::operational) << s.rig.log();
  EXPECT_EQ(s.rig.log().find("asked by SDO"), std::string::npos) << s.rig.log();
}

TEST(BootLetters, KAHeartbeatThatNeverStartsStaysFailedUntilOneComes) {
  Sieved s(one());
  unsigned starts_sent = 0;
  s.loses = is_heartbeat;
  s.goes_out = [&](const can::Frame& frame) { starts_sent += starts(frame) ? 1 : 0; };
  s.rig.begin();
  ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).state == SlotState::failed; }, 10s)) << s.rig.log();
  const std::size_t told = s.rig.events().size();
  s.rig.run_for(120s);
  EXPECT_EQ(slot(s.rig).state, SlotState::failed) << s.rig.log();
  EXPECT_EQ(slot(s.rig).boot, BootStatus::k);
  EXPECT_TRUE(says(s.rig, "no heartbeat came for 1500 ms, though 1017h was set to 500 ms")) << slot(s.rig).reason;
  EXPECT_EQ(s.rig.events().size(), told) << "it stays that\n" << s.rig.log();
  EXPECT_EQ(starts_sent, 1U) << "it is started once\n" << s.rig.log();
  EXPECT_EQ(s.rig.log().find("operational: "), std::string::npos) << s.rig.log();
  s.loses = {};
  ASSERT_TRUE(s.rig.until_operational(5s)) << s.rig.log();
  EXPECT_EQ(slot(s.rig).boot, BootStatus::booted);
  EXPECT_EQ(slot(s.rig).reason, "");
  // From here on by its heartbeat.
  s.rig.run_for(10s);
  s.rig.device("d").unplug();
  ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).state == SlotState::absent; }, 3s)) << s.rig.log();
}

TEST(BootLetters, KItIsWatchedBySdoMeanwhile) {
  Sieved s(one());
  s.loses = is_heartbeat;
  s.rig.begin();
  ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).state == SlotState::failed; }, 10s)) << s.rig.log();
  s.rig.device("d").unplug();
  ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).state == SlotState::absent; }, 10s)) << s.rig.log();
  EXPECT_EQ(slot(s.rig).boot, BootStatus::b);
  s.loses = {};
  s.rig.device("d").plug();
  EXPECT_TRUE(s.rig.until_operational(20s)) << s.rig.log();
}

// A device that accepts each write of 1017h and keeps 0 has no heartbeat: it is watched by what it has.
TEST(BootLetters, ADeviceThatKeepsNoHeartbeatTimeIsOperationalAndWatched) {
  for (const bool guards : {true, false}) {
    Sieved s(one());
    s.alters = [&](can::Frame& frame) {
      if (writes(frame, 0x1017)) frame.data[4] = frame.data[5] = 0;
      if (frame.remote && !guards) frame.id = 0x7F0;  // no node's
    };
    s.rig.begin();
    ASSERT_TRUE(s.rig.until_operational(20s)) << s.rig.log();
    s.rig.run_for(60s);
    EXPECT_TRUE(s.rig.operational()) << s.rig.log();
    EXPECT_EQ(s.rig.device("d").truth().state, NmtState::operational);
    EXPECT_EQ(slot(s.rig).boot, guards ? BootStatus::booted : BootStatus::k);
    EXPECT_TRUE(says(s.rig, "500 ms: the device accepts the write and keeps 0")) << slot(s.rig).reason;
    EXPECT_TRUE(says(s.rig, guards ? "it is watched by guarding" : "it is asked by SDO")) << slot(s.rig).reason;
    s.rig.device("d").unplug();
    ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).state == SlotState::absent; }, 10s)) << s.rig.log();
    s.rig.device("d").plug();
    EXPECT_TRUE(s.rig.until_operational(20s)) << s.rig.log();
  }
}

// ---- B

TEST(BootLetters, BADeviceThatAnswers1018hAndNot1000h) {
  for (const bool beats : {false, true}) {
    World w = one();
    if (beats) w.plant.devices.front().heartbeat = 200ms;
    Sieved s(w);
    s.loses = [](const can::Frame& frame) { return answers(frame, 0x1000); };
    s.rig.begin();
    s.rig.run_for(30s);
    EXPECT_EQ(slot(s.rig).state, SlotState::absent) << s.rig.log();
    EXPECT_EQ(slot(s.rig).boot, BootStatus::b);
    EXPECT_TRUE(says(s.rig, "1000h")) << slot(s.rig).reason;
    s.loses = {};
    EXPECT_TRUE(s.rig.until_operational(60s)) << s.rig.log();
    EXPECT_EQ(slot(s.rig).boot, BootStatus::booted);
  }
}

// The same for one that LSS gave its node-ID.
TEST(BootLetters, BAlsoBehindABindingByLss) {
  World w;
  add_slot(w.machine, node.value(), type_b);
  add_device(w.plant, "d", type_b, 7);
  Sieved s(w);
  s.loses = [](const can::Frame& frame) { return answers(frame, 0x1000); };
  s.rig.begin();
  ASSERT_TRUE(s.rig.run_until([&] { return slot(s.rig).boot == BootStatus::b; }, 30s)) << s.rig.log();
  EXPECT_TRUE(says(s.rig, "1000h")) << slot(s.rig).reason;
  EXPECT_EQ(s.rig.log().find("operational: "), std::string::npos) << s.rig.log();
}

// ---- another device's mismatch

TEST(BootLetters, TheMismatchOfADeviceLeavesWithIt) {
  World w;
  add_fixed_slot(w, node.value());
  add_fixed(w, "other", type_c, node.value());
  add_fixed(w, "right", type_b, node.value()).plugged = false;
  add_fixed(w, "beside", type_a, 9);  // somebody acknowledges
  Rig rig(w.machine, w.plant);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig).state == SlotState::wrong_type; }, 10s)) << rig.log();
  EXPECT_EQ(slot(rig).boot, BootStatus::m);
  rig.device("other").unplug();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig).state == SlotState::empty; }, 60s)) << rig.log();
  EXPECT_EQ(slot(rig).boot, BootStatus::booted) << "that was the other one's";
  rig.device("right").plug();
  ASSERT_TRUE(rig.until_operational(30s)) << rig.log();
  EXPECT_EQ(slot(rig).boot, BootStatus::booted);
}

// Letter C is found before 1017h is written: nothing but a question tells that the device has left.
TEST(BootLetters, AWrongDeviceTypeLeavesWithItsDevice) {
  World w = one();
  w.machine.slots.back().spec.device_type = 0x7777;
  add_fixed(w, "beside", type_a, 9);
  Rig rig(w.machine, w.plant);
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig).boot == BootStatus::c; }, 10s)) << rig.log();
  const std::size_t told = rig.events().size();
  rig.run_for(60s);
  EXPECT_EQ(rig.events().size(), told) << "while it is there it stays C\n" << rig.log();
  rig.device("d").unplug();
  ASSERT_TRUE(rig.run_until([&] { return slot(rig).state == SlotState::absent; }, 10s)) << rig.log();
  EXPECT_EQ(slot(rig).boot, BootStatus::b);
}

// ---- J

// It restarts each time that its limit is written, 200 ms or four seconds long.
TEST(BootLetters, JARestartInTheConfigurationKeepsItsCause) {
  for (const auto boots_in : {200ms, 4000ms}) {
    World w;
    add_fixed_slot(w, node.value(), type_pump);
    w.machine.slots.back().spec.config = example_eds("pump.dcf");
    auto& d = add_fixed(w, "d", type_pump, node.value());
    d.boot = d.reset = boots_in;
    Sieved s(w);
    bool good = false;
    bool restarts = false;
    unsigned written = 0;
    s.goes_out = [&](const can::Frame& frame) {
      if (!writes(frame, 0x2000)) return;
      ++written;
      restarts = !good;
    };
    s.rig.begin();
    const auto run = [&](rt::Duration time, const std::function<bool()>& done) {
      const rt::Time end = s.rig.now() + time;
      while (s.rig.now() < end && !done()) {
        static_cast<void>(s.rig.run_until([&] { return restarts || done(); }, end - s.rig.now()));
        if (std::exchange(restarts, false)) s.rig.device("d").reset();
      }
      return done();
    };
    ASSERT_TRUE(run(120s, [&] { return says(s.rig, "in a row"); })) << s.rig.log();
    const unsigned before = written;
    run(60s, [] { return false; });
    EXPECT_EQ(slot(s.rig).state, SlotState::failed) << s.rig.log();
    EXPECT_EQ(slot(s.rig).boot, BootStatus::j);
    EXPECT_TRUE(says(s.rig, "its configuration failed")) << slot(s.rig).reason;
    EXPECT_EQ(written, before) << "it is not written again and again\n" << s.rig.log();
    good = true;
    s.rig.device("d").unplug();
    s.rig.run_for(1s);
    s.rig.device("d").plug();
    EXPECT_TRUE(run(60s, [&] { return s.rig.operational(); })) << s.rig.log();
  }
}

}  // namespace boot_letters_tests
