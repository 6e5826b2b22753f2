// The update of a device's program as a step of its boot-up (docs/programs.md): by a master's own dictionary, and with
// a power loss at every byte that the device writes.
#include <fmt/format.h>

#include "berth/network/boot_slave.hpp"
#include "tests/network/program_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using Phase = NetworkBoot::Phase;

namespace {

constexpr std::uint8_t updater_id = 100;
constexpr std::uint32_t checks = 0x0D | 1U << 5U;     // assigned, booted, mandatory, software checked
constexpr std::uint32_t updates = checks | 1U << 6U;  // and updated

std::shared_ptr<const od::Description> updating_master() {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
  add_manager_objects(b, {.most = 3, .startup = 1, .longest_concise = 0, .longest_program = 9'000});
  return b.build();
}

// A master whose 1F58h:01 holds a program, and slave 1.
struct UpdateRig : can::Tap {
  explicit UpdateRig(std::vector<device::Preset> presets, std::uint8_t slaves = 1, ProgrammedSpec spec = {})
      : bus(slaves, spec),
        controller(bus.wire.attach({.queue_depth = 64, .rx_depth = 256})),
        dispatcher(bus.world.executor(), *controller),
        master(dispatcher, updating_master(), nullptr,
               {.address = {1, 2, 3, 4},
                .source = device::NodeIdSource::fixed,
                .node_id = NodeId(updater_id),
                .presets = std::move(presets)}),
        manager(dispatcher, master.values(), [this](co::NmtCommand command) { master.apply(command); }) {
    bus.wire.add_tap(*this);
    // A DOMAIN is not among the stored parameters: the application has it.
    master.on().start = [this] {
      for (const auto& [node, image] : images) {
        EXPECT_EQ(master.values().write({0x1F58, node}, image), od::AbortCode::none);
      }
    };
    master.on().state = [this](NmtState state) { manager.own_state(state, NodeId(updater_id)); };
  }
  ~UpdateRig() { bus.wire.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const bool to_slave = frame.id == 0x601 || frame.id == 0x000 || frame.id == 0x701;
    if (to_slave) frames.push_back(frame);
  }
  void store(std::uint8_t node, const Image& image) { images[node] = image; }
  bool run_to(Phase phase, rt::Duration limit = 60s) {
    return bus.world.run_until([&] { return manager.network().phase() == phase; }, limit);
  }
  [[nodiscard]] const SlaveStatus& status(std::uint8_t id = 1) { return *manager.network().find(NodeId(id)); }
  [[nodiscard]] device::Device& slave(std::uint8_t id = 1) { return bus.devices[id]->device; }

  ProgramRig bus;
  std::unique_ptr<sim::Controller> controller;
  can::Dispatcher dispatcher;
  device::Device master;
  DictionaryManager manager;
  std::map<std::uint8_t, Image> images;
  std::vector<can::Frame> frames;
};

std::vector<device::Preset> rules_for(std::uint32_t assignment, std::uint32_t software, std::uint8_t node = 1) {
  return {{{0x1F81, node}, assignment},
          {{0x1F84, node}, programmed_type},
          {{0x1F85, node}, programmed_product.vendor},
          {{0x1F86, node}, programmed_product.product},
          {{0x1F55, node}, software},
          {{0x1016, node}, std::uint32_t{node} << 16U | 300U}};
}

}  // namespace

// S5.26: 1F55h against 1F56h, and the program of 1F58h when they differ and 1F81h bit 6 allows it.
TEST(ProgramBoot, S5_2_ABlankDeviceIsUpdatedAndStarted) {
  const auto content = program_content(4'000, 1);
  UpdateRig rig(rules_for(updates, crc32(content)));
  rig.store(1, program_image(4'000, 1));
  rig.master.power_on();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.bus.world.run_for(100ms);
  EXPECT_EQ(rig.status().result.status, BootStatus::booted) << rig.status().result.text();
  EXPECT_TRUE(rig.status().result.updated);
  EXPECT_EQ(rig.bus.devices[1]->held(), content);
  EXPECT_EQ(rig.slave().state(), NmtState::operational);
  // The next boot-up finds it right and downloads nothing.
  rig.frames.clear();
  rig.manager.network().command(co::NmtCommand::reset_node, NodeId(1));
  rig.bus.world.run_for(2s);
  EXPECT_EQ(rig.slave().state(), NmtState::operational);
  EXPECT_FALSE(rig.status().result.updated);
  const auto block = std::ranges::count_if(
      rig.frames, [](const can::Frame& f) { return f.id == 0x601 && (f.data[0] & 0xE1U) == 0xC0U; });
  EXPECT_EQ(block, 0);
}

TEST(ProgramBoot, WhatIsNotAllowedOrNotThereIsALetter) {
  const auto content = program_content(500, 1);
  const auto ends = [&](std::uint32_t assignment, std::uint32_t software, const Image& image) {
    UpdateRig rig(rules_for(assignment, software));
    if (!image.empty()) rig.store(1, image);
    rig.master.power_on();
    rig.bus.world.run_for(60s);
    EXPECT_NE(rig.slave().state(), NmtState::operational);
    return rig.status().result;
  };
  EXPECT_EQ(ends(checks, crc32(content), program_image(500, 1)).status, BootStatus::h) << "not allowed";
  EXPECT_EQ(ends(checks, 0, {}).status, BootStatus::g) << "not said what is expected";
  const auto none = ends(updates, crc32(content), {});
  EXPECT_EQ(none.status, BootStatus::i);
  EXPECT_NE(none.detail.find("1F58h"), std::string::npos) << none.detail;
  const auto other = ends(updates, crc32(content), program_image(500, 1, {.type = {9, 9}}));
  EXPECT_EQ(other.status, BootStatus::i);
  EXPECT_NE(other.detail.find("product"), std::string::npos) << other.detail;
  EXPECT_EQ(ends(updates, 0x1234, program_image(500, 1)).status, BootStatus::i) << "1F55h names another program";
}

// S5.26: by the objects of paper 5's time: 1F53h and 1F54h against 1F52h.
TEST(ProgramBoot, TheOldSoftwareCheckUpdatesToo) {
  auto rules = rules_for(updates, 0);
  rules.push_back({{0x1F53, 1}, 15'000});
  rules.push_back({{0x1F54, 1}, 4'711});
  UpdateRig rig(rules);
  rig.store(1, program_image(700, 2, {.type = programmed_product, .date = 15'000, .time = 4'711}));
  rig.master.power_on();
  ASSERT_TRUE(rig.run_to(Phase::operational)) << rig.status().result.text();
  EXPECT_TRUE(rig.status().result.updated);
  EXPECT_TRUE(rig.slave().programs()->runs());
}

// S5.16: the boot of a slave as paper 5's Figure 4 has it, on the wire: device type, the rest of the identity, the
// software version, the configuration's date, a heartbeat, and only then its start.
TEST(ProgramBoot, TheStepsOfASlavesBootInTheirOrder) {
  const auto content = program_content(300, 7);
  auto rules = rules_for(updates, crc32(content));
  rules.push_back({{0x1F87, 1}, 1});
  rules.push_back({{0x1F88, 1}, 1});
  rules.push_back({{0x1F26, 1}, 5});
  rules.push_back({{0x1F27, 1}, 6});
  UpdateRig rig(rules);
  ASSERT_TRUE(rig.bus.download(1, program_image(300, 7)));
  for (const auto& [object, value] : {std::pair{ObjectRef{0x1020, 1}, 5U}, std::pair{ObjectRef{0x1020, 2}, 6U},
                                      std::pair{ObjectRef{0x1010, 1}, 0x6576'6173U}}) {
    ASSERT_TRUE(rig.bus.get(rig.bus.managed.sdo().write(NodeId(1), object.index, object.sub, value)));
  }
  rig.master.power_on();
  ASSERT_TRUE(rig.run_to(Phase::operational)) << rig.status().result.text();
  rig.bus.world.run_for(20ms);
  std::vector<std::string> steps;
  bool booted = false;
  for (const auto& f : rig.frames) {
    std::string step;
    if (f.id == 0x000) step = f.data[0] == 0x82 ? "reset" : f.data[0] == 0x01 ? "start" : "other";
    if (f.id == 0x601) step = fmt::format("{:02X}{:02X}:{:02X}", f.data[2], f.data[1], f.data[3]);
    if (f.id == 0x701 && f.data[0] == 0) booted = true;
    if (f.id == 0x701 && f.data[0] == 0x7F && booted) step = "heartbeat";
    if (step == "reset") steps.clear();
    if (!step.empty() && (steps.empty() || steps.back() != step)) steps.push_back(step);
  }
  const std::vector<std::string> expected{"reset",   "1000:00", "1018:01", "1018:02", "1018:03",   "1018:04",
                                          "1F56:01", "1F51:01", "1020:01", "1020:02", "heartbeat", "start"};
  std::erase_if(steps, [n = 0](const std::string& s) mutable { return s == "heartbeat" && n++ > 0; });
  EXPECT_EQ(steps, expected);
}

// Every byte that the device writes or erases, from the stop of the old program to the start of the new one: power goes
// there, and comes back. The device is in its boot loader or runs a whole program, and its next boot-up ends well.
TEST(ProgramBoot, APowerLossAtAnyByteIsHealedByTheNextBootUp) {
  ProgrammedSpec spec;
  spec.layout = {.count = 1, .images = 2, .longest = 200, .sector = 64};
  spec.times = {.byte = 1us, .sector = 100us, .sector_size = 64};
  spec.boot = 1ms;
  const auto old_one = program_content(150, 1);
  const auto new_one = program_content(180, 2);
  const auto image = program_image(180, 2);
  std::size_t cuts = 0;
  for (std::uint64_t at = 0;; ++at) {
    ProgramRig rig(1, spec);
    auto& device = *rig.devices[1];
    ASSERT_TRUE(rig.download(1, program_image(150, 1)));
    device.flash.cut_after(at, at % 3 == 0 ? -1 : at % 3 == 1 ? 0x00 : 0xA5);
    rig.given.tries = 1;
    rig.given.restart_time = 200ms;
    rig.given.flash_time = 200ms;
    rig.given.answer_time = 100ms;
    const auto first = rig.download(1, image);
    const bool cut = device.cuts > 0;
    EXPECT_EQ(first.has_value(), !cut) << at;
    if (!cut) break;
    ++cuts;
    device.on();
    rig.world.run_for(10ms);
    const auto held = device.held();
    ASSERT_TRUE(held.empty() || held == old_one || held == new_one) << at;
    ASSERT_EQ(device.device.programs()->runs(), !held.empty()) << at;
    // The next boot-up.
    struct Source final : BootSource {
      Source(ProgramRig& of, const Image& what) : rig(&of), wish{ProgramWish{.image = what}} {}
      rt::Task<Result<void>> update(BootTarget& target, const SlaveRules&) override {
        ProgramLoader loader(target.objects(), wish, rig->given);
        ProgramReport report;
        co_return co_await loader.run(report);
      }
      ProgramRig* rig;
      std::array<ProgramWish, 1> wish;
    } source(rig, image);
    SlaveRules rules{.assigned = true, .boots = true, .checks_software = true, .may_update = true};
    rules.expected.software = crc32(new_one);
    BootSlave boot(rig.world.executor(), rig.managed.target(NodeId(1)), source, rules, {});
    std::optional<BootResult> result;
    const auto run = [](BootSlave& which, std::optional<BootResult>& into) -> rt::Task<void> {
      auto done = co_await which.run();
      into = done;
    };
    rt::Scope scope(rig.world.executor());
    scope.spawn(run(boot, result));
    ASSERT_TRUE(rig.world.run_until([&] { return result.has_value(); }, 60s));
    ASSERT_EQ(result->status, BootStatus::booted) << at << ": " << result->text();
    ASSERT_EQ(device.held(), new_one) << at;
    ASSERT_TRUE(device.device.programs()->runs());
  }
  // Both images are erased, and one is written with its head.
  EXPECT_EQ(cuts, 2U * 256U + 180U + 32U);
}

// A master that is gone in the middle: the device gives its transfer up, and the next master's boot-up heals it.
TEST(ProgramBoot, AMasterThatIsLostInMidDownload) {
  ProgramRig rig;
  const auto image = program_image(6'000, 4);
  {
    ProgramOptions options;
    options.transfers = &rig.transfers;
    const std::array wishes{ProgramWish{.image = image}};
    co::NodeAccess access(rig.managed.sdo(), NodeId(1));
    ProgramLoader loader(access, wishes, options);
    ProgramReport report;
    std::optional<Result<void>> ended;
    rt::Scope scope(rig.world.executor());
    scope.spawn(ProgramRig::load(loader, report, ended));
    ASSERT_TRUE(rig.world.run_until([&] { return rig.devices[1]->device.programs()->downloading(); }, 10s));
    rig.world.run_for(20ms);
  }
  EXPECT_FALSE(rig.devices[1]->device.programs()->runs());
  const auto done = rig.download(1, image);
  ASSERT_TRUE(done) << describe(done.error());
  EXPECT_TRUE(rig.devices[1]->device.programs()->runs());
}

// Several slaves of one master are updated side by side.
TEST(ProgramBoot, ThreeSlavesAtOnce) {
  const auto content = program_content(6'000, 3);
  std::vector<device::Preset> all;
  for (std::uint8_t node = 1; node <= 3; ++node) {
    for (const auto& preset : rules_for(updates, crc32(content), node)) all.push_back(preset);
  }
  UpdateRig rig(all, 3);
  for (std::uint8_t node = 1; node <= 3; ++node) rig.store(node, program_image(6'000, 3));
  rig.master.power_on();
  std::size_t side_by_side = 0;
  ASSERT_TRUE(rig.bus.world.run_until(
      [&] {
        std::size_t now = 0;
        for (std::uint8_t node = 1; node <= 3; ++node) now += rig.slave(node).programs()->downloading() ? 1U : 0U;
        side_by_side = std::max(side_by_side, now);
        return rig.manager.network().phase() == Phase::operational;
      },
      60s));
  EXPECT_EQ(side_by_side, 3U);
  for (std::uint8_t node = 1; node <= 3; ++node) EXPECT_EQ(rig.bus.devices[node]->held(), content);
}
