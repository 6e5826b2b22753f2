// What gives a device its node-ID, part by part: LSS with its memory, the node-ID as an object, the other schemes.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/device/lss_slave.hpp"
#include "berth/device/node_id_object.hpp"
#include "berth/device/node_id_schemes.hpp"
#include "part_rig.hpp"

namespace berth::device::test::lss_slave_tests {
namespace {

/// `PartRig` and the LSS slave of a device with memory.
struct LssRig : PartRig, private LssSlave::Owner {
  explicit LssRig(const Options& how = {.address = address_of(5), .bit_rate = 500'000}, const Timing& timing = {},
                  std::shared_ptr<const od::Description> d = minimal_description())
      : PartRig(timing, d),
        options(how),
        flash(world.executor(), memory_size(*d), milliseconds(10)),
        lss(dispatcher, options, &flash, host, static_cast<LssSlave::Owner&>(*this)) {}

  /// Power, and the reset that follows it.
  void begin() {
    lss.power_on();
    lss.reset(Reset::power_on);
    lss.listen(!lss.active().node_id.configured());
  }

  Options options;
  SimFlash flash;
  LssSlave lss;
  std::vector<co::NmtCommand> resets;
  std::vector<bool> heard;
  std::vector<bool> hushed;
  unsigned changes = 0;

 private:
  void reset_by_lss(co::NmtCommand command) noexcept override { resets.push_back(command); }
  void hush(bool on) noexcept override { hushed.push_back(on); }
  void lss_heard(bool answered) noexcept override { heard.push_back(answered); }
  void changed() noexcept override { ++changes; }
};

TEST(LssSlave, TakesStoresAndLoadsANodeId) {
  LssRig rig;
  rig.begin();
  EXPECT_FALSE(rig.lss.active().node_id.configured());
  rig.give_id(address_of(5), 7);
  EXPECT_TRUE(rig.lss.configures());
  EXPECT_EQ(rig.record.text.back(), "7E4#1100000000000000");
  EXPECT_EQ(rig.lss.pending().node_id, NodeId(7));
  EXPECT_FALSE(rig.lss.persistent().node_id.configured());
  EXPECT_EQ(rig.changes, 1U);
  EXPECT_EQ(rig.heard.back(), true);
  EXPECT_EQ(rig.heard.front(), false) << "04 00 has no answer";

  rig.ask("7E5#1700000000000000");
  EXPECT_TRUE(rig.lss.storing());
  EXPECT_EQ(rig.record.count("7E4#1700000000000000"), 0U);
  rig.run(milliseconds(10));
  EXPECT_FALSE(rig.lss.storing());
  EXPECT_EQ(rig.record.count("7E4#1700000000000000"), 1U) << "answered when it is in memory";
  EXPECT_EQ(rig.lss.persistent().node_id, NodeId(7));
  rig.ask("7E5#0400000000000000");
  EXPECT_EQ(rig.resets, (std::vector<co::NmtCommand>{co::NmtCommand::reset_communication}));
  rig.lss.reset(Reset::communication);
  EXPECT_EQ(rig.lss.active().node_id, NodeId(7));

  rig.lss.power_off();
  EXPECT_FALSE(rig.lss.powered());
  EXPECT_EQ(rig.lss.persistent().node_id, NodeId(7));
  rig.begin();
  EXPECT_EQ(rig.lss.active().node_id, NodeId(7));
}

TEST(LssSlave, DoesNotAnswerWhatItLacks) {
  using enum lss::Lackable;
  const auto options = [](lss::LackSet without) {
    Options o{.address = address_of(5), .bit_rate = 500'000};
    o.lss.without = without;
    return o;
  };
  const std::vector<std::pair<lss::Lackable, std::string>> services{
      {inquire_identity, "7E5#5D00000000000000"},
      {inquire_node_id, "7E5#5E00000000000000"},
      {identify, "7E5#4C00000000000000"},
      {bit_timing, "7E5#1300040000000000"},
  };
  for (const auto& [lacking, request] : services) {
    for (const bool has : {true, false}) {
      LssRig rig(options(has ? lss::LackSet() : lss::LackSet{lacking}));
      rig.begin();
      rig.ask("7E5#0401000000000000");
      const auto before = rig.record.text.size();
      rig.ask(request);
      EXPECT_EQ(rig.record.text.size() - before, has ? 2U : 1U) << request;
      EXPECT_EQ(rig.heard.back(), has) << request;
    }
  }
  LssRig unselected(options({select}));
  unselected.begin();
  unselected.give_id(address_of(5), 7);
  EXPECT_FALSE(unselected.lss.configures());
  LssRig stays(options({activate}));
  stays.begin();
  stays.ask("7E5#0401000000000000");
  stays.ask("7E5#1300040000000000");
  stays.ask("7E5#1501000000000000");
  stays.run(milliseconds(10));
  EXPECT_TRUE(stays.hushed.empty());
}

TEST(LssSlave, RefusesToStoreWhereItHasNoStoring) {
  Options options{.address = address_of(5), .bit_rate = 500'000};
  options.lss.stores = false;
  LssRig rig(options);
  rig.begin();
  rig.give_id(address_of(5), 7);
  rig.ask("7E5#1700000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#1701000000000000");
  rig.run(milliseconds(20));
  EXPECT_FALSE(rig.lss.persistent().node_id.configured());
}

TEST(LssSlave, AnswersWithoutTheZerosAtTheEnd) {
  Options options{.address = address_of(5), .bit_rate = 500'000};
  options.lss.short_answers = true;
  LssRig rig(options);
  rig.begin();
  rig.ask("7E5#4C00000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#50");
  rig.give_id(address_of(5), 7);
  EXPECT_EQ(rig.record.count("7E4#44"), 1U);
  EXPECT_EQ(rig.record.text.back(), "7E4#110000");
  rig.ask("7E5#5D00000000000000");
  EXPECT_EQ(rig.record.text.back().size(), std::string("7E4#5D00000000").size());
  rig.ask("7E5#5E00000000000000");
  EXPECT_EQ(rig.record.text.back(), "7E4#5E07");
  rig.ask("7E5#1700000000000000");
  rig.run(milliseconds(10));
  EXPECT_EQ(rig.record.count("7E4#170000"), 1U);
}

TEST(LssSlave, PowerLostWhileItStoresLeavesTheOldNodeId) {
  LssRig rig;
  rig.begin();
  rig.give_id(address_of(5), 7);
  rig.ask("7E5#1700000000000000");
  ASSERT_TRUE(rig.lss.storing());
  rig.lss.power_off();
  EXPECT_FALSE(rig.flash.writing());
  rig.begin();
  EXPECT_FALSE(rig.lss.active().node_id.configured());
  rig.run(milliseconds(20));
  EXPECT_EQ(rig.record.count("7E4#1700000000000000"), 0U);
}

TEST(LssSlave, APartThatEndsWhileItStoresIsNotCalled) {
  SimFlash* flash = nullptr;
  PartRig outer;
  SimFlash memory(outer.world.executor(), 64, milliseconds(10));
  flash = &memory;
  struct Owner final : LssSlave::Owner {
    void reset_by_lss(co::NmtCommand) noexcept override {}
    void hush(bool) noexcept override {}
    void lss_heard(bool) noexcept override {}
    void changed() noexcept override {}
  } owner;
  struct Done final : NvMemory::Done {
    void written(bool) noexcept override { ++times; }
    unsigned times = 0;
  } done;
  {
    const Options options{.address = address_of(5)};
    LssSlave lss(outer.dispatcher, options, flash, outer.host, owner);
    lss.power_on();
    ASSERT_TRUE(lss.keep(NodeId(7), done));
  }
  EXPECT_FALSE(memory.writing());
  outer.run(milliseconds(20));
  EXPECT_EQ(done.times, 0U);
}

TEST(LssSlave, AFixedNodeIdIsNotConfigured) {
  LssRig rig({.address = address_of(5), .source = NodeIdSource::fixed, .node_id = NodeId(12)});
  rig.begin();
  rig.give_id(address_of(5), 7);
  EXPECT_EQ(rig.record.text.back(), "7E4#1101000000000000") << "out of range";
  EXPECT_EQ(rig.lss.pending().node_id, NodeId(12));
  rig.options.node_id = NodeId(13);
  rig.lss.power_off();
  EXPECT_EQ(rig.lss.persistent().node_id, NodeId(13)) << "what the switches say now";
}

TEST(LssSlave, ANewNodeIdThatCountsOnlyAfterAPowerCycle) {
  LssRig rig({.address = address_of(5), .bit_rate = 500'000}, {.power_cycle_after_store = true});
  rig.begin();
  rig.give_id(address_of(5), 7);
  rig.ask("7E5#1700000000000000", milliseconds(20));
  rig.ask("7E5#0400000000000000");
  EXPECT_TRUE(rig.resets.empty());
  for (const Reset what : {Reset::communication, Reset::node}) {
    rig.lss.reset(what);
    EXPECT_FALSE(rig.lss.active().node_id.configured());
  }
  rig.lss.power_off();
  rig.begin();
  EXPECT_EQ(rig.lss.active().node_id, NodeId(7));
}

TEST(LssSlave, NotOneItHearsNothing) {
  LssRig rig({.address = address_of(5), .lss = {.on = false}});
  rig.begin();
  rig.give_id(address_of(5), 7);
  EXPECT_TRUE(rig.heard.empty());
  EXPECT_FALSE(rig.lss.configures());
}

// CiA 305: both delays are silent for the device's other services; the second for LSS as well.
TEST(LssSlave, ABitRateIsChangedInSilence) {
  LssRig rig({.address = address_of(5), .node_id = NodeId(9), .bit_rate = 500'000});
  rig.begin();
  rig.select(address_of(5));
  rig.ask("7E5#1300020000000000");  // 500 kbit/s again, so that the test's port still hears
  rig.ask("7E5#150A000000000000");  // 10 ms
  EXPECT_TRUE(rig.hushed.empty());
  rig.run(milliseconds(8));
  EXPECT_EQ(rig.hushed, (std::vector<bool>{true}));
  EXPECT_TRUE(rig.lss.silent());
  rig.run(milliseconds(10));
  EXPECT_EQ(rig.hushed, (std::vector<bool>{true, false}));
  EXPECT_FALSE(rig.lss.silent());
}

// --- The node-ID as an object ----------------------------------------------------------------------------------------

std::shared_ptr<const od::Description> with_node_id_object() {
  od::DescriptionBuilder b;
  add_device(b);
  add_storage(b);
  b.variable(0x2100, {.name = "Node-ID", .type = od::DataType::unsigned8});
  b.variable(0x2101, {.name = "Signature", .initial = od::Literal::number(0)});
  return b.build();
}

struct ObjectRig : LssRig {
  explicit ObjectRig(std::optional<Signature> signature = std::nullopt)
      : LssRig({.address = address_of(5), .node_id_object = NodeIdAsObject{{0x2100, 0}, signature}}, {},
               with_node_id_object()),
        sdo(dispatcher, values),
        stored(values, sdo, &flash, options, host, lss),
        object(values, sdo, options, lss, stored) {
    begin();
    stored.reset_values(od::Area::all);
    object.show();
    sdo.start(NodeId(9));
  }
  co::SdoServers sdo;
  StoredObjects stored;
  NodeIdObject object;
};

TEST(NodeIdObject, IsConfirmedWhenItIsInMemory) {
  ObjectRig rig;
  EXPECT_EQ(rig.values.get<std::uint8_t>({0x2100, 0}), std::uint8_t{255});
  EXPECT_EQ(rig.write(0x2100, 0, 1, 0), Rig::refused(0x2100, 0, od::AbortCode::invalid_value));
  EXPECT_EQ(rig.write(0x2100, 0, 1, 128), Rig::refused(0x2100, 0, od::AbortCode::invalid_value));
  EXPECT_EQ(rig.write(0x2100, 0, 1, 33), "") << "being stored";
  EXPECT_TRUE(rig.stored.storing());
  rig.run(milliseconds(10));
  EXPECT_EQ(rig.record.text.back(), Rig::done(0x2100, 0));
  EXPECT_EQ(rig.lss.persistent().node_id, NodeId(33));
  EXPECT_FALSE(rig.lss.active().node_id.configured()) << "in use after the next reset";
  rig.flash.broken(true);
  EXPECT_EQ(rig.write(0x2100, 0, 1, 34, milliseconds(20)), Rig::refused(0x2100, 0, od::AbortCode::hardware));
  EXPECT_EQ(rig.lss.persistent().node_id, NodeId(33));
}

TEST(NodeIdObject, WithASignature) {
  ObjectRig rig(Signature{{0x2101, 0}, 0x6576'6173});
  EXPECT_EQ(rig.write(0x2101, 0, 4, 0x6576'6173), Rig::refused(0x2101, 0, od::AbortCode::not_stored)) << "of nothing";
  EXPECT_EQ(rig.write(0x2100, 0, 1, 33), Rig::done(0x2100, 0)) << "not yet stored";
  EXPECT_FALSE(rig.lss.storing());
  EXPECT_EQ(rig.write(0x2101, 0, 4, 1), Rig::refused(0x2101, 0, od::AbortCode::not_stored));
  EXPECT_EQ(rig.write(0x2101, 0, 4, 0x6576'6173, milliseconds(20)), Rig::done(0x2101, 0));
  EXPECT_EQ(rig.lss.persistent().node_id, NodeId(33));
}

TEST(NodeIdObject, PowerLostMeanwhileAnswersNothing) {
  ObjectRig rig;
  EXPECT_EQ(rig.write(0x2100, 0, 1, 33), "");
  rig.sdo.stop();
  rig.lss.power_off();
  rig.lss.power_on();
  rig.sdo.start(NodeId(9));
  EXPECT_EQ(rig.write(0x2100, 0, 1, 34, milliseconds(20)), Rig::done(0x2100, 0));
  EXPECT_EQ(rig.lss.persistent().node_id, NodeId(34));
}

// --- The other schemes -----------------------------------------------------------------------------------------------

struct SchemesRig : LssRig, private NodeIdSchemes::Owner {
  explicit SchemesRig(const Options& how)
      : LssRig(how),
        schemes(dispatcher, options, &flash, host, lss, errors, static_cast<NodeIdSchemes::Owner&>(*this)) {
    boot();
    begin();
    schemes.power_on();
    schemes.listen();
    schemes.ready(lss.active().node_id);
  }
  NodeIdSchemes schemes;
  std::vector<NodeId> given;
  unsigned lost = 0;

 private:
  void node_id_given(NodeId id) noexcept override { given.push_back(id); }
  void node_id_lost() noexcept override { ++lost; }
  void changed() noexcept override {}
};

TEST(NodeIdSchemes, WhichThereAreSayTheOptions) {
  SchemesRig none({.address = address_of(5), .rand = RandMode::off});
  EXPECT_EQ(none.schemes.claimer(), nullptr);
  EXPECT_EQ(none.schemes.negotiator(), nullptr);
  EXPECT_EQ(none.schemes.memory(), 0U);
  SchemesRig both({.address = address_of(5), .claim = true, .negotiation = NegotiationMode::on});
  EXPECT_NE(both.schemes.claimer(), nullptr);
  EXPECT_NE(both.schemes.negotiator(), nullptr);
  EXPECT_EQ(both.schemes.memory(), sizeof(Negotiation) + sizeof(Claiming));
}

TEST(NodeIdSchemes, AClaimedNodeIdIsActiveAndNotStored) {
  SchemesRig rig({.address = address_of(5), .claim = true});
  rig.run(seconds(2));
  ASSERT_EQ(rig.given.size(), 1U);
  EXPECT_EQ(rig.lss.active().node_id, rig.given[0]);
  EXPECT_FALSE(rig.lss.persistent().node_id.configured());
}

TEST(NodeIdSchemes, ANegotiatedOneToo) {
  SchemesRig rig({.address = address_of(5), .negotiation = NegotiationMode::on});
  rig.run(seconds(10));
  ASSERT_EQ(rig.given.size(), 1U);
  EXPECT_EQ(rig.lss.active().node_id, rig.given[0]);
  EXPECT_EQ(rig.lost, 0U);
}

// SX.6.
TEST(NodeIdSchemes, WhileAMasterAsksTheNegotiationWaits) {
  SchemesRig rig({.address = address_of(5), .negotiation = NegotiationMode::on});
  for (int i = 0; i < 20; ++i) {
    rig.schemes.master_heard(true);
    rig.run(milliseconds(500));
  }
  EXPECT_TRUE(rig.given.empty());
  rig.schemes.master_heard(false);
  rig.run(seconds(10));
  EXPECT_EQ(rig.given.size(), 1U);
}

TEST(NodeIdSchemes, WithoutPowerNothingIsClaimed) {
  SchemesRig rig({.address = address_of(5), .claim = true});
  rig.run(milliseconds(1));
  EXPECT_EQ(rig.record.text.size(), 1U) << "its claim";
  rig.lss.power_off();
  rig.schemes.power_off();
  rig.record.clear();
  rig.run(seconds(2));
  EXPECT_TRUE(rig.given.empty());
  EXPECT_TRUE(rig.record.text.empty());
}

}  // namespace
}  // namespace berth::device::test::lss_slave_tests
