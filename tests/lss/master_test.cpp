// The LSS master against LSS slaves and scripted answers on the simulated bus.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "lss_world.hpp"

namespace berth::lss::test {
namespace {

constexpr LssAddress a1{0x0100'0001, 1, 0, 0x0A};
constexpr LssAddress a2{1, 1, 0, 5};
constexpr LssAddress a3{1, 5, 0, 8};

TEST(LssMaster, BindsOneOfThreeAndTheOthersStay) {
  World w;
  auto& n1 = w.add(a1);
  auto& n2 = w.add(a2);
  auto& n3 = w.add(a3);
  ASSERT_TRUE(w.run(w.master->switch_global(State::waiting)));
  const auto selected = w.run(w.master->switch_selective(a2));
  ASSERT_TRUE(selected);
  EXPECT_EQ(selected->answers, 1U);
  EXPECT_EQ(selected->attempts, 1U);
  EXPECT_GE(selected->heard_at[0] - selected->sent, milliseconds(1));
  EXPECT_LT(selected->heard_at[0] - selected->sent, milliseconds(5));
  ASSERT_TRUE(w.run(w.master->configure_node_id(NodeId(2))));
  const auto id = w.run(w.master->inquire_node_id());
  ASSERT_TRUE(id);
  EXPECT_EQ(id->byte(), 2);
  ASSERT_TRUE(w.run(w.master->store()));
  ASSERT_TRUE(w.run(w.master->switch_global(State::waiting)));
  w.settle();
  EXPECT_EQ(n2.slave.active().node_id, NodeId(2));
  EXPECT_EQ(n2.memory.node_id, NodeId(2));
  EXPECT_TRUE(n1.slave.unconfigured());
  EXPECT_TRUE(n3.slave.unconfigured());
}

TEST(LssMaster, InquireAddressReadsAllFourParts) {
  World w;
  w.add({0x1234'5678, 0x9ABC'DEF0, 0x0F1E'2D3C, 0xFFFF'FFFF});
  ASSERT_TRUE(w.run(w.master->switch_global(State::configuration)));
  const auto address = w.run(inquire_address(*w.master));
  ASSERT_TRUE(address);
  EXPECT_EQ(*address, (LssAddress{0x1234'5678, 0x9ABC'DEF0, 0x0F1E'2D3C, 0xFFFF'FFFF}));
}

TEST(LssMaster, SilenceIsATimeoutAfterAllAttempts) {
  World w;
  w.add(a1);
  const ServiceOptions options{.timeout = milliseconds(20), .retries = 2};
  const Record record(w.bus);
  const auto before = w.world.now();
  const auto reply = w.run(w.master->switch_selective(a2, options));
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::timeout);
  EXPECT_EQ(record.text.size(), 12U);
  EXPECT_GE(w.world.now() - before, milliseconds(60));
}

TEST(LssMaster, ARefusalCarriesBothCodes) {
  World w;
  auto& n = w.add(a1);
  ASSERT_TRUE(w.run(w.master->switch_selective(a1)));
  n.store_result = {.code = error::specific, .specific = 0x42};
  const auto reply = w.run(w.master->store());
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::aborted);
  EXPECT_EQ(reply.error().detail, 0x42FFU);
}

TEST(LssMaster, ArgumentsOutOfRangeNeverReachTheBus) {
  World w;
  const Record record(w.bus);
  for (const unsigned id : {0U, 128U, 254U}) {
    const auto reply = w.run(w.master->configure_node_id(NodeId(static_cast<std::uint8_t>(id))));
    ASSERT_FALSE(reply);
    EXPECT_EQ(reply.error().code, Errc::invalid);
  }
  EXPECT_EQ(w.run(w.master->configure_bit_timing(BitRateIndex::reserved)).error().code, Errc::invalid);
  EXPECT_EQ(w.run(w.master->configure_bit_timing(static_cast<BitRateIndex>(10))).error().code, Errc::invalid);
  EXPECT_EQ(w.run(w.master->inquire(4)).error().code, Errc::invalid);
  w.settle();
  EXPECT_TRUE(record.text.empty());
}

// HC3.6, HU.3: identify remote slave is there for old devices.
TEST(LssMaster, IdentifyWaitsTheWholeWindowAndCountsAnswers) {
  World w;
  w.add(a1, {}, milliseconds(1));
  w.add(a2, {}, milliseconds(30));
  w.add(a3, {NodeId(3), BitRateIndex::kbit_125}, milliseconds(60));  // configured: silent
  auto reply = w.run(w.master->identify_non_configured());
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->answers, 2U);
  const IdentifyRanges all_of_type{.vendor = 1, .product = 5};
  reply = w.run(w.master->identify_remote(all_of_type));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->answers, 1U);
  const IdentifyRanges nobody{.vendor = 1, .product = 5, .serial_low = 9};
  reply = w.run(w.master->identify_remote(nobody));
  ASSERT_TRUE(reply) << "silence is an answer";
  EXPECT_EQ(reply->answers, 0U);
}

// HC3.3 (its second half): duplicate full 128-bit identities: detected by a double answer in a full window.
TEST(LssMaster, TwoDevicesWithOneAddressAnswerTwice) {
  World w;
  w.add(a1, {}, milliseconds(2));
  w.add(a1, {}, milliseconds(9));
  const ServiceOptions full{.full_window = true};
  const auto reply = w.run(w.master->switch_selective(a1, full));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->answers, 2U);
  EXPECT_FALSE(reply->differ);
}

TEST(LssMaster, TwoInConfigurationAreADuplicateForInquireAddress) {
  World w;
  w.add(a1, {}, milliseconds(2));
  w.add(a2, {}, milliseconds(3));
  MasterOptions options;
  options.service.full_window = true;
  w.master->set_options(options);
  ASSERT_TRUE(w.run(w.master->switch_global(State::configuration)));
  const auto address = w.run(inquire_address(*w.master));
  ASSERT_FALSE(address);
  EXPECT_EQ(address.error().code, Errc::duplicate);
}

// HC3.3 (its first half): a late answer must not be taken for the next request's: what comes before `sent` is stale.
TEST(LssMaster, AnswersBeforeSentAreStale) {
  World w;
  w.add(a1);
  auto stranger = w.bus.attach();
  can::Dispatcher voice(w.world.executor(), *stranger);
  // Queued at the same instant; 7E4h outranks 7E5h, so it is on the wire before the request.
  voice.send(can::Frame::base(slave_cob_id, {0x11, 1, 0, 0, 0, 0, 0, 0}));
  w.run(w.master->switch_global(State::configuration));
  World::Done done;
  auto operation = w.master->configure_node_id(NodeId(4));
  done.done = operation.begin(w.world.executor(), done);
  voice.send(can::Frame::base(slave_cob_id, {0x11, 1, 0, 0, 0, 0, 0, 0}));
  ASSERT_TRUE(w.world.run_until([&] { return done.done; }, seconds(5)));
  const auto reply = operation.await_resume();
  ASSERT_TRUE(reply) << "the stale refusal was believed";
  EXPECT_EQ(reply->stale, 1U);
  EXPECT_EQ(reply->answers, 1U);
}

TEST(LssMaster, OtherCommandsInTheWindowAreCountedAndPassedOver) {
  World w;
  w.add(a1, {}, milliseconds(10));
  auto stranger = w.bus.attach();
  can::Dispatcher voice(w.world.executor(), *stranger);
  w.world.after(milliseconds(5), [&] {
    voice.send(can::Frame::base(slave_cob_id, {0x50, 0, 0, 0, 0, 0, 0, 0}));
    voice.send(can::Frame::base(slave_cob_id, {0x5D, 1, 0, 0}));  // too short: a part of a number is none
  });
  const auto reply = w.run(w.master->switch_selective(a1));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->others, 1U);
  EXPECT_EQ(reply->answers, 1U);
}

// Devices of several makers leave out the zeros at the end of an answer.
TEST(LssMaster, TakesAnAnswerThatIsShort) {
  World w;
  auto slave = w.bus.attach();
  can::Dispatcher voice(w.world.executor(), *slave);
  const auto answers = [&](std::initializer_list<std::uint8_t> bytes) {
    const std::vector<std::uint8_t> copy(bytes);
    w.world.after(milliseconds(5), [&voice, copy] { voice.send(can::Frame::base(slave_cob_id, copy)); });
  };
  answers({0x44});
  EXPECT_TRUE(w.run(w.master->switch_selective(a1)));
  answers({0x5D, 0x0A, 0, 0, 0});
  const auto serial = w.run(w.master->inquire(3));
  ASSERT_TRUE(serial);
  EXPECT_EQ(serial->value(), 0x0AU);
  answers({0x5E, 7});
  const auto id = w.run(w.master->inquire_node_id());
  ASSERT_TRUE(id);
  EXPECT_EQ(id->byte(), 7U);
  answers({0x11, 1});
  const auto refused = w.run(w.master->configure_node_id(NodeId(4)));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::aborted);
  EXPECT_EQ(refused.error().detail, 1U);
}

TEST(LssMaster, ServicesQueueAndDoNotMix) {
  World w;
  w.add(a1);
  const Record record(w.bus);
  auto first = w.master->switch_selective(a1);
  auto second = w.master->configure_node_id(NodeId(7));
  auto third = w.master->switch_global(State::waiting);
  World::Done d1, d2, d3;
  first.begin(w.world.executor(), d1);
  second.begin(w.world.executor(), d2);
  third.begin(w.world.executor(), d3);
  ASSERT_TRUE(w.world.run_until([&] { return d1.done && d2.done && d3.done; }, seconds(5)));
  const std::vector<std::string> expected{"7E5#4001000001000000", "7E5#4101000000000000", "7E5#4200000000000000",
                                          "7E5#430A000000000000", "7E4#4400000000000000", "7E5#1107000000000000",
                                          "7E4#1100000000000000", "7E5#0400000000000000"};
  EXPECT_EQ(record.text, expected);
}

TEST(LssMaster, AnyServiceMayBeDestroyedAtAnyTime) {
  // Nanosecond offsets through a select with two more services behind it.
  for (int step = 0; step < 60; ++step) {
    World w;
    w.add(a1, {}, milliseconds(3));
    auto doomed = std::make_unique<Master>(w.dispatcher);
    World::Done d1, d2;
    std::optional<rt::Task<Result<LssAddress>>> task(inquire_address(*w.master));
    task->start(w.world.executor(), d1);
    auto survivor = w.master->switch_selective(a1);
    survivor.begin(w.world.executor(), d2);
    w.settle(microseconds(400 * step));
    task.reset();
    ASSERT_TRUE(w.world.run_until([&] { return d2.done; }, seconds(5))) << step;
    EXPECT_TRUE(survivor.await_resume()) << step;
  }
}

TEST(LssMaster, DestroyingTheMasterCancelsAllServices) {
  World w;
  auto first = w.master->switch_selective(a1);
  auto second = w.master->store();
  World::Done d1, d2;
  first.begin(w.world.executor(), d1);
  second.begin(w.world.executor(), d2);
  w.master.reset();
  w.settle();
  ASSERT_TRUE(d1.done && d2.done);
  EXPECT_EQ(first.await_resume().error().code, Errc::cancelled);
  EXPECT_EQ(second.await_resume().error().code, Errc::cancelled);
}

TEST(LssMaster, ARequestNobodyAcknowledgesIsABusError) {
  World w;  // no other node
  const auto reply = w.run(w.master->switch_global(State::waiting));
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::bus);
  w.add(a1);
  w.settle(seconds(1));
  EXPECT_TRUE(w.run(w.master->switch_selective(a1))) << "the next service works";
}

TEST(LssMaster, APortThatIsOffIsABusError) {
  World w;
  w.add(a1);
  w.port->power(false);
  const auto reply = w.run(w.master->switch_selective(a1));
  ASSERT_FALSE(reply);
  EXPECT_EQ(reply.error().code, Errc::bus);
}

// HC3.11: a single-slot mailbox loses the 2nd of 40h..43h, masters insert delays.
TEST(LssMaster, InhibitSpacesRequestsForSingleSlotReceivers) {
  World w;
  auto slow = w.bus.attach({.rx_depth = 1, .rx_service = milliseconds(4)});
  can::Dispatcher ear(w.world.executor(), *slow);
  struct SlowSlave final : can::Handler, SlaveOwner {
    SlowSlave(can::Dispatcher& d) : dispatcher(d), slave(d.executor(), *this, {.address = a1}, {}) {
      slave.reset_communication();
      d.add(can::only(master_cob_id), *this);
    }
    void received(const can::Frame& f, rt::Time) noexcept override {
      if (const auto answer = slave.handle(f)) dispatcher.send(*answer);
    }
    std::optional<StoreResult> store(const Settings&) noexcept override { return StoreResult{}; }
    void wants_reset_communication() noexcept override {}
    void switch_bit_rate(BitRateIndex) noexcept override {}
    void silence_over() noexcept override {}
    can::Dispatcher& dispatcher;
    Slave slave;
  } slave(ear);
  EXPECT_FALSE(w.run(w.master->switch_selective(a1))) << "back to back, frames are lost";
  MasterOptions options;
  options.inhibit = milliseconds(10);
  w.master->set_options(options);
  const Record record(w.bus);
  EXPECT_TRUE(w.run(w.master->switch_selective(a1)));
  for (std::size_t i = 1; i < 4; ++i) EXPECT_GE(record.times[i] - record.times[i - 1], milliseconds(10));
  EXPECT_TRUE(w.run(w.master->inquire(0)));
}

TEST(LssMaster, ASlowStoreHasItsOwnTimeoutAndADeafDeviceMissesWhatCame) {
  World w;
  auto& n = w.add(a1);
  n.store_time = seconds(2);
  n.deaf_while_storing = true;
  ASSERT_TRUE(w.run(w.master->switch_selective(a1)));
  ASSERT_TRUE(w.run(w.master->configure_node_id(NodeId(9))));
  const auto before = w.world.now();
  ASSERT_TRUE(w.run(w.master->store()));
  EXPECT_GE(w.world.now() - before, seconds(2));
  EXPECT_EQ(n.memory.node_id, NodeId(9));
  const ServiceOptions short_wait{.timeout = milliseconds(100), .retries = 0};
  const auto late = w.run(w.master->store(short_wait));
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, Errc::timeout);
  ASSERT_TRUE(w.run(w.master->switch_global(State::waiting)));  // not heard: deaf
  w.settle(seconds(3));
  EXPECT_EQ(n.slave.state(), State::configuration);
  EXPECT_EQ(w.master->answer_times().unexpected, 1U) << "the late answer to 17h";
}

// A frame that CAN itself delivers twice (error in the last bit of end of frame) breaks 40h..43h; the retry mends it.
TEST(LssMaster, ARequestDeliveredTwiceIsRetried) {
  World w;
  w.add(a1);
  sim::Fault fault{.kind = sim::Fault::Kind::dominant};
  fault.trigger.skip = 1;  // the 41h
  fault.where = sim::from_end(0);
  fault.victims = {w.port.get()};
  w.bus.inject(fault);
  const auto reply = w.run(w.master->switch_selective(a1));
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->attempts, 2U);
}

// HC3.8, HU.8: slaves change together; the master follows its own switch.
TEST(LssMaster, AWholeBusMovesToAnotherBitRate) {
  World w(125'000);
  w.add(a1);
  w.add(a2);
  ASSERT_TRUE(w.run(w.master->switch_selective(a1)));
  ASSERT_TRUE(w.run(w.master->configure_bit_timing(BitRateIndex::kbit_500)));
  ASSERT_TRUE(w.run(w.master->store()));
  ASSERT_TRUE(w.run(w.master->switch_selective(a2)));
  const ServiceOptions full{.full_window = true};
  const auto both = w.run(w.master->configure_bit_timing(BitRateIndex::kbit_500, full));
  ASSERT_TRUE(both);
  ASSERT_TRUE(w.run(w.master->activate_bit_timing(50)));
  w.settle(milliseconds(50));
  w.port->restart(500'000);
  w.settle(milliseconds(60));
  ASSERT_TRUE(w.run(w.master->switch_global(State::waiting)));
  const auto reply = w.run(w.master->switch_selective(a2));
  ASSERT_TRUE(reply) << "everybody at 500 kbit/s";
  for (const auto& n : w.nodes) {
    EXPECT_EQ(n->switches, std::vector{BitRateIndex::kbit_500});
    EXPECT_EQ(n->silences_over, 1U);
  }
  EXPECT_EQ(w.nodes[0]->memory.bit_rate, BitRateIndex::kbit_500);
}

// S1.37, S1.50: paper 1, Figures 7 and 10, as its text tells it. Written by hand; LSS frames have 8 bytes and base
// format (S1.47).
TEST(LssMaster, S1_50_Figure10ConfiguresTheFiveSlaves) {
  World w(50'000);
  const std::vector<LssAddress> slaves{
      {0x0100'0001, 1, 0, 0x0A}, {1, 1, 0, 5}, {1, 5, 0, 8}, {1, 1, 0, 6}, {1, 1, 0, 7}};
  for (const auto& a : slaves) w.add(a);
  const Record record(w.bus);
  std::uint8_t id = 0;
  for (const auto& a : slaves) {
    ASSERT_TRUE(w.run(w.master->switch_global(State::waiting)));
    ASSERT_TRUE(w.run(w.master->switch_selective(a)));
    ASSERT_TRUE(w.run(w.master->configure_node_id(NodeId(++id))));
  }
  const std::vector<std::string> figure{
      "7E5#0400000000000000", "7E5#4001000001000000", "7E5#4101000000000000", "7E5#4200000000000000",
      "7E5#430A000000000000", "7E4#4400000000000000", "7E5#1101000000000000", "7E4#1100000000000000",
      "7E5#0400000000000000", "7E5#4001000000000000", "7E5#4101000000000000", "7E5#4200000000000000",
      "7E5#4305000000000000", "7E4#4400000000000000", "7E5#1102000000000000", "7E4#1100000000000000",
      "7E5#0400000000000000", "7E5#4001000000000000", "7E5#4105000000000000", "7E5#4200000000000000",
      "7E5#4308000000000000", "7E4#4400000000000000", "7E5#1103000000000000", "7E4#1100000000000000",
      "7E5#0400000000000000", "7E5#4001000000000000", "7E5#4101000000000000", "7E5#4200000000000000",
      "7E5#4306000000000000", "7E4#4400000000000000", "7E5#1104000000000000", "7E4#1100000000000000",
      "7E5#0400000000000000", "7E5#4001000000000000", "7E5#4101000000000000", "7E5#4200000000000000",
      "7E5#4307000000000000", "7E4#4400000000000000", "7E5#1105000000000000", "7E4#1100000000000000"};
  EXPECT_EQ(record.text, figure);
  for (unsigned i = 0; i < 5; ++i) EXPECT_EQ(w.nodes[i]->slave.pending().node_id.value(), i + 1);
}

// S1.29: the three services, then store, then the id becomes active.
RC_GTEST_PROP(LssMasterProperty, EveryDeviceGetsItsIdWhateverTheLatencies, ()) {
  const auto count = *rc::gen::inRange<unsigned>(1, 12);
  Random random(*rc::gen::arbitrary<std::uint64_t>());
  World w(250'000, random.next());
  std::vector<LssAddress> addresses;
  for (unsigned i = 0; i < count; ++i) {
    const auto part = [&] { return static_cast<std::uint32_t>(random.below(3)); };
    addresses.push_back({part(), part(), part(), 100 + i});
    w.add(addresses.back(), {}, microseconds(random.between(10, 60'000)));
  }
  for (unsigned i = 0; i < count; ++i) {
    RC_ASSERT(w.run(w.master->switch_global(State::waiting)).has_value());
    RC_ASSERT(w.run(w.master->switch_selective(addresses[i])).has_value());
    RC_ASSERT(w.run(w.master->configure_node_id(NodeId(static_cast<std::uint8_t>(i + 1)))).has_value());
    RC_ASSERT(w.run(w.master->store()).has_value());
  }
  RC_ASSERT(w.run(w.master->switch_global(State::waiting)).has_value());
  w.settle();
  for (unsigned i = 0; i < count; ++i) {
    RC_ASSERT(w.nodes[i]->slave.active().node_id.value() == i + 1);
    RC_ASSERT(w.nodes[i]->memory.node_id.value() == i + 1);
  }
}

// Other frames of the same port stand in front: 55 devices are read at once.
TEST(LssMaster, AQueueThatIsFullIsWaitedFor) {
  World w;
  w.add(a2);
  while (w.dispatcher.send(can::Frame::base(0x600, {0, 0, 0, 0, 0, 0, 0, 0})) == can::Queued::yes) {
  }
  const Record record(w.bus);
  const auto selected = w.run(w.master->switch_selective(a2));
  ASSERT_TRUE(selected) << selected.error().text;
  EXPECT_EQ(selected->attempts, 1U);
  EXPECT_EQ(record.text.front().substr(0, 3), "600");
}

TEST(LssMaster, AQueueThatStaysFullEndsWithTheTimeToSend) {
  World w;  // nobody else: nothing is acknowledged
  while (w.dispatcher.send(can::Frame::base(0x600, {})) == can::Queued::yes) {
  }
  const auto before = w.world.now();
  const auto selected = w.run(w.master->switch_selective(a2));
  ASSERT_FALSE(selected);
  EXPECT_EQ(selected.error().code, Errc::bus);
  EXPECT_EQ(w.world.now() - before, w.master->options().send_timeout);
}

}  // namespace
}  // namespace berth::lss::test
