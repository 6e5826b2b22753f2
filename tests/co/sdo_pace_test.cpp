// SDO transfers whose stream, source or sink is not ready yet: each side waits without a frame, and goes on where it
// was (docs/protocols/cia301.md §SDO).
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>

#include "berth/co/sdo_servers.hpp"
#include "sdo_rig.hpp"

using namespace berth;
using namespace berth::test;

namespace {

// A stream that has and takes no more than the test allows.
struct SlowStream final : od::Stream {
  od::Answer<std::optional<std::size_t>> open_read(ObjectRef) noexcept override {
    if (!open) return od::refuse(od::AbortCode::pending);
    if (refusal != od::AbortCode::none) return od::refuse(refusal);
    position = 0;
    return size;
  }
  std::size_t ready() const noexcept override { return ended ? SIZE_MAX : bytes.size() - position; }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    if (refusal != od::AbortCode::none) return od::refuse(refusal);
    const auto count = std::min(into.size(), bytes.size() - position);
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(position), count, into.begin());
    position += count;
    return count;
  }
  od::AbortCode open_write(ObjectRef, std::optional<std::size_t>) noexcept override {
    taken.clear();
    return od::AbortCode::none;
  }
  std::size_t piece() const noexcept override { return 1; }
  od::AbortCode write(std::span<const std::uint8_t> more) noexcept override {
    taken.insert(taken.end(), more.begin(), more.end());
    return full ? od::AbortCode::pending : od::AbortCode::none;
  }
  od::AbortCode close(ObjectRef, bool complete) noexcept override {
    closed = complete;
    return od::AbortCode::none;
  }
  ObjectRef named(ObjectRef ref) const noexcept override { return name.value_or(ref); }
  Bytes bytes;
  Bytes taken;
  std::optional<std::size_t> size;
  std::optional<ObjectRef> name;
  od::AbortCode refusal = od::AbortCode::none;
  std::size_t position = 0;
  bool open = false, ended = false, full = false;
  std::optional<bool> closed;
};

struct SlowServer : ::testing::Test, ServerRig {
  SlowServer() { EXPECT_TRUE(values.attach(stream, {0x2004, 0})); }
  std::string complete(od::AbortCode code = od::AbortCode::none) {
    const auto answer = server.complete(code);
    return answer ? can::to_string(*answer).substr(4) : "";
  }
  SlowStream stream;
};

}  // namespace

TEST_F(SlowServer, AnUploadWaitsForItsSizeAndItsBytes) {
  EXPECT_EQ(ask("4004200000000000"), "");
  EXPECT_EQ(server.pending(), (ObjectRef{0x2004, 0}));
  EXPECT_EQ(server.expire(), std::nullopt);
  EXPECT_EQ(ask("4004200000000000"), "");  // the client repeats itself
  EXPECT_EQ(complete(), "");               // still nothing
  stream.open = true;
  stream.size = 9;
  EXPECT_EQ(complete(), "4104200009000000");
  EXPECT_EQ(ask("6000000000000000"), "");
  stream.bytes = {1, 2, 3, 4, 5, 6, 7};
  EXPECT_EQ(complete(), "");  // seven, and it is not known whether they are the last
  stream.bytes.push_back(8);
  EXPECT_EQ(complete(), "0001020304050607");
  EXPECT_EQ(ask("7000000000000000"), "");
  stream.bytes.push_back(9);
  EXPECT_EQ(complete(), "1B08090000000000");
  EXPECT_EQ(stream.closed, true);
  EXPECT_EQ(complete(), "");  // harmless
}

TEST_F(SlowServer, AnUploadOfUnknownSizeEndsWithItsStream) {
  stream.open = true;
  stream.bytes = {1, 2, 3};
  EXPECT_EQ(ask("4004200000000000"), "4004200000000000");
  EXPECT_EQ(ask("6000000000000000"), "");
  stream.ended = true;
  EXPECT_EQ(complete(), "0901020300000000");
}

TEST_F(SlowServer, RefusedLater) {
  EXPECT_EQ(ask("4004200000000000"), "");
  stream.open = true;
  stream.refusal = od::AbortCode::no_data;
  stream.name = ObjectRef{0x1234, 5};
  EXPECT_EQ(complete(), "8034120524000008");  // the stream's own name for it
  stream.name.reset();
  stream.refusal = od::AbortCode::none;
  stream.open = false;
  EXPECT_EQ(ask("4004200000000000"), "");
  EXPECT_EQ(complete(od::AbortCode::hardware), "8004200000000606");
  EXPECT_FALSE(server.busy());
}

TEST_F(SlowServer, ABlockUploadWaitsForASubBlock) {
  stream.open = true;
  EXPECT_EQ(ask("A004200002000000"), "C004200000000000");
  EXPECT_EQ(ask("A300000000000000"), "");
  EXPECT_TRUE(segments().empty());
  stream.bytes = numbers(15);
  EXPECT_EQ(complete(), "");
  EXPECT_EQ(segments(), segments_of(numbers(14), false));
  EXPECT_EQ(ask("A202020000000000"), "");
  EXPECT_FALSE(server.sending());
  stream.ended = true;
  EXPECT_EQ(complete(), "");
  EXPECT_EQ(segments(), segments_of(numbers(1, 14)));
  EXPECT_EQ(ask("A201020000000000"), "D900000000000000");
}

TEST_F(SlowServer, ADownloadWaitsForRoom) {
  EXPECT_EQ(ask("210420000A000000"), "6004200000000000");
  EXPECT_EQ(ask("0001020304050607"), "2000000000000000");
  stream.full = true;
  EXPECT_EQ(ask("1908090A00000000"), "3000000000000000");  // the last is the end's own affair
  EXPECT_EQ(stream.taken, (Bytes{1, 2, 3, 4, 5, 6, 7, 8, 9, 10}));
  EXPECT_EQ(ask("2104200015000000"), "6004200000000000");
  EXPECT_EQ(ask("0001020304050607"), "2000000000000000");
  EXPECT_EQ(ask("1008090A0B0C0D0E"), "");
  EXPECT_EQ(stream.taken, (Bytes{1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(ask("1008090A0B0C0D0E"), "");  // the client repeats itself: not taken twice
  EXPECT_EQ(complete(), "3000000000000000");
  EXPECT_EQ(ask("8004200000000008"), "");
  EXPECT_EQ(stream.closed, false);
}

TEST_F(SlowServer, ABlockDownloadWaitsForRoom) {
  stream.full = true;
  EXPECT_EQ(ask("C004200000000000"), "A00420007F000000");
  for (unsigned i = 1; i < 127; ++i) EXPECT_EQ(ask(hex({static_cast<std::uint8_t>(i), 1, 2, 3, 4, 5, 6, 7})), "");
  EXPECT_EQ(ask("7F01020304050607"), "");
  EXPECT_EQ(complete(), "A27F7F0000000000");
}

// Who waits is told when nobody waits any more.
TEST_F(SlowServer, Abandoned) {
  struct Watch final : od::Hook {
    od::AbortCode writing(const od::Values&, ObjectRef, std::span<const std::uint8_t>) noexcept override {
      return od::AbortCode::pending;
    }
    void abandoned(od::Values&, ObjectRef ref) noexcept override { left.push_back(ref); }
    std::vector<ObjectRef> left;
  } watch;
  values.attach(watch, 0x2000);
  EXPECT_EQ(ask("2F00200001000000"), "");
  EXPECT_EQ(ask("8000200000000008"), "");
  EXPECT_EQ(watch.left.size(), 1U);
  EXPECT_EQ(ask("2F00200001000000"), "");
  EXPECT_EQ(ask("4000100000000000"), "4300100092010200");
  EXPECT_EQ(watch.left.size(), 2U);
  EXPECT_EQ(ask("2F00200001000000"), "");
  server.reset();
  EXPECT_EQ(watch.left, (std::vector<ObjectRef>(3, {0x2000, 0})));
  EXPECT_EQ(ask("2F00200001000000"), "");
  EXPECT_EQ(complete(), "6000200000000000");
  EXPECT_EQ(watch.left.size(), 3U);
}

// Which channel accesses, and an answer to one of several.
TEST(SdoChannels, AreToldApart) {
  Bench bench;
  Station far(bench.wire), near(bench.wire);
  od::DescriptionBuilder b;
  b.variable(0x2000, {.name = "slow", .type = od::DataType::unsigned8});
  for (const std::uint16_t index : {std::uint16_t{0x1200}, std::uint16_t{0x1203}}) {
    b.object(index, od::ObjectCode::record, "SDO server parameter", od::DataType::sdo_parameter);
    b.sub(index, {.sub = 1, .name = "COB-ID", .initial = od::Literal::number(0x331)});
    b.sub(index, {.sub = 2, .name = "COB-ID", .initial = od::Literal::number(0x3B1)});
  }
  od::Values values(b.build(), NodeId(5));
  struct Watch final : od::Hook {
    explicit Watch(od::Values& v) : values(&v) { v.attach(*this, 0x2000); }
    od::AbortCode writing(const od::Values&, ObjectRef, std::span<const std::uint8_t>) noexcept override {
      channels.push_back(values->channels().now());
      return od::AbortCode::pending;
    }
    od::Values* values;
    std::vector<unsigned> channels;
  } watch(values);
  std::optional<co::SdoServers> servers(std::in_place, far.dispatcher, values);
  servers->start(NodeId(5));
  near.send("605#2F00200001000000");
  near.send("331#2F00200001000000");
  bench.run(10ms);
  ASSERT_EQ(watch.channels.size(), 2U);
  std::ranges::sort(watch.channels);
  EXPECT_EQ(watch.channels, (std::vector<unsigned>{0, 3}));
  bench.wire.log.clear();
  EXPECT_TRUE(values.channels().answer(3, {0x2000, 0}, od::AbortCode::none));
  EXPECT_FALSE(values.channels().answer(3, {0x2000, 0}, od::AbortCode::none));
  EXPECT_FALSE(values.channels().answer(2, {0x2000, 0}, od::AbortCode::none));
  EXPECT_FALSE(values.channels().answer(0, {0x2001, 0}, od::AbortCode::none));
  bench.run(10ms);
  EXPECT_EQ(bench.wire.log, Log{"3B1#6000200000000000"});
  EXPECT_TRUE(values.channels().answer(0, {0x2000, 0}, od::AbortCode::hardware, {0x1234, 1}));
  bench.run(10ms);
  EXPECT_EQ(bench.wire.log.back(), "585#8034120100000606");
  servers.reset();
  EXPECT_FALSE(values.channels().answer(0, {0x2000, 0}, od::AbortCode::none));
}

// ---- the client

namespace {

struct SlowSource final : co::SdoSource {
  std::size_t ready() const noexcept override { return ended ? SIZE_MAX : bytes.size() - position; }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    const auto count = std::min(into.size(), bytes.size() - position);
    std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(position), count, into.begin());
    position += count;
    return count;
  }
  Bytes bytes;
  std::size_t position = 0;
  bool ended = false;
};

struct SlowSink final : co::SdoSink {
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    taken.insert(taken.end(), bytes.begin(), bytes.end());
    return full ? od::AbortCode::pending : od::AbortCode::none;
  }
  Bytes taken;
  bool full = true;
};

struct SlowClient : ::testing::Test, Bench {
  SlowClient() : server(far.dispatcher, values, 8000) {
    server.set_timeout(0s);
    server.start(NodeId(5));
  }
  Station far{wire};
  Station near{wire};
  od::Values values{test_description(), NodeId(5)};
  co::SdoServerService server;
  co::SdoClient client{near.dispatcher};
};

}  // namespace

TEST_F(SlowClient, ADownloadWaitsForItsSource) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    SlowSource source;
    co::SdoOptions options;
    options.mode = mode;
    auto transfer = client.download(NodeId(5), 0x2004, 0, source, options);
    Flag flag;
    ASSERT_FALSE(transfer.begin(executor, flag));
    run(10s);
    EXPECT_EQ(wire.log.size(), 2U);
    for (std::size_t i = 0; i < 2000; ++i) {
      source.bytes.push_back(static_cast<std::uint8_t>(i));
      source.ended = i == 1999;
      if (i % 97 == 0 || source.ended) source.go_on();
      run(20ms);
    }
    run(1s);
    ASSERT_TRUE(flag.set);
    EXPECT_TRUE(transfer.await_resume());
    const auto stored = values.bytes({0x2004, 0});
    EXPECT_EQ(Bytes(stored.begin(), stored.end()), source.bytes);
    wire.log.clear();
  }
}

TEST_F(SlowClient, AnUploadWaitsForItsSink) {
  values.set_bytes({0x2004, 0}, numbers(2000));
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    SlowSink sink;
    co::SdoOptions options;
    options.mode = mode;
    auto transfer = client.upload(NodeId(5), 0x2004, 0, sink, options);
    Flag flag;
    ASSERT_FALSE(transfer.begin(executor, flag));
    run(10s);
    EXPECT_EQ(sink.taken.size(), mode == co::SdoMode::block ? 889U : 7U);
    for (int i = 0; i < 1000 && !flag.set; ++i) {
      sink.go_on();
      run(50ms);
    }
    ASSERT_TRUE(flag.set);
    EXPECT_TRUE(transfer.await_resume());
    EXPECT_EQ(sink.taken, numbers(2000));
    sink.go_on();  // harmless
  }
}

// The server gives up while the source is waited for: heard at once. And a transfer that is destroyed meanwhile leaves
// nobody who would be woken.
TEST_F(SlowClient, TheWaitingEnds) {
  server.set_timeout(1s);
  SlowSource source;
  {
    auto transfer = client.download(NodeId(5), 0x2004, 0, source, client.options());
    Flag flag;
    ASSERT_FALSE(transfer.begin(executor, flag));
    run(1100ms);
    ASSERT_TRUE(flag.set);
    EXPECT_EQ(transfer.await_resume().error().detail, 0x05040000U);
    source.go_on();
  }
  {
    auto transfer = client.download(NodeId(5), 0x2004, 0, source, client.options());
    Flag flag;
    ASSERT_FALSE(transfer.begin(executor, flag));
    run(100ms);
  }
  source.go_on();
  run(10ms);
  EXPECT_EQ(wire.log.back(), "605#8004200000000008");
}
