// SDO client (docs/protocols/cia301.md §SDO; docs/hard-cases.md §1, §5, §Users). Scripted servers speak by
// hand-written frames; only the property tests at the end join the client with our own server.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "berth/co/sdo_client.hpp"

#include "berth/base/random.hpp"
#include "berth/co/sdo_server.hpp"
#include "dictionary.hpp"
#include "wire.hpp"

using namespace berth;
using namespace berth::test;

namespace {

using Bytes = std::vector<std::uint8_t>;

struct Surplus final : co::SdoClient::Observer {
  void surplus(NodeId node, const can::Frame& f, rt::Time) noexcept override {
    log.push_back(std::to_string(node.value()) + " " + can::to_string(f));
  }
  Log log;
};

// Answers requests to node 5 by a table; what is not in it is not answered.
struct Client : ::testing::Test, Bench {
  Client() { client.set_observer(&surplus); }
  // Each request has its answers in order; the last one is repeated.
  void reply(const std::string& request, std::vector<std::string> answers) { table[request] = std::move(answers); }
  // A transfer that ends soon, and without an abort.
  [[nodiscard]] co::SdoOptions gives_up_soon(std::optional<unsigned> retries = {}) const {
    co::SdoOptions options = client.options();
    options.timeout = 20ms;
    options.retries = retries.value_or(options.retries);
    options.abort_on_timeout = false;
    return options;
  }
  std::map<std::string, std::vector<std::string>> table;
  Peer server{wire, co::all_sdo_requests, [this](Peer& self, const can::Frame& f) {
                const auto it = table.find(can::to_string(f));
                if (it == table.end()) return;
                self.send(it->second.front().c_str());
                if (it->second.size() > 1) it->second.erase(it->second.begin());
              }};
  Station station{wire};
  Surplus surplus;
  co::SdoClient client{station.dispatcher};
  const NodeId node{5};
};

// A7.1, the client's side.
TEST_F(Client, ExpeditedUpload) {
  reply("605#4000100000000000", {"585#4300100092010200"});
  auto op = client.read<std::uint32_t>(node, 0x1000, 0);
  const auto value = await(*this, op);
  ASSERT_TRUE(value);
  EXPECT_EQ(*value, 0x00020192U);
  reply("605#4000200000000000", {"585#4F0020002A000000"});
  auto small = client.upload(node, 0x2000, 0);
  EXPECT_EQ(await(*this, small)->bytes().size(), 1U);
  auto wrong = client.read<std::uint32_t>(node, 0x2000, 0);
  const auto mismatch = await(*this, wrong);
  ASSERT_FALSE(mismatch);
  EXPECT_EQ(mismatch.error().code, Errc::mismatch);
  EXPECT_EQ(mismatch.error().index, 0x2000);
  auto i8 = client.read<std::int8_t>(node, 0x2000, 0);
  EXPECT_EQ(*await(*this, i8), 42);
  // e=1, s=0: the server does not say how many count; the type asked for does.
  reply("605#4000200000000000", {"585#420020002A000000"});
  auto unsized = client.read<std::uint8_t>(node, 0x2000, 0);
  EXPECT_EQ(*await(*this, unsized), 42);
  auto all = client.upload(node, 0x2000, 0);
  EXPECT_EQ(await(*this, all)->size(), 4U);
}

// A7.1, the client's side.
TEST_F(Client, ExpeditedDownload) {
  reply("605#2B171000E8030000", {"585#6017100000000000"});
  auto op = client.write<std::uint16_t>(node, 0x1017, 0, 1000);
  EXPECT_TRUE(await(*this, op));
  reply("605#2F002000FE000000", {"585#6000200000000000"});
  auto negative = client.write<std::int8_t>(node, 0x2000, 0, -2);
  EXPECT_TRUE(await(*this, negative));
  const Bytes three{1, 2, 3};
  reply("605#2700200101020300", {"585#6000200100000000"});
  auto odd = client.download(node, 0x2000, 1, three);
  EXPECT_TRUE(await(*this, odd));
  EXPECT_EQ(wire.log.size(), 6U);
}

// A7.2, the client's side.
TEST_F(Client, SegmentedUpload) {
  reply("605#4008100000000000", {"585#410810000A000000"});
  reply("605#6000000000000000", {"585#0061626364656667"});
  reply("605#7000000000000000", {"585#1968696A00000000"});
  auto op = client.upload(node, 0x1008, 0);
  const auto value = await(*this, op);
  ASSERT_TRUE(value);
  EXPECT_EQ(value->text(), "abcdefghij");
}

// HC1.S2: segmented upload, the server does not indicate the size.
TEST_F(Client, S2_SegmentedUploadWithoutSize) {
  reply("605#4008100000000000", {"585#4008100000000000"});
  reply("605#6000000000000000", {"585#0061626364656667"});
  reply("605#7000000000000000", {"585#1968696A00000000"});
  auto op = client.upload(node, 0x1008, 0);
  const auto value = await(*this, op);
  ASSERT_TRUE(value);
  EXPECT_EQ(value->text(), "abcdefghij");
}

// HC1.S2: of any length, 0 included, in frames that are counted; and of a type, whose length is looked at all the same.
TEST_F(Client, S2_SegmentedUploadWithoutSizeOfAnyLength) {
  for (const std::size_t length : {0U, 1U, 6U, 7U, 8U, 14U, 700U}) {
    Bytes data;
    std::vector<std::string> even;
    std::vector<std::string> odd;
    const std::size_t segments = std::max<std::size_t>(1, (length + 6) / 7);
    for (std::size_t i = 0; i < segments; ++i) {
      const std::size_t bytes = std::min<std::size_t>(7, length - 7 * i);
      const bool last = i + 1 == segments;
      can::Frame segment = can::Frame::base(0x585, {0, 0, 0, 0, 0, 0, 0, 0});
      segment.data[0] = static_cast<std::uint8_t>(i % 2 << 4U | (7 - bytes) << 1U | (last ? 1U : 0U));
      for (std::size_t k = 0; k < bytes; ++k) {
        data.push_back(static_cast<std::uint8_t>(3 * data.size() + 1));
        segment.data[1 + k] = data.back();
      }
      (i % 2 == 0 ? even : odd).push_back(can::to_string(segment));
    }
    wire.log.clear();
    reply("605#4008100000000000", {"585#4008100000000000"});
    reply("605#6000000000000000", even);
    if (!odd.empty()) reply("605#7000000000000000", odd);
    auto op = client.upload(node, 0x1008, 0);
    const auto value = await(*this, op);
    ASSERT_TRUE(value) << length;
    EXPECT_EQ(Bytes(value->bytes().begin(), value->bytes().end()), data) << length;
    EXPECT_EQ(wire.log.size(), 2 * (1 + segments)) << length << ": no abort, no frame more";
  }
}
TEST_F(Client, S2_SegmentedUploadWithoutSizeOfAType) {
  reply("605#4000100000000000", {"585#4000100000000000"});
  reply("605#6000000000000000", {"585#0792010200000000"});
  auto op = client.read<std::uint32_t>(node, 0x1000, 0);
  const auto value = await(*this, op);
  ASSERT_TRUE(value);
  EXPECT_EQ(*value, 0x00020192U);
  for (const char* other : {"585#0992010200000000", "585#0592010200FF0000"}) {  // 3 bytes, 5 bytes
    reply("605#6000000000000000", {other});
    auto wrong = client.read<std::uint32_t>(node, 0x1000, 0);
    const auto mismatch = await(*this, wrong);
    ASSERT_FALSE(mismatch) << other;
    EXPECT_EQ(mismatch.error().code, Errc::mismatch);
  }
}

// HC1.S16: what is not 8 bytes long is no answer and no abort: the whole one that follows is taken, else it is silence.
TEST_F(Client, S16_ShortAnswersAreNotHeard) {
  std::vector<const char*> answers{"585#",   "585#43001000FF0102",  "585#4300100092010F00FF", "585#80001000000002",
                                   "585#R8", "585#4300100092010200"};
  const auto valid = [](const char* text) { return can::parse_frame(text).has_value(); };
  std::erase_if(answers, [&](const char* text) { return !valid(text); });  // 9 bytes are no classic frame
  ASSERT_EQ(answers.size(), 5U);
  Peer stutters(wire, can::only(0x605), [&](Peer& self, const can::Frame&) {
    for (const char* answer : answers) self.send(answer);
  });
  auto op = client.read<std::uint32_t>(node, 0x1000, 0);
  const auto value = await(*this, op);
  ASSERT_TRUE(value);
  EXPECT_EQ(*value, 0x00020192U);
  EXPECT_EQ(executor.now(), at(6 * wire.frame_time));
  answers.pop_back();
  const auto before = executor.now();
  auto short_only = client.read<std::uint32_t>(node, 0x1000, 0);
  EXPECT_EQ(await(*this, short_only).error().code, Errc::timeout);
  EXPECT_GE(executor.now() - before, client.options().timeout);
}

// A7.2, the client's side.
TEST_F(Client, SegmentedDownload) {
  const Bytes data{1, 2, 3, 4, 5, 6, 7, 8};
  reply("605#2105200008000000", {"585#6005200000000000"});
  reply("605#0001020304050607", {"585#2000000000000000"});
  reply("605#1D08000000000000", {"585#3000000000000000"});
  auto op = client.download(node, 0x2005, 0, data);
  EXPECT_TRUE(await(*this, op));
  EXPECT_EQ(wire.log.size(), 6U);
}

// S17: nothing at all, both ways.
TEST_F(Client, S17_ZeroBytes) {
  reply("605#2103200000000000", {"585#6003200000000000"});
  reply("605#0F00000000000000", {"585#2000000000000000"});
  auto down = client.with(node).download(0x2003, 0, {});
  EXPECT_TRUE(await(*this, down));
  reply("605#4003200000000000", {"585#4103200000000000"});
  reply("605#6000000000000000", {"585#0F00000000000000"});
  auto up = client.upload(node, 0x2003, 0);
  const auto value = await(*this, up);
  ASSERT_TRUE(value);
  EXPECT_TRUE(value->empty());
}

// S17: more or fewer bytes than the server indicated.
TEST_F(Client, S17_LengthMismatch) {
  reply("605#4008100000000000", {"585#4108100005000000"});
  reply("605#6000000000000000", {"585#0161626364656667"});
  auto more = client.upload(node, 0x1008, 0);
  EXPECT_EQ(await(*this, more).error().detail, 0x06070012U);
  run(1ms);
  EXPECT_EQ(wire.log.back(), "605#8008100012000706");
  reply("605#6000000000000000", {"585#0961626300000000"});
  auto fewer = client.upload(node, 0x1008, 0);
  const auto value = await(*this, fewer);
  EXPECT_EQ(value.error().code, Errc::mismatch);
  EXPECT_EQ(value.error().detail, 0x06070013U);
}

TEST_F(Client, AbortIsToldWithItsCodeAndObject) {
  reply("605#4018100300000000", {"585#8018100311000906"});
  auto op = client.read<std::uint32_t>(node, 0x1018, 3);
  const auto value = await(*this, op);
  ASSERT_FALSE(value);
  EXPECT_EQ(value.error().code, Errc::aborted);
  EXPECT_EQ(value.error().detail, 0x06090011U);
  EXPECT_EQ(value.error().node, 5);
  EXPECT_EQ(value.error().index, 0x1018);
  EXPECT_EQ(value.error().sub, 3);
}

// HC1.S13: an abort in the middle ends the transfer, and nothing more is sent.
TEST_F(Client, S13_AbortIsNeverAnswered) {
  reply("605#4008100000000000", {"585#410810000A000000"});
  reply("605#6000000000000000", {"585#8008100000000008"});
  auto op = client.upload(node, 0x1008, 0);
  EXPECT_EQ(await(*this, op).error().detail, 0x08000000U);
  run(10s);
  EXPECT_EQ(wire.log.size(), 4U);
  // A server that lost the transfer may not know the object any more.
  reply("605#6000000000000000", {"585#8000000001000405"});
  auto lost = client.upload(node, 0x1008, 0);
  EXPECT_EQ(await(*this, lost).error().detail, 0x05040001U);
}

// HC1.S5, the client's side: a wrong toggle is aborted with 0503 0000.
TEST_F(Client, S5_WrongToggle) {
  reply("605#4008100000000000", {"585#410810000A000000"});
  reply("605#6000000000000000", {"585#1061626364656667"});
  auto op = client.upload(node, 0x1008, 0);
  EXPECT_EQ(await(*this, op).error().detail, 0x05030000U);
  run(1ms);
  EXPECT_EQ(wire.log.back(), "605#8008100000000305");
  const Bytes data(8, 1);
  reply("605#2105200008000000", {"585#6005200000000000"});
  reply("605#0001010101010101", {"585#3000000000000000"});
  auto down = client.download(node, 0x2005, 0, data);
  EXPECT_EQ(await(*this, down).error().detail, 0x05030000U);
}

// HC1.S15: answers for another object, late ones, short ones: ignored; the right one still counts.
TEST_F(Client, S15_ForeignAnswersAreIgnored) {
  auto op = client.read<std::uint32_t>(node, 0x1000, 0);
  Flag flag;
  op.begin(executor, flag);
  run(1ms);
  for (const char* f : {"585#4301100092010200", "585#4300100192010200", "585#6000100000000000", "585#8001100000000008",
                        "585#0000000000000000", "585#43001000920102", "585#R8", "586#4300100011111111"}) {
    server.send(f);
    run(1ms);
    ASSERT_FALSE(flag.set) << f;
  }
  server.send("585#4300100092010200");
  run(1ms);
  ASSERT_TRUE(flag.set);
  EXPECT_EQ(*op.await_resume(), 0x00020192U);
}

// The timer is the channel's and stays when a transfer ends: it must not end the next one before its own time.
TEST_F(Client, TheTimeOfTheTransferBeforeIsNotTheNextOnes) {
  reply("605#4000100000000000", {"585#4300100092010200"});
  auto first = client.read<std::uint32_t>(node, 0x1000, 0);
  ASSERT_TRUE(await(*this, first));
  run(900ms);
  auto second = client.read<std::uint32_t>(node, 0x1001, 0);  // is not answered
  Flag flag;
  second.begin(executor, flag);
  run(950ms);  // the first one's time of 1 s ended meanwhile
  EXPECT_FALSE(flag.set);
  run(100ms);
  ASSERT_TRUE(flag.set);
  EXPECT_EQ(second.await_resume().error().code, Errc::timeout);
}

// HC1.S15: the answer to a request that was given up comes while the next one is on its way. An answer outranks the
// next request, so what is heard before the request's confirmation is not its answer.
TEST_F(Client, S15_LateAnswerOfTheSameObjectBeforeTheFence) {
  const co::SdoOptions impatient = gives_up_soon();
  auto first = client.read<std::uint32_t>(node, 0x1000, 0, impatient);
  EXPECT_EQ(await(*this, first).error().code, Errc::timeout);
  reply("605#4000100000000000", {"585#4300100022222222"});
  server.send("585#4300100011111111");  // outranks the request queued now
  auto second = client.read<std::uint32_t>(node, 0x1000, 0);
  EXPECT_EQ(*await(*this, second), 0x22222222U);
  EXPECT_EQ(client.late(node), 1U);
  EXPECT_EQ(client.surplus(node), 0U) << "late is not surplus";
}

// What the first late answer took, and a quarter more, is waited for from then on, by whatever patience it is asked.
TEST_F(Client, ALateAnswerTeachesPatience) {
  co::SdoPatience patience{.most = 100ms};
  co::SdoOptions impatient = gives_up_soon();
  impatient.least = &patience.times;
  client.set_late_window(5s, &patience);
  auto first = client.read<std::uint32_t>(node, 0x1000, 0, impatient);
  EXPECT_EQ(await(*this, first).error().code, Errc::timeout);
  run(20ms);
  server.send("585#4300100011111111");
  run(1ms);
  EXPECT_EQ(client.late(node), 1U);
  EXPECT_GE(patience.times[5], 50ms) << "it took 40 ms";
  EXPECT_LE(patience.times[5], 55ms);
  auto second = client.read<std::uint32_t>(node, 0x1000, 0, impatient);
  Flag flag;
  ASSERT_FALSE(second.begin(executor, flag));
  run(45ms);
  EXPECT_FALSE(flag.set) << "it is waited for";
  server.send("585#4300100022222222");
  run(1ms);
  EXPECT_EQ(*second.await_resume(), 0x22222222U);
  for (unsigned other = 0; other < 128; ++other)
    EXPECT_TRUE(other == 5 || patience.times[other] == rt::Duration{}) << other;
}

// Not above the most, never downwards, and not by the answer to a download: the device may be saving.
TEST_F(Client, PatienceIsLearntUpwardsAndWithinBounds) {
  co::SdoPatience patience{.most = 100ms};
  client.set_late_window(5s, &patience);
  const auto ask_late = [&](rt::Duration behind) {
    auto read = client.read<std::uint32_t>(node, 0x1000, 0, gives_up_soon());
    EXPECT_EQ(await(*this, read).error().code, Errc::timeout);
    run(behind);
    server.send("585#4300100011111111");
    run(1ms);
    return patience.times[5];
  };
  auto save = client.write<std::uint32_t>(node, 0x1010, 1, 0x65766173, gives_up_soon());
  EXPECT_EQ(await(*this, save).error().code, Errc::timeout);
  run(30ms);
  server.send("585#6010100100000000");
  run(1ms);
  EXPECT_EQ(client.late(node), 1U);
  EXPECT_EQ(patience.times[5], rt::Duration{}) << "a download";
  EXPECT_EQ(ask_late(400ms), 100ms);
  EXPECT_EQ(ask_late(20ms), 100ms);
}

// A slow device refuses a download that was sent twice; the second refusal comes when the object is read.
TEST_F(Client, S15_ALateRefusalOfADownloadIsNoAnswerToTheUploadBehindIt) {
  const co::SdoOptions twice = gives_up_soon(2);
  auto first = client.write<std::uint16_t>(node, 0x1017, 0, 500, twice);
  Flag flag;
  ASSERT_FALSE(first.begin(executor, flag));
  run(twice.timeout + 1ms);  // it is sent again
  server.send("585#8017100002000106");
  run(1ms);
  ASSERT_TRUE(flag.set);
  EXPECT_EQ(first.await_resume().error().detail, 0x06010002U);
  auto second = client.read<std::uint16_t>(node, 0x1017, 0);
  Flag read;
  ASSERT_FALSE(second.begin(executor, read));
  run(1ms);
  server.send("585#8017100002000106");
  run(1ms);
  EXPECT_FALSE(read.set) << "it says that 1017h cannot be written";
  server.send("585#4B171000E8030000");
  run(1ms);
  ASSERT_TRUE(read.set);
  EXPECT_EQ(*second.await_resume(), 1000U);
  EXPECT_EQ(client.late(node), 1U);
}

// Not late, it is the device's answer, however odd.
TEST_F(Client, S15_ARefusalOfADownloadAnswersAnUploadWhereNothingIsOwed) {
  reply("605#4017100000000000", {"585#8017100002000106"});
  auto odd = client.read<std::uint16_t>(node, 0x1017, 0);
  EXPECT_EQ(await(*this, odd).error().detail, 0x06010002U);
}

// An answer is late for a while only, however many requests follow: a second device under the node-ID is not taken for
// it.
TEST_F(Client, S15_AnOldSilenceExcusesNoSecondAnswer) {
  client.set_late_window(100ms);
  const co::SdoOptions impatient = gives_up_soon();
  auto silent = client.read<std::uint32_t>(node, 0x1000, 0, impatient);
  EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
  run(200ms);
  reply("605#4000100000000000", {"585#4300100022222222"});
  auto answered = client.read<std::uint32_t>(node, 0x1000, 0);
  EXPECT_EQ(*await(*this, answered), 0x22222222U);
  server.send("585#4300100033333333");
  run(1ms);
  EXPECT_EQ(client.surplus(node), 1U);
  EXPECT_EQ(client.late(node), 0U);
}

// Nor do the requests that are answered meanwhile make it younger.
TEST_F(Client, S15_AnswersDoNotProlongAnOldSilence) {
  client.set_late_window(100ms);
  const co::SdoOptions impatient = gives_up_soon();
  auto silent = client.read<std::uint32_t>(node, 0x1000, 0, impatient);
  EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
  for (int i = 0; i < 4; ++i) {
    run(40ms);
    reply("605#4000100000000000", {"585#4300100022222222"});
    auto answered = client.read<std::uint32_t>(node, 0x1000, 0);
    EXPECT_EQ(*await(*this, answered), 0x22222222U);
  }
  server.send("585#4300100033333333");
  run(1ms);
  EXPECT_EQ(client.surplus(node), 1U);
  EXPECT_EQ(client.late(node), 0U);
}

// Nor does a new silence revive it: one answer may be late, not two.
TEST_F(Client, S15_ANewSilenceDoesNotReviveAnOldOne) {
  client.set_late_window(100ms);
  const co::SdoOptions impatient = gives_up_soon(0);
  for (const auto pause : {0ms, 0ms, 200ms}) {
    run(pause);
    auto silent = client.read<std::uint32_t>(node, 0x1000, 0, impatient);
    EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
  }
  for (int i = 0; i < 2; ++i) {
    server.send("585#4300100033333333");
    run(1ms);
  }
  EXPECT_EQ(client.late(node), 1U);
  EXPECT_EQ(client.surplus(node), 1U);
}

// Nobody was there when it was asked first: the device that boots then has nothing late to say.
TEST_F(Client, S15_ASilenceBeforeABootUpExcusesNoSecondAnswer) {
  const co::SdoOptions impatient = gives_up_soon(1);
  auto silent = client.read<std::uint32_t>(node, 0x1018, 1, impatient);
  EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
  client.booted(node);
  reply("605#4018100100000000", {"585#4318100101000000"});
  auto answered = client.read<std::uint32_t>(node, 0x1018, 1);
  EXPECT_EQ(*await(*this, answered), 1U);
  server.send("585#4318100133333333");
  run(1ms);
  EXPECT_EQ(client.late(node), 0U);
  EXPECT_EQ(client.surplus(node), 1U);
}

// A request that is on its way as the device boots is still to be answered, late or not.
TEST_F(Client, S15_ABootUpWhileARequestIsOpen) {
  const co::SdoOptions impatient = gives_up_soon();
  auto silent = client.read<std::uint32_t>(node, 0x1018, 1, impatient);
  Flag flag;
  ASSERT_FALSE(silent.begin(executor, flag));
  run(10ms);
  client.booted(node);
  run(20ms);
  ASSERT_TRUE(flag.set);
  EXPECT_EQ(silent.await_resume().error().code, Errc::timeout);
  server.send("585#4318100101000000");
  run(1ms);
  EXPECT_EQ(client.late(node), 1U);
  EXPECT_EQ(client.surplus(node), 0U);
}

// What a request left unanswered is owed for is its own object: a second answer about another one is a second device's.
TEST_F(Client, S15_ASilenceExcusesNoSecondAnswerAboutAnotherObject) {
  const co::SdoOptions impatient = gives_up_soon(2);
  auto silent = client.read<std::uint32_t>(node, 0x1000, 0, impatient);
  EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
  reply("605#4018100100000000", {"585#4318100101000000"});
  auto answered = client.read<std::uint32_t>(node, 0x1018, 1);
  EXPECT_EQ(*await(*this, answered), 1U);
  server.send("585#4300100033333333");
  run(1ms);
  EXPECT_EQ(client.late(node), 1U);
  EXPECT_EQ(client.surplus(node), 0U);
  server.send("585#4318100133333333");
  run(1ms);
  EXPECT_EQ(client.late(node), 1U);
  EXPECT_EQ(client.surplus(node), 1U);
}

// Silence ends in time, says so, and tells the server once (HU.22: optional).
TEST_F(Client, TimeoutAbortsOnceAndSaysNoAnswer) {
  auto op = client.read<std::uint32_t>(node, 0x1000, 0);
  const auto value = await(*this, op);
  EXPECT_EQ(value.error().code, Errc::timeout);
  EXPECT_EQ(value.error().node, 5);
  EXPECT_EQ(executor.now(), at(1s) + wire.frame_time);
  run(10s);
  EXPECT_EQ(wire.log, (Log{"605#4000100000000000", "605#8000100000000405"}));
  auto quiet = client.options();
  quiet.abort_on_timeout = false;
  auto silent = client.read<std::uint32_t>(node, 0x1000, 0, quiet);
  EXPECT_EQ(await(*this, silent).error().code, Errc::timeout);
  run(10s);
  EXPECT_EQ(wire.log.size(), 3U);
}

// HU.21: it is told whether the frame left.
TEST_F(Client, NeverLeftIsNotNoAnswer) {
  station.port.mute = true;
  auto op = client.read<std::uint32_t>(node, 0x1000, 0);
  EXPECT_EQ(await(*this, op).error().code, Errc::bus);
  EXPECT_EQ(station.port.queued(), 0U) << "the request is withdrawn";
  station.port.mute = false;
  for (const auto why : {can::Queued::bus_off, can::Queued::listen_only, can::Queued::closed}) {
    station.port.refuses = why;
    auto refused = client.read<std::uint32_t>(node, 0x1000, 0);
    EXPECT_EQ(await(*this, refused).error().code, Errc::bus);
  }
  station.port.refuses = can::Queued::full;
  auto full = client.read<std::uint32_t>(node, 0x1000, 0);
  const auto begun = executor.now();
  EXPECT_EQ(await(*this, full).error().code, Errc::bus);
  EXPECT_EQ(executor.now() - begun, 1s);
  EXPECT_TRUE(wire.log.empty());
  // A queue that is full for a while only delays.
  reply("605#4000100000000000", {"585#4300100092010200"});
  auto delayed = client.read<std::uint32_t>(node, 0x1000, 0);
  Flag flag;
  delayed.begin(executor, flag);
  run(30ms);
  station.port.refuses.reset();
  run(30ms);
  ASSERT_TRUE(flag.set);
  EXPECT_TRUE(delayed.await_resume());
}

// The window starts when the request is on the wire: a bus that is busy for longer than the time-out is not silence.
TEST_F(Client, WindowStartsOnTheWire) {
  reply("605#4000100000000000", {"585#4300100092010200"});
  auto options = client.options();
  options.timeout = 5ms;
  station.port.mute = true;
  auto op = client.read<std::uint32_t>(node, 0x1000, 0, options);
  Flag flag;
  op.begin(executor, flag);
  run(500ms);
  station.port.mute = false;
  wire.wake();
  run(5ms);
  ASSERT_TRUE(flag.set);
  EXPECT_TRUE(op.await_resume());
}

TEST_F(Client, RetriesStartTheTransferAnew) {
  auto options = client.options();
  options.timeout = 20ms;
  options.retries = 2;
  reply("605#4008100000000000", {"585#410810000A000000"});
  reply("605#6000000000000000", {"585#0061626364656667"});
  reply("605#7000000000000000", {"585#1968696A00000000"});
  int lost = 0;
  wire.lose = [&](const can::Frame& f) { return f.id == 0x585 && f.data[0] == 0x19 && lost++ < 2; };
  auto op = client.upload(node, 0x1008, 0, options);
  const auto value = await(*this, op);
  ASSERT_TRUE(value);
  EXPECT_EQ(value->text(), "abcdefghij");
  EXPECT_EQ(std::ranges::count(wire.log, "605#4008100000000000"), 3);
  lost = -1000;
  auto hopeless = client.upload(node, 0x1008, 0, options);
  EXPECT_EQ(await(*this, hopeless).error().code, Errc::timeout);
}

// A server with a receive buffer of one frame loses what comes right behind a heartbeat, of the same period as the
// client's time-out.
TEST_F(Client, RetriesDoNotKeepStepWithAPeriodicFrame) {
  auto options = client.options();
  options.timeout = 20ms;
  options.retries = 2;
  reply("605#4000100000000000", {"585#4300100001000000"});
  const rt::Time heartbeat = executor.now();
  wire.lose = [&](const can::Frame& f) {
    return f.id == 0x605 && (executor.now() - heartbeat) % rt::Duration(20ms) < rt::Duration(1ms);
  };
  auto op = client.upload(node, 0x1000, 0, options);
  EXPECT_TRUE(await(*this, op));
}

TEST_F(Client, OneNodeOneTransferAtATimeOthersInParallel) {
  reply("605#4000100000000000", {"585#4300100001000000"});
  reply("605#4001100000000000", {"585#4301100002000000"});
  reply("606#4000100000000000", {"586#4300100003000000"});
  auto a = client.read<std::uint32_t>(node, 0x1000, 0);
  auto b = client.read<std::uint32_t>(node, 0x1001, 0);
  auto c = client.read<std::uint32_t>(NodeId(6), 0x1000, 0);
  Flag fa, fb, fc;
  a.begin(executor, fa);
  b.begin(executor, fb);
  c.begin(executor, fc);
  run(10ms);
  EXPECT_EQ(*a.await_resume(), 1U);
  EXPECT_EQ(*b.await_resume(), 2U);
  EXPECT_EQ(*c.await_resume(), 3U);
  EXPECT_LT(std::ranges::find(wire.log, "585#4300100001000000"), std::ranges::find(wire.log, "605#4001100000000000"));
  EXPECT_LT(std::ranges::find(wire.log, "606#4000100000000000"), std::ranges::find(wire.log, "605#4001100000000000"));
}

// HC5.1: cancelled when the node resets or the client goes, with no waiter left behind; in any order.
TEST_F(Client, CancelAndDestroyAtAnyTime) {
  {
    auto a = client.upload(node, 0x1000, 0);
    auto b = client.upload(node, 0x1001, 0);
    Flag fa, fb;
    a.begin(executor, fa);
    b.begin(executor, fb);
    run(1ms);
    client.cancel(node);
    run(1ms);
    EXPECT_TRUE(fa.set && fb.set);
    const auto ended = a.await_resume();
    EXPECT_EQ(ended.error().code, Errc::cancelled);
    EXPECT_EQ(std::string(ended.error().text), "the node booted during the SDO transfer");
    EXPECT_EQ(b.await_resume().error().code, Errc::cancelled);
    EXPECT_FALSE(client.busy(node));
  }
  {
    Flag fb;
    auto b = client.upload(node, 0x1001, 0);
    {
      auto a = client.upload(node, 0x1000, 0);
      Flag fa;
      a.begin(executor, fa);
      b.begin(executor, fb);
    }
    reply("605#4001100000000000", {"585#4301100002000000"});
    run(10ms);
    EXPECT_TRUE(fb.set) << "the next in line goes on when the first is destroyed";
  }
  {
    reply("605#4008100000000000", {"585#410810000A000000"});
    auto a = client.upload(node, 0x1008, 0);
    Flag fa;
    a.begin(executor, fa);
    run(10ms);
    wire.log.clear();
  }
  run(10ms);
  EXPECT_EQ(wire.log, (Log{"605#8008100000000008"})) << "a segmented transfer is aborted on the bus";
}

TEST(SdoClientLife, ClientDestroyedBeforeItsOperations) {
  Bench b;
  Station station(b.wire);
  Peer server(b.wire, co::all_sdo_requests);
  std::optional<co::SdoClient> client(std::in_place, station.dispatcher);
  auto op = client->upload(NodeId(5), 0x1000, 0);
  auto waiting = client->upload(NodeId(5), 0x1001, 0);
  Flag flag, other;
  op.begin(b.executor, flag);
  waiting.begin(b.executor, other);
  b.run(1ms);
  client.reset();
  b.run(10s);
  EXPECT_TRUE(flag.set && other.set);
  EXPECT_EQ(op.await_resume().error().code, Errc::cancelled);
}

TEST_F(Client, UnconfiguredNodeIsInvalid) {
  auto op = client.read<std::uint32_t>(NodeId(), 0x1000, 0);
  EXPECT_EQ(await(*this, op).error().code, Errc::invalid);
  run(1s);
  EXPECT_TRUE(wire.log.empty());
}

// Two nodes with one node-ID: the second answer to one request is told.
TEST_F(Client, SecondAnswerToOneRequestIsSurplus) {
  reply("605#4018100400000000", {"585#431810040A000000"});
  Peer clone(wire, co::all_sdo_requests, [](Peer& self, const can::Frame& f) {
    if (f.data[0] == 0x40) self.send("585#431810040B000000");
  });
  auto op = client.read<std::uint32_t>(node, 0x1018, 4);
  EXPECT_EQ(*await(*this, op), 0x0AU);
  run(1ms);
  EXPECT_EQ(client.surplus(node), 1U);
  EXPECT_EQ(surplus.log, (Log{"5 585#431810040B000000"}));
  // Also when it comes while the next request waits.
  auto next = client.read<std::uint32_t>(node, 0x1018, 4);
  auto other = client.read<std::uint32_t>(node, 0x1018, 1);
  Flag fn, fo;
  next.begin(executor, fn);
  other.begin(executor, fo);
  run(10ms);
  EXPECT_TRUE(fn.set);
  EXPECT_GE(client.surplus(node), 2U);
  EXPECT_EQ(client.late(node), 0U);
}

// The clone answers the initiate of a segmented upload too, when the segments are on their way already.
TEST_F(Client, SurplusInitiateAnswerDoesNotEndASegmentedTransfer) {
  reply("605#4008100000000000", {"585#410810000A000000"});
  auto op = client.upload(node, 0x1008, 0);
  Flag flag;
  op.begin(executor, flag);
  run(2ms);
  server.send("585#4108100005000000");
  run(1ms);
  EXPECT_FALSE(flag.set);
  EXPECT_EQ(client.surplus(node), 1U);
  server.send("585#0061626364656667");
  reply("605#7000000000000000", {"585#1968696A00000000"});
  run(2ms);
  ASSERT_TRUE(flag.set);
  EXPECT_EQ(op.await_resume()->text(), "abcdefghij");
}

TEST_F(Client, ASingleHonestNodeNeverCausesSurplus) {
  reply("605#4018100400000000", {"585#431810040A000000"});
  for (int i = 0; i < 50; ++i) {
    auto op = client.read<std::uint32_t>(node, 0x1018, 4);
    ASSERT_TRUE(await(*this, op));
  }
  server.send("585#8000100000000405");  // a server that gives up by itself
  run(1s);
  EXPECT_EQ(client.surplus(node), 0U);
  EXPECT_EQ(client.late(node), 0U);
}

// Another client of the bus on the default channel: its requests are heard, so their answers are known to be its.
struct BesideAnother : Client {
  BesideAnother() { client.heed_other_clients(); }
  Peer another{wire, co::all_sdo_responses, [](Peer&, const can::Frame&) {}};
  void asks(const char* request) {
    another.send(request);
    run(2ms);
  }
  // What the node holds, by a client of its own.
  void read_serial() {
    auto op = client.read<std::uint32_t>(node, 0x1018, 4);
    EXPECT_EQ(*await(*this, op), 0x0AU);
    run(2ms);
  }
};

TEST_F(BesideAnother, AnAnswerToItIsNoSecondAnswer) {
  reply("605#4018100400000000", {"585#431810040A000000"});
  reply("605#4000100000000000", {"585#4300100092010200"});
  reply("605#2B171000E8030000", {"585#6017100000000000"});
  for (int i = 0; i < 3; ++i) {
    asks("605#4000100000000000");
    asks("605#2B171000E8030000");
    asks("605#4018100400000000");
    read_serial();
  }
  // Its question for the same object is on the wire between ours and the answer.
  auto op = client.read<std::uint32_t>(node, 0x1018, 4);
  Flag flag;
  op.begin(executor, flag);
  another.send("605#4018100400000000");
  run(5ms);
  EXPECT_TRUE(flag.set);
  EXPECT_EQ(client.surplus(node), 0U);
  EXPECT_TRUE(surplus.log.empty());
}

TEST_F(BesideAnother, TwoDevicesAnswerItTwice) {
  reply("605#4018100400000000", {"585#431810040A000000"});
  Peer clone(wire, co::all_sdo_requests, [](Peer& self, const can::Frame& f) {
    if (f.data[0] == 0x40) self.send("585#431810040B000000");
  });
  asks("605#4018100400000000");
  EXPECT_EQ(client.surplus(node), 1U);
}

// A master that died has asked a slow device, and the next one hears the answer.
TEST_F(BesideAnother, AnAnswerBeforeAnyQuestionIsNoSecondAnswer) {
  server.send("585#431810040A000000");
  run(1ms);
  EXPECT_EQ(client.surplus(node), 0U);
  reply("605#4018100400000000", {"585#431810040A000000"});
  read_serial();
  server.send("585#431810040B000000");
  run(1ms);
  EXPECT_EQ(surplus.log, (Log{"5 585#431810040B000000"}));
}

// One that asks for another object all the time hides no double.
TEST_F(BesideAnother, ASecondAnswerAboutAnotherObjectIsTold) {
  reply("605#4018100400000000", {"585#431810040A000000"});
  asks("605#4000100000000000");  // is never answered
  read_serial();
  server.send("585#431810040B000000");
  run(1ms);
  EXPECT_EQ(surplus.log, (Log{"5 585#431810040B000000"}));
}

TEST_F(BesideAnother, WhatItWasOwedExpires) {
  reply("605#4018100400000000", {"585#431810040A000000"});
  client.set_late_window(100ms);
  asks("605#4000100000000000");
  run(200ms);
  server.send("585#4300100092010200");
  run(1ms);
  EXPECT_EQ(client.surplus(node), 1U);
}

// Seven segments, of which the last ones have the first byte of an upload's answer, and its end.
TEST_F(BesideAnother, ItsBlockUploadIsItsOwn) {
  reply("605#4018100400000000", {"585#431810040A000000"});
  asks("605#A40810007F000000");
  server.send("585#C608100031000000");
  asks("605#A300000000000000");
  for (const char* segment :
       {"585#0141414141414141", "585#4041414141414141", "585#6241414141414141", "585#FF41414141414141"})
    server.send(segment);
  run(5ms);
  asks("605#A27F7F0000000000");
  server.send("585#C100000000000000");
  asks("605#A100000000000000");
  EXPECT_EQ(client.surplus(node), 0U);
  // What is left of it excuses nothing any more when it asks for something else.
  reply("605#4000100000000000", {"585#4300100092010200"});
  asks("605#4000100000000000");
  server.send("585#4300100092010200");
  run(1ms);
  EXPECT_EQ(client.surplus(node), 1U);
}

// A server's lies about lengths cost no memory and no endless transfer.
TEST_F(Client, HostileLengths) {
  auto options = client.options();
  options.longest = 100;
  reply("605#4008100000000000", {"585#41081000FFFFFFFF"});
  auto huge = client.upload(node, 0x1008, 0, options);
  EXPECT_EQ(await(*this, huge).error().detail, 0x05040005U);
  reply("605#4008100000000000", {"585#4008100000000000"});
  reply("605#6000000000000000", {"585#0061616161616161"});
  reply("605#7000000000000000", {"585#1061616161616161"});
  auto endless = client.upload(node, 0x1008, 0, options);
  EXPECT_EQ(await(*this, endless).error().detail, 0x05040005U);
  reply("605#6000000000000000", {"585#0E00000000000000"});
  auto empty = client.upload(node, 0x1008, 0, options);
  EXPECT_EQ(await(*this, empty).error().detail, 0x08000000U) << "at the first of them";
}

// Random frames on the response channel: never a crash, never a hang, and transfers before and after unharmed.
RC_GTEST_PROP(ClientProperty, AdversarialFrames, (std::uint64_t seed)) {
  Bench b;
  Random random(seed);
  Station station(b.wire), enemy(b.wire);
  od::Values values(test_description(), NodeId(5));
  co::SdoServerService server(enemy.dispatcher, values);
  co::SdoClient client(station.dispatcher);
  const auto honest = [&] {
    server.start(NodeId(5));
    auto op = client.read<std::uint32_t>(NodeId(5), 0x1000, 0);
    const auto value = await(b, op);
    server.stop();
    return value && *value == 0x00020192U;
  };
  RC_ASSERT(honest());
  for (int round = 0; round < 5; ++round) {
    auto options = client.options();
    options.timeout = 20ms;
    options.longest = 200;
    const Bytes data(random.below(30), 0x55);
    auto up = client.upload(NodeId(5), 0x1008, 0, options);
    auto down = client.download(NodeId(5), 0x1008, 0, data, options);
    Flag fu, fd;
    up.begin(b.executor, fu);
    down.begin(b.executor, fd);
    for (int i = 0; i < 40; ++i) {
      can::Frame f;
      f.id = 0x585;
      f.size = random.chance(950'000) ? 8 : static_cast<std::uint8_t>(random.below(8));
      for (unsigned k = 0; k < 8; ++k) f.data[k] = static_cast<std::uint8_t>(random.next());
      if (random.chance(700'000)) {
        f.data[1] = 0x08;
        f.data[2] = 0x10;
        f.data[3] = 0;
      }
      enemy.dispatcher.send(f);
      b.run(std::chrono::microseconds(random.below(2000)));
    }
    b.run(1s);
    RC_ASSERT(fu.set && fd.set);
  }
  RC_ASSERT(honest());
}

// A server that takes its time with every answer.
struct Lazy final : can::Handler, rt::Job {
  Lazy(Wire& wire, od::Values& values, std::size_t buffer, std::uint64_t seed)
      : station(wire), core(values, buffer), random(seed) {
    core.set_response_id(co::CobId(0x585));
    station.dispatcher.add(can::only(0x605), *this);
  }
  void received(const can::Frame& f, rt::Time) noexcept override {
    held = answer_of(core, f);
    if (held) station.dispatcher.executor().after(std::chrono::microseconds(random.below(4000)), *this);
  }
  void run() noexcept override { station.dispatcher.send(*std::exchange(held, std::nullopt)); }
  Station station;
  co::SdoServer core;
  Random random;
  std::optional<can::Frame> held;
};

// Any payload of 0 to 2000 bytes, down and up again, whatever the server's buffer and delays.
RC_GTEST_PROP(SdoProperty, AnyPayloadGoesDownAndUp, (std::uint64_t seed)) {
  Bench b;
  b.executor.perturb(seed);
  Random random(seed);
  const std::size_t edges[] = {0, 1, 3, 4, 5, 7, 8, 14, 15, 1999, 2000};
  const auto length = random.chance(300'000) ? edges[random.below(std::size(edges))] : random.below(2001);
  Bytes data(length);
  for (auto& byte : data) byte = static_cast<std::uint8_t>(random.next());
  od::Values values(test_description(), NodeId(5));
  const auto buffer = random.below(2200);
  Lazy server(b.wire, values, buffer, random.next());
  Station station(b.wire);
  co::SdoClient client(station.dispatcher);
  auto down = client.download(NodeId(5), 0x2004, 0, data);
  const auto done = await(b, down);
  if (length > 4 && length > buffer) {
    RC_ASSERT(!done && done.error().detail == 0x05040005U);
    RC_ASSERT(values.set_bytes({0x2004, 0}, data) == od::AbortCode::none);  // for the way up, which needs no buffer
  } else {
    RC_ASSERT(done.has_value());
  }
  const auto stored = values.bytes(ObjectRef{0x2004, 0});
  RC_ASSERT(Bytes(stored.begin(), stored.end()) == data);
  auto up = client.upload(NodeId(5), 0x2004, 0);
  const auto value = await(b, up);
  RC_ASSERT(value.has_value());
  RC_ASSERT(Bytes(value->bytes().begin(), value->bytes().end()) == data);
  RC_ASSERT(client.surplus(NodeId(5)) == 0U);
}

// HC5.3, HU.25: an SDO begun inside a callback neither blocks nor nests; it queues.
TEST_F(Client, AnSdoBegunInsideACallback) {
  reply("605#4000100000000000", {"585#4300100001000000"});
  struct Asker final : co::SdoClient::Observer {
    Asker(co::SdoClient& c, rt::Executor& e) : op(c.read<std::uint32_t>(NodeId(5), 0x1000, 0)), executor(e) {}
    void surplus(NodeId, const can::Frame&, rt::Time) noexcept override { op.begin(executor, flag); }
    co::SdoRead<std::uint32_t> op;
    rt::Executor& executor;
    Flag flag;
  } asker(client, executor);
  client.set_observer(&asker);
  server.send("585#4300100009000000");
  run(10ms);
  ASSERT_TRUE(asker.flag.set);
  EXPECT_EQ(*asker.op.await_resume(), 1U);
  client.set_observer(nullptr);
}

}  // namespace
