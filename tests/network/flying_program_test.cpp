// The active master is gone in the middle of a program's download: the standby master finds a boot loader, and begins
// anew (docs/flying-master.md §Taking over, docs/programs.md).
#include "berth/network/dictionary_manager.hpp"
#include "tests/network/program_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;

namespace {

constexpr std::uint32_t assigned_and_updated =
    0x05 | 1U << 5U | 1U << 6U;  // assigned, booted, software checked and updated
constexpr std::size_t program_size = 6'000;

std::shared_ptr<const od::Description> updating_flying_master() {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
  add_manager_objects(
      b, {.most = 3, .startup = 0x21, .longest_concise = 0, .longest_program = 9'000, .flying = true, .priority = 0});
  return b.build();
}

struct UpdatingMaster {
  UpdatingMaster(ProgramRig& bus, std::uint8_t id, std::uint8_t priority)
      : controller(bus.wire.attach({.queue_depth = 64, .rx_depth = 256})),
        dispatcher(bus.world.executor(), *controller),
        master(dispatcher, updating_flying_master(), nullptr,
               {.address = {1, 2, 3, id},
                .source = device::NodeIdSource::fixed,
                .node_id = NodeId(id),
                .presets = {{{0x1F90, 3}, priority},
                            {{0x1F81, 1}, assigned_and_updated},
                            {{0x1F84, 1}, programmed_type},
                            {{0x1F55, 1}, crc32(program_content(program_size, 1))},
                            {{0x1016, 1}, 1U << 16U | 300U}}}),
        manager(dispatcher, master.values(), [this](co::NmtCommand command) { master.apply(command); }) {
    master.on().parameters = [this] {
      EXPECT_EQ(master.values().write({0x1F58, 1}, program_image(program_size, 1)), od::AbortCode::none);
    };
    master.on().state = [this, id](NmtState state) { manager.own_state(state, NodeId(id)); };
    master.power_on();
  }
  void off() {
    manager.power_off();
    master.power_off();
    controller->power(false);
  }
  std::unique_ptr<sim::Controller> controller;
  can::Dispatcher dispatcher;
  device::Device master;
  DictionaryManager manager;
};

struct StartCount : can::Tap {
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const bool of_block = frame.id == 0x601 && frame.size == 8;
    if (of_block) ++requests;
    if (frame.id == 0 && frame.size == 2 && frame.data[0] == 1) ++starts;
  }
  unsigned requests = 0;
  unsigned starts = 0;
};

}  // namespace

TEST(FlyingMaster, TakeOverInTheMiddleOfAProgram) {
  for (const unsigned frames : {20U, 150U, 400U, 800U, 850U}) {
    SCOPED_TRACE(std::to_string(frames) + " requests to the device");
    ProgramRig bus(1);
    StartCount starts;
    bus.wire.add_tap(starts);
    UpdatingMaster first(bus, 10, 0);
    const UpdatingMaster second(bus, 11, 1);
    ASSERT_TRUE(bus.world.run_until([&] { return starts.requests >= frames; }, 60s));
    ASSERT_TRUE(first.manager.flying().is_master());
    ASSERT_EQ(starts.starts, 0U);
    first.off();
    ASSERT_TRUE(bus.world.run_until([&] { return second.manager.flying().is_master(); }, 10s));
    auto& device = *bus.devices[1];
    EXPECT_TRUE(bus.world.run_until([&] { return device.device.state() == NmtState::operational; }, 120s));
    EXPECT_EQ(device.held(), program_content(program_size, 1));
    bus.world.run_for(2s);
    EXPECT_EQ(starts.starts, 1U);
    bus.wire.remove_tap(starts);
  }
}
