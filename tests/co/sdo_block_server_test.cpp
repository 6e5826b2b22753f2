// SDO block transfer, the server's side (docs/protocols/cia301.md §SDO; docs/hard-cases.md §1). Frames by hand from the
// standard's layouts.
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/base/crc.hpp"
#include "sdo_rig.hpp"

using namespace berth;
using namespace berth::test;

namespace {

struct BlockServer : ::testing::Test, ServerRig {
  // Sends a sub-block; the answer to its last segment.
  std::string send(const std::vector<std::string>& frames) {
    std::string last;
    for (const auto& frame : frames) last = ask(frame);
    return last;
  }
  // An acknowledgement: of how many, whatever block size is asked for next.
  void expect_acknowledged(const std::string& answer, unsigned count) {
    ASSERT_EQ(answer.size(), 16U) << answer;
    EXPECT_EQ(answer.substr(0, 2), "A2");
    EXPECT_EQ(std::stoul(answer.substr(2, 2), nullptr, 16), count);
    const auto size = std::stoul(answer.substr(4, 2), nullptr, 16);
    EXPECT_TRUE(size >= 1 && size <= 127) << answer;
    EXPECT_EQ(answer.substr(6), "0000000000");
  }
  void store(const Bytes& data) { ASSERT_EQ(values.set_bytes({0x2004, 0}, data), od::AbortCode::none); }
  // A new initiate is answered, whatever was under way.
  void expect_answers_anew() { EXPECT_EQ(ask("4000100000000000"), "4300100092010200"); }
  // Still serves.
  void expect_unharmed() {
    EXPECT_FALSE(server.busy());
    expect_answers_anew();
  }
};

// A7.3, A7.6: initiate with size and CRC, sub-block, end.
TEST_F(BlockServer, A7_3_Download) {
  const Bytes data = numbers(20);
  EXPECT_EQ(ask("C604200014000000"), "A40420007F000000");
  EXPECT_TRUE(server.busy());
  const auto frames = segments_of(data);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(ask(frames[0]), "");
  EXPECT_EQ(ask(frames[1]), "");
  expect_acknowledged(ask(frames[2]), 3);
  // 20 bytes in 3 segments: one unused; C1h with n = 1 in bits 4..2.
  EXPECT_EQ(ask("C5" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  EXPECT_EQ(stored(0x2004), data);
  expect_unharmed();
}

// A7.4, A7.6: initiate, start, sub-blocks, end.
TEST_F(BlockServer, A7_4_Upload) {
  const Bytes data = numbers(20);
  store(data);
  EXPECT_EQ(ask("A40420007F000000"), "C604200014000000");
  EXPECT_EQ(ask("A300000000000000"), "");
  EXPECT_EQ(segments(), segments_of(data));
  EXPECT_EQ(ask("A2037F0000000000"), "C5" + le16(slow_crc(data)) + "0000000000");
  EXPECT_EQ(ask("A100000000000000"), "");
  expect_unharmed();
}

TEST_F(BlockServer, SubBlocksOfTheSizeThatTheClientAsksFor) {
  const Bytes data = numbers(7 * 9 + 2);
  store(data);
  EXPECT_EQ(ask("A404200004000000"), "C604200041000000");
  ask("A300000000000000");
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin(), data.begin() + 28), false));
  EXPECT_EQ(ask("A204030000000000"), "");
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin() + 28, data.begin() + 49), false));
  EXPECT_EQ(ask("A2037F0000000000"), "");
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin() + 49, data.end())));
  EXPECT_EQ(ask("A2037F0000000000"), "D5" + le16(slow_crc(data)) + "0000000000");  // 65 bytes in 10: 5 unused
  EXPECT_EQ(ask("A100000000000000"), "");
  expect_unharmed();
}

// HC1.S3: block download without a size.
TEST_F(BlockServer, S3_DownloadWithoutSize) {
  const Bytes data = numbers(10);
  EXPECT_EQ(ask("C404200000000000"), "A40420007F000000");
  expect_acknowledged(send(segments_of(data)), 2);
  EXPECT_EQ(ask("D1" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  EXPECT_EQ(stored(0x2004), data);
}

// HU.33, HC1.S17: nothing at all, one byte, and lengths about a segment and a sub-block.
TEST_F(BlockServer, HU_33_Lengths) {
  for (const std::size_t length : {0U, 1U, 6U, 7U, 8U, 14U, 888U, 889U, 890U, 896U, 1778U, 1779U, 4000U}) {
    const Bytes data = numbers(length, length);
    ASSERT_EQ(ask("C6042000" + le16(static_cast<unsigned>(length)) + "0000"), "A40420007F000000");
    std::size_t done = 0;
    do {
      const auto count = std::min<std::size_t>(length - done, 889);
      const Bytes part(data.begin() + static_cast<std::ptrdiff_t>(done),
                       data.begin() + static_cast<std::ptrdiff_t>(done + count));
      const auto frames = segments_of(part, done + count == length);
      expect_acknowledged(send(frames), static_cast<unsigned>(frames.size()));
      done += count;
    } while (done < length);
    const auto unused = length == 0 ? 7 : (7 - length % 7) % 7;
    const auto end = static_cast<std::uint8_t>(0xC1U | (unused << 2U));
    ASSERT_EQ(ask(hex({end}) + le16(slow_crc(data)) + "0000000000"), "A100000000000000") << length;
    ASSERT_EQ(stored(0x2004), data);
    // And up again.
    ASSERT_EQ(ask("A40420007F000000"), "C6042000" + le16(static_cast<unsigned>(length)) + "0000");
    ask("A300000000000000");
    Bytes back;
    std::string answer;
    for (int blocks = 0; blocks < 10 && server.busy() && answer.empty(); ++blocks) {
      const auto frames = segments();
      for (const auto& f : frames) {
        for (std::size_t k = 2; k < 16; k += 2) {
          back.push_back(static_cast<std::uint8_t>(std::stoul(f.substr(k, 2), nullptr, 16)));
        }
      }
      answer = ask("A2" + hex({static_cast<std::uint8_t>(frames.size())}) + "7F0000000000");
    }
    ASSERT_EQ(answer, hex({end}) + le16(slow_crc(data)) + "0000000000") << length;
    back.resize(back.size() - unused);
    ASSERT_EQ(back, data);
    ASSERT_EQ(ask("A100000000000000"), "");
  }
  expect_unharmed();
}

// HC1.S4: a lost segment before the last: the last good one is acknowledged, and the sub-block is repeated from there.
TEST_F(BlockServer, S4_LostSegmentBeforeTheLast) {
  const Bytes data = numbers(35);
  ask("C604200023000000");
  const auto frames = segments_of(data);
  ask(frames[0]);
  ask(frames[1]);
  ask(frames[3]);  // the third is lost
  expect_acknowledged(ask(frames[4]), 2);
  EXPECT_TRUE(server.busy());
  // The repetition begins with number 1 at the byte behind the acknowledged ones.
  const auto again = segments_of(Bytes(data.begin() + 14, data.end()));
  expect_acknowledged(send(again), 3);
  EXPECT_EQ(ask("C1" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  EXPECT_EQ(stored(0x2004), data);
}

// HC1.S4: the first is lost: none is acknowledged. Also with two segments only.
TEST_F(BlockServer, S4_LostFirst) {
  const Bytes data = numbers(14);
  ask("C60420000E000000");
  const auto frames = segments_of(data);
  expect_acknowledged(ask(frames[1]), 0);
  expect_acknowledged(send(frames), 2);
  EXPECT_EQ(ask("C1" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  EXPECT_EQ(stored(0x2004), data);
}

// HC1.S4: the last is lost: after a time-out what there is is acknowledged, and the sub-block is not given up.
TEST_F(BlockServer, S4_LostLast) {
  const Bytes data = numbers(21);
  ask("C604200015000000");
  EXPECT_FALSE(server.collecting()) << "nothing was heard yet: no acknowledgement nobody waits for";
  const auto frames = segments_of(data);
  ask(frames[0]);
  ask(frames[1]);
  EXPECT_TRUE(server.collecting());
  const auto acknowledged = server.expire();
  ASSERT_TRUE(acknowledged);
  expect_acknowledged(can::to_string(*acknowledged).substr(4), 2);
  EXPECT_FALSE(server.collecting());
  expect_acknowledged(send(segments_of(Bytes(data.begin() + 14, data.end()))), 1);
  EXPECT_EQ(ask("C1" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  EXPECT_EQ(stored(0x2004), data);
}

// After a loss the sub-blocks become smaller, so that a receive buffer that overflowed does so no more.
TEST_F(BlockServer, BlockSizeShrinksAfterALoss) {
  ask("C404200000000000");
  const auto size = [](const std::string& answer) { return std::stoul(answer.substr(4, 2), nullptr, 16); };
  unsigned long before = 127;
  for (int i = 0; i < 4; ++i) {
    const auto answer = ask(hex({static_cast<std::uint8_t>(before), 0, 0, 0, 0, 0, 0, 0}));
    expect_acknowledged(answer, 0);
    EXPECT_LT(size(answer), before);
    before = size(answer);
  }
}

// A duplicated and a reordered segment.
TEST_F(BlockServer, DuplicatedAndReorderedSegments) {
  const Bytes data = numbers(28);
  ask("C60420001C000000");
  const auto frames = segments_of(data);
  for (const int i : {0, 0, 1, 1, 0, 2, 1}) EXPECT_EQ(ask(frames[static_cast<std::size_t>(i)]), "") << i;
  expect_acknowledged(ask(frames[3]), 4);
  EXPECT_EQ(ask(frames[3]), "") << "once more, while the end is awaited";
  EXPECT_EQ(ask("C1" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  EXPECT_EQ(stored(0x2004), data);
  // Two changed places: the first of them that comes late is asked for again.
  ask("C60420001C000000");
  ask(frames[0]);
  ask(frames[2]);
  ask(frames[1]);
  expect_acknowledged(ask(frames[3]), 2);
  expect_acknowledged(send(segments_of(Bytes(data.begin() + 14, data.end()))), 2);
  EXPECT_EQ(ask("C1" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  // The last frame of a sub-block comes twice: not the end of the next one.
  const Bytes more = numbers(892);
  ask("C60420007C030000");
  const auto first = segments_of(Bytes(more.begin(), more.begin() + 889), false);
  expect_acknowledged(send(first), 127);
  EXPECT_EQ(ask(first.back()), "");
  expect_acknowledged(send(segments_of(Bytes(more.begin() + 889, more.end()))), 1);
  EXPECT_EQ(ask("D1" + le16(slow_crc(more)) + "0000000000"), "A100000000000000");
}

// HC1.S6, A7.7: more acknowledged than sent.
TEST_F(BlockServer, S6_MoreAcknowledgedThanSent) {
  store(numbers(100));
  for (const char* acknowledged : {"A203020000000000", "A27F020000000000", "A2FF020000000000"}) {
    ask("A404200002000000");
    ask("A300000000000000");
    EXPECT_EQ(segments().size(), 2U);
    EXPECT_EQ(ask(acknowledged), "8004200003000405") << acknowledged;
    expect_unharmed();
  }
}

// HC1.S7: the block size changes while segments are repeated: what is acknowledged counts in the old sub-block.
TEST_F(BlockServer, S7_BlockSizeChangesWhileRepeating) {
  const Bytes data = numbers(70);
  store(data);
  ask("A404200006000000");
  ask("A300000000000000");
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin(), data.begin() + 42), false));
  EXPECT_EQ(ask("A204020000000000"), "") << "4 of 6, next 2";
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin() + 28, data.begin() + 42), false));
  EXPECT_EQ(ask("A201050000000000"), "") << "1 of 2, next 5";
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin() + 35, data.end())));
  EXPECT_EQ(ask("A200010000000000"), "") << "none of 5, next 1";
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin() + 35, data.begin() + 42), false));
  EXPECT_EQ(ask("A201040000000000"), "");
  EXPECT_EQ(segments(), segments_of(Bytes(data.begin() + 42, data.end())));
  EXPECT_EQ(ask("A204040000000000"), "C1" + le16(slow_crc(data)) + "0000000000");
  EXPECT_EQ(ask("A100000000000000"), "");
}

// HC1.S8, A7.7: block sizes 0 and 128 and above, at the initiate and in an acknowledgement.
TEST_F(BlockServer, S8_BlockSizes) {
  store(numbers(100));
  for (const char* size : {"00", "80", "FF"}) {
    EXPECT_EQ(ask("A4042000" + std::string(size) + "000000"), "8004200002000405") << size;
    ask("A404200002000000");
    ask("A300000000000000");
    segments();
    EXPECT_EQ(ask("A202" + std::string(size) + "0000000000"), "8004200002000405") << size;
    expect_unharmed();
  }
  for (const char* size : {"01", "7F"}) EXPECT_EQ(ask("A4042000" + std::string(size) + "000000").substr(0, 2), "C6");
}

// A7.7: a number that is not of the sub-block.
TEST_F(BlockServer, A7_7_SequenceNumbers) {
  ask("C604200064000000");
  EXPECT_EQ(ask("0001020304050607"), "8004200003000405") << "number 0 is never valid";
  EXPECT_FALSE(server.busy());
  // 80h is the abort, not a last segment with number 0.
  ask("C604200064000000");
  EXPECT_EQ(ask("8000000000000008"), "");
  expect_unharmed();
  // Beyond the block size that was asked for.
  ask("C404200000000000");
  std::string answer = ask("7F00000000000000");
  const auto size = std::stoul(answer.substr(4, 2), nullptr, 16);
  ASSERT_LT(size, 127U);
  EXPECT_EQ(ask("7E00000000000000"), "8004200003000405");
  expect_unharmed();
}

// HC1.S9, A7.6: CRC-16/XMODEM over the data only, not over unused bytes.
TEST_F(BlockServer, S9_CrcOverTheDataOnly) {
  const Bytes vector{'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(slow_crc(vector), 0x31C3);
  EXPECT_EQ(crc16(vector), 0x31C3);
  store(vector);
  ask("A40420007F000000");
  ask("A300000000000000");
  segments();
  EXPECT_EQ(ask("A2027F0000000000"), "D5C3310000000000");
  ask("A100000000000000");
  // Unused bytes may hold anything.
  ask("C604200009000000");
  ask("0131323334353637");
  ask("823839FFEEDDCCBB");
  EXPECT_EQ(ask("D5C3310000000000"), "A100000000000000");
  EXPECT_EQ(stored(0x2004), vector);
}

// HC1.S9: a wrong CRC: 0504 0004, and nothing is stored.
TEST_F(BlockServer, S9_WrongCrc) {
  store(numbers(3));
  ask("C604200007000000");
  ask("8101020304050607");
  EXPECT_EQ(ask("C112340000000000"), "8004200004000405");
  EXPECT_EQ(stored(0x2004), numbers(3));
  expect_unharmed();
}

// HC1.S10: CRC on one side only: a client that wants none is offered none. python-canopen takes the server's bit alone
// for a CRC that is there, and finds 0000h wrong.
TEST_F(BlockServer, S10_ClientWithoutCrc) {
  EXPECT_EQ(ask("C204200007000000"), "A00420007F000000");
  ask("8101020304050607");
  EXPECT_EQ(ask("C112340000000000"), "A100000000000000") << "what stands in the CRC's place is not looked at";
  EXPECT_EQ(ask("A00420007F000000"), "C204200007000000");
  ask("A300000000000000");
  segments();
  EXPECT_EQ(ask("A2017F0000000000"), "C100000000000000") << "0 where none is used";
  ask("A100000000000000");
  expect_unharmed();
}

// HC1.S11, A7.5: protocol switch threshold.
TEST_F(BlockServer, S11_A7_5_ProtocolSwitch) {
  store(numbers(20));
  // 20 bytes, threshold 20: a normal upload.
  EXPECT_EQ(ask("A404200002140000"), "4104200014000000");
  EXPECT_EQ(ask("6000000000000000").substr(0, 2), "00");
  EXPECT_EQ(ask("7000000000000000").substr(0, 2), "10");
  EXPECT_EQ(ask("6000000000000000").substr(0, 2), "03");
  // 20 bytes, threshold 19: in blocks. Threshold 0: never.
  EXPECT_EQ(ask("A404200002130000"), "C604200014000000");
  EXPECT_EQ(ask("A404200002000000"), "C604200014000000");
  // Four bytes: expedited, and the transfer is over.
  EXPECT_EQ(ask("A400100002040000"), "4300100092010200");
  EXPECT_FALSE(server.busy());
  EXPECT_EQ(ask("A400100002000000"), "C600100004000000");
}

// HC1.S12: a write error at the end: the abort only, no confirmation.
TEST_F(BlockServer, S12_WriteErrorAtTheEnd) {
  Refuser refuser;
  refuser.code = od::AbortCode::hardware;
  values.attach(refuser, 0x2004);
  ask("C204200007000000");
  expect_acknowledged(ask("8101020304050607"), 1);
  EXPECT_EQ(ask("C100000000000000"), "8004200000000606");
  expect_unharmed();
  // A value beyond its limit is a write error, too.
  ask("C201200002000000");
  ask("81FF000000000000");
  EXPECT_EQ(ask("D500000000000000"), "8001200031000906");
  expect_unharmed();
}

// Lengths that do not fit.
TEST_F(BlockServer, S17_LengthMismatch) {
  EXPECT_EQ(ask("C601200003000000"), "8001200012000706") << "U16 by 3";
  EXPECT_EQ(ask("C601200001000000"), "8001200013000706") << "U16 by 1";
  EXPECT_EQ(ask("C6002000FFFFFFFF"), "8000200012000706");
  EXPECT_EQ(ask("C600100004000000"), "8000100002000106") << "read-only";
  EXPECT_EQ(ask("C600300004000000"), "8000300000000206");
  EXPECT_EQ(ask("A402200002000000"), "8002200001000106") << "write-only";
  EXPECT_EQ(ask("A406200302000000"), "8006200311000906");
  // Fewer than indicated, known at the end; more, known when a segment is too many.
  ask("C204200008000000");
  ask("8101020304050607");
  EXPECT_EQ(ask("C100000000000000"), "8004200013000706");
  ask("C204200007000000");
  ask("0101020304050607");
  expect_acknowledged(ask("8201020304050607"), 2);
  EXPECT_EQ(ask("C100000000000000"), "8004200012000706");
  // Not indicated, and too long for the object.
  ask("C007200000000000");
  EXPECT_EQ(send(segments_of(numbers(28))).substr(0, 2), "A2");
  EXPECT_EQ(ask("C100000000000000"), "8007200012000706") << "20 bytes are the most";
  expect_unharmed();
}

TEST_F(BlockServer, LongerThanTheBuffer) {
  ServerRig small(30);
  EXPECT_EQ(small.ask("C60420001F000000"), "8004200005000405");
  small.ask("C404200000000000");
  std::string answer;
  for (const auto& f : segments_of(numbers(889), false)) answer = small.ask(f);
  EXPECT_EQ(answer, "8004200005000405");
  // To the byte.
  const Bytes data = numbers(30);
  small.ask("C40420001E000000");
  for (const auto& f : segments_of(data)) answer = small.ask(f);
  EXPECT_EQ(answer.substr(0, 4), "A205");
  EXPECT_EQ(small.ask("D5" + le16(slow_crc(data)) + "0000000000"), "A100000000000000");
  EXPECT_EQ(small.stored(0x2004), data);
  // An upload needs no such buffer.
  const Bytes large = numbers(4000);
  small.values.set_bytes({0x2004, 0}, large);
  EXPECT_EQ(small.ask("A40420007F000000"), "C6042000A00F0000");
  small.ask("A300000000000000");
  EXPECT_EQ(small.segments(), segments_of(Bytes(large.begin(), large.begin() + 889), false));
  // It ends when the length changes meanwhile.
  small.values.set_bytes({0x2004, 0}, numbers(3999));
  EXPECT_EQ(small.ask("A27F7F0000000000"), "8004200022000008");
}

// HC1.S13, HC1.S14: an abort and a new initiate in every state but the sub-block that comes in.
TEST_F(BlockServer, S13_S14_AbortAndNewInitiate) {
  store(numbers(100));
  const std::vector<std::vector<std::string>> beginnings{
      {"A404200002000000"},
      {"A404200002000000", "A300000000000000"},
      {"C604200007000000", "8101020304050607"},
  };
  for (const auto& beginning : beginnings) {
    send(beginning);
    EXPECT_TRUE(server.busy());
    EXPECT_EQ(ask("8004200000000008"), "");
    expect_unharmed();
    send(beginning);
    expect_answers_anew();
  }
  ask("C604200007000000");
  EXPECT_EQ(ask("8004200000000008"), "") << "within the sub-block";
  expect_unharmed();
}

// A command of another transfer within a block transfer.
TEST_F(BlockServer, UnexpectedCommands) {
  store(numbers(100));
  ask("A404200002000000");
  EXPECT_EQ(ask("6000000000000000"), "8004200001000405");
  ask("A404200002000000");
  EXPECT_EQ(ask("A202020000000000"), "8004200001000405") << "acknowledged before the start";
  ask("A404200002000000");
  ask("A300000000000000");
  EXPECT_EQ(ask("C100000000000000"), "8004200001000405");
  ask("C604200007000000");
  ask("8101020304050607");
  EXPECT_EQ(ask("0101020304050607"), "8004200001000405") << "one more segment behind the last";
  expect_unharmed();
}

// A client that acknowledges nothing, again and again, does not keep the server for ever.
TEST_F(BlockServer, NoProgressEnds) {
  store(numbers(100));
  ask("A404200002000000");
  ask("A300000000000000");
  std::string answer;
  int rounds = 0;
  for (; rounds < 1000 && answer.empty(); ++rounds) {
    segments();
    answer = ask("A200020000000000");
  }
  EXPECT_EQ(answer, "8004200000000405");
  EXPECT_LT(rounds, 128);
  ask("C404200000000000");
  for (rounds = 0; rounds < 128 && server.busy(); ++rounds) {
    answer = ask(hex({0x82, static_cast<std::uint8_t>(rounds), 0, 0, 0, 0, 0, 0}));
    if (answer.starts_with("A2")) answer = ask("0200000000000000");  // smaller sub-blocks: 2 may be their last
  }
  EXPECT_EQ(answer.substr(0, 2), "80");
  expect_unharmed();
}

// HC1.S20 in block transfer: every state but `collecting` ends by one abort.
TEST_F(BlockServer, S20_TimeoutInEveryState) {
  store(numbers(100));
  const std::vector<std::vector<std::string>> beginnings{
      {"A404200002000000"},
      {"A404200002000000", "A300000000000000"},
      {"C604200007000000"},
      {"C604200007000000", "8101020304050607"},
  };
  for (const auto& beginning : beginnings) {
    send(beginning);
    const auto abort = server.expire();
    ASSERT_TRUE(abort);
    EXPECT_EQ(can::to_string(*abort), "585#8004200000000405");
    EXPECT_FALSE(server.expire());
    expect_unharmed();
  }
}

}  // namespace
