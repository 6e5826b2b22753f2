// `places::Binder` alone on a bus, with devices that hear and miss what the step at hand needs.
#include "berth/places/binder.hpp"

#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "tests/discovery/discovery_world.hpp"

using namespace berth;
using namespace berth::places;
using namespace std::chrono_literals;
using discovery::test::Node;
using discovery::test::World;

namespace {

constexpr LssAddress moving{0x11, 0x22, 1, 100};
constexpr NodeId old_id{9}, new_id{5};

// Another device, with the node-ID that the slot has.
struct Other {
  Other(sim::World& world, sim::Bus& bus)
      : controller(bus.attach({.queue_depth = 16, .rx_depth = 16})),
        dispatcher(world.executor(), *controller),
        device(dispatcher, description(), nullptr,
               {.address = {0x11, 0x22, 1, 200}, .source = device::NodeIdSource::fixed, .node_id = new_id}) {}
  static std::shared_ptr<const od::Description> description() {
    od::DescriptionBuilder b;
    device::add_device(b, {.type = 0, .name = "Other", .heartbeat_ms = 0});
    return b.build();
  }
  std::unique_ptr<sim::Controller> controller;
  can::Dispatcher dispatcher;
  device::Device device;
};

// What a device with the slot's node-ID says when it is asked who it is, so long behind the question.
class Voice final : private can::Handler {
 public:
  Voice(sim::World& world, sim::Bus& bus, const LssAddress& who, rt::Duration behind)
      : world_(world),
        who_(who),
        behind_(behind),
        controller_(bus.attach({.queue_depth = 16, .rx_depth = 16})),
        dispatcher_(world.executor(), *controller_) {
    dispatcher_.add(can::only(0x600U + new_id.value()), *this);
    dispatcher_.add(can::only(0x000), *this);
  }
  bool speaks = true;

 private:
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (frame.id == 0) {
      speaks = speaks || (frame.data[0] == 0x80 && frame.data[1] == new_id.value());
      return;
    }
    if (!speaks) return;
    const std::array parts{std::uint32_t{0}, who_.vendor, who_.product, who_.revision, who_.serial};
    can::Frame answer = frame;
    answer.id = 0x580U + new_id.value();
    answer.data[0] = 0x43;
    const bool identity = frame.data[1] == 0x18 && frame.data[2] == 0x10;
    answer.data[4] = static_cast<std::uint8_t>(identity ? parts.at(frame.data[3]) : 0U);
    world_.after(behind_, [this, answer] { dispatcher_.send(answer); });
  }
  sim::World& world_;
  LssAddress who_;
  rt::Duration behind_;
  std::unique_ptr<sim::Controller> controller_;
  can::Dispatcher dispatcher_;
};

struct Rig : World {
  explicit Rig(NodeId has = old_id, rt::Duration answers_after = 0ms) {
    const device::Timing timing{.response_min = answers_after, .response_max = answers_after};
    Node& node = add({.address = moving, .node_id = has, .timing = timing});
    node.overhears = [this](const can::Frame&) { return deaf; };
    binder_options.before_step = [this](const Binding& binding) {
      if (before) before(binding.step());
    };
  }
  Step bind(unsigned tries = 1) {
    const SlotId slot = *store.declare({"machine", "bus", "slot"});
    Binder binder({dispatcher, lss, sdo, nmt, boots, store, vacancy}, binder_options);
    Binding binding(Binding::Kind::bind, {.device = moving, .id = new_id}, tries);
    const std::string reason = "test";
    run(binder.run(binding, slot, reason));
    why = binding.why();
    return binding.step();
  }
  rt::Task<bool> select(LssAddress device) {
    const auto selected = co_await lss.switch_selective(device);
    co_return selected.has_value();
  }
  // As after a binding: the master knows how long answers take, and of nobody left in configuration.
  void learn_windows() {
    for (int i = 0; i < 2; ++i) EXPECT_TRUE(run(learn(moving)));
    lss.no_strangers();
  }
  rt::Task<bool> learn(LssAddress device) {
    const auto selected = co_await lss::select_alone(lss, device);
    const auto waiting = co_await lss.switch_global(lss::State::waiting);
    co_return selected&& waiting;
  }
  void hear_boot_up(NodeId id) { hear(id, 0x00); }
  void hear(NodeId id, std::uint8_t state) {
    can::Frame error_control;
    error_control.id = 0x700U + id.value();
    error_control.size = 1;
    error_control.data[0] = state;
    port_of_another->send(error_control, 0);
  }

  co::SdoClient sdo{dispatcher, {.timeout = 50ms}};
  co::NmtMaster nmt{dispatcher};
  BootWatch boots{dispatcher};
  MemoryStore store;
  VacancyTable vacancy{};
  Binder::Options binder_options;
  std::unique_ptr<sim::Controller> port_of_another{bus.attach({.queue_depth = 4})};
  std::function<void(Step)> before;
  bool deaf = false;
  Why why = Why::none;
};

}  // namespace

// The device misses `04 00` and the reset; meanwhile another comes with its new node-ID. It gets its old one back, and
// keeps it in its memory.
TEST(Binder, TheOldNodeIdIsGivenBack) {
  Rig rig;
  Other other(rig.world, rig.bus);
  rig.before = [&](Step step) {
    rig.deaf = step == Step::release;
    if (step == Step::await_boot_up) other.device.power_on();
  };
  EXPECT_EQ(rig.bind(), Step::failed);
  EXPECT_EQ(rig.why, Why::other_device);
  EXPECT_EQ(rig.nodes[0]->slave.persistent().node_id, old_id);
}

// A device that lacks 5Eh: where it answers by SDO it is reset.
TEST(Binder, ANodeIdThatLssDoesNotTellIsFoundBySdo) {
  Rig rig;
  const LssAddress address{0x11, 0x22, 1, 201};
  const auto controller = rig.bus.attach({.queue_depth = 16, .rx_depth = 16});
  can::Dispatcher dispatcher(rig.world.executor(), *controller);
  device::Options options{.address = address, .node_id = NodeId(77)};
  options.lss.without = {lss::Lackable::inquire_identity, lss::Lackable::inquire_node_id};
  device::Device mute(dispatcher, Other::description(), nullptr, options);
  mute.power_on();
  rig.world.run_for(500ms);
  const SlotId slot = *rig.store.declare({"machine", "bus", "slot"});
  Binder binder({rig.dispatcher, rig.lss, rig.sdo, rig.nmt, rig.boots, rig.store, rig.vacancy}, rig.binder_options);
  Binding binding(Binding::Kind::bind, {.device = address, .id = new_id}, 1);
  const std::string reason = "test";
  rig.run(binder.run(binding, slot, reason));
  EXPECT_EQ(binding.step(), Step::done) << name(binding.why());
  EXPECT_EQ(binding.old_id(), NodeId(77));
  EXPECT_EQ(mute.lss().active().node_id, new_id);
}

// As before, and its old node-ID has come into use by another device, too.
TEST(Binder, TheOldNodeIdIsNotGivenBackWhenAnotherHasIt) {
  Rig rig;
  Other other(rig.world, rig.bus);
  rig.before = [&](Step step) {
    rig.deaf = step == Step::release;
    if (step == Step::reset) rig.hear_boot_up(old_id);
    if (step == Step::await_boot_up) other.device.power_on();
  };
  EXPECT_EQ(rig.bind(), Step::failed);
  EXPECT_EQ(rig.why, Why::other_device);
  EXPECT_EQ(rig.nodes[0]->slave.persistent().node_id, NodeId());
}

// The device has its slot's node-ID already.
TEST(Binder, ADeviceThatKeepsItsNodeIdIsConfirmedThere) {
  Rig rig(new_id);
  const Voice own(rig.world, rig.bus, moving, 0ms);
  EXPECT_EQ(rig.bind(), Step::done);
}

// It is in NMT stopped, where it answers no SDO: a gateway, say, that stopped itself (FF01h) while its slot was free.
TEST(Binder, ADeviceThatKeepsItsNodeIdAndIsStoppedIsAskedAllTheSame) {
  Rig rig(new_id);
  Voice own(rig.world, rig.bus, moving, 0ms);
  own.speaks = false;
  rig.hear(new_id, 0x04);
  rig.world.run_for(1ms);
  EXPECT_EQ(rig.bind(), Step::done);
}

// So has another, which misses the first questions, and whose answers come behind the last.
TEST(Binder, ADeviceThatKeepsItsNodeIdIsNotConfirmedBesideASlowOne) {
  Rig rig(new_id);
  const Voice own(rig.world, rig.bus, moving, 0ms);
  Voice others(rig.world, rig.bus, {0x11, 0x22, 1, 200}, 12ms);
  rig.before = [&](Step step) { others.speaks = step == Step::identify; };
  EXPECT_EQ(rig.bind(), Step::failed);
  EXPECT_EQ(rig.why, Why::clone) << "two answered each time";
}

// Another is in LSS configuration, since it missed `04 00`, was deaf, and hears again while the last questions before
// the 11h are asked: its answer comes behind the device's own, and is waited for; the first time on a bus, where nobody
// knows how slow it is, for longer.
TEST(Binder, NobodyIsToldBesideASlowOneThatHearsTheLastQuestions) {
  for (const int hears_from : {0x5A, 0x5D, 0x5E}) {
    for (const auto& [calm, learnt] : {std::pair(false, true), {true, true}, {true, false}}) {
      SCOPED_TRACE(::testing::Message() << "from " << hears_from << (calm ? ", calm" : "")
                                        << (learnt ? ", learnt" : ""));
      Rig rig;
      const rt::Duration late = learnt ? 4ms : 30ms;
      Node& left = rig.add({.address = {0x11, 0x22, 1, 200}, .timing = {.response_min = late, .response_max = late}});
      ASSERT_TRUE(rig.run(rig.select(left.options.address)));
      bool asked = false, hears = false;
      left.overhears = [&](const can::Frame& f) {
        hears = hears || (asked && f.data[0] == hears_from);
        return !hears || f.data[0] == 0x04;
      };
      if (learnt) rig.learn_windows();
      asked = true;
      discovery::test::Record record(rig.bus);
      record.on_frame = [&](const can::Frame&) { EXPECT_NE(left.slave.pending().node_id, new_id); };
      if (calm) rig.world.run_for(500ms);
      rig.bind();
      EXPECT_TRUE(hears) << "this case is not the one that is meant";
    }
  }
}

// Another hears nothing before the 11h, which both execute: its answer comes a little behind, and nothing is stored.
TEST(Binder, NobodyStoresWhatTwoWereTold) {
  Rig rig;
  Node& moves = *rig.nodes[0];
  Node& left = rig.add({.address = {0x11, 0x22, 1, 200}, .timing = {.response_min = 4ms, .response_max = 4ms}});
  ASSERT_TRUE(rig.run(rig.select(left.options.address)));
  bool hears = false;
  left.overhears = [&](const can::Frame& f) {
    hears = hears || (f.data[0] == 0x11 && f.data[1] == new_id.value());
    return !hears || f.data[0] == 0x04;
  };
  rig.learn_windows();
  bool both = false;
  const auto has = [](const Node& node) { return node.slave.pending().node_id == new_id; };
  discovery::test::Record record(rig.bus);
  record.on_frame = [&](const can::Frame&) {
    both = both || (has(moves) && has(left));
    EXPECT_NE(left.slave.persistent().node_id, new_id);
  };
  rig.bind();
  EXPECT_TRUE(both) << "this case is not the one that is meant";
}

// It was proven alone, so that it is in configuration, wherever it is.
TEST(Binder, ADeviceThatIsSilentInConfigurationIsLostThere) {
  for (const Step from : {Step::inquire, Step::configure, Step::store}) {
    Rig rig;
    rig.before = [&](Step step) { rig.deaf = rig.deaf || step == from; };
    EXPECT_EQ(rig.bind(), Step::failed);
    EXPECT_TRUE(rig.lss.answer_times().lost) << name(from);
  }
}

// While it boots, another binding takes back from all in configuration what two of them were told: this one may have
// missed `04 00`, and have been told, too.
TEST(Binder, WhoMayHaveLostItsNodeIdWithAnotherIsToldAnew) {
  Rig rig(new_id);
  const Voice own(rig.world, rig.bus, moving, 0ms);
  unsigned told = 0;
  rig.before = [&](Step step) {
    if (step == Step::configure) ++told;
    if (step == Step::identify && told == 1) rig.lss.took_back();
  };
  EXPECT_EQ(rig.bind(2), Step::done);
  EXPECT_EQ(told, 2U);
}

// ---- another device in LSS configuration, which missed everything since ----

namespace {

bool gives_new_id(const can::Frame& f) { return f.data[0] == 0x11 && f.data[1] == new_id.value(); }
bool stores(const can::Frame& f) { return f.data[0] == 0x17; }

// It hears nothing until `hears`, and never `04 00`. Its answers come after the windows that were learnt.
struct Left {
  Left(Rig& rig, std::function<bool(const can::Frame&)> hears_from, rt::Duration late = 30ms)
      : node(rig.add({.address = {0x11, 0x22, 1, 200}, .timing = {.response_min = late, .response_max = late}})) {
    node.swallows = [](const can::Frame&) { return true; };
    rig.run(rig.select(node.options.address));
    EXPECT_EQ(node.slave.state(), lss::State::configuration);
    node.swallows = nullptr;
    node.overhears = [this, hears_from](const can::Frame& f) {
      hears = hears || hears_from(f);
      return !hears || f.data[0] == 0x04;
    };
    rig.learn_windows();
    EXPECT_LT(rig.lss.answer_times().slowest * 3 / 2, late);
  }
  [[nodiscard]] bool took() const { return node.slave.pending().node_id == new_id; }
  [[nodiscard]] bool stored() const { return node.slave.persistent().node_id == new_id; }
  Node& node;
  bool hears = false;
};

// Binds; it takes the node-ID, and never stores it.
void expect_told_and_not_stored(Rig& rig, const Left& left) {
  bool told = false;
  discovery::test::Record record(rig.bus);
  record.on_frame = [&](const can::Frame&) {
    told = told || left.took();
    EXPECT_FALSE(left.stored());
  };
  rig.bind();
  EXPECT_TRUE(told) << "this case is not the one that is meant";
}

}  // namespace

TEST(Binder, S1_53_WhereADeviceWasLostEveryAnswerToTheNodeIdIsWaitedFor) {
  Rig rig;
  const Left left(rig, gives_new_id);
  rig.lss.lost_one();
  rig.lss.no_strangers();
  expect_told_and_not_stored(rig, left);
}

// The device that is meant misses the first 11h; the other one hears the repetition.
TEST(Binder, S1_53_ARepeatedNodeIdIsProvenBeforeItIsStored) {
  Rig rig;
  unsigned given = 0;
  const Left left(rig, [&](const can::Frame& f) { return gives_new_id(f) && given > 1; });
  rig.nodes[0]->overhears = [&](const can::Frame& f) { return gives_new_id(f) && ++given == 1; };
  expect_told_and_not_stored(rig, left);
}

// Its answer to the 11h comes while Berth waits for another device's store to end.
TEST(Binder, S1_53_AnAnswerBetweenTwoRequestsStopsTheStore) {
  Rig rig;
  const Left left(rig, gives_new_id);
  rig.binder_options.stores_end = rig.dispatcher.executor().now() + 500ms;
  expect_told_and_not_stored(rig, left);
}

// It was lost, misses the 11h too, and answers the 17h, which the device that is meant misses.
TEST(Binder, S1_53_WhereADeviceWasLostAnAnswerToTheStoreIsNotBelieved) {
  Rig rig;
  Voice own(rig.world, rig.bus, moving, 0ms);
  own.speaks = false;
  const Left left(rig, stores);
  Node& meant = *rig.nodes[0];
  bool missed = false;
  meant.overhears = [&](const can::Frame& f) {
    missed = missed || stores(f);
    return stores(f);
  };
  rig.lss.lost_one();
  rig.lss.no_strangers();
  rig.before = [&](Step step) {
    if (step != Step::await_boot_up) return;
    own.speaks = true;
    rig.hear_boot_up(new_id);
  };
  EXPECT_NE(rig.bind(), Step::done);
  EXPECT_TRUE(missed && left.hears) << "this case is not the one that is meant";
}

// Both took the node-ID and both store; the other one is deaf for as long as that takes. Both are told to store none.
TEST(Binder, S1_53_AStoreByTwoIsWaitedForUntilTheSlowerOneIsDone) {
  Rig rig(old_id, 20ms);
  Left left(rig, gives_new_id, 40ms);
  rt::Time deaf_until{};
  left.node.overhears = [&, hears = left.node.overhears](const can::Frame& f) {
    const rt::Time now = rig.dispatcher.executor().now();
    if (now < deaf_until || hears(f)) return true;
    if (stores(f) && deaf_until == rt::Time{}) deaf_until = now + 300ms;
    return false;
  };
  left.node.swallows = [](const can::Frame& f) { return stores(f); };
  rig.bind();
  EXPECT_NE(deaf_until, rt::Time{}) << "this case is not the one that is meant";
  EXPECT_FALSE(left.stored());
}
