// SDO transfers of any length between our client and our server: streams at both ends, lossy wires, answers that come
// later (docs/protocols/cia301.md §SDO; docs/hard-cases.md §1, §5).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>

#include "sdo_rig.hpp"

using namespace berth;
using namespace berth::test;

namespace {

// A port that loses, doubles and changes the order of what is sent through it.
class Mangler final : public can::Port, private rt::Job {
 public:
  Mangler(can::Port& port, rt::Executor& executor, std::uint64_t seed)
      : random(seed), port_(port), executor_(executor) {}
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (random.chance(reorder) && !held_) {
      held_ = frame;
      held_tag_ = tag;
      executor_.after(2ms, *this);
      return can::Queued::yes;
    }
    const auto queued = port_.send(frame, tag);
    if (queued == can::Queued::yes && random.chance(duplicate)) port_.send(frame, 0);
    if (queued == can::Queued::yes) release();
    return queued;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    if (held_ && held_tag_ == tag) held_tag_ = 0;
    port_.withdraw(tag);
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    port_.listen(listener, accept);
  }
  can::Status status() const noexcept override { return port_.status(); }
  bool restart(std::uint32_t rate) noexcept override { return port_.restart(rate); }
  Random random;
  std::uint32_t duplicate = 0, reorder = 0;  // per million

 private:
  void release() {
    if (!held_) return;
    const auto frame = *std::exchange(held_, std::nullopt);
    if (port_.send(frame, held_tag_) == can::Queued::full) {
      held_ = frame;
      executor_.after(2ms, *this);
    }
  }
  void run() noexcept override { release(); }
  can::Port& port_;
  rt::Executor& executor_;
  std::optional<can::Frame> held_;
  std::uint32_t held_tag_ = 0;
};

// Client and server on a wire, with streams of any length behind 2004h.
struct Pair : Bench {
  explicit Pair(std::size_t buffer = 1024) : server(far.dispatcher, values, buffer) {
    server.start(NodeId(5));
    wire.log.reserve(1000);
  }
  Station far{wire};
  Station near{wire};
  od::Values values{test_description(), NodeId(5)};
  co::SdoServerService server;
  co::SdoClient client{near.dispatcher};
};

struct Streams : ::testing::Test, Pair {
  Streams() { EXPECT_TRUE(values.attach(stream, {0x2004, 0})); }
  co::SdoOptions of(co::SdoMode mode) const {
    co::SdoOptions options;
    options.mode = mode;
    return options;
  }
  Result<void> down(Pattern& source, const co::SdoOptions& options) {
    auto op = client.download(NodeId(5), 0x2004, 0, source, options);
    return await(*this, op);
  }
  Result<void> up(Pattern& sink, const co::SdoOptions& options) {
    auto op = client.upload(NodeId(5), 0x2004, 0, sink, options);
    return await(*this, op);
  }
  Pattern stream;
};

// Any length both ways, in both modes, with and without a size at either end.
TEST_F(Streams, AnyLengthBothWays) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    for (const bool sized : {true, false}) {
      for (const std::size_t length : {0U, 1U, 4U, 5U, 7U, 8U, 888U, 889U, 890U, 1023U, 1024U, 1025U, 1778U, 5000U}) {
        SCOPED_TRACE(std::to_string(length) + (sized ? " sized" : "") + (mode == co::SdoMode::block ? " block" : ""));
        Pattern source;
        source.length = length;
        source.sized = sized;
        const auto opened = stream.opened;
        const auto done = down(source, of(mode));
        ASSERT_TRUE(done) << describe(done.error());
        EXPECT_EQ(stream.position, length);
        EXPECT_EQ(stream.wrong, 0U);
        EXPECT_EQ(stream.told, sized ? std::optional(length) : std::nullopt);
        EXPECT_EQ(stream.opened, opened + 1);
        EXPECT_EQ(stream.closed, stream.opened);
        EXPECT_TRUE(stream.completed);
        Pattern sink;
        stream.length = length;
        stream.sized = sized;
        const auto got = up(sink, of(mode));
        ASSERT_TRUE(got) << describe(got.error());
        EXPECT_EQ(sink.position, length);
        EXPECT_EQ(sink.wrong, 0U);
        EXPECT_EQ(stream.closed, stream.opened);
        EXPECT_TRUE(stream.completed);
        wire.log.clear();
        wire.times.clear();
      }
    }
  }
  EXPECT_EQ(client.surplus(NodeId(5)), 0U);
  EXPECT_EQ(client.late(NodeId(5)), 0U);
}

// What the stream refuses reaches the client as it is, whenever it is refused; and the stream is closed once.
TEST_F(Streams, RefusalsOfTheStream) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    const auto options = of(mode);
    Pattern other;
    other.length = 3000;
    stream.on_open = od::AbortCode::local_control;
    EXPECT_EQ(down(other, options).error().detail, 0x08000021U);
    stream.on_open = od::AbortCode::none;
    other.position = 0;
    stream.refuse_from = 1500;
    EXPECT_EQ(down(other, options).error().detail, 0x06060000U);
    EXPECT_FALSE(stream.completed);
    stream.length = 3000;
    EXPECT_EQ(up(other, options).error().detail, 0x06060000U);
    stream.refuse_from = SIZE_MAX;
    other.position = 0;
    stream.on_close = od::AbortCode::not_stored;
    EXPECT_EQ(down(other, options).error().detail, 0x08000020U);
    stream.on_close = od::AbortCode::none;
    EXPECT_EQ(stream.opened, stream.closed);
    // It says 3000 and has fewer.
    stream.promised = 3000;
    stream.length = 2000;
    EXPECT_EQ(up(other, options).error().detail, 0x08000022U);
    stream.promised.reset();
    EXPECT_EQ(stream.opened, stream.closed);
    // And at the client's end.
    stream.length = 3000;
    Pattern sink;
    sink.on_open = od::AbortCode::out_of_memory;
    EXPECT_EQ(up(sink, options).error().detail, 0x05040005U);
    sink.on_open = od::AbortCode::none;
    sink.refuse_from = 1500;
    EXPECT_EQ(up(sink, options).error().detail, 0x06060000U);
    Pattern source;
    source.length = 3000;
    source.refuse_from = 1500;
    EXPECT_EQ(down(source, options).error().detail, 0x06060000U);
    source.refuse_from = SIZE_MAX;
    source.promised = 3500;
    source.position = 0;
    EXPECT_EQ(down(source, options).error().detail, 0x08000024U);
    run(2s);
    EXPECT_EQ(stream.opened, stream.closed);
    EXPECT_FALSE(server.busy());
  }
}

namespace {

// Takes each piece, and is ready for the next one only when it is told so: flash memory.
struct SlowStream final : od::Stream {
  od::AbortCode open_write(ObjectRef, std::optional<std::size_t>) noexcept override {
    taken.clear();
    return od::AbortCode::none;
  }
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    largest = std::max(largest, bytes.size());
    taken.insert(taken.end(), bytes.begin(), bytes.end());
    ++waits;
    return od::AbortCode::pending;
  }
  od::AbortCode close(ObjectRef, bool complete) noexcept override {
    completed = complete;
    ++closed;
    return od::AbortCode::none;
  }
  Bytes taken;
  std::size_t largest = 0;
  int waits = 0;
  int closed = 0;
  bool completed = false;
};

}  // namespace

// A stream that takes its time between two pieces: the acknowledgement of a sub-block, or of a segment, waits for it,
// and what the client says meanwhile changes nothing.
TEST_F(Streams, AStreamThatWritesSlowly) {
  const auto data = numbers(5'000);
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    for (const bool fails : {false, true}) {
      SlowStream slow;
      ASSERT_TRUE(values.attach(slow, {0x2004, 0}));
      auto options = of(mode);
      options.timeout = 1s;
      auto op = client.download(NodeId(5), 0x2004, 0, std::span<const std::uint8_t>(data), options);
      struct Told final : rt::Job {
        void run() noexcept override { done = true; }
        bool done = false;
      } told;
      ASSERT_FALSE(op.begin(near.dispatcher.executor(), told));
      int answered = 0;
      for (int i = 0; i < 200 && !told.done; ++i) {
        run(20ms);
        if (!server.pending()) continue;
        EXPECT_EQ(server.pending(), (ObjectRef{0x2004, 0}));
        run(100ms);
        EXPECT_TRUE(server.pending()) << "nothing else ends the waiting";
        const bool refuse = fails && answered == 2;
        EXPECT_TRUE(server.complete(refuse ? od::AbortCode::hardware : od::AbortCode::none));
        ++answered;
      }
      ASSERT_TRUE(told.done);
      const auto done = op.await_resume();
      EXPECT_EQ(done.has_value(), !fails) << (done ? "" : describe(done.error()));
      EXPECT_LE(slow.largest, od::Stream::longest_piece);
      EXPECT_GE(answered, 3);
      EXPECT_EQ(slow.closed, 1);
      EXPECT_EQ(slow.completed, !fails);
      EXPECT_TRUE(!fails || done.error().detail == 0x06060000U);
      EXPECT_TRUE(fails || slow.taken == data);
      wire.log.clear();
      wire.times.clear();
    }
  }
}

// While an acknowledgement waits, every frame but an abort is a segment that comes late.
TEST(SdoServerPending, LateSegmentsDoNotBeginATransfer) {
  ServerRig rig;
  SlowStream slow;
  ASSERT_TRUE(rig.values.attach(slow, {0x2004, 0}));
  const auto data = numbers(3 * 889);
  ASSERT_EQ(rig.ask("C2042000" + hex({0x6B, 0x0A, 0, 0})).substr(0, 2), "A0");
  const auto send = [&](std::size_t block) {
    std::string last;
    for (const auto& frame : segments_of(Bytes(data.begin() + block * 889, data.begin() + (block + 1) * 889), false)) {
      last = rig.ask(frame);
    }
    return last;
  };
  EXPECT_EQ(send(0), "") << "the stream writes";
  ASSERT_TRUE(rig.server.pending());
  EXPECT_EQ(rig.ask("2220200001000000"), "") << "it looks like an initiate";
  EXPECT_EQ(rig.ask("7F00000000000000"), "") << "the last segment once more";
  ASSERT_TRUE(rig.server.pending());
  const auto answer = rig.server.complete(od::AbortCode::none);
  ASSERT_TRUE(answer);
  EXPECT_EQ(can::to_string(*answer).substr(4, 4), "A27F");
  EXPECT_EQ(send(1), "");
  EXPECT_EQ(rig.ask("8004200000000008"), "") << "the client aborts";
  EXPECT_FALSE(rig.server.pending());
  EXPECT_EQ(slow.closed, 1);
  EXPECT_FALSE(slow.completed);
}

// One transfer at a time; access rights count; the whole-value interface of the dictionary uses the stream as well.
TEST_F(Streams, OneTransferAtATime) {
  stream.length = 100;
  od::StreamUse use;
  ASSERT_TRUE(use.open_read(stream, {0x2004, 0}));
  Pattern sink;
  EXPECT_EQ(up(sink, of(co::SdoMode::segmented)).error().detail, 0x08000022U);
  use.drop();
  EXPECT_TRUE(up(sink, of(co::SdoMode::segmented)));
  Bytes bytes(100);
  const auto whole = values.read({0x2004, 0}, bytes);
  ASSERT_TRUE(whole);
  EXPECT_EQ(*whole, 100U);
  EXPECT_EQ(bytes[99], Pattern::at(99));
  EXPECT_EQ(values.read({0x2004, 0}, std::span(bytes).first(99)).error(), od::AbortCode::out_of_memory);
  EXPECT_EQ(values.write({0x2004, 0}, bytes), od::AbortCode::none);
  EXPECT_EQ(values.view({0x2004, 0}).error(), od::AbortCode::unsupported_access);
  EXPECT_FALSE(values.attach(stream, {0x2003, 0})) << "not a DOMAIN";
  EXPECT_EQ(stream.opened, stream.closed);
}

// The stream, the dictionary's hold on it and the server may go in any order, in the middle of a transfer as well.
TEST_F(Streams, GoneInTheMiddle) {
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    auto passing = std::make_unique<Pattern>();
    ASSERT_TRUE(values.attach(*passing, {0x2004, 0}));
    passing->length = 5000;
    Pattern sink;
    auto op = client.upload(NodeId(5), 0x2004, 0, sink, of(mode));
    Flag flag;
    op.begin(executor, flag);
    run(3ms);
    passing.reset();
    run(5s);
    ASSERT_TRUE(flag.set);
    EXPECT_EQ(op.await_resume().error().detail, 0x08000020U);
    auto next = client.read<std::uint32_t>(NodeId(5), 0x1000, 0);
    EXPECT_TRUE(await(*this, next));
  }
  Pattern late;
  {
    od::Values brief(test_description(), NodeId(5));
    brief.attach(late, {0x2004, 0});
    co::SdoServer core(brief, 1000);
    core.set_response_id(co::CobId(0x585));
    EXPECT_TRUE(answer_of(core, *can::parse_frame("605#2104200064000000")));
    EXPECT_TRUE(core.busy());
  }
  EXPECT_EQ(late.closed, 1);
  EXPECT_FALSE(late.completed);
}

// A port whose frames are with the other end at once.
class Cable final : public can::Port, private rt::Job {
 public:
  explicit Cable(rt::Executor& executor) : executor_(executor) {}
  void join(Cable& other) { other_ = &other; }
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (count_ == queue_.size()) return can::Queued::full;
    queue_[(first_ + count_++) % queue_.size()] = {frame, tag};
    executor_.post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t) noexcept override {}
  void listen(can::Listener* listener, std::span<const can::IdRange>) noexcept override { listener_ = listener; }
  can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
  bool restart(std::uint32_t) noexcept override { return true; }

 private:
  void run() noexcept override {
    const auto item = queue_[first_];
    first_ = (first_ + 1) % queue_.size();
    if (--count_ > 0) executor_.post(*this);
    if (item.tag != 0) listener_->sent(item.tag, executor_.now());
    other_->listener_->received(item.frame, executor_.now());
  }
  struct Item {
    can::Frame frame;
    std::uint32_t tag = 0;
  };
  rt::Executor& executor_;
  Cable* other_ = nullptr;
  can::Listener* listener_ = nullptr;
  std::array<Item, 5> queue_;
  std::size_t first_ = 0, count_ = 0;
};

// A 100 MB DOMAIN needs no 100 MB: what is in memory at a time does not depend on the length. (100 MB in the bench.)
TEST(LongStreams, LongDomainInBoundedMemory) {
  rt::Executor executor;
  Cable near(executor), far(executor);
  near.join(far);
  far.join(near);
  can::Dispatcher near_side(executor, near), far_side(executor, far);
  od::Values values(test_description(), NodeId(5));
  co::SdoServerService server(far_side, values, 1024);
  server.start(NodeId(5));
  co::SdoClient client(near_side);
  Pattern stream;
  values.attach(stream, {0x2004, 0});
  for (const auto mode : {co::SdoMode::segmented, co::SdoMode::block}) {
    const std::size_t length = mode == co::SdoMode::block ? 6'000'003 : 1'000'003;
    co::SdoOptions options;
    options.mode = mode;
    Pattern source;
    source.length = length;
    auto down = client.download(NodeId(5), 0x2004, 0, source, options);
    Flag flag;
    down.begin(executor, flag);
    executor.advance(executor.now() + 1s);
    ASSERT_TRUE(flag.set);
    ASSERT_TRUE(down.await_resume());
    EXPECT_EQ(stream.position, length);
    EXPECT_EQ(stream.wrong, 0U);
    EXPECT_LE(stream.largest, 1100U);
    Pattern sink;
    stream.length = length;
    auto up = client.upload(NodeId(5), 0x2004, 0, sink, options);
    Flag up_flag;
    up.begin(executor, up_flag);
    executor.advance(executor.now() + 1s);
    ASSERT_TRUE(up_flag.set);
    ASSERT_TRUE(up.await_resume());
    EXPECT_EQ(sink.position, length);
    EXPECT_EQ(sink.wrong, 0U);
    EXPECT_LE(sink.largest, 1100U);
  }
}

// A source that began may be asked to begin anew, when it can.
TEST_F(Streams, RetriesOfASource) {
  auto options = of(co::SdoMode::block);
  options.retries = 1;
  options.timeout = 100ms;
  for (const bool can : {true, false}) {
    bool lost = false;
    wire.lose = [&](const can::Frame& f) { return f.id == 0x585 && f.data[0] == 0xA2 && !std::exchange(lost, true); };
    Pattern source;
    source.length = 2000;
    source.can_rewind = can;
    const auto done = down(source, options);
    EXPECT_EQ(source.rewound, 1);
    ASSERT_EQ(done.has_value(), can);
    EXPECT_TRUE(!can || stream.wrong == 0);
    wire.lose = {};
    run(2s);
  }
}

// ---- lossy wires

// Whatever is lost, doubled or changes places: the right data or an error, in bounded time, and afterwards an honest
// transfer. With CRC, as only that finds segments of one sub-block in another.
RC_GTEST_PROP(SdoBlockProperty, LossyWire, (std::uint64_t seed)) {
  Random random(seed);
  Bench b;
  b.executor.perturb(seed);
  Wire::Node near_node(b.wire), far_node(b.wire);
  Mangler near_port(near_node, b.executor, random.next()), far_port(far_node, b.executor, random.next());
  can::Dispatcher near(b.executor, near_port), far(b.executor, far_port);
  near_node.capacity = far_node.capacity = 1 + random.below(40);
  od::Values values(test_description(), NodeId(5));
  co::SdoServerService server(far, values, random.chance(300'000) ? random.below(300) : 4096);
  server.start(NodeId(5));
  co::SdoClient client(near);
  auto options = client.options();
  options.mode = random.chance(800'000) ? co::SdoMode::block : co::SdoMode::segmented;
  options.block_size = static_cast<std::uint8_t>(1 + random.below(127));
  options.retries = static_cast<unsigned>(random.below(3));
  options.longest = 10'000;
  const auto loss = static_cast<std::uint32_t>(random.below(60'000));
  Random noise = random.fork();
  b.wire.lose = [&](const can::Frame&) { return noise.chance(loss); };
  near_port.duplicate = far_port.duplicate = random.chance(500'000) ? 20'000 : 0;
  near_port.reorder = far_port.reorder = random.chance(500'000) ? 20'000 : 0;
  for (int round = 0; round < 3; ++round) {
    Bytes data(random.below(4001));
    for (auto& byte : data) byte = static_cast<std::uint8_t>(random.next());
    auto down = client.download(NodeId(5), 0x2004, 0, data, options);
    const auto done = await(b, down);
    const auto stored = values.bytes(ObjectRef{0x2004, 0});
    if (done && options.mode == co::SdoMode::block) {
      RC_ASSERT(Bytes(stored.begin(), stored.end()) == data);
    }
    RC_ASSERT(values.set_bytes({0x2004, 0}, data) == od::AbortCode::none);
    auto up = client.upload(NodeId(5), 0x2004, 0, options);
    const auto value = await(b, up);
    if (value && options.mode == co::SdoMode::block) {
      RC_ASSERT(Bytes(value->bytes().begin(), value->bytes().end()) == data);
    }
  }
  // The wire is fine again: after the server's time-out at the latest all is well.
  b.wire.lose = {};
  near_port.duplicate = far_port.duplicate = near_port.reorder = far_port.reorder = 0;
  b.run(3s);
  RC_ASSERT(!client.busy(NodeId(5)));
  RC_ASSERT(!server.busy());
  auto honest = client.read<std::uint32_t>(NodeId(5), 0x1000, 0);
  const auto type = await(b, honest);
  RC_ASSERT(type.has_value());
  RC_ASSERT(*type == 0x00020192U);
}

// Losses alone, which is what a CAN bus has: they cost time, not the transfer. (Anew only when a sub-block of a single
// segment is lost, of which the receiver knows nothing.)
RC_GTEST_PROP(SdoBlockProperty, LostSegmentsAreRepeated, (std::uint64_t seed)) {
  Random random(seed);
  Pair p(4096);
  Random noise = random.fork();
  // A segment is known by having no zero in it, here.
  p.wire.lose = [&](const can::Frame& f) {
    return std::ranges::none_of(f.bytes(), [](auto byte) { return byte == 0; }) && noise.chance(100'000);
  };
  Bytes data(500 + random.below(3501));
  for (auto& byte : data) byte = static_cast<std::uint8_t>(1 + random.below(255));
  auto options = p.client.options();
  options.mode = co::SdoMode::block;
  options.block_size = static_cast<std::uint8_t>(20 + random.below(108));
  options.retries = 6;
  auto down = p.client.download(NodeId(5), 0x2004, 0, data, options);
  const auto done = await(p, down);
  if (!done) RC_FAIL(describe(done.error()) + " last " + p.wire.log.back());
  auto up = p.client.upload(NodeId(5), 0x2004, 0, options);
  const auto value = await(p, up);
  if (!value) RC_FAIL(describe(value.error()));
  RC_ASSERT(Bytes(value->bytes().begin(), value->bytes().end()) == data);
}

// Any payload, any block size, any port, any buffer: down and up again.
RC_GTEST_PROP(SdoBlockProperty, AnyPayloadGoesDownAndUp, (std::uint64_t seed)) {
  Random random(seed);
  Pair p(4096);
  p.executor.perturb(seed);
  p.near.port.capacity = 1 + random.below(40);
  p.far.port.capacity = 1 + random.below(40);
  const std::size_t edges[] = {0, 1, 6, 7, 8, 888, 889, 890, 3999, 4000};
  Bytes data(random.chance(300'000) ? edges[random.below(std::size(edges))] : random.below(4001));
  for (auto& byte : data) byte = static_cast<std::uint8_t>(random.next());
  auto options = p.client.options();
  options.mode = random.chance(200'000) ? co::SdoMode::automatic : co::SdoMode::block;
  options.block_size = static_cast<std::uint8_t>(1 + random.below(127));
  options.protocol_switch = static_cast<std::uint8_t>(random.below(256));
  options.crc = random.chance(500'000);
  options.block_from = random.below(300);
  auto down = p.client.download(NodeId(5), 0x2004, 0, data, options);
  const auto done = await(p, down);
  RC_ASSERT(done.has_value());
  const auto stored = p.values.bytes(ObjectRef{0x2004, 0});
  RC_ASSERT(Bytes(stored.begin(), stored.end()) == data);
  auto up = p.client.upload(NodeId(5), 0x2004, 0, options);
  const auto value = await(p, up);
  RC_ASSERT(value.has_value());
  RC_ASSERT(Bytes(value->bytes().begin(), value->bytes().end()) == data);
  RC_ASSERT(p.client.surplus(NodeId(5)) == 0U);
  RC_ASSERT(p.client.late(NodeId(5)) == 0U);
}

}  // namespace
