// SDO server (docs/protocols/cia301.md §SDO; docs/hard-cases.md §1). Frames are written by hand from the standard's
// layouts.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/co/sdo_server.hpp"

#include "berth/base/random.hpp"
#include "dictionary.hpp"
#include "wire.hpp"

using namespace berth;
using namespace berth::test;
using od::AbortCode;

namespace {

using Bytes = std::vector<std::uint8_t>;

struct Server : ::testing::Test {
  explicit Server(std::size_t buffer = 64) : server(values, buffer) {
    server.set_response_id(co::CobId(0x585));
    values.attach(refuser, 0x2008);
  }
  // The answer's data as hex; "" when there is none.
  std::string ask(const std::string& data) {
    const auto answer = answer_of(server, *can::parse_frame("605#" + data));
    if (!answer) return "";
    EXPECT_EQ(answer->id, 0x585U);
    EXPECT_EQ(answer->size, 8);
    return can::to_string(*answer).substr(4);
  }
  static std::string aborted(const std::string& object, const std::string& code) { return "80" + object + code; }
  Bytes stored(std::uint16_t index) {
    const auto bytes = values.bytes(ObjectRef{index, 0});
    return {bytes.begin(), bytes.end()};
  }
  od::Values values{test_description(), NodeId(5)};
  Refuser refuser;
  co::SdoServer server;
};

// A7.1: initiate upload, the expedited answer.
TEST_F(Server, ExpeditedUpload) {
  EXPECT_EQ(ask("4000100000000000"), "4300100092010200");
  EXPECT_EQ(ask("4018100000000000"), "4F18100004000000");
  EXPECT_EQ(ask("4018100400000000"), "4318100444444444");
  values.set<std::uint16_t>({0x2001, 0}, 77);
  EXPECT_EQ(ask("4001200000000000"), "4B0120004D000000");
}

// A7.1: expedited download.
TEST_F(Server, ExpeditedDownload) {
  EXPECT_EQ(ask("2F0020002A000000"), "6000200000000000");
  EXPECT_EQ(stored(0x2000), (Bytes{0x2A}));
  EXPECT_EQ(ask("2B01200014000000"), "6001200000000000");
  EXPECT_EQ(stored(0x2001), (Bytes{0x14, 0}));
  EXPECT_EQ(ask("2303200061626364"), "6003200000000000");
  EXPECT_EQ(ask("2703200061626300"), "6003200000000000");
  EXPECT_EQ(values.get_text({0x2003, 0}), "abc");
}

// S17: e=1, s=0: the server takes the object's own length; a string takes all four.
TEST_F(Server, S17_ExpeditedDownloadWithoutSize) {
  EXPECT_EQ(ask("220020002A999999"), "6000200000000000");
  EXPECT_EQ(stored(0x2000), (Bytes{0x2A}));
  EXPECT_EQ(ask("2203200061626364"), "6003200000000000");
  EXPECT_EQ(values.get_text({0x2003, 0}), "abcd");
  EXPECT_EQ(ask("2205200061626364"), aborted("052000", "13000706"));
}

// A7.2: segmented upload.
TEST_F(Server, SegmentedUpload) {
  EXPECT_EQ(ask("4008100000000000"), "410810001A000000");
  EXPECT_EQ(ask("6000000000000000"), "0054696E79204E6F");
  EXPECT_EQ(ask("7000000000000000"), "106465202D204D65");
  EXPECT_EQ(ask("6000000000000000"), "00676120446F6D61");
  EXPECT_EQ(ask("7000000000000000"), "15696E7320210000");
  EXPECT_FALSE(server.busy());
}

// A7.2: segmented download.
TEST_F(Server, SegmentedDownloadWithSize) {
  EXPECT_EQ(ask("2105200008000000"), "6005200000000000");
  EXPECT_EQ(ask("0001020304050607"), "2000000000000000");
  EXPECT_EQ(stored(0x2005), Bytes(8, 0)) << "nothing is stored before the end";
  EXPECT_EQ(ask("1D08000000000000"), "3000000000000000");
  EXPECT_EQ(stored(0x2005), (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_FALSE(server.busy());
  EXPECT_EQ(ask("0009090909090909"), aborted("000000", "01000405")) << "nothing comes after the last segment";
}

// HC1.S1: segmented download, size not indicated.
TEST_F(Server, S1_SegmentedDownloadWithoutSize) {
  EXPECT_EQ(ask("2003200000000000"), "6003200000000000");
  EXPECT_EQ(ask("0061626364656667"), "2000000000000000");
  EXPECT_EQ(ask("1D68000000000000"), "3000000000000000");
  EXPECT_EQ(values.get_text({0x2003, 0}), "abcdefgh");
  // Also to an object of fixed size; and there a wrong total is refused at the end.
  EXPECT_EQ(ask("2005200000000000"), "6005200000000000");
  EXPECT_EQ(ask("0001020304050607"), "2000000000000000");
  EXPECT_EQ(ask("1D08000000000000"), "3000000000000000");
  EXPECT_EQ(stored(0x2005), (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_EQ(ask("2005200000000000"), "6005200000000000");
  EXPECT_EQ(ask("0909090900000000"), aborted("052000", "13000706"));
  EXPECT_EQ(stored(0x2005), (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
}

// HC1.S5: wrong toggle on a download segment and on an upload segment: 0503 0000, and the transfer is over.
TEST_F(Server, S5_WrongToggle) {
  ask("2105200008000000");
  EXPECT_EQ(ask("1001020304050607"), aborted("052000", "00000305"));
  EXPECT_EQ(ask("0001020304050607"), aborted("000000", "01000405"));
  ask("2105200008000000");
  ask("0001020304050607");
  EXPECT_EQ(ask("0D08000000000000"), aborted("052000", "00000305")) << "also on the last one";
  EXPECT_EQ(stored(0x2005), Bytes(8, 0));
  ask("4008100000000000");
  EXPECT_EQ(ask("7000000000000000"), aborted("081000", "00000305"));
  ask("4008100000000000");
  ask("6000000000000000");
  EXPECT_EQ(ask("6000000000000000"), aborted("081000", "00000305"));
  EXPECT_FALSE(server.busy());
}

// HC1.S13: an abort from the client ends the transfer with no answer, also when none is running.
TEST_F(Server, S13_AbortIsNeverAnswered) {
  EXPECT_EQ(ask("8000000000000008"), "");
  ask("2105200008000000");
  EXPECT_TRUE(server.busy());
  EXPECT_EQ(ask("8005200000000405"), "");
  EXPECT_FALSE(server.busy());
  EXPECT_EQ(ask("0001020304050607"), aborted("000000", "01000405"));
}

// HC1.S14: a client that was restarted begins anew; the server must not stay busy.
TEST_F(Server, S14_NewInitiateReplacesTheTransfer) {
  ask("2105200008000000");
  ask("0001020304050607");
  EXPECT_EQ(ask("4000100000000000"), "4300100092010200");
  EXPECT_FALSE(server.busy());
  ask("4008100000000000");
  ask("6000000000000000");
  EXPECT_EQ(ask("2105200008000000"), "6005200000000000");
  EXPECT_EQ(ask("0001020304050607"), "2000000000000000") << "the toggle is 0 again";
  EXPECT_EQ(ask("1D08000000000000"), "3000000000000000");
  EXPECT_EQ(stored(0x2005), (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
}

// HC1.S16: frames that are not 8 bytes long are not heard and disturb nothing; nor do remote frames.
TEST_F(Server, S16_WrongLengthIsIgnored) {
  ask("2105200008000000");
  for (const char* data : {"", "40", "40001000", "40001000000000", "R8", "R0"}) EXPECT_EQ(ask(data), "") << data;
  // A segment, an abort and a new initiate that lack a byte: the transfer is where it was.
  for (const char* data : {"000A0B0C0D0E0F", "80052000000000", "2F0020002A0000", "80"}) {
    EXPECT_EQ(ask(data), "") << data;
    EXPECT_TRUE(server.busy()) << data;
  }
  EXPECT_EQ(ask("0001020304050607"), "2000000000000000");
  EXPECT_EQ(ask("1D08000000000000"), "3000000000000000");
  EXPECT_EQ(stored(0x2005), (Bytes{1, 2, 3, 4, 5, 6, 7, 8}));
}

// S17: an object of 0 bytes, both ways.
TEST_F(Server, S17_ZeroBytes) {
  values.set_text({0x2003, 0}, "old");
  EXPECT_EQ(ask("2103200000000000"), "6003200000000000");
  EXPECT_EQ(ask("0F00000000000000"), "2000000000000000");
  EXPECT_EQ(values.get_text({0x2003, 0}), "");
  EXPECT_EQ(ask("4003200000000000"), "4103200000000000");
  EXPECT_EQ(ask("6000000000000000"), "0F00000000000000");
  EXPECT_FALSE(server.busy());
}

// S17: length mismatches: at the initiate where the size is known, else at the end.
TEST_F(Server, S17_LengthMismatch) {
  EXPECT_EQ(ask("2B00200001020000"), aborted("002000", "12000706"));
  EXPECT_EQ(ask("2F01200014000000"), aborted("012000", "13000706"));
  EXPECT_EQ(ask("2105200009000000"), aborted("052000", "12000706"));
  EXPECT_EQ(ask("2105200007000000"), aborted("052000", "13000706"));
  // More and fewer bytes than indicated.
  ask("2105200008000000");
  ask("0001020304050607");
  EXPECT_EQ(ask("1B08090000000000"), aborted("052000", "12000706"));
  ask("2105200008000000");
  EXPECT_EQ(ask("0101020304050607"), aborted("052000", "13000706"));
}

// S17: longer than the buffer: refused at the initiate, or when it overflows; longer than the object is told as that.
TEST_F(Server, S17_LongerThanTheBuffer) {
  EXPECT_EQ(ask("2103200041000000"), aborted("032000", "05000405"));
  EXPECT_EQ(ask("21032000FFFFFFFF"), aborted("032000", "12000706"));
  EXPECT_EQ(ask("2003200000000000"), "6003200000000000");
  for (int i = 0; i < 9; ++i)
    EXPECT_EQ(ask(i % 2 ? "1061616161616161" : "0061616161616161").substr(2), "00000000000000");
  EXPECT_EQ(ask("1061616161616161"), aborted("032000", "05000405"));
  EXPECT_EQ(values.get_text({0x2003, 0}), "");
}

// S17: uploads longer than the buffer go piece by piece; a length that changes meanwhile is refused, never mixed.
TEST_F(Server, S17_UploadLongerThanTheBuffer) {
  Bytes content(1000);
  for (std::size_t i = 0; i < content.size(); ++i) content[i] = static_cast<std::uint8_t>(i * 7);
  ASSERT_EQ(values.set_bytes({0x2004, 0}, content), AbortCode::none);
  EXPECT_EQ(ask("4004200000000000"), "41042000E8030000");
  Bytes got;
  for (bool toggle = false;; toggle = !toggle) {
    const auto answer = answer_of(server, *can::parse_frame(toggle ? "605#7000000000000000" : "605#6000000000000000"));
    ASSERT_TRUE(answer);
    const auto count = 7U - ((answer->data[0] >> 1U) & 7U);
    got.insert(got.end(), answer->data.begin() + 1, answer->data.begin() + 1 + count);
    if ((answer->data[0] & 1U) != 0) break;
    ASSERT_LE(got.size(), content.size());
  }
  EXPECT_EQ(got, content);
  ask("4004200000000000");
  ask("6000000000000000");
  ASSERT_EQ(values.set_bytes({0x2004, 0}, std::span(content).first(500)), AbortCode::none);
  EXPECT_EQ(ask("7000000000000000"), aborted("042000", "22000008"));
}

// S17: exactly as long as the buffer, and one byte more.
TEST_F(Server, S17_BufferToTheByte) {
  for (const bool fits : {true, false}) {
    EXPECT_EQ(ask("2003200000000000"), "6003200000000000");
    for (int i = 0; i < 9; ++i) ask(i % 2 ? "1061616161616161" : "0061616161616161");
    EXPECT_EQ(ask(fits ? "1D61000000000000" : "1B61610000000000"),
              fits ? "3000000000000000" : aborted("032000", "05000405"));
    EXPECT_EQ(values.get_text({0x2003, 0}).size(), 64U);
  }
}

TEST_F(Server, UploadWithinTheBufferIsOneConsistentValue) {
  values.set_text({0x2003, 0}, "aaaaaaaaaa");
  ask("4003200000000000");
  EXPECT_EQ(ask("6000000000000000"), "0061616161616161");
  values.set_text({0x2003, 0}, "bbbbbbbbbb");
  EXPECT_EQ(ask("7000000000000000"), "1961616100000000");
}

// S18: what the dictionary refuses, with its code.
TEST_F(Server, S18_AbortCodes) {
  EXPECT_EQ(ask("4000300000000000"), aborted("003000", "00000206"));
  EXPECT_EQ(ask("2F00300000000000"), aborted("003000", "00000206"));
  EXPECT_EQ(ask("4018100500000000"), aborted("181005", "11000906"));
  EXPECT_EQ(ask("4006200000000000"), "4F06200004000000");
  EXPECT_EQ(ask("4006200300000000"), aborted("062003", "11000906")) << "a gap";
  EXPECT_EQ(ask("4000100100000000"), aborted("001001", "11000906")) << "a VAR has no sub-index 1";
  EXPECT_EQ(ask("4002200000000000"), aborted("022000", "01000106"));
  EXPECT_EQ(ask("2300100001000000"), aborted("001000", "02000106"));
  EXPECT_EQ(ask("2108100004000000"), aborted("081000", "02000106"));
  EXPECT_EQ(ask("2B01200065000000"), aborted("012000", "31000906"));
  EXPECT_EQ(ask("2B01200009000000"), aborted("012000", "32000906"));
  EXPECT_EQ(ask("4004200000000000"), aborted("042000", "24000008")) << "a DOMAIN without a value";
  EXPECT_EQ(ask("4008200000000000"), aborted("082000", "22000008"));
  EXPECT_EQ(ask("2308200001000000"), aborted("082000", "22000008"));
}

TEST_F(Server, EveryAbortCodeOfTheDictionaryReachesTheWire) {
  for (const auto code : od::all_abort_codes()) {
    refuser.code = code;
    const auto answer = answer_of(server, *can::parse_frame("605#4008200000000000"));
    ASSERT_TRUE(answer);
    EXPECT_EQ(answer->data[0], 0x80);
    EXPECT_EQ(co::sdo::abort_code(*answer), code);
  }
}

// A7.9, HC1.S18: what no transfer is under way for, and what is no command: 0504 0001.
TEST_F(Server, A7_9_UnknownCommandSpecifier) {
  EXPECT_EQ(ask("E003200000000000"), aborted("000000", "01000405"));
  for (const char* stray : {"A300000000000000", "A2017F0000000000", "A100000000000000", "C100000000000000"}) {
    EXPECT_EQ(ask(stray), aborted("000000", "01000405")) << stray;
  }
  EXPECT_EQ(ask("6000000000000000"), aborted("000000", "01000405"));
  ask("4008100000000000");
  EXPECT_EQ(ask("0001020304050607"), aborted("081000", "01000405")) << "a download segment within an upload";
  ask("2105200008000000");
  EXPECT_EQ(ask("6000000000000000"), aborted("052000", "01000405"));
  EXPECT_FALSE(server.busy());
}

// Random requests: never a crash, always well-formed answers, and the next transfer is unharmed.
RC_GTEST_PROP(ServerProperty, AdversarialFrames, (std::uint64_t seed)) {
  od::Values values(test_description(), NodeId(5));
  const auto buffer = seed % 40;
  co::SdoServer server(values, buffer);
  server.set_response_id(co::CobId(0x585));
  Random random(seed);
  const std::uint16_t objects[] = {0x1000, 0x1008, 0x1018, 0x2000, 0x2003, 0x2004, 0x2005, 0x2007, 0x3000};
  for (int i = 0; i < 200; ++i) {
    can::Frame f;
    f.id = 0x605;
    f.size = random.chance(950'000) ? 8 : static_cast<std::uint8_t>(random.below(9));
    f.remote = random.chance(20'000);
    for (unsigned k = 0; k < 8; ++k) f.data[k] = static_cast<std::uint8_t>(random.next());
    if (random.chance(600'000)) store_le(f.data.data() + 1, objects[random.below(std::size(objects))]);
    if (random.chance(600'000)) f.data[3] = 0;
    if (random.chance(300'000)) store_le(f.data.data() + 4, static_cast<std::uint32_t>(random.below(64)));
    const bool was_busy = server.busy();
    const auto answer = answer_of(server, f);
    if (f.size != 8 || f.remote) {
      RC_ASSERT(!answer);
    }
    if (!was_busy && f.size == 8 && !f.remote) {
      RC_ASSERT(answer.has_value() == (f.data[0] >> 5 != 4));
    }
    if (answer) {
      RC_ASSERT(answer->id == 0x585U && answer->size == 8 && !answer->remote);
    }
    for (auto most = random.below(200); most > 0 && server.sending(); --most) {
      server.segments().segment(f);
      server.segments().advance();
      if (random.chance(900'000)) server.segments().confirm();
    }
    if (random.chance(50'000)) static_cast<void>(server.expire());
  }
  static_cast<void>(answer_of(server, *can::parse_frame("605#8000000000000000")));
  RC_ASSERT(!server.busy());
  const auto answer = answer_of(server, *can::parse_frame("605#4000100000000000"));
  RC_ASSERT(can::to_string(*answer) == "585#4300100092010200");
  RC_ASSERT(can::to_string(*answer_of(server, *can::parse_frame("605#2F0020002A000000"))) == "585#6000200000000000");
}

// ---- bound to a port

struct Service : ::testing::Test, Bench {
  Service() { service.start(NodeId(5)); }
  Log ask(const char* frame) {
    wire.log.clear();
    client.send(frame);
    run(10ms);
    return wire.log;
  }
  od::Values values{test_description(), NodeId(5)};
  Station device{wire};
  Station client{wire};
  co::SdoServerService service{device.dispatcher, values, 64};
};

TEST_F(Service, AnswersItsOwnChannelOnly) {
  EXPECT_EQ(ask("605#4000100000000000"), (Log{"605#4000100000000000", "585#4300100092010200"}));
  EXPECT_EQ(ask("606#4000100000000000"), (Log{"606#4000100000000000"}));
  service.stop();
  EXPECT_EQ(ask("605#4000100000000000"), (Log{"605#4000100000000000"}));
  service.start(NodeId(6));
  EXPECT_EQ(ask("606#4000100000000000").size(), 2U);
}

// HC1.S20: time-out in the middle of a transfer: 0504 0000, once.
TEST_F(Service, S20_TimeoutAbortsOnce) {
  service.set_timeout(200ms);
  ask("605#2105200008000000");
  run(180ms);
  EXPECT_EQ(wire.log.size(), 2U);
  EXPECT_EQ(ask("605#0001020304050607").size(), 2U) << "every segment gives new time";
  run(10s);
  EXPECT_EQ(wire.log, (Log{"605#0001020304050607", "585#2000000000000000", "585#8005200000000405"}));
  EXPECT_FALSE(service.busy());
  service.set_timeout(0ms);
  ask("605#4008100000000000");
  run(1000s);
  EXPECT_EQ(wire.log.size(), 2U) << "0 = waits for ever";
  EXPECT_TRUE(service.busy());
}

TEST_F(Service, AFullPortDelaysTheAnswer) {
  device.port.refuses = can::Queued::full;
  EXPECT_EQ(ask("605#4000100000000000").size(), 1U);
  device.port.refuses.reset();
  run(10ms);
  EXPECT_EQ(wire.log, (Log{"605#4000100000000000", "585#4300100092010200"}));
  // A new request gives up the answer that never left.
  device.port.refuses = can::Queued::full;
  client.send("605#4000100000000000");
  executor.advance(executor.now() + 150us);
  device.port.refuses.reset();
  ask("605#4008100000000000");
  run(10s);
  EXPECT_EQ(wire.log, (Log{"605#4008100000000000", "585#410810001A000000", "585#8008100000000405"}));
}

}  // namespace
