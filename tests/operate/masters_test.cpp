// Several Berths as flying masters of one bus (`[bus.NAME.flying_master]`; docs/flying-master.md): one works, the
// others stand by and send nothing, and take over what is there.
#include <gtest/gtest.h>

#include <map>
#include <optional>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace {

// One bus, its devices, and Berths with a slot table of their own each.
class Berths : private can::Tap, private plant::World::Observer {
 public:
  Berths(const design::Machine& machine, const plant::PlantFile& file, const std::vector<std::uint8_t>& priorities) {
    Findings findings;
    const std::vector<plant::BusRate> rates{{"backbone", machine.buses[0].bitrate}};
    world_ = plant::World::make(file, rates, findings);
    world_->bus("backbone")->add_tap(*this);
    world_->add_observer(*this);
    for (std::size_t i = 0; i < priorities.size(); ++i) {
      auto& one = *berths_.emplace_back(std::make_unique<One>());
      one.machine = machine;
      one.machine.buses[0].master = NodeId(static_cast<std::uint8_t>(127 - i));
      one.machine.buses[0].flying = design::FlyingBus{priorities[i], {}};
    }
    world_->start();
  }
  ~Berths() {
    for (auto& one : berths_) kill(*one);
    world_->bus("backbone")->remove_tap(*this);
    world_->remove_observer(*this);
  }

  void begin(std::size_t i) {
    One& one = *berths_[i];
    one.port = world_->attach_master("backbone");
    operate::NetworkObserver observer;
    observer.event = [&one](const operate::Event& event) { one.lines.push_back(operate::to_line(event)); };
    one.network = std::make_unique<operate::Network>(world_->executor(), *one.port, one.machine.buses[0],
                                                     one.machine.specs("backbone"), one.store, observer);
    ASSERT_TRUE(one.network->open());
    one.network->start();
  }
  // It dies where it stands.
  void kill(std::size_t i) { kill(*berths_[i]); }
  [[nodiscard]] bool leads(std::size_t i) const {
    const auto master = berths_[i]->network ? berths_[i]->network->services().master : std::nullopt;
    return master && master->here;
  }
  [[nodiscard]] operate::Network& network(std::size_t i) { return *berths_[i]->network; }
  [[nodiscard]] bool operational(std::size_t i) const {
    return berths_[i]->network->operational() && berths_[i]->network->idle();
  }
  bool run_until(const std::function<bool()>& done, rt::Duration limit = 120s) {
    return world_->sim().run_until(done, limit);
  }
  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  // Frames of this Berth's controller, by identifier, since `forget`.
  [[nodiscard]] std::map<std::uint32_t, unsigned> sent_by(std::size_t i) const {
    const auto found = sent_.find(berths_[i]->port ? berths_[i]->port->number() : -1);
    return found == sent_.end() ? std::map<std::uint32_t, unsigned>{} : found->second;
  }
  void forget() {
    sent_.clear();
    commands.clear();
  }
  std::vector<std::string> commands;  // NMT
  [[nodiscard]] std::string log() const {
    std::string text;
    for (const auto& one : berths_) {
      text += "---\n";
      for (const auto& line : one->lines) text += line + "\n";
    }
    return text;
  }
  [[nodiscard]] plant::World& world() { return *world_; }
  unsigned second_starts = 0;
  unsigned left_operational = 0;

 private:
  struct One {
    design::Machine machine;
    places::MemoryStore store;
    std::unique_ptr<sim::Controller> port;
    std::unique_ptr<operate::Network> network;
    std::vector<std::string> lines;
  };
  static void kill(One& one) {
    one.network.reset();
    one.port.reset();
  }
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    ++sent_[sender][frame.key()];
    if (frame.key() == 0) commands.push_back(can::to_string(frame));
    const bool start = frame.key() == 0 && frame.size == 2 && frame.data[0] == 1;
    if (!start) return;
    for (const auto& device : world_->devices()) {
      const auto since = runs_since_[device.get()];
      const auto id = device->device().node_id();
      const bool meant = id.configured() && (frame.data[1] == 0 || frame.data[1] == id.value());
      if (meant && since && *since < at) ++second_starts;
    }
  }
  void plant_changed(const plant::SimDevice& device) noexcept override {
    auto& since = runs_since_[&device];
    const bool runs = device.powered() && device.device().state() == NmtState::operational;
    if (since && !runs) ++left_operational;
    if (!runs) since.reset();
    if (runs && !since) since = world_->executor().now();
  }

  std::unique_ptr<plant::World> world_;
  std::vector<std::unique_ptr<One>> berths_;
  std::map<int, std::map<std::uint32_t, unsigned>> sent_;
  std::map<const plant::SimDevice*, std::optional<rt::Time>> runs_since_;
};

bool only_agrees(const std::map<std::uint32_t, unsigned>& frames) {
  return std::ranges::all_of(frames, [](const auto& f) { return f.first >= 0x71 && f.first <= 0x76; });
}

}  // namespace

TEST(Masters, OneWorksAndTheOtherStandsByInSilence) {
  Berths berths(five_slots(), five_slaves(), {1, 1});
  berths.begin(0);
  berths.begin(1);
  // Of one priority the lower node-ID's slot time is over first: that is 126, the second.
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); })) << berths.log();
  EXPECT_FALSE(berths.leads(0));
  EXPECT_TRUE(only_agrees(berths.sent_by(0)));
  const auto master = berths.network(0).services().master;
  ASSERT_TRUE(master && master->active);
  EXPECT_EQ(master->active->node, NodeId(126));
  EXPECT_EQ(master->text(), "backbone: node 126 is the active NMT master (priority 1)");
  EXPECT_EQ(berths.network(1).services().master->text(),
            "backbone: node 126 is the active NMT master (priority 1), this Berth");
  for (const auto& slot : berths.network(0).report()) {
    EXPECT_EQ(slot.state, SlotState::unknown);
    EXPECT_EQ(slot.reason, "node 126 is the active NMT master");
  }
  berths.run_for(30s);
  EXPECT_TRUE(only_agrees(berths.sent_by(0)));
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
}

// The standby's slot table is empty: it knows the devices by what they are and have.
TEST(Masters, TheStandbyTakesOverADeadBerthsMachine) {
  Berths berths(five_slots(), five_slaves(), {0, 1});
  berths.begin(0);
  berths.begin(1);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
  berths.run_for(5s);
  berths.forget();
  berths.kill(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 60s)) << berths.log();
  berths.run_for(10s);
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
  // That for devices without a node-ID, which the dead one may have lent one, and no other.
  EXPECT_EQ(berths.commands, std::vector<std::string>{"000#82FF"});
  for (const auto& slot : berths.network(1).report()) EXPECT_EQ(slot.state, SlotState::operational) << berths.log();
}

// Whatever the dead one was in the middle of: searching, lending node-IDs, binding, storing, starting.
TEST(Masters, TakeOverAtAnyInstant) {
  for (const auto instant :
       {20ms, 150ms, 400ms, 700ms, 900ms, 1100ms, 1300ms, 1500ms, 1700ms, 2000ms, 2300ms, 3000ms}) {
    SCOPED_TRACE(std::to_string(instant / 1ms) + " ms after it became active");
    Berths berths(five_slots(), five_slaves(), {0, 1});
    berths.begin(0);
    berths.begin(1);
    ASSERT_TRUE(berths.run_until([&] { return berths.leads(0); }, 10s));
    berths.run_for(instant);
    berths.kill(0);
    ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 180s)) << berths.log();
    EXPECT_TRUE(berths.world().duplicates().empty());
    EXPECT_EQ(berths.second_starts, 0U) << berths.log();
    EXPECT_EQ(berths.left_operational, 0U) << berths.log();
  }
}

TEST(Masters, ABetterOneTakesOver) {
  Berths berths(five_slots(), five_slaves(), {2, 0});
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
  berths.begin(1);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 60s)) << berths.log();
  EXPECT_FALSE(berths.leads(0));
  berths.forget();
  berths.run_for(20s);
  EXPECT_TRUE(only_agrees(berths.sent_by(0))) << berths.log();
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
  // The former one takes it back when the better one is gone, with what its slot table knows.
  berths.kill(1);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); }, 60s)) << berths.log();
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
}

// A device that is exchanged while the one is active is known to the other by what it finds.
TEST(Masters, ThreeOfThemOneAfterTheOther) {
  Berths berths(five_slots(), five_slaves(), {0, 1, 2});
  for (std::size_t i = 0; i < 3; ++i) berths.begin(i);
  for (std::size_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(berths.run_until([&] { return berths.leads(i) && berths.operational(i); }, 60s)) << i << berths.log();
    for (std::size_t other = i + 1; other < 3; ++other) EXPECT_TRUE(only_agrees(berths.sent_by(other)));
    berths.kill(i);
  }
  EXPECT_EQ(berths.left_operational, 0U);
  EXPECT_EQ(berths.second_starts, 0U);
}

// A device of the plant is the standby master: it keeps the devices running, and Berth gets its role back.
TEST(Masters, ADeviceStandsInForBerth) {
  auto file = five_slaves();
  auto& standby = add_device(file, "standby", {7, 7}, 1);
  standby.node_id = NodeId(100);
  standby.source = plant::NodeIdSource::hard_coded;
  standby.speaks = {};
  standby.heartbeat = 500ms;
  standby.does.master = plant::PlantMaster{.priority = 1, .slaves = {1, 2, 3, 4, 5}, .keep_alive = true};
  Berths berths(five_slots(), file, {0});
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
  berths.run_for(5s);
  const auto& device = *berths.world().find("standby");
  EXPECT_EQ(device.truth().active_master, NodeId(127));
  berths.kill(0);
  ASSERT_TRUE(berths.run_until([&] { return device.truth().leads; }, 30s)) << berths.log();
  berths.run_for(10s);
  EXPECT_EQ(berths.left_operational, 0U);
  berths.begin(0);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); }, 60s)) << berths.log();
  EXPECT_FALSE(device.truth().leads);
  EXPECT_EQ(device.truth().active_master, NodeId(127));
  EXPECT_EQ(berths.second_starts, 0U);
}
