// An answer that comes too late lends its part of an address to another device's: RAND finds a device that is not
// there.
#include <gtest/gtest.h>
#include <memory>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using namespace std::chrono_literals;
using places::SlotState;

namespace {

// Answers each first question for the last part of an address, IURS 7, as a device that is late with another part does.
class Stray final : public can::Tap {
 public:
  Stray(plant::World& world, sim::Bus& bus, std::uint16_t chunk)
      : world_(&world), bus_(&bus), chunk_(chunk), controller_(bus.attach({.name = "stray"})) {
    bus.add_tap(*this);
  }
  ~Stray() { bus_->remove_tap(*this); }
  Stray(const Stray&) = delete;
  Stray& operator=(const Stray&) = delete;
  unsigned answers = 0;

 private:
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    constexpr std::uint32_t request = 0x1F94'0000;
    const bool asks = frame.extended && frame.id == request && frame.data[0] == 0x80 && frame.data[1] == 0x07;
    if (!asks || answers > 0) return;
    ++answers;
    can::Frame answer;
    answer.id = 0x1F50'0000U + 4U * chunk_;
    answer.extended = true;
    answer.size = 0;
    world_->sim().after(300us, [this, answer] { controller_->send(answer, 0); });
  }
  plant::World* world_;
  sim::Bus* bus_;
  std::uint16_t chunk_;
  std::unique_ptr<sim::Controller> controller_;
};

}  // namespace

// Two slots of one type, of which one takes one revision only. The device of that revision is there; with one that is
// not, each would get a slot, and the device the one that the next needs (seed 922706).
TEST(StrayAnswers, ADeviceThatIsNotThereDoesNotMoveAnotherIntoTheWrongSlot) {
  auto machine = one_bus(500'000);
  add_slot(machine, 11, type_c);
  add_slot(machine, 12, type_c);
  machine.slots.back().spec.rule = places::RevisionRule::exact;
  machine.slots.back().spec.revision = 1;
  auto plant = one_bus_plant(1);
  add_device(plant, "first", type_c, 1).address.revision = 1;
  auto& second = add_device(plant, "second", type_c, 2);
  second.plugged = false;
  Rig rig(machine, plant);
  const Stray stray(rig.world(), *rig.world().bus("backbone"), 0x30);
  rig.begin();
  rig.run_for(5s);
  EXPECT_EQ(stray.answers, 1U);
  rig.device("second").plug();
  EXPECT_TRUE(rig.until_operational(20s)) << rig.log();
  using Seats = std::vector<std::pair<unsigned, std::uint32_t>>;
  EXPECT_EQ(rig.seats(), (Seats{{11, 2}, {12, 1}})) << rig.log();
}
