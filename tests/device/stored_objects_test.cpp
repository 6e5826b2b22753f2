// Stored objects, services by objects and programs, each by itself: values in their layers, 1010h, 1011h, 1020h, 1021h;
// which services a dictionary has; what restarts a device.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/device/object_services.hpp"
#include "berth/device/programming.hpp"
#include "berth/device/stored_objects.hpp"
#include "part_rig.hpp"

namespace berth::device::test::stored_objects_tests {
namespace {

constexpr std::uint32_t save = 0x6576'6173, load = 0x6461'6F6C;

std::shared_ptr<const od::Description> with_parameters() {
  od::DescriptionBuilder b;
  add_device(b, {.name = "Described"});
  add_storage(b);
  b.variable(0x1021, {.name = "Store EDS", .type = od::DataType::domain, .access = od::Access::ro});
  b.variable(0x2000, {.name = "Parameter", .initial = od::Literal::number(1)});
  b.variable(0x2001, {.name = "Other", .initial = od::Literal::number(2)});
  return b.build();
}

/// A device's stored objects over memory, with an LSS slave that has node-ID 9.
struct StoredRig : PartRig, private LssSlave::Owner {
  explicit StoredRig(bool with_memory = true, const Timing& timing = {})
      : PartRig(timing, with_parameters()),
        options{.address = address_of(5), .node_id = NodeId(9), .name = "Named", .presets = {{{0x2001, 0}, 22}}},
        flash(world.executor(), memory_size(values.description()), milliseconds(10)),
        sdo(dispatcher, values),
        lss(dispatcher, options, with_memory ? &flash : nullptr, host, static_cast<LssSlave::Owner&>(*this)),
        stored(values, sdo, with_memory ? &flash : nullptr, options, host, lss) {
    begin();
  }
  void begin() {
    lss.power_on();
    lss.reset(Reset::power_on);
    stored.power_on();
    stored.reset_values(od::Area::all);
    sdo.start(NodeId(9));
  }
  void power_off() {
    sdo.stop();
    lss.power_off();
    stored.power_off();
  }
  Options options;
  SimFlash flash;
  co::SdoServers sdo;
  LssSlave lss;
  StoredObjects stored;

 private:
  void reset_by_lss(co::NmtCommand) noexcept override {}
  void hush(bool) noexcept override {}
  void lss_heard(bool) noexcept override {}
  void changed() noexcept override {}
};

TEST(StoredObjects, ValuesComeInLayers) {
  StoredRig rig;
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x2000, 0}), 1U) << "described";
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x2001, 0}), 22U) << "preset";
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x1018, 4}), 5U) << "its address";
  const auto name = rig.values.bytes({0x1008, 0});
  EXPECT_EQ(std::string(name.begin(), name.end()), "Named");
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x1014, 0}), 0x89U) << "of its node-ID";
  rig.values.set({0x2000, 0}, 100U);
  rig.values.set({0x2001, 0}, 200U);
  rig.values.set({0x1017, 0}, std::uint16_t{500});
  EXPECT_EQ(rig.write(0x1010, 3, 4, save, milliseconds(30)), Rig::done(0x1010, 3)) << "the application's";
  EXPECT_EQ(rig.write(0x1010, 4, 4, save, milliseconds(30)), Rig::done(0x1010, 4)) << "the manufacturer's";
  rig.stored.reset_values(od::Area::communication);
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x2000, 0}), 100U);
  EXPECT_EQ(rig.values.get<std::uint16_t>({0x1017, 0}), std::uint16_t{0}) << "it was not stored";
  rig.values.set({0x2001, 0}, 201U);
  rig.stored.reset_values(od::Area::all);
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x2001, 0}), 200U) << "stored over preset";
}

TEST(StoredObjects, AnsweredWhenTheMemoryIsDone) {
  StoredRig rig;
  EXPECT_EQ(rig.write(0x1010, 1, 4, load), Rig::refused(0x1010, 1, od::AbortCode::not_stored));
  rig.values.set({0x2000, 0}, 100U);
  EXPECT_EQ(rig.write(0x1010, 1, 4, save), "");
  EXPECT_TRUE(rig.stored.storing());
  rig.run(milliseconds(30));
  EXPECT_EQ(rig.record.text.back(), Rig::done(0x1010, 1));
  EXPECT_FALSE(rig.stored.storing());
  EXPECT_EQ(rig.write(0x1011, 1, 4, load, milliseconds(30)), Rig::done(0x1011, 1));
  rig.power_off();
  rig.begin();
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x2000, 0}), 1U);
}

TEST(StoredObjects, ARefusalForEachReason) {
  StoredRig bare(false);
  EXPECT_EQ(bare.read(0x1010, 1), Rig::value(0x1010, 1, 4, 0)) << "it can store nothing, whatever is described";
  EXPECT_EQ(bare.write(0x1010, 1, 4, save), Rig::refused(0x1010, 1, od::AbortCode::not_stored));
  StoredRig rig;
  EXPECT_EQ(rig.read(0x1010, 1), Rig::value(0x1010, 1, 4, 1));
  struct Done final : NvMemory::Done {
    void written(bool) noexcept override {}
  } done;
  ASSERT_TRUE(rig.lss.keep(NodeId(10), done));
  EXPECT_EQ(rig.write(0x1010, 1, 4, save), Rig::refused(0x1010, 1, od::AbortCode::device_state)) << "LSS stores";
  rig.run(milliseconds(30));
  rig.flash.broken(true);
  rig.values.set({0x2000, 0}, 100U);
  EXPECT_EQ(rig.write(0x1010, 1, 4, save, milliseconds(50)), Rig::refused(0x1010, 1, od::AbortCode::hardware));
}

TEST(StoredObjects, AResetGivesUpWhatIsBeingStored) {
  StoredRig rig;
  rig.values.set({0x2000, 0}, 100U);
  EXPECT_EQ(rig.write(0x1010, 1, 4, save), "");
  rig.stored.resetting();
  rig.stored.reset_values(od::Area::all);
  rig.run(milliseconds(50));
  EXPECT_FALSE(rig.stored.storing());
  rig.power_off();
  rig.begin();
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x2000, 0}), 1U);
}

// Deaf from the beginning of a write to its end, with a device that is.
TEST(StoredObjects, DeafWhileItStores) {
  StoredRig rig(true, {.deaf_while_storing = true});
  rig.values.set({0x2000, 0}, 100U);
  EXPECT_EQ(rig.write(0x1010, 1, 4, save), "");
  EXPECT_TRUE(rig.port.deaf());
  rig.run(milliseconds(30));
  EXPECT_FALSE(rig.port.deaf());
}

TEST(StoredObjects, AChangedValueIsNotTheVerifiedConfiguration) {
  StoredRig rig;
  rig.values.set({0x1020, 1}, 7U);
  rig.values.set({0x1020, 2}, 8U);
  EXPECT_EQ(rig.write(0x2000, 0, 4, 1), Rig::done(0x2000, 0)) << "the value it has";
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x1020, 1}), 7U);
  EXPECT_EQ(rig.write(0x2000, 0, 4, 3), Rig::done(0x2000, 0));
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x1020, 1}), 0U);
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x1020, 2}), 0U);
}

TEST(StoredObjects, A1021hUploadsTheEds) {
  StoredRig rig;
  EXPECT_EQ(rig.read(0x1021, 0), Rig::refused(0x1021, 0, od::AbortCode::no_data));
  constexpr std::array<std::uint8_t, 3> eds{'E', 'D', 'S'};
  rig.options.eds = eds;
  EXPECT_EQ(rig.read(0x1021, 0), "589#4721100045445300");
}

// --- Services by objects ---------------------------------------------------------------------------------------------

TEST(ObjectServices, AreThereWhenTheirObjectsAre) {
  PartRig rig;
  Application application(rig.values);
  ObjectServices bare(rig.dispatcher, rig.values, application, rig.errors, {});
  EXPECT_EQ(bare.pdos(), nullptr);
  EXPECT_FALSE(bare.event(1));
  EXPECT_FALSE(bare.changed({0x1001, 0}));
  EXPECT_FALSE(bare.sync_missing());
  EXPECT_EQ(bare.send_time({}), can::Queued::closed);
}

TEST(ObjectServices, FollowTheNmtState) {
  od::DescriptionBuilder b;
  add_device(b);
  b.variable(0x2000, {.name = "Value", .type = od::DataType::unsigned8, .mappable = true});
  add_tpdo(b, 1, {.map = {{{0x2000, 0}, 8}}});
  PartRig rig({}, b.build());
  Application application(rig.values);
  ObjectServices services(rig.dispatcher, rig.values, application, rig.errors, {.send_at_start = false});
  ASSERT_NE(services.pdos(), nullptr);
  const auto none = co::services_in(NmtState::initialising);
  const auto pre_operational = co::services_in(NmtState::pre_operational);
  const auto operational = co::services_in(NmtState::operational);
  EXPECT_EQ(rig.read(0x1000, 0), "");
  services.change(none, pre_operational, NodeId(9));
  EXPECT_EQ(rig.read(0x1000, 0), Rig::value(0x1000, 0, 4, 0)) << "SDO";
  EXPECT_FALSE(services.event(1)) << "no PDOs";
  services.change(pre_operational, operational, NodeId(9));
  rig.values.set({0x2000, 0}, std::uint8_t{5});
  EXPECT_TRUE(services.changed({0x2000, 0}));
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.count("189#05"), 1U);
  services.change(operational, co::services_in(NmtState::stopped), NodeId(9));
  EXPECT_FALSE(services.event(1));
  EXPECT_EQ(rig.read(0x1000, 0), "");
}

// --- Programs --------------------------------------------------------------------------------------------------------

TEST(Programming, OnlyWithMemoryAndObjects) {
  PartRig rig;
  co::SdoServers sdo(rig.dispatcher, rig.values);
  const ProgramLayout layout{};
  SimFlash flash(rig.world.executor(), ProgramMemory::footprint(layout), milliseconds(0));
  const auto made = [&](PartRig& on, co::SdoServers& servers, NvMemory* memory) {
    return Programming::make(on.world.executor(), on.values, {.memory = memory, .layout = layout}, {1, 2}, on.nmt,
                             servers);
  };
  EXPECT_EQ(made(rig, sdo, &flash), nullptr) << "no objects";
  od::DescriptionBuilder b;
  add_device(b);
  add_programs(b);
  PartRig programmed({}, b.build());
  co::SdoServers servers(programmed.dispatcher, programmed.values);
  EXPECT_EQ(made(programmed, servers, nullptr), nullptr) << "no memory";
  const auto programming = made(programmed, servers, &flash);
  ASSERT_NE(programming, nullptr);
  programming->programs().power_on();
  EXPECT_FALSE(programming->programs().runs()) << "there is no valid program";
}

}  // namespace
}  // namespace berth::device::test::stored_objects_tests
