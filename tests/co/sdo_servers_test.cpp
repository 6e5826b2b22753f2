// SDO channels of a device (1200h.., 1280h..), answers that come later, and transfers that a reset, a dead node or a
// destroyed client interrupts (docs/protocols/cia301.md §CAN-IDs, §SDO; docs/hard-cases.md §1, §5).
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/co/sdo_servers.hpp"

#include "sdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using od::AbortCode;

namespace {

std::shared_ptr<const od::Description> channels_description() {
  using od::Access;
  using od::DataType;
  using od::Literal;
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = Access::ro, .initial = Literal::number(0x00020192)});
  b.variable(0x2000, {.name = "U8", .type = DataType::unsigned8});
  b.variable(0x2004, {.name = "domain", .type = DataType::domain, .capacity = 4000});
  // Described as some files have it: writable, and without $NODEID.
  b.sub(0x1200, {.sub = 1, .name = "c->s", .initial = Literal::number(0x600)});
  b.sub(0x1200, {.sub = 2, .name = "s->c", .initial = Literal::number(0x580)});
  for (const std::uint16_t index : {std::uint16_t{0x1201}, std::uint16_t{0x1202}, std::uint16_t{0x127F},
                                    std::uint16_t{0x1280}, std::uint16_t{0x12FF}}) {
    b.sub(index, {.sub = 1, .name = "c->s", .initial = Literal::number(0x8000'0000)});
    b.sub(index, {.sub = 2, .name = "s->c", .initial = Literal::number(0x8000'0000)});
    b.sub(index, {.sub = 3, .name = "node", .type = DataType::unsigned8, .initial = Literal::number(1)});
  }
  return b.build();
}

// A device with all channels of its dictionary, and a client on the default one.
struct Channels : ::testing::Test, Bench {
  Channels() { servers.start(NodeId(5)); }
  AbortCode write(std::uint16_t index, std::uint8_t sub, std::uint32_t value) {
    auto op = client.write<std::uint32_t>(NodeId(5), index, sub, value);
    const auto done = await(*this, op);
    return done ? AbortCode::none : static_cast<AbortCode>(done.error().detail);
  }
  void open(std::uint16_t index, std::uint32_t request, std::uint32_t response) {
    EXPECT_EQ(write(index, 1, request), AbortCode::none);
    EXPECT_EQ(write(index, 2, response), AbortCode::none);
  }
  Station device{wire};
  Station station{wire};
  od::Values values{channels_description(), NodeId(5)};
  co::SdoServers servers{device.dispatcher, values, 4096};
  co::SdoClient client{station.dispatcher};
};

// OD.1200, A7.8: the default channel is what the standard says, and it is read-only.
TEST_F(Channels, OD_1200_DefaultChannel) {
  auto request = client.read<std::uint32_t>(NodeId(5), 0x1200, 1);
  EXPECT_EQ(*await(*this, request), 0x605U);
  auto response = client.read<std::uint32_t>(NodeId(5), 0x1200, 2);
  EXPECT_EQ(*await(*this, response), 0x585U);
  EXPECT_EQ(write(0x1200, 1, 0x600), AbortCode::read_only);
  EXPECT_EQ(write(0x1200, 2, 0x585), AbortCode::read_only);
}

// A7.8: an additional server serves from the write that makes it valid; transfers in both channels run side by side.
TEST_F(Channels, A7_8_AdditionalServer) {
  EXPECT_EQ(servers.additional(), 0U);
  EXPECT_EQ(write(0x1201, 1, 0x6A0), AbortCode::none);
  EXPECT_EQ(servers.additional(), 0U) << "half of it is not valid yet";
  EXPECT_EQ(write(0x1201, 2, 0x5A0 - 0x120), AbortCode::none);
  EXPECT_EQ(servers.additional(), 1U);
  co::SdoChannelClient second(station.dispatcher, {co::CobId(0x6A0), co::CobId(0x480)}, NodeId(5));
  co::SdoOptions options;
  options.mode = co::SdoMode::block;
  const Bytes data = numbers(500);
  auto long_op = second.download(0x2004, 0, data, options);
  Flag flag;
  long_op.begin(executor, flag);
  auto beside = client.read<std::uint32_t>(NodeId(5), 0x1000, 0);
  EXPECT_EQ(*await(*this, beside), 0x00020192U);
  EXPECT_FALSE(flag.set);
  EXPECT_TRUE(servers.busy());
  run(1s);
  ASSERT_TRUE(flag.set);
  EXPECT_TRUE(long_op.await_resume());
  EXPECT_FALSE(servers.busy());
  auto up = second.upload(0x2004, 0, options);
  EXPECT_EQ(await(*this, up)->size(), 500U);
  auto number = second.read<std::uint32_t>(0x1000, 0);
  EXPECT_EQ(*await(*this, number), 0x00020192U);
  // Its own channel is closed over itself: the answer still comes.
  auto closing = second.write<std::uint32_t>(0x1201, 1, 0x8000'06A0U);
  EXPECT_TRUE(await(*this, closing));
  EXPECT_EQ(servers.additional(), 0U);
  auto silent = second.read<std::uint32_t>(0x1000, 0);
  EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
}

TEST_F(Channels, ExtendedIdentifiers) {
  open(0x127F, 0x2000'0000U | 0x12345678U, 0x2000'0000U | 0x12345679U);
  co::SdoChannelClient second(station.dispatcher, {co::CobId(0x3234'5678U), co::CobId(0x3234'5679U)}, NodeId(5));
  auto number = second.read<std::uint32_t>(0x1000, 0);
  EXPECT_EQ(*await(*this, number), 0x00020192U);
  const Bytes data = numbers(100);
  co::SdoOptions options;
  options.mode = co::SdoMode::block;
  auto down = second.download(0x2004, 0, data, options);
  EXPECT_TRUE(await(*this, down));
  EXPECT_TRUE(std::ranges::all_of(wire.log, [](const std::string& f) {
    return f.substr(0, 4) == "605#" || f.substr(0, 4) == "585#" || f.substr(0, 7) == "1234567";
  }));
}

// A1.2: restricted CAN-IDs are refused with 0609 0030, the edges included.
TEST_F(Channels, A1_2_RestrictedCanIds) {
  for (const std::uint32_t id : {0x000U, 0x001U, 0x07FU, 0x101U, 0x180U, 0x581U, 0x5FFU, 0x601U, 0x67FU, 0x6E0U, 0x6FFU,
                                 0x701U, 0x77FU, 0x780U, 0x7FFU}) {
    for (const std::uint16_t index : {std::uint16_t{0x1201}, std::uint16_t{0x1280}}) {
      EXPECT_EQ(write(index, 1, id), AbortCode::invalid_value) << id;
      EXPECT_EQ(write(index, 2, id), AbortCode::invalid_value) << id;
    }
  }
  EXPECT_EQ(write(0x1201, 1, 0x800), AbortCode::invalid_value) << "more than 11 bits";
  EXPECT_EQ(write(0x1201, 1, 0x8000'0800U), AbortCode::invalid_value) << "valid or not";
  EXPECT_EQ(write(0x1280, 2, 0x9000'0000U), AbortCode::invalid_value);
  for (const std::uint32_t id : {0x080U, 0x100U, 0x181U, 0x580U, 0x600U, 0x680U, 0x6DFU, 0x700U}) {
    EXPECT_EQ(write(0x1202, 1, id), AbortCode::none) << id;
    EXPECT_EQ(write(0x1202, 1, 0x8000'0000U | id), AbortCode::none);
  }
  // As long as it is not valid it may say anything.
  EXPECT_EQ(write(0x1201, 1, 0x8000'0605U), AbortCode::none);
}

// A1.3, A7.8: bits 29..0 stand while the COB-ID is valid.
TEST_F(Channels, A7_8_ChangedOnlyWhileInvalid) {
  open(0x1201, 0x6A0, 0x480);
  EXPECT_EQ(write(0x1201, 1, 0x6A1), AbortCode::invalid_value);
  EXPECT_EQ(write(0x1201, 2, 0x2000'0480U), AbortCode::invalid_value);
  EXPECT_EQ(write(0x1201, 1, 0x6A0), AbortCode::none) << "no change";
  EXPECT_EQ(write(0x1201, 1, 0x8000'06A1U), AbortCode::none) << "may say something else as it becomes invalid";
  EXPECT_EQ(write(0x1201, 1, 0x6A1), AbortCode::none);
  EXPECT_EQ(servers.additional(), 1U);
  co::SdoChannelClient second(station.dispatcher, {co::CobId(0x6A1), co::CobId(0x480)}, NodeId(5));
  auto number = second.read<std::uint32_t>(0x1000, 0);
  EXPECT_TRUE(await(*this, number));
  // The client's node-ID.
  for (const std::uint8_t node : {std::uint8_t{0}, std::uint8_t{128}, std::uint8_t{255}}) {
    auto op = client.write<std::uint8_t>(NodeId(5), 0x1201, 3, node);
    EXPECT_EQ(await(*this, op).error().detail, 0x06090030U);
  }
  auto op = client.write<std::uint8_t>(NodeId(5), 0x1201, 3, std::uint8_t{127});
  EXPECT_TRUE(await(*this, op));
}

// OD.1280: the application opens its client channels from their objects.
TEST_F(Channels, OD_1280_ClientChannels) {
  EXPECT_FALSE(co::client_channel(values, 1));
  EXPECT_FALSE(co::client_channel(values, 2)) << "no such object";
  EXPECT_FALSE(co::client_channel(values, 0));
  EXPECT_FALSE(co::client_channel(values, 129));
  open(0x1280, 0x607 + 0x99, 0x480);
  open(0x12FF, 0x6A1, 0x481);
  auto node = client.write<std::uint8_t>(NodeId(5), 0x1280, 3, std::uint8_t{7});
  EXPECT_TRUE(await(*this, node));
  const auto first = co::client_channel(values, 1);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->channel, (co::SdoChannel{co::CobId(0x6A0), co::CobId(0x480)}));
  EXPECT_EQ(first->server, NodeId(7));
  ASSERT_TRUE(co::client_channel(values, 128));
  // A server at the other end of it.
  od::Values other(test_description(), NodeId(7));
  Station far(wire);
  co::SdoServerService service(far.dispatcher, other, 64);
  service.start(first->channel);
  co::SdoChannelClient mine(device.dispatcher, first->channel, first->server);
  auto type = mine.read<std::uint32_t>(0x1000, 0);
  EXPECT_EQ(*await(*this, type), 0x00020192U);
  auto missing = mine.read<std::uint32_t>(0x3000, 0);
  EXPECT_EQ(await(*this, missing).error().node, 7);
  co::SdoChannelClient closed(device.dispatcher, {}, NodeId(7));
  auto invalid = closed.read<std::uint32_t>(0x1000, 0);
  EXPECT_EQ(await(*this, invalid).error().code, Errc::invalid);
}

// A reset: no channel hears anything; afterwards the objects' values count.
TEST_F(Channels, StopAndStart) {
  open(0x1201, 0x6A0, 0x480);
  servers.stop();
  auto silent = client.read<std::uint32_t>(NodeId(5), 0x1000, 0);
  EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
  EXPECT_EQ(servers.additional(), 0U);
  servers.start(NodeId(5));
  EXPECT_EQ(servers.additional(), 1U);
  servers.stop();
  values.reset(NodeId(6));
  servers.start(NodeId(6));
  EXPECT_EQ(servers.additional(), 0U);
  auto moved = client.read<std::uint32_t>(NodeId(6), 0x1200, 1);
  EXPECT_EQ(*await(*this, moved), 0x606U);
}

// ---- answers that come later

// Answers `pending` and counts.
struct Slow final : od::Hook {
  AbortCode writing(const od::Values&, ObjectRef, std::span<const std::uint8_t>) noexcept override {
    ++writes;
    return AbortCode::pending;
  }
  int writes = 0;
};

struct Pending : ::testing::Test, ServerRig {
  Pending() {
    values.attach(slow, 0x2000, 0x2005);
    EXPECT_TRUE(values.attach(stream, {0x2004, 0}));
  }
  std::string completed(AbortCode code) {
    const auto answer = server.complete(code);
    return answer ? can::to_string(*answer) : "";
  }
  Slow slow;
  Pattern stream;
};

TEST_F(Pending, ExpeditedSegmentedAndBlock) {
  EXPECT_EQ(ask("2F0020002A000000"), "");
  EXPECT_TRUE(server.busy());
  EXPECT_EQ(server.pending(), (ObjectRef{0x2000, 0}));
  EXPECT_EQ(completed(AbortCode::none), "585#6000200000000000");
  EXPECT_FALSE(server.busy());
  EXPECT_EQ(ask("2105200008000000"), "6005200000000000");
  EXPECT_EQ(ask("0001020304050607"), "2000000000000000");
  EXPECT_EQ(ask("1D08000000000000"), "");
  EXPECT_EQ(completed(AbortCode::none), "585#3000000000000000");
  EXPECT_FALSE(server.busy());
  ask("C205200008000000");
  ask("0101020304050607");
  ask("8208000000000000");
  EXPECT_EQ(ask("D900000000000000"), "");
  EXPECT_EQ(completed(AbortCode::hardware), "585#8005200000000606");
  EXPECT_FALSE(server.busy());
  EXPECT_EQ(slow.writes, 3);
}

TEST_F(Pending, StreamsOpenAndCloseLater) {
  stream.on_open = stream.on_close = AbortCode::pending;
  EXPECT_EQ(ask("C204200007000000"), "");
  EXPECT_EQ(ask("0183060000000000"), "") << "segments before the answer are not heard";
  EXPECT_EQ(completed(AbortCode::none).substr(0, 16), "585#A00420007F00");
  Bytes data(7);
  for (std::size_t i = 0; i < 7; ++i) data[i] = Pattern::at(i);
  EXPECT_EQ(ask(segments_of(data)[0]).substr(0, 4), "A201");
  EXPECT_EQ(ask("C100000000000000"), "");
  EXPECT_EQ(server.pending(), (ObjectRef{0x2004, 0}));
  EXPECT_EQ(completed(AbortCode::none), "585#A100000000000000");
  EXPECT_EQ(stream.wrong, 0U);
  EXPECT_TRUE(stream.completed);
  ask("2104200007000000");
  EXPECT_EQ(completed(AbortCode::local_control), "585#8004200021000008");
  EXPECT_EQ(stream.closed, 2) << "opened, so it is closed";
}

TEST_F(Pending, TheSameRequestIsNotExecutedTwice) {
  ask("2F0020002A000000");
  for (int i = 0; i < 3; ++i) EXPECT_EQ(ask("2F0020002A000000"), "");
  EXPECT_EQ(ask("6000000000000000"), "") << "nor is anything else that is no new initiate";
  EXPECT_EQ(ask("A200000000000000"), "");
  EXPECT_EQ(slow.writes, 1);
  EXPECT_EQ(server.expire(), std::nullopt) << "the client's silence counts for nothing";
  EXPECT_EQ(completed(AbortCode::none), "585#6000200000000000");
}

TEST_F(Pending, DroppedByAbortInitiateAndReset) {
  ask("2F0020002A000000");
  EXPECT_EQ(ask("8000200000000405"), "");
  EXPECT_EQ(completed(AbortCode::none), "") << "too late, and harmless";
  ask("2F0020002A000000");
  EXPECT_EQ(ask("4000100000000000"), "4300100092010200");
  EXPECT_EQ(completed(AbortCode::none), "");
  ask("2F0020002A000000");
  server.reset();
  EXPECT_EQ(completed(AbortCode::none), "");
  EXPECT_EQ(completed(AbortCode::pending), "");
  ask("2F0020002A000000");
  EXPECT_EQ(completed(AbortCode::pending), "") << "is no answer";
  EXPECT_TRUE(server.pending());
}

TEST(PendingService, AnswersWhenItIsTold) {
  Bench b;
  Station device(b.wire), station(b.wire);
  od::Values values(channels_description(), NodeId(5));
  Slow slow;
  values.attach(slow, 0x2000);
  co::SdoServers servers(device.dispatcher, values, 64);
  servers.start(NodeId(5));
  co::SdoClient client(station.dispatcher);
  co::SdoOptions patient;
  patient.timeout = 30s;
  auto op = client.write<std::uint8_t>(NodeId(5), 0x2000, 0, 1, patient);
  Flag flag;
  op.begin(b.executor, flag);
  b.run(10s);
  EXPECT_FALSE(flag.set) << "the server's own time-out does not run";
  EXPECT_EQ(b.wire.log.size(), 1U);
  EXPECT_FALSE(servers.complete({0x2001, 0}, AbortCode::none)) << "another object";
  EXPECT_TRUE(servers.complete({0x2000, 0}, AbortCode::none));
  EXPECT_FALSE(servers.complete({0x2000, 0}, AbortCode::none));
  b.run(1s);
  ASSERT_TRUE(flag.set);
  EXPECT_TRUE(op.await_resume());
}

// ---- interrupted

// HC5.1: requests pending when the node resets are cancelled, and each ends once.
TEST_F(Channels, HC5_1_NodeResetsWithRequestsPending) {
  const Bytes data = numbers(3000);
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    co::SdoOptions options;
    options.mode = mode;
    struct Count final : rt::Job {
      void run() noexcept override { ++times; }
      int times = 0;
    } ends[3];
    auto first = client.download(NodeId(5), 0x2004, 0, data, options);
    auto second = client.upload(NodeId(5), 0x2004, 0, options);
    auto third = client.read<std::uint32_t>(NodeId(5), 0x1000, 0);
    first.begin(executor, ends[0]);
    second.begin(executor, ends[1]);
    third.begin(executor, ends[2]);
    run(5ms);
    servers.stop();            // the node's NMT state machine
    client.cancel(NodeId(5));  // the master heard the boot-up message
    run(10s);
    for (const auto& each : ends) EXPECT_EQ(each.times, 1);
    EXPECT_EQ(first.await_resume().error().code, Errc::cancelled);
    EXPECT_EQ(second.await_resume().error().code, Errc::cancelled);
    EXPECT_EQ(third.await_resume().error().code, Errc::cancelled);
    servers.start(NodeId(5));
    auto next = client.read<std::uint32_t>(NodeId(5), 0x1000, 0);
    EXPECT_TRUE(await(*this, next));
  }
}

// A node that resets or dies without a word: an error in bounded time, and the server is free again.
TEST_F(Channels, InterruptedByADeadNodeEitherWay) {
  const Bytes data = numbers(3000);
  co::SdoOptions options;
  options.mode = co::SdoMode::block;
  for (auto time = 500us; time < 60ms; time += 3700us) {
    auto op = client.download(NodeId(5), 0x2004, 0, data, options);
    Flag flag;
    op.begin(executor, flag);
    run(time);
    servers.stop();
    run(5s);
    ASSERT_TRUE(flag.set);
    const auto done = op.await_resume();
    EXPECT_TRUE(done || done.error().code == Errc::timeout);
    servers.start(NodeId(5));
    run(1ms);
    // The client dies: the server gives up.
    auto dying = std::make_unique<co::SdoClient>(station.dispatcher);
    auto up = dying->upload(NodeId(5), 0x2004, 0, options);
    up.begin(executor, flag);
    run(time);
    station.port.refuses = can::Queued::closed;
    dying.reset();
    run(5s);
    station.port.refuses.reset();
    EXPECT_FALSE(servers.busy());
  }
}

// HC5.2: a client destroyed while requests are pending: each ends, none calls back afterwards.
TEST_F(Channels, HC5_2_ClientDestroyedWithRequestsPending) {
  const Bytes data = numbers(3000);
  auto mine = std::make_unique<co::SdoClient>(station.dispatcher);
  co::SdoOptions options;
  options.mode = co::SdoMode::block;
  auto first = mine->download(NodeId(5), 0x2004, 0, data, options);
  auto second = mine->read<std::uint32_t>(NodeId(5), 0x1000, 0);
  auto other = mine->read<std::uint32_t>(NodeId(9), 0x1000, 0);
  Flag flags[3];
  first.begin(executor, flags[0]);
  second.begin(executor, flags[1]);
  other.begin(executor, flags[2]);
  run(5ms);
  mine.reset();
  for (const auto& each : flags) EXPECT_FALSE(each.set) << "nothing is called from inside the destructor";
  run(0ns);
  for (const auto& each : flags) EXPECT_TRUE(each.set);
  EXPECT_EQ(first.await_resume().error().code, Errc::cancelled);
  EXPECT_EQ(second.await_resume().error().code, Errc::cancelled);
  EXPECT_EQ(other.await_resume().error().code, Errc::cancelled);
  for (auto& each : flags) each.set = false;
  run(20s);
  for (const auto& each : flags) EXPECT_FALSE(each.set);
}

// HC5.3, HU.25: an SDO begun in a callback of the device is queued behind the one under way, not nested in it.
TEST_F(Channels, HC5_3_SdoFromACallback) {
  struct Asks final : od::Hook {
    void written(od::Values&, ObjectRef) noexcept override {
      op->begin(*executor, flag);
      at_once = flag.set;
    }
    co::SdoRead<std::uint32_t>* op = nullptr;
    rt::Executor* executor = nullptr;
    Flag flag;
    bool at_once = true;
  } asks;
  od::Values other(test_description(), NodeId(9));
  Station far(wire);
  co::SdoServerService service(far.dispatcher, other, 64);
  service.start(NodeId(9));
  co::SdoClient own(device.dispatcher);
  auto op = own.read<std::uint32_t>(NodeId(9), 0x1000, 0);
  asks.op = &op;
  asks.executor = &executor;
  values.attach(asks, 0x2000);
  auto write = client.write<std::uint8_t>(NodeId(5), 0x2000, 0, 1);
  EXPECT_TRUE(await(*this, write));
  EXPECT_FALSE(asks.at_once);
  run(1s);
  ASSERT_TRUE(asks.flag.set);
  EXPECT_EQ(*op.await_resume(), 0x00020192U);
  values.detach(asks);
}

// HC5.4: nothing is bound to a thread or a process, only to an executor: two networks with a device each, and one
// executor that drives both or two that do.
TEST(SdoNetworks, HC5_4_TwoNetworksInOneProcess) {
  struct Network : Bench {
    Station device{wire};
    Station station{wire};
    od::Values values{channels_description(), NodeId(5)};
    co::SdoServers servers{device.dispatcher, values, 64};
    co::SdoClient client{station.dispatcher};
    co::SdoWrite<std::uint8_t> op = client.write<std::uint8_t>(NodeId(5), 0x2000, 0, 1);
    Flag flag;
  };
  auto first = std::make_unique<Network>();
  auto second = std::make_unique<Network>();
  for (auto* network : {first.get(), second.get()}) {
    network->servers.start(NodeId(5));
    network->op.begin(network->executor, network->flag);
  }
  second->run(1s);
  EXPECT_TRUE(second->flag.set);
  EXPECT_FALSE(first->flag.set);
  second.reset();
  first->run(1s);
  EXPECT_TRUE(first->flag.set);
  EXPECT_TRUE(first->op.await_resume());
}

// Many transfers to many nodes run side by side: all together take as long as one.
TEST(SdoParallel, ManyNodesAtOnce) {
  Bench b;
  b.wire.frame_time = 1us;
  Station station(b.wire);
  station.port.capacity = 1000;
  struct Node {
    explicit Node(Wire& wire, unsigned id)
        : far(wire),
          values(test_description(), NodeId(static_cast<std::uint8_t>(id))),
          service(far.dispatcher, values) {
      service.start(NodeId(static_cast<std::uint8_t>(id)));
    }
    Station far;
    od::Values values;
    co::SdoServerService service;
  };
  std::vector<std::unique_ptr<Node>> nodes;
  for (unsigned id = 1; id <= 40; ++id) nodes.push_back(std::make_unique<Node>(b.wire, id));
  co::SdoClient client(station.dispatcher);
  std::vector<std::unique_ptr<co::SdoDownload>> ops;
  std::vector<std::unique_ptr<Flag>> flags;
  const Bytes data = numbers(900);
  for (unsigned id = 1; id <= 40; ++id) {
    co::SdoOptions options;
    options.mode = id % 2 == 0 ? co::SdoMode::block : co::SdoMode::segmented;
    ops.push_back(std::unique_ptr<co::SdoDownload>(
        new co::SdoDownload(client.download(NodeId(static_cast<std::uint8_t>(id)), 0x2004, 0, data, options))));
    flags.push_back(std::make_unique<Flag>());
    ops.back()->begin(b.executor, *flags.back());
  }
  b.run(1s);
  for (unsigned i = 0; i < 40; ++i) {
    ASSERT_TRUE(flags[i]->set) << i;
    EXPECT_TRUE(ops[i]->await_resume());
    const auto stored = nodes[i]->values.bytes(ObjectRef{0x2004, 0});
    EXPECT_EQ(Bytes(stored.begin(), stored.end()), data);
  }
}

// A7.10: every abort code of the table, by its number and words; each reaches the client as it is.
TEST_F(Channels, A7_10_AbortCodes) {
  const std::map<std::uint32_t, std::string> table{
      {0x05030000, "toggle"},        {0x05040000, "timed out"},    {0x05040001, "command"},
      {0x05040002, "block size"},    {0x05040003, "sequence"},     {0x05040004, "CRC"},
      {0x05040005, "memory"},        {0x06010000, "unsupported"},  {0x06010001, "write-only"},
      {0x06010002, "read-only"},     {0x06020000, "not exist"},    {0x06040041, "mapped"},
      {0x06040042, "PDO length"},    {0x06040043, "parameter"},    {0x06040047, "internal"},
      {0x06060000, "hardware"},      {0x06070010, "length"},       {0x06070012, "too high"},
      {0x06070013, "too low"},       {0x06090011, "sub-index"},    {0x06090030, "invalid"},
      {0x06090031, "too high"},      {0x06090032, "too low"},      {0x06090036, "less than"},
      {0x060A0023, "connection"},    {0x08000000, "general"},      {0x08000020, "application"},
      {0x08000021, "local control"}, {0x08000022, "device state"}, {0x08000023, "dictionary"},
      {0x08000024, "no data"}};
  EXPECT_EQ(od::all_abort_codes().size(), table.size());
  struct Refuses final : od::Hook {
    AbortCode writing(const od::Values&, ObjectRef, std::span<const std::uint8_t>) noexcept override { return code; }
    AbortCode code = AbortCode::none;
  } refuses;
  values.attach(refuses, 0x2000);
  for (const auto& [number, words] : table) {
    const auto code = static_cast<AbortCode>(number);
    EXPECT_TRUE(od::known(code)) << number;
    EXPECT_NE(std::string(od::text(code)).find(words), std::string::npos) << od::text(code) << " / " << words;
    refuses.code = code;
    auto op = client.write<std::uint8_t>(NodeId(5), 0x2000, 0, 1);
    const auto done = await(*this, op);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().code, Errc::aborted);
    EXPECT_EQ(done.error().detail, number);
    EXPECT_STREQ(done.error().text, od::text(code));
  }
  EXPECT_FALSE(od::known(AbortCode::pending));
  EXPECT_FALSE(od::known(static_cast<AbortCode>(0x08000025)));
}

}  // namespace
