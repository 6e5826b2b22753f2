// The SDO gateway of paper 3, against frames written by hand from its Figures 11 to 13 (docs/multilevel.md §SDO).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/multilevel/sdo_session.hpp"
#include "tree.hpp"

using namespace berth;
using namespace berth::multilevel;
using namespace berth::multilevel::test;

namespace {

// A client above (raw frames), gateway 3, and beneath it what the test says: a raw node, or a device.
struct OneGateway : ::testing::Test {
  void build(const SdoGatewayOptions& options = {}) {
    gateway.emplace(world, above, 3, beneath, 1, options);
    world.run_for(50ms);
    above.clear();
    beneath.clear();
  }
  std::string ask(const std::string& request, rt::Duration time = 5ms) {
    const auto before = above.log.size();
    client.send("603#" + request);
    world.run_for(time);
    std::string answer;
    for (auto i = before; i < above.log.size(); ++i) {
      if (above.log[i].starts_with("583#")) answer = above.log[i].substr(4);
    }
    return answer;
  }
  sim::World world;
  Line above{world, "above"};
  Line beneath{world, "beneath"};
  Station client{world, above};
  Station node{world, beneath};  // acknowledges, and speaks as the test wants
  std::optional<Gateway> gateway;
};

struct WithLeaf : OneGateway {
  WithLeaf() {
    build();
    leaf.emplace(world, beneath, 5);
    world.run_for(50ms);
    above.clear();
    beneath.clear();
  }
  std::optional<Leaf> leaf;
};

}  // namespace

// S3.22, S3.23, S3.30: Figures 11 and 12, step by step; then the same node once more.
TEST_F(WithLeaf, DownloadInTenSteps) {
  client.send("603#2F305F0005000000");
  world.run_for(5ms);
  client.send("603#2B315F0034120000");
  world.run_for(5ms);
  client.send("603#23325F002B012000");
  world.run_for(5ms);
  EXPECT_EQ(above.log, (Log{"603#2F305F0005000000",    // 2. the downstream node-ID
                            "583#60305F0000000000",    // 3.
                            "603#2B315F0034120000",    // 4. the data
                            "583#60315F0000000000",    // 5.
                            "603#23325F002B012000",    // 6. command specifier and multiplexer
                            "583#60325F0000000000"}))  // 9. when the answer beneath is there
  ;
  EXPECT_EQ(beneath.log, (Log{"605#2B01200034120000",    // 7.
                              "585#6001200000000000"}))  // 8.
  ;
  EXPECT_GT(beneath.when("605#2B01200034120000"), above.when("603#23325F002B012000"));
  EXPECT_GT(above.when("583#60325F0000000000"), beneath.when("585#6001200000000000"));
  EXPECT_EQ(leaf->device.values().get<std::uint16_t>({0x2001, 0}), 0x1234);
  // "Next downstream SDO downloads to the same node need only 2."
  above.clear();
  beneath.clear();
  EXPECT_EQ(ask("2F315F0077000000"), "60315F0000000000");
  EXPECT_EQ(ask("23325F002F002000"), "60325F0000000000");
  EXPECT_EQ(beneath.log, (Log{"605#2F00200077000000", "585#6000200000000000"}));
  // The client may look what it has written.
  EXPECT_EQ(ask("40305F0000000000"), "4F305F0005000000");
  EXPECT_EQ(ask("40325F0000000000"), "43325F002F002000");
}

// S3.24: Figure 13, then the same node once more.
TEST_F(WithLeaf, UploadInTenSteps) {
  client.send("603#2F305F0005000000");
  world.run_for(5ms);
  client.send("603#23325F0040001000");
  world.run_for(5ms);
  client.send("603#40315F0000000000");
  world.run_for(5ms);
  EXPECT_EQ(above.log, (Log{"603#2F305F0005000000",    // 2.
                            "583#60305F0000000000",    // 3.
                            "603#23325F0040001000",    // 4. command specifier and multiplexer
                            "583#60325F0000000000",    // 5.
                            "603#40315F0000000000",    // 8.
                            "583#43315F0092010200"}))  // 9.
  ;
  EXPECT_EQ(beneath.log, (Log{"605#4000100000000000",    // 6.
                              "585#4300100092010200"}))  // 7.
  ;
  // "After first access to the same node, only one upstream SDO upload and download are needed."
  EXPECT_EQ(ask("23325F0040011000"), "60325F0000000000");
  EXPECT_EQ(ask("40315F0000000000"), "4F315F0000000000");
  // An answer that was lost can be fetched once more.
  EXPECT_EQ(ask("40315F0000000000"), "4F315F0000000000");
}

// S3.25: strict, the multiplexer is that of the object above and the abort code that from beneath.
TEST_F(WithLeaf, StrictAborts) {
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  EXPECT_EQ(ask("23315F0001000020"), "60315F0000000000");
  EXPECT_EQ(ask("23325F0023022000"), "80325F0031000906");  // 2002h: value too high
  EXPECT_EQ(ask("23325F0040345600"), "60325F0000000000");
  EXPECT_EQ(ask("40315F0000000000"), "80315F0000000206");  // 5634h does not exist
  EXPECT_EQ(beneath.log,
            (Log{"605#2302200001000020", "585#8002200031000906", "605#4034560000000000", "585#8034560000000206"}));
}

// S3.25: literal, "reply, which is equal to the downstream reply, except cob-id".
TEST_F(OneGateway, LiteralReplies) {
  build({.literal = true});
  Leaf leaf(world, beneath, 5);
  world.run_for(50ms);
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  EXPECT_EQ(ask("2B315F0034120000"), "60315F0000000000");
  EXPECT_EQ(ask("23325F002B012000"), "6001200000000000");
  EXPECT_EQ(ask("23325F0040001000"), "60325F0000000000");
  EXPECT_EQ(ask("40315F0000000000"), "4300100092010200");
  EXPECT_EQ(ask("23315F0001000020"), "60315F0000000000");
  EXPECT_EQ(ask("23325F0023022000"), "8002200031000906");
  EXPECT_EQ(ask("23325F0040345600"), "60325F0000000000");
  EXPECT_EQ(ask("40315F0000000000"), "8034560000000206");
  // A client as CiA 301 has it does not take them for its answers.
  co::SdoClient strict(client.dispatcher, {.timeout = 100ms});
  co::NodeAccess access(strict, NodeId(3));
  const auto value = await(world, access.read_u32(0x5F32, 0));
  EXPECT_TRUE(value);
  const Bytes node{5};
  ASSERT_TRUE(await(world, access.write(0x5F30, 0, node)));
  ASSERT_TRUE(await(world, access.write_u32(0x5F32, 0, 0x0010'0040)));
  const auto data = await(world, access.read_u32(0x5F31, 0));
  ASSERT_FALSE(data);
  EXPECT_EQ(data.error().code, Errc::timeout);
}

// S3.27: the upload comes before the answer beneath; it is held back.
TEST_F(OneGateway, AnUploadThatComesEarly) {
  build();
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  client.send("603#23325F0040001000");
  client.send("603#40315F0000000000");
  world.run_for(200ms);
  EXPECT_EQ(above.log.back(), "603#40315F0000000000");
  EXPECT_EQ(beneath.log, Log{"605#4000100000000000"});
  node.send("585#4300100092010200");
  world.run_for(5ms);
  EXPECT_EQ(above.log.back(), "583#43315F0092010200");
}

// S3.27: nobody answers beneath; the upload is told 0504 0000 after one time-out, and the gateway goes on.
TEST_F(WithLeaf, ANodeThatIsNotThere) {
  EXPECT_EQ(ask("2F305F0009000000"), "60305F0000000000");
  client.send("603#23325F0040001000");
  client.send("603#40315F0000000000");
  world.run_for(990ms);
  EXPECT_EQ(above.log.back(), "603#40315F0000000000");
  world.run_for(20ms);
  EXPECT_EQ(above.log.back(), "583#80315F0000000405");
  EXPECT_EQ(ask("2B315F0034120000"), "60315F0000000000");
  EXPECT_EQ(ask("23325F002B012000", 1100ms), "80325F0000000405");
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  EXPECT_EQ(ask("23325F0040001000"), "60325F0000000000");
  EXPECT_EQ(ask("40315F0000000000"), "43315F0092010200");
  EXPECT_EQ(gateway->gateway.busy(), 0U);
}

// S3.28: the client aborts in the middle: the access beneath is given up, too.
TEST_F(OneGateway, AnAbortInTheMiddle) {
  build();
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  // A segmented upload beneath that has begun.
  EXPECT_EQ(ask("23325F0040081000"), "60325F0000000000");
  node.send("585#4108100064000000");
  world.run_for(5ms);
  EXPECT_EQ(ask("40315F0000000000"), "41315F0064000000");
  EXPECT_EQ(beneath.log.back(), "605#6000000000000000");
  client.send("603#80315F0000000008");
  world.run_for(5ms);
  EXPECT_EQ(beneath.log.back(), "605#8008100000000008");
  EXPECT_EQ(gateway->gateway.busy(), 0U);
  // A download that waits for its answer.
  EXPECT_EQ(ask("2B315F0034120000"), "60315F0000000000");
  EXPECT_EQ(ask("23325F002B012000"), "");
  EXPECT_EQ(gateway->gateway.busy(), 1U);
  client.send("603#80325F0000000008");
  world.run_for(5ms);
  EXPECT_EQ(gateway->gateway.busy(), 0U);
  node.send("585#6001200000000000");
  world.run_for(5ms);
  EXPECT_EQ(above.log.back(), "603#80325F0000000008");
}

// S3.28: who asks for something else instead of fetching its data ends what it asked for first.
TEST_F(OneGateway, ANewCommandReplacesTheOne) {
  build();
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  EXPECT_EQ(ask("23325F0040081000"), "60325F0000000000");
  EXPECT_EQ(ask("23325F0040091000"), "60325F0000000000");
  node.send("585#4F08100011000000");  // the answer to the first one
  world.run_for(5ms);
  EXPECT_EQ(ask("40315F0000000000"), "");
  node.send("585#4F09100022000000");
  world.run_for(5ms);
  EXPECT_EQ(above.log.back(), "583#4F315F0022000000");
}

// What a client may say wrongly, each with its own answer.
TEST_F(WithLeaf, WrongUse) {
  EXPECT_EQ(ask("23325F0040001000"), "80325F0022000008");  // no node-ID yet
  EXPECT_EQ(ask("2F305F0000000000"), "80305F0030000906");
  EXPECT_EQ(ask("2F305F0080000000"), "80305F0030000906");
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  EXPECT_EQ(ask("40315F0000000000"), "80315F0024000008");  // no command yet
  EXPECT_EQ(ask("23325F002B012000"), "80325F0024000008");  // no data
  EXPECT_EQ(ask("2F315F0001000000"), "60315F0000000000");
  EXPECT_EQ(ask("23325F002B012000"), "80325F0010000706");  // one byte is not two
  for (const char* specifier : {"00", "41", "60", "80", "A1", "A2", "A3", "C1", "C5", "E0", "33", "FF"}) {
    EXPECT_EQ(ask("23325F00" + std::string(specifier) + "001000"), "80325F0001000405") << specifier;
  }
  EXPECT_TRUE(beneath.log.empty());
  EXPECT_EQ(ask("40305F0100000000"), "80305F0111000906");
}

// S3.30
TEST(GatewayCommand, SpecifierAndMultiplexer) {
  using Kind = GatewayCommand::Kind;
  struct Row {
    std::uint32_t value;
    Kind kind;
    co::SdoMode mode;
    std::optional<std::size_t> length;
  };
  for (const auto& row : {Row{0x0320'0123, Kind::expedited_download, co::SdoMode::segmented, 4},
                          Row{0x0320'0127, Kind::expedited_download, co::SdoMode::segmented, 3},
                          Row{0x0320'012B, Kind::expedited_download, co::SdoMode::segmented, 2},
                          Row{0x0320'012F, Kind::expedited_download, co::SdoMode::segmented, 1},
                          Row{0x0320'0122, Kind::expedited_download, co::SdoMode::segmented, std::nullopt},
                          Row{0x0320'0120, Kind::passed_download, co::SdoMode::segmented, std::nullopt},
                          Row{0x0320'0121, Kind::download, co::SdoMode::segmented, std::nullopt},
                          Row{0x0320'0140, Kind::upload, co::SdoMode::segmented, std::nullopt},
                          Row{0x0320'01A4, Kind::upload, co::SdoMode::block, std::nullopt},
                          Row{0x0320'01C4, Kind::passed_download, co::SdoMode::block, std::nullopt},
                          Row{0x0320'01C6, Kind::download, co::SdoMode::block, std::nullopt}}) {
    const auto command = parse_command(row.value);
    ASSERT_TRUE(command) << std::hex << row.value;
    EXPECT_EQ(command->object, (ObjectRef{0x2001, 3}));
    EXPECT_EQ(command->kind, row.kind) << std::hex << row.value;
    EXPECT_EQ(command->mode, row.mode) << std::hex << row.value;
    EXPECT_EQ(command->length, row.length) << std::hex << row.value;
  }
}

// The gateway's own device beneath: no node hears itself, so its dictionary is asked.
TEST_F(WithLeaf, ItsOwnDeviceBeneath) {
  EXPECT_EQ(ask("2F305F0001000000"), "60305F0000000000");
  EXPECT_EQ(ask("23325F0040181002"), "60325F0000000000");
  EXPECT_EQ(ask("40315F0000000000"), "43315F0001000000");  // 1018h:02 of the lower device
  EXPECT_EQ(ask("2B315F00F4010000"), "60315F0000000000");
  EXPECT_EQ(ask("23325F002B171000"), "60325F0000000000");
  EXPECT_EQ(gateway->lower.values().get<std::uint16_t>({0x1017, 0}), 500);
  EXPECT_EQ(ask("23325F0020081000"), "60325F0000000000");
  EXPECT_EQ(ask("2F315F0041000000"), "80315F0002000106");  // 1008h is read-only
  EXPECT_TRUE(std::ranges::none_of(beneath.log, [](const auto& frame) { return frame.starts_with("601#"); }));
}

// Reset of the gateway: nothing of a client is left, nothing under way.
TEST_F(WithLeaf, ResetForgetsAll) {
  EXPECT_EQ(ask("2F305F0009000000"), "60305F0000000000");
  EXPECT_EQ(ask("23325F0040001000"), "60325F0000000000");
  EXPECT_EQ(gateway->gateway.busy(), 1U);
  client.send("000#8203");
  world.run_for(50ms);
  EXPECT_EQ(gateway->gateway.busy(), 0U);
  EXPECT_EQ(ask("23325F0040001000"), "80325F0022000008");
  EXPECT_EQ(ask("40305F0000000000"), "4F305F0000000000");
}

// A client that asks for much and fetches nothing: the node beneath is not kept from others.
TEST_F(WithLeaf, AForsakenUpload) {
  leaf->device.values().set_bytes({0x2004, 0}, numbers(15000));
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  EXPECT_EQ(ask("23325F0040042000"), "60325F0000000000");
  co::SdoChannelClient other(client.dispatcher, extra_channel(1), NodeId(3));
  const Bytes five{5};
  const Bytes command{0x40, 0x00, 0x10, 0};
  auto task = [](co::SdoChannelClient& use, const Bytes& node, const Bytes& what) -> rt::Task<Result<co::SdoValue>> {
    auto done = co_await use.download(0x5F30, 0, node);
    if (!done) co_return fail(done.error());
    done = co_await use.download(0x5F32, 0, what);
    if (!done) co_return fail(done.error());
    auto options = use.options();
    options.timeout = 5s;
    auto value = co_await use.upload(0x5F31, 0, options);
    co_return value;
  };
  EXPECT_EQ(bytes_of(await(world, task(other, five, command))), (Bytes{0x92, 0x01, 0x02, 0x00}));
  EXPECT_EQ(gateway->gateway.busy(), 0U);
  EXPECT_EQ(ask("40315F0000000000"), "80315F0000000405");
}

// ---- S3.26: any length, handed on as it comes

// S3.26
TEST(SdoGatewayLength, AnyLengthInAnyMode) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block, co::SdoMode::automatic}) {
    for (const bool block_beneath : {false, true}) {
      Chain chain(1);
      co::SdoOptions options;
      options.mode = mode;
      Routes routes(*chain.client, options);
      auto& access = dynamic_cast<GatewayAccess&>(routes.access(chain.path));
      access.set_block_from(block_beneath ? 5 : 100'000);
      for (const std::size_t length : {5U, 7U, 8U, 12U, 889U, 890U, 1778U, 4000U, 9000U, 20000U}) {
        SCOPED_TRACE(std::to_string(length) + (block_beneath ? " block beneath " : " segmented beneath ") +
                     std::to_string(static_cast<int>(mode)));
        const auto bytes = numbers(length, length);
        const auto done = await(chain.world, access.write(0x2004, 0, bytes));
        ASSERT_TRUE(done) << describe(done.error());
        const auto stored = chain.leaf->device.values().bytes({0x2004, 0});
        EXPECT_EQ(Bytes(stored.begin(), stored.end()), bytes);
        EXPECT_EQ(bytes_of(await(chain.world, access.read(0x2004, 0))), bytes);
      }
      EXPECT_EQ(chain.gateways[0]->gateway.busy(), 0U);
    }
  }
}

// S3.23, S3.26: beneath, it takes four times as long. The end is confirmed when the node has all, and not when the
// gateway has room again.
TEST(SdoGatewayLength, TheNodeBeneathConfirmsTheEnd) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    Chain chain(1, {}, 125'000);
    co::SdoOptions options;
    options.mode = mode;
    Routes routes(*chain.client, options);
    auto& access = routes.access(chain.path);
    for (const std::size_t length : {1700U, 1800U, 2400U, 3000U, 4000U, 9000U}) {
      SCOPED_TRACE(std::to_string(length) + " mode " + std::to_string(static_cast<int>(mode)));
      const auto bytes = numbers(length, length);
      const auto done = await(chain.world, access.write(0x2004, 0, bytes));
      ASSERT_TRUE(done) << describe(done.error());
      const auto stored = chain.leaf->device.values().bytes({0x2004, 0});
      EXPECT_EQ(Bytes(stored.begin(), stored.end()), bytes);
    }
  }
}

// Data whose command never came (its client gave up) are not taken for those of the next download.
TEST_F(WithLeaf, DataOfAnotherDownload) {
  EXPECT_EQ(ask("2F305F0005000000"), "60305F0000000000");
  EXPECT_EQ(ask("23315F0078563412"), "60315F0000000000");
  EXPECT_EQ(ask("23325F0020042000"), "60325F0000000000");
  EXPECT_TRUE(beneath.log.empty());
  EXPECT_EQ(ask("2F315F0011000000"), "60315F0000000000");
  EXPECT_EQ(leaf->device.values().bytes({0x2004, 0}).size(), 1U);
  EXPECT_EQ(ask("23325F0021042000"), "80325F0024000008");
}

// S3.26: as the paper has it, the data first: they are kept, up to a limit, and then go down segmented.
TEST_F(WithLeaf, LongDataBeforeTheirCommand) {
  co::SdoClient sdo(client.dispatcher);
  co::NodeAccess access(sdo, NodeId(3));
  const Bytes five{5};
  ASSERT_TRUE(await(world, access.write(0x5F30, 0, five)));
  const auto text = numbers(12);
  ASSERT_TRUE(await(world, access.write(0x5F31, 0, text)));
  EXPECT_TRUE(beneath.log.empty());
  ASSERT_TRUE(await(world, access.write_u32(0x5F32, 0, 0x0020'0321)));
  EXPECT_EQ(beneath.log.front(), "605#210320000C000000");
  EXPECT_EQ(beneath.log.size(), 6U);
  const auto too_long = numbers(4097);
  const auto refused = await(world, access.write(0x5F31, 0, too_long));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().detail, 0x05040005U);
  // One more than the object has room for: the node's own word, at the end.
  const auto thirteen = numbers(13);
  ASSERT_TRUE(await(world, access.write(0x5F31, 0, thirteen)));
  const auto done = await(world, access.write_u32(0x5F32, 0, 0x0020'0321));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().detail, 0x06070012U);
}

// What the node beneath refuses in the middle, the client above hears at once, and not after all its data.
TEST(SdoGatewayLength, RefusedInTheMiddle) {
  Chain chain(2);
  Routes routes(*chain.client);
  auto& access = routes.access(chain.path);
  const auto bytes = numbers(30000);
  const auto done = await(chain.world, access.write(0x2004, 0, bytes));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::aborted);
  EXPECT_EQ(done.error().detail, 0x06070012U);
  EXPECT_EQ(done.error().node, 50);
  EXPECT_EQ(done.error().index, 0x2004);
  EXPECT_LT(chain.lines[0]->log.size(), 1000U);
  EXPECT_EQ(bytes_of(await(chain.world, access.read(0x1000, 0))), (Bytes{0x92, 0x01, 0x02, 0x00}));
}

// ---- S3.29: depth, and what it costs

namespace {

// Completed transactions on a bus: confirmations of downloads and expedited answers of uploads.
std::size_t transactions(const Line& line) {
  return static_cast<std::size_t>(std::ranges::count_if(
      line.log, [](const auto& frame) { return frame.starts_with("5") && (frame[4] == '6' || frame[4] == '4'); }));
}

}  // namespace

// S3.29: 2^(d+1) - 1 accesses for the first, 2^d for each further one, on the bus of the client; each direction.
TEST(SdoGatewayDepth, CostOfAnAccess) {
  for (unsigned depth = 0; depth <= 6; ++depth) {
    SCOPED_TRACE(depth);
    Chain chain(depth);
    Routes routes(*chain.client);
    auto& access = routes.access(chain.path);
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    EXPECT_EQ(transactions(*chain.lines[0]), (2U << depth) - 1);
    chain.lines[0]->clear();
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    EXPECT_EQ(transactions(*chain.lines[0]), 1U << depth);
    chain.lines[0]->clear();
    ASSERT_TRUE(await(chain.world, access.write_u32(0x2002, 0, 7 + depth)));
    EXPECT_EQ(transactions(*chain.lines[0]), 1U << depth);
    EXPECT_EQ(chain.leaf->device.values().get<std::uint32_t>({0x2002, 0}), 7 + depth);
  }
}

TEST(SdoGatewayDepth, FirstDownload) {
  for (unsigned depth = 1; depth <= 4; ++depth) {
    Chain chain(depth);
    Routes routes(*chain.client);
    ASSERT_TRUE(await(chain.world, routes.access(chain.path).write_u32(0x2002, 0, 7)));
    EXPECT_EQ(transactions(*chain.lines[0]), (2U << depth) - 1) << depth;
  }
}

// S3.27: time-outs that grow with depth. The lowest gateway's ends first, and everybody above hears of it in time.
TEST(SdoGatewayDepth, ASilentNodeCostsOneTimeOut) {
  for (unsigned depth = 1; depth <= 5; ++depth) {
    SCOPED_TRACE(depth);
    Chain chain(depth);
    Routes routes(*chain.client);
    chain.leaf->device.power_off();
    Path path = chain.path;
    const auto before = chain.world.now();
    const auto value = await(chain.world, routes.access(path).read_u32(0x1000, 0));
    ASSERT_FALSE(value);
    EXPECT_EQ(value.error().code, Errc::timeout);
    EXPECT_STREQ(value.error().text, "no answer beneath the gateway");
    EXPECT_EQ(value.error().node, 50);
    EXPECT_GE(chain.world.now() - before, 1s);
    EXPECT_LT(chain.world.now() - before, 1200ms);
    const Bytes data = numbers(4);
    EXPECT_EQ(await(chain.world, routes.access(path).write(0x2002, 0, data)).error().code, Errc::timeout);
    const Bytes much = numbers(100);
    EXPECT_EQ(await(chain.world, routes.access(path).write(0x2004, 0, much)).error().code, Errc::timeout);
    EXPECT_LT(chain.world.now() - before, 3600ms);
    for (auto& each : chain.gateways) EXPECT_EQ(each->gateway.busy(), 0U);
    // Who waits for a gateway does not give up before that has answered: only on the lowest bus is a request aborted.
    for (unsigned level = 0; level < depth; ++level) {
      EXPECT_TRUE(std::ranges::none_of(chain.lines[level]->log, [](const auto& frame) {
        return frame.starts_with("60") && frame.substr(4, 2) == "80";
      })) << level;
    }
    // It is back: nothing is stuck.
    chain.leaf->device.power_on();
    chain.world.run_for(50ms);
    EXPECT_EQ(*await(chain.world, routes.access(path).read_u32(0x1000, 0)), 0x0002'0192U);
  }
}

namespace {

// Whoever waits above the lowest bus has not given up before its answer came.
bool nobody_gave_up(const Chain& chain, std::size_t lowest) {
  for (std::size_t level = 0; level < lowest; ++level) {
    for (const auto& frame : chain.lines[level]->log) {
      if (frame.starts_with("60") && frame.substr(4, 2) == "80") return false;
    }
  }
  return true;
}

}  // namespace

// Berth's own: it waits 500 ms for a device, its gateways a second for a node beneath. The abort of the gateway is what
// it hears, at any depth, and a gateway that is silent is told sooner.
TEST(SdoGatewayDepth, AClientThatWaitsLessThanItsGateways) {
  for (unsigned depth = 1; depth <= 4; ++depth) {
    SCOPED_TRACE(depth);
    Chain chain(depth);
    Routes routes(*chain.client, {.timeout = 500ms});
    auto& access = routes.access(chain.path);
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    chain.leaf->device.power_off();
    const Bytes much = numbers(100);
    for (const auto& error : {await(chain.world, access.read_u32(0x1000, 0)).error(),
                              await(chain.world, access.write_u32(0x2002, 0, 1)).error(),
                              await(chain.world, access.write(0x2004, 0, much)).error()}) {
      EXPECT_EQ(error.code, Errc::timeout);
      EXPECT_STREQ(error.text, "no answer beneath the gateway");
    }
    chain.world.run_for(50ms);
    EXPECT_TRUE(nobody_gave_up(chain, depth));
    chain.gateways[0]->upper.power_off();
    const auto before = chain.world.now();
    const auto error = await(chain.world, access.read_u32(0x1000, 0)).error();
    EXPECT_EQ(error.code, Errc::timeout);
    EXPECT_STREQ(error.text, "no answer of the gateway");
    EXPECT_EQ(error.node, 50);
    EXPECT_LT(chain.world.now() - before, 600ms);
  }
}

// A node on the way that is no gateway: told with that node, at any depth.
TEST(SdoGatewayDepth, ANodeOnTheWayIsNoGateway) {
  for (unsigned depth = 0; depth <= 3; ++depth) {
    SCOPED_TRACE(depth);
    Chain chain(depth);
    Routes routes(*chain.client);
    Path beyond = chain.path;
    beyond.gateways.push_back({NodeId(50)});
    beyond.node = NodeId(7);
    const auto read = await(chain.world, routes.access(beyond).read_u32(0x1000, 0)).error();
    const auto write = await(chain.world, routes.access(beyond).write_u32(0x2002, 0, 1)).error();
    for (const auto& error : {read, write}) {
      EXPECT_EQ(error.code, Errc::unsupported);
      EXPECT_EQ(error.node, 50);
    }
    chain.path.node = NodeId(50);
    EXPECT_EQ(*await(chain.world, routes.access(chain.path).read_u32(0x1000, 0)), 0x0002'0192U) << "nothing is stuck";
  }
}

// The first gateway waits for another one as long as all levels beneath it need, also when the path ends sooner.
TEST(SdoGatewayDepth, ASilentGatewayOfADeeperTree) {
  Chain chain(4);
  Routes routes(*chain.client, {.timeout = 500ms}, {.levels = 4});
  const Path path{{chain.path.gateways[0], chain.path.gateways[1]}, NodeId(1)};
  auto& access = routes.access(path);
  ASSERT_TRUE(await(chain.world, access.read_u32(0x1000, 0)));
  chain.gateways[1]->upper.power_off();
  for (auto& line : chain.lines) line->clear();
  const auto error = await(chain.world, access.read_u32(0x1000, 0)).error();
  EXPECT_EQ(error.code, Errc::timeout);
  EXPECT_STREQ(error.text, "no answer of the gateway");
  chain.world.run_for(50ms);
  EXPECT_TRUE(nobody_gave_up(chain, 1));
  EXPECT_EQ(chain.lines[0]->log.back(), "583#80325F0000000405") << "0504 0000, of the first gateway";
}

// A client that tries again does so with the whole access: a command alone that is repeated finds its data gone, and a
// silent gateway is a time-out to it, whether it reads or writes.
TEST(SdoGatewayDepth, ASilentNodeIsATimeOutToAClientThatTriesAgain) {
  for (const bool node : {false, true}) {
    Chain chain(2);
    Routes routes(*chain.client, {.retries = 2});
    auto& access = routes.access(chain.path);
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    (node ? chain.leaf->device : chain.gateways[1]->upper).power_off();
    for (const bool writes : {false, true}) {
      const auto before = chain.world.now();
      const auto error = writes ? await(chain.world, access.write_u32(0x2002, 0, 1)).error()
                                : await(chain.world, access.read_u32(0x1000, 0)).error();
      EXPECT_EQ(error.code, Errc::timeout) << describe(error);
      EXPECT_EQ(error.node, 50);
      EXPECT_LT(chain.world.now() - before, 3 * 3200ms);  // three attempts, none longer than the client's 3 s
    }
    for (auto& each : chain.gateways) EXPECT_EQ(each->gateway.busy(), 0U);
  }
}

// It gets through although frames are lost, on each bus.
TEST(SdoGatewayDepth, WhatIsLostIsTriedAgain) {
  for (const std::size_t bus : {0U, 1U, 2U}) {
    Chain chain(2);
    Routes routes(*chain.client, {.retries = 2});
    auto& access = routes.access(chain.path);
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    auto& device = bus == 2 ? chain.leaf->device : chain.gateways[bus]->upper;
    for (std::uint32_t value : {1U, 2U}) {
      device.power_off();
      chain.world.after(500ms, [&] { device.power_on(); });
      if (value == 1) {
        ASSERT_TRUE(await(chain.world, access.write_u32(0x2002, 0, value))) << bus;
        EXPECT_EQ(chain.leaf->device.values().get<std::uint32_t>({0x2002, 0}), value);
      } else {
        const auto read = await(chain.world, access.read_u32(0x1000, 0));
        ASSERT_TRUE(read) << bus << describe(read.error());
      }
    }
  }
}

// What the node refuses, the client gets with the node's code and the node's object, however deep it is.
TEST(SdoGatewayDepth, AbortCodesOfEveryLevel) {
  for (unsigned depth = 1; depth <= 6; ++depth) {
    SCOPED_TRACE(depth);
    Chain chain(depth);
    Routes routes(*chain.client);
    auto& access = routes.access(chain.path);
    const auto refused = [](const Result<void>& done, std::uint16_t index, std::uint32_t code) {
      ASSERT_FALSE(done);
      EXPECT_EQ(done.error().code, Errc::aborted);
      EXPECT_EQ(done.error().node, 50);
      EXPECT_EQ(done.error().index, index);
      EXPECT_EQ(done.error().detail, code) << std::hex << done.error().detail;
    };
    const auto missing = await(chain.world, access.read(0x3000, 0));
    ASSERT_FALSE(missing);
    EXPECT_EQ(missing.error().detail, 0x0602'0000U);
    EXPECT_EQ(missing.error().index, 0x3000);
    const Bytes two = numbers(2), four = numbers(4), thirteen = numbers(13);
    refused(await(chain.world, access.write(0x1000, 0, four)), 0x1000, 0x0601'0002);             // read only
    refused(await(chain.world, access.write(0x2000, 7, two)), 0x2000, 0x0609'0011);              // no such sub-index
    refused(await(chain.world, access.write(0x2000, 0, two)), 0x2000, 0x0607'0012);              // too long
    refused(await(chain.world, access.write_u32(0x2002, 0, 0x2000'0000)), 0x2002, 0x0609'0031);  // too high
    refused(await(chain.world, access.write(0x2003, 0, thirteen)), 0x2003, 0x0607'0012);         // 12 bytes at most
    // And nothing is stuck.
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    for (auto& each : chain.gateways) EXPECT_EQ(each->gateway.busy(), 0U);
  }
}

// A gateway of the path that is not there: told apart from the node.
TEST(SdoGatewayDepth, ASilentGateway) {
  Chain chain(2);
  Routes routes(*chain.client);
  chain.gateways[0]->upper.power_off();
  const auto value = await(chain.world, routes.access(chain.path).read_u32(0x1000, 0));
  ASSERT_FALSE(value);
  EXPECT_EQ(value.error().code, Errc::timeout);
}

// A gateway that restarts between two accesses has forgotten the node-ID: it is written again, whatever the depth.
TEST(SdoGatewayDepth, AGatewayRestarts) {
  for (const unsigned which : {0U, 1U, 2U}) {
    Chain chain(3);
    Routes routes(*chain.client);
    auto& access = routes.access(chain.path);
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    chain.gateways[which]->upper.power_on();
    chain.world.run_for(50ms);
    EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U) << which;
    chain.gateways[which]->upper.power_on();
    chain.world.run_for(50ms);
    ASSERT_TRUE(await(chain.world, access.write_u32(0x2002, 0, 77))) << which;
    EXPECT_EQ(chain.leaf->device.values().get<std::uint32_t>({0x2002, 0}), 77U);
  }
}

// The lowest one restarts while others have been spoken to through the same gateways: its abort code is not taken for
// that of a gateway above it.
TEST(SdoGatewayDepth, ADeepGatewayRestartsBetweenAccessesToOthers) {
  Chain chain(3);
  Leaf other(chain.world, *chain.lines[1], 60);
  Routes routes(*chain.client);
  Path beside{{chain.path.gateways.front()}, NodeId(60)};
  for (const bool writes : {false, true}) {
    EXPECT_EQ(*await(chain.world, routes.access(chain.path).read_u32(0x1000, 0)), 0x0002'0192U);
    EXPECT_EQ(*await(chain.world, routes.access(beside).read_u32(0x1000, 0)), 0x0002'0192U);
    chain.gateways[2]->upper.power_on();
    chain.world.run_for(50ms);
    if (writes) {
      ASSERT_TRUE(await(chain.world, routes.access(chain.path).write_u32(0x2002, 0, 78)));
      EXPECT_EQ(chain.leaf->device.values().get<std::uint32_t>({0x2002, 0}), 78U);
    } else {
      const auto value = await(chain.world, routes.access(chain.path).read_u32(0x1000, 0));
      ASSERT_TRUE(value) << describe(value.error());
    }
  }
  // All of them at once.
  for (auto& gateway : chain.gateways) gateway->upper.power_on();
  chain.world.run_for(50ms);
  EXPECT_EQ(*await(chain.world, routes.access(chain.path).read_u32(0x1000, 0)), 0x0002'0192U);
}

// In the middle of a long transfer: that one fails, the next one works.
TEST(SdoGatewayDepth, AGatewayRestartsInMidTransfer) {
  for (const unsigned which : {0U, 1U}) {
    for (const bool down : {false, true}) {
      Chain chain(2);
      Routes routes(*chain.client);
      auto& access = routes.access(chain.path);
      const auto bytes = numbers(15000);
      chain.leaf->device.values().set_bytes({0x2004, 0}, bytes);
      chain.world.after(300ms, [&] { chain.gateways[which]->upper.power_on(); });
      const bool done = down ? await(chain.world, access.write(0x2004, 0, bytes)).has_value()
                             : await(chain.world, access.read(0x2004, 0)).has_value();
      EXPECT_FALSE(done);
      chain.world.run_for(5s);
      for (auto& each : chain.gateways) EXPECT_EQ(each->gateway.busy(), 0U);
      EXPECT_EQ(*await(chain.world, access.read_u32(0x1000, 0)), 0x0002'0192U);
    }
  }
}

// ---- S3.28: several clients

namespace {

rt::Task<void> client_work(co::SdoChannelClient& use, std::uint8_t node, unsigned count, std::uint64_t seed,
                           unsigned& wrong, unsigned& done) {
  Random random(seed);
  for (unsigned i = 0; i < count; ++i) {
    const auto value = static_cast<std::uint32_t>(random.below(0x1000'0000));
    const Bytes id{node};
    Bytes data(4);
    for (unsigned k = 0; k < 4; ++k) data[k] = static_cast<std::uint8_t>(value >> (8 * k));
    const Bytes write{0x23, 0x02, 0x20, 0x00};
    const Bytes read{0x40, 0x02, 0x20, 0x00};
    const std::span<const std::uint8_t> to_id = id, to_data = data, to_write = write, to_read = read;
    auto options = use.options();
    options.timeout = 10s;
    auto result = co_await use.download(0x5F30, 0, to_id, options);
    wrong += result ? 0 : 1;
    result = co_await use.download(0x5F31, 0, to_data, options);
    wrong += result ? 0 : 1;
    result = co_await use.download(0x5F32, 0, to_write, options);
    wrong += result ? 0 : 1;
    result = co_await use.download(0x5F32, 0, to_read, options);
    wrong += result ? 0 : 1;
    auto got = co_await use.upload(0x5F31, 0, options);
    wrong += got && got->as<std::uint32_t>() == value ? 0 : 1;
    ++done;
  }
}

}  // namespace

// S3.28: three clients on three channels, each with a node of its own: what each writes, it reads.
TEST(SdoGatewayClients, DoNotMix) {
  Chain chain(1);
  std::vector<std::unique_ptr<Leaf>> leaves;
  for (unsigned id = 61; id <= 63; ++id) leaves.push_back(std::make_unique<Leaf>(chain.world, *chain.lines[1], id));
  chain.world.run_for(50ms);
  co::SdoChannelClient first(chain.master->dispatcher, co::SdoChannel::of(NodeId(3)), NodeId(3));
  co::SdoChannelClient second(chain.master->dispatcher, extra_channel(1), NodeId(3));
  co::SdoChannelClient third(chain.master->dispatcher, extra_channel(2), NodeId(3));
  unsigned wrong = 0, done = 0;
  rt::Scope scope(chain.world.executor());
  scope.spawn(client_work(first, 61, 100, 1, wrong, done));
  scope.spawn(client_work(second, 62, 100, 2, wrong, done));
  scope.spawn(client_work(third, 63, 100, 3, wrong, done));
  chain.world.run_until([&] { return done == 300; }, 60s);
  EXPECT_EQ(done, 300U);
  EXPECT_EQ(wrong, 0U);
}

// Two clients on one node: one after the other, both answered.
TEST(SdoGatewayClients, OneNode) {
  Chain chain(1);
  co::SdoChannelClient first(chain.master->dispatcher, co::SdoChannel::of(NodeId(3)), NodeId(3));
  co::SdoChannelClient second(chain.master->dispatcher, extra_channel(1), NodeId(3));
  std::vector<unsigned> order;
  const auto read = [](co::SdoChannelClient& use, unsigned number, std::vector<unsigned>& into) -> rt::Task<void> {
    const Bytes id{50};
    const Bytes command{0x40, 0x00, 0x10, 0x00};
    const std::span<const std::uint8_t> to_id = id, to_command = command;
    for (int i = 0; i < 20; ++i) {
      auto done = co_await use.download(0x5F30, 0, to_id);
      EXPECT_TRUE(done);
      done = co_await use.download(0x5F32, 0, to_command);
      EXPECT_TRUE(done);
      auto value = co_await use.upload(0x5F31, 0);
      EXPECT_TRUE(value && value->as<std::uint32_t>() == 0x0002'0192U);
      into.push_back(number);
    }
  };
  rt::Scope scope(chain.world.executor());
  scope.spawn(read(first, 1, order));
  scope.spawn(read(second, 2, order));
  chain.world.run_until([&] { return order.size() == 40; }, 60s);
  EXPECT_EQ(order.size(), 40U);
}

// A stuck node costs its client one time-out, and the others nothing.
TEST(SdoGatewayClients, AStuckNodeHoldsNobodyElse) {
  Chain chain(1);
  Leaf other(chain.world, *chain.lines[1], 61);
  chain.leaf->device.power_off();
  chain.world.run_for(50ms);
  co::SdoChannelClient first(chain.master->dispatcher, co::SdoChannel::of(NodeId(3)), NodeId(3));
  co::SdoChannelClient second(chain.master->dispatcher, extra_channel(1), NodeId(3));
  unsigned wrong = 0, lost = 0, done = 0;
  rt::Scope scope(chain.world.executor());
  scope.spawn(client_work(first, 50, 1, 1, lost, done));
  scope.spawn(client_work(second, 61, 100, 2, wrong, done));
  chain.world.run_for(900ms);
  EXPECT_EQ(done, 100U);
  EXPECT_EQ(wrong, 0U);
  chain.world.run_for(2s);
  EXPECT_EQ(done, 101U);
  EXPECT_EQ(lost, 2U);
}

// Tasks that share a client and a gateway take turns.
TEST(SdoGatewayClients, TasksOfOneClient) {
  Chain chain(2);
  Leaf other(chain.world, *chain.lines[2], 51);
  chain.world.run_for(50ms);
  other.device.values().set<std::uint32_t>({0x2002, 0}, 51);
  chain.leaf->device.values().set<std::uint32_t>({0x2002, 0}, 50);
  Routes routes(*chain.client);
  Path second = chain.path;
  second.node = NodeId(51);
  unsigned right = 0;
  const auto read = [](co::SdoAccess& access, std::uint32_t expected, unsigned& into) -> rt::Task<void> {
    for (int i = 0; i < 25; ++i) {
      const auto value = co_await access.read_u32(0x2002, 0);
      into += value && *value == expected ? 1 : 0;
    }
  };
  rt::Scope scope(chain.world.executor());
  scope.spawn(read(routes.access(chain.path), 50, right));
  scope.spawn(read(routes.access(second), 51, right));
  chain.world.run_until([&] { return scope.running() == 0; }, 60s);
  EXPECT_EQ(right, 50U);
}

// ---- laws

namespace {

// What every access must be: the node's own answer, whatever was asked before.
void random_accesses(std::uint64_t seed, unsigned depth, unsigned losses_per_million) {
  Chain chain(depth);
  Random random(seed);
  Routes routes(*chain.client);
  auto& access = routes.access(chain.path);
  auto& values = chain.leaf->device.values();
  for (auto& line : chain.lines) line->bus.faults().draw_from({.overrun_per_million = losses_per_million});
  for (int i = 0; i < 40; ++i) {
    const auto kind = random.below(4);
    const std::size_t length = random.below(3) == 0 ? random.below(3000) : 1 + random.below(20);
    const auto bytes = numbers(length, random.below(1000));
    if (kind == 0) {
      const auto done = await(chain.world, access.write(0x2004, 0, bytes), 120s);
      const auto stored = values.bytes({0x2004, 0});
      if (done) {
        ASSERT_EQ(Bytes(stored.begin(), stored.end()), bytes) << seed;
      }
      if (!done && losses_per_million == 0) FAIL() << describe(done.error());
    } else if (kind == 1) {
      values.set_bytes({0x2004, 0}, bytes);
      const auto got = await(chain.world, access.read(0x2004, 0), 120s);
      if (got) {
        ASSERT_EQ(bytes_of(got), bytes) << seed;
      }
      if (!got && losses_per_million == 0) FAIL() << describe(got.error());
    } else if (kind == 2) {
      const auto value = static_cast<std::uint32_t>(random.below(0x1FFF'FFFF));
      const auto done = await(chain.world, access.write_u32(0x2002, 0, value), 120s);
      if (done) {
        ASSERT_EQ(values.get<std::uint32_t>({0x2002, 0}), value);
      }
      if (losses_per_million == 0) {
        ASSERT_EQ(done.has_value(), value <= 0x1000'0000U);
      }
    } else {
      const auto done = await(chain.world, access.read_u32(0x5000, 0), 120s);
      ASSERT_FALSE(done);
      if (losses_per_million == 0) {
        ASSERT_EQ(done.error().detail, 0x0602'0000U);
      }
    }
  }
  for (auto& line : chain.lines) line->bus.faults().draw_from({});
  chain.world.run_for(20s);
  for (auto& each : chain.gateways) ASSERT_EQ(each->gateway.busy(), 0U) << seed;
  const auto value = await(chain.world, access.read_u32(0x1000, 0));
  ASSERT_TRUE(value) << describe(value.error()) << " " << seed;
  ASSERT_EQ(*value, 0x0002'0192U);
}

}  // namespace

TEST(SdoGatewayLaws, EveryAccessIsTheNodesOwn) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) random_accesses(seed, 1 + static_cast<unsigned>(seed % 3), 0);
}

// Frames get lost on every bus: an access may fail, but it ends, tells no wrong value, and nothing is stuck behind it.
TEST(SdoGatewayLaws, FramesAreLost) {
  for (std::uint64_t seed = 101; seed <= 116; ++seed) random_accesses(seed, 1 + static_cast<unsigned>(seed % 3), 4000);
}

// ---- paths

RC_GTEST_PROP(GatewayPath, IsReadAsItIsWritten, ()) {
  Path path;
  const auto depth = *rc::gen::inRange(0, 7);
  for (int i = 0; i < depth; ++i) {
    path.gateways.push_back({NodeId(static_cast<std::uint8_t>(*rc::gen::inRange(1, 128))),
                             static_cast<std::uint8_t>(*rc::gen::inRange(1, 9))});
  }
  path.node = NodeId(static_cast<std::uint8_t>(*rc::gen::inRange(1, 128)));
  RC_ASSERT(parse_path(to_string(path)) == path);
}

TEST(GatewayPath, Text) {
  EXPECT_EQ(to_string(*parse_path("3.2/4/5")), "3.2/4/5");
  EXPECT_EQ(parse_path("3/5")->gateways.at(0).port, 1);
  for (const char* bad : {"", "/", "3/", "/5", "0", "128", "3//5", "3.0/5", "3.9/5", "3/5.1", "3 /5", "a", "-1", "3./5",
                          ".1/5", "99999999999"}) {
    EXPECT_FALSE(parse_path(bad)) << bad;
  }
}
