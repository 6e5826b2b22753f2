// Rows out of traces: words, names, values, and what the trace itself teaches.
#include "berth/decode/decoder.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/trace/candump.hpp"

namespace berth::decode {
namespace {

struct Kept {
  std::string words;
  Service service;
  unsigned node, frames;
  std::vector<Field> fields;
};

class Rows final : public decode::Rows {
 public:
  void row(const Row& row) override {
    ASSERT_NE(row.entry, nullptr);
    EXPECT_LE(row.began, row.entry->at);
    rows.push_back({std::string(row.words),
                    row.meaning.service,
                    row.meaning.node,
                    row.frames,
                    {row.fields.begin(), row.fields.end()}});
  }
  std::vector<Kept> rows;
};

std::shared_ptr<const od::Description> sensor() {
  using od::Access;
  using od::DataType;
  using od::Literal;
  od::DescriptionBuilder b;
  b.variable(0x1014, {.name = "COB-ID EMCY", .initial = Literal::node_id_plus(0x80)});
  b.object(0x1018, od::ObjectCode::record, "Identity object");
  b.sub(0x1018, {.sub = 1, .name = "Vendor-ID", .initial = Literal::number(0x1F)});
  b.variable(0x1008, {.name = "Manufacturer device name", .type = DataType::visible_string});
  b.variable(0x2000, {.name = "Position", .type = DataType::integer16, .mappable = true});
  b.variable(0x2001, {.name = "Speed", .type = DataType::real32, .mappable = true});
  b.variable(0x2002, {.name = "Limit switch", .type = DataType::boolean, .mappable = true});
  b.object(0x1400, od::ObjectCode::record, "RPDO communication parameter");
  b.sub(0x1400, {.sub = 1, .name = "COB-ID", .initial = Literal::node_id_plus(0x200)});
  b.object(0x1600, od::ObjectCode::array, "RPDO mapping");
  b.sub(0x1600, {.sub = 0, .type = DataType::unsigned8, .initial = Literal::number(2)});
  b.sub(0x1600, {.sub = 1, .initial = Literal::number(0x0005'0008)});  // a dummy byte
  b.sub(0x1600, {.sub = 2, .initial = Literal::number(0x2000'0010)});
  b.object(0x1800, od::ObjectCode::record, "TPDO communication parameter");
  b.sub(0x1800, {.sub = 1, .name = "COB-ID", .initial = Literal::node_id_plus(0x180)});
  b.object(0x1A00, od::ObjectCode::array, "TPDO mapping");
  b.sub(0x1A00, {.sub = 0, .type = DataType::unsigned8, .initial = Literal::number(3)});
  b.sub(0x1A00, {.sub = 1, .initial = Literal::number(0x2000'0010)});
  b.sub(0x1A00, {.sub = 2, .initial = Literal::number(0x2002'0001)});
  b.sub(0x1A00, {.sub = 3, .initial = Literal::number(0x2001'0020)});
  return b.build();
}

std::vector<Kept> rows_of(const std::string& frames, bool with_sensor = false, DecodeOptions options = {}) {
  Rows rows;
  Decoder decoder(rows, options);
  if (with_sensor) decoder.know(0, NodeId(5), {.name = "left sensor", .description = sensor()});
  std::string log;
  std::size_t at = 0;
  int number = 0;
  while (at < frames.size()) {
    const auto end = std::min(frames.find(' ', at), frames.size());
    log += trace::candump_line(std::chrono::milliseconds(number++), "can0", frames.substr(at, end - at)) + "\n";
    at = end + 1;
  }
  const auto reading = trace::read_candump(log, "t");
  EXPECT_TRUE(reading.findings.empty()) << to_string(reading.findings.front());
  for (const auto& entry : reading.trace.entries) decoder.entry(entry);
  decoder.finish();
  return std::move(rows.rows);
}

std::string words(const std::string& frames, bool with_sensor = false) {
  std::string all;
  for (const auto& row : rows_of(frames, with_sensor)) all += row.words + "\n";
  return all;
}

TEST(Decoder, ServicesByThemselves) {
  EXPECT_EQ(words("000#0105 000#8100 080# 080#07"),
            "NMT: start, node 5\nNMT: reset node, all nodes\nSYNC\nSYNC, counter 7\n");
  // 08:00:00.000 on day 1 after 1 January 1984
  EXPECT_EQ(words("100#0074B7010100"), "TIME: 1984-01-02 08:00:00.000\n");
  EXPECT_EQ(words("705#00 705#05 705#7F 785#00"),
            "Boot up of node 5\nHeartbeat of node 5: operational\nHeartbeat of node 5: pre-operational\nframe\n");
  EXPECT_EQ(words("705#R1 705#85 705#85"),
            "Node guarding of node 5\nNode guarding answer of node 5: operational, toggle 1\n"
            "Heartbeat of node 5: operational\n");
  // 00h is a boot-up message, and answers no question: the node was silent when it was asked.
  EXPECT_EQ(words("705#R1 705#00 705#7F"),
            "Node guarding of node 5\nBoot up of node 5\nNode guarding answer of node 5: pre-operational, toggle 0\n");
  EXPECT_EQ(words("185#0102 205#"), "TPDO 1 of node 5\nRPDO 1 of node 5\n");
  EXPECT_EQ(words("7E5#5100000000800000 7E5#0401000000000000").find("LSS Fastscan"), 0U);
  EXPECT_NE(words("085#3081110500000000").find("8130h life guard"), std::string::npos) << words("085#3081110500000000");
  EXPECT_NE(words("085#3081110500000000").find("register 11h (generic, communication), data 05 00 00 00 00"),
            std::string::npos);
  EXPECT_EQ(words("7C2#8000000000000000"), "AND IURS: phase 0, who is unknown?\n");
  EXPECT_EQ(words("7C2#8003123000000000"), "AND IURS: phase 3, the address begins with 0x123\n");
  EXPECT_EQ(words("18EEFF05#0100000000000080"), "Claim: node-ID 5 for NAME 0x8000000000000001\n");
  EXPECT_EQ(words("18EAFFFE#00EE00"), "Claim request: everybody\n");
}

TEST(Decoder, ErrorFramesOfSocketCan) {
  Rows rows;
  Decoder decoder(rows);
  trace::Entry entry;
  entry.error = true;
  entry.frame = can::Frame::base(0, {0, 0x08, 0x84, 0, 0, 0, 96, 12});
  entry.frame.id = 0x0C;
  decoder.entry(entry);
  ASSERT_EQ(rows.rows.size(), 1U);
  EXPECT_EQ(rows.rows[0].words,
            "error: controller (transmit warning), protocol (stuff, while sending); counters tx 96, rx 12");
  EXPECT_EQ(rows.rows[0].service, Service::error);
  // CAN_ERR_PROT_LOC_ACK of linux/can/error.h; a place that it does not have is not told.
  const auto told = [](std::uint8_t place) {
    can::Frame report = can::Frame::base(0, {0, 0, 0, place, 0, 0, 0, 0});
    report.id = 0xA8;
    std::string out;
    error_words(report, out);
    return out;
  };
  EXPECT_EQ(told(0x19), "error: no acknowledge, bus error, protocol, in the ACK slot");
  EXPECT_EQ(told(0x02), "error: no acknowledge, bus error, protocol, in the identifier");
  EXPECT_EQ(told(0xEE), "error: no acknowledge, bus error, protocol");
}

TEST(Decoder, ATransferIsOneRowWithNamesAndValues) {
  // Without a description: CiA 301's names, and numbers by their size.
  EXPECT_EQ(words("605#4018100100000000 585#431810011F000000"),
            "SDO read node 5 1018h:01 Identity object.Vendor-ID = 31 (0x0000001F)\n");
  EXPECT_EQ(words("605#2B171000F4010000 585#6017100000000000"),
            "SDO write node 5 1017h:00 Producer heartbeat time = 500 (0x01F4)\n");
  const std::string mapping = words("605#23001A0110001060 585#60001A0100000000");
  EXPECT_TRUE(mapping.ends_with(" = 1611661328 (0x60100010) = 6010h:00, 16 bit\n")) << mapping;
  EXPECT_EQ(words("605#4000200000000000 585#8000200000000206"),
            "SDO read node 5 2000h:00: abort by the server, 06020000h, object does not exist\n");
  // With one: its names and types, and the slot's name.
  EXPECT_EQ(words("605#4000200000000000 585#4B002000FEFF0000", true),
            "SDO read node 5 2000h:00 Position = -2 [left sensor]\n");
  EXPECT_EQ(words("605#4008100000000000 585#410810000A000000 605#6000000000000000 585#0042657274682064 "
                  "605#7000000000000000 585#1965766900000000",
                  true),
            "SDO read node 5 1008h:00 Manufacturer device name = \"Berth devi\" (segmented, 10 bytes, 6 frames) "
            "[left sensor]\n");
  EXPECT_EQ(words("605#4018100100000000 605#4018100200000000"),
            "SDO read node 5 1018h:01 Identity object.Vendor-ID: no answer\n"
            "SDO read node 5 1018h:02 Identity object.Product code: no answer\n");
  EXPECT_EQ(words("585#43181001FF000000"),
            "SDO of node 5 1018h:01 Identity object.Vendor-ID: belongs to no transfer that was seen to begin\n");
  EXPECT_EQ(words("605#40181001"), "SDO to node 5: not eight bytes\n");
}

TEST(Decoder, FieldsForPrograms) {
  const auto rows = rows_of("605#4018100100000000 585#431810011F000000 185#FEFF010000803F", true, {.fields = true});
  ASSERT_EQ(rows.size(), 2U);
  const auto value = [&](std::size_t row, const char* key) {
    for (const auto& f : rows[row].fields)
      if (f.key == key) return f.value;
    return std::string("?");
  };
  EXPECT_EQ(value(0, "object"), "1018h:01");
  EXPECT_EQ(value(0, "name"), "Identity object.Vendor-ID");
  EXPECT_EQ(value(0, "value"), "31 (0x0000001F)");
  EXPECT_EQ(value(0, "bytes"), "1F 00 00 00");
  EXPECT_EQ(value(0, "mode"), "expedited");
  EXPECT_EQ(value(0, "result"), "done");
  EXPECT_EQ(rows[0].frames, 2U);
  EXPECT_EQ(value(1, "Position"), "-2");
}

// Position 16 bits, one bit, then a REAL32 that begins at bit 17: 1.0 = 3F80 0000h, shifted by one.
TEST(Decoder, SignalsByName) {
  EXPECT_EQ(words("185#FEFF0100007F00", true),
            "TPDO 1 of node 5 [left sensor]: Position = -2, Limit switch = 1, Speed = 1\n");
  EXPECT_EQ(words("205#AA1000", true), "RPDO 1 of node 5 [left sensor]: Position = 16\n") << "a dummy is passed over";
  EXPECT_EQ(words("185#FE", true), "TPDO 1 of node 5 [left sensor]: too short for Position\n");
  EXPECT_EQ(words("205#AA10000102", true), "RPDO 1 of node 5 [left sensor]: Position = 16 (and 2 bytes more)\n");
  EXPECT_EQ(words("185#R", true), "TPDO 1 of node 5 [left sensor]: remote request\n");
}

// The trace shows how the mapping is changed: COB-ID off, count 0, one entry, count 1, COB-ID 285h on.
TEST(Decoder, LearnsFromWhatIsWritten) {
  const std::string change =
      "605#2300180185010080 585#6000180100000000 605#2F001A0000000000 585#60001A0000000000 "
      "605#23001A0110000020 585#60001A0100000000 605#2F001A0001000000 585#60001A0000000000 "
      "605#2300180185020000 585#6000180100000000 ";
  const auto all = words(change + "285#1000 185#1000", true);
  EXPECT_NE(all.find("TPDO 1 of node 5 [left sensor]: Position = 16\n"), std::string::npos) << all;
  EXPECT_NE(all.find("TPDO 1 of node 5 [left sensor]\n"), std::string::npos)
      << "185h is the predefined connection set's again: " << all;
  // Refused: nothing changes.
  const auto refused = words("605#2300180185010080 585#8000180122000008 185#10000100007F00", true);
  EXPECT_NE(refused.find("Position = 16"), std::string::npos) << refused;
}

TEST(Decoder, EveryFrameByItself) {
  const auto rows = rows_of("605#4018100100000000 585#431810011F000000 585#8000200000000206 585#83616D706C657300",
                            false, {.fold = false});
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_EQ(rows[0].words, "SDO to node 5: read 1018h:01 Identity object.Vendor-ID");
  EXPECT_EQ(rows[1].words, "SDO of node 5: value of 1018h:01 Identity object.Vendor-ID");
  EXPECT_EQ(rows[2].words, "SDO of node 5: abort 2000h:00, 06020000h, object does not exist");
  EXPECT_EQ(rows[3].words, "SDO of node 5: block transfer") << "a block's last segment is no abort";
  for (const auto& row : rows) EXPECT_EQ(row.frames, 1U);
}

TEST(Decoder, ServicesHaveNames) {
  for (std::size_t i = 0; i < services; ++i)
    EXPECT_EQ(parse_service(name(static_cast<Service>(i))), static_cast<Service>(i));
  EXPECT_FALSE(parse_service("telepathy"));
}

// 3210h is another thing in a drive than in an I/O module; 1000h says which it is, in the description or when it is
// read.
TEST(Decoder, AnEmergencyIsToldInTheWordsOfTheProfile) {
  Rows rows;
  Decoder decoder(rows);
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .initial = od::Literal::number(0x0002'0192)});  // CiA 402
  decoder.know(0, NodeId(5), {.name = "drive", .description = b.build()});
  trace::Entry entry;
  const auto say = [&](std::uint32_t id, std::vector<std::uint8_t> bytes) {
    entry.frame = can::Frame::base(id, bytes);
    decoder.entry(entry);
  };
  say(0x085, {0x10, 0x32, 0x05, 0, 0, 0, 0, 0});
  say(0x086, {0x10, 0x32, 0x05, 0, 0, 0, 0, 0});
  say(0x605, {0x40, 0x00, 0x10, 0, 0, 0, 0, 0});
  say(0x585, {0x43, 0x00, 0x10, 0, 0x91, 0x01, 0x07, 0});  // CiA 401
  say(0x085, {0x10, 0x32, 0x05, 0, 0, 0, 0, 0});
  decoder.finish();
  ASSERT_EQ(rows.rows.size(), 4U);
  EXPECT_NE(rows.rows[0].words.find("3210h DC link over-voltage"), std::string::npos) << rows.rows[0].words;
  EXPECT_NE(rows.rows[1].words.find("3210h internal voltage too high"), std::string::npos) << rows.rows[1].words;
  EXPECT_NE(rows.rows[3].words.find("3210h internal voltage too high"), std::string::npos) << rows.rows[3].words;
}

/// Names a value by its bytes; of one object nothing is known.
class Named final : public ValueWords {
 public:
  [[nodiscard]] bool knows(ObjectRef object) const override { return object.index != 0x2001; }
  [[nodiscard]] std::string words(ObjectRef object, od::DataType type,
                                  std::span<const std::uint8_t> bytes) const override {
    if (!knows(object) || type == od::DataType::none) return {};
    std::string all;
    for (const auto byte : bytes) all += " " + std::to_string(byte);
    return std::to_string(object.index) + all;
  }
};

// 2000h is mapped with 16 bits, 2002h with one, 2001h is not known; 1008h is longer than what is kept of it.
TEST(Decoder, WhatValuesMeanIsToldBehindThem) {
  Rows rows;
  Decoder decoder(rows, {.fields = true});
  decoder.know(0, NodeId(5),
               {.name = "s", .description = sensor(), .settings = {}, .words = std::make_shared<Named>()});
  const auto reading = trace::read_candump(
      "(1.0) can0 185#FEFF0100000000\n(1.1) can0 605#2B002000FEFF0000\n(1.2) can0 585#6000200000000000\n"
      "(1.3) can0 605#4000300000000000\n(1.4) can0 585#4300300007000000\n"
      "(1.5) can0 605#4000200000000000\n(1.6) can0 585#8000200000000206\n",
      "t");
  for (const auto& entry : reading.trace.entries) decoder.entry(entry);
  ASSERT_EQ(rows.rows.size(), 4U);
  EXPECT_NE(rows.rows[0].words.find("Position = -2 (8192 254 255), Limit switch = 1"), std::string::npos)
      << rows.rows[0].words;
  EXPECT_EQ(rows.rows[0].words.find("Speed = 0 ("), std::string::npos) << rows.rows[0].words;
  for (const auto& field : rows.rows[0].fields) {
    EXPECT_TRUE(field.key != "Position" || field.value == "-2") << "a program reads the number alone";
  }
  EXPECT_NE(rows.rows[1].words.find("2000h:00 Position = -2 = 8192 254 255"), std::string::npos) << rows.rows[1].words;
  const auto& fields = rows.rows[1].fields;
  const auto meaning = std::ranges::find(fields, "meaning", &Field::key);
  ASSERT_NE(meaning, fields.end());
  EXPECT_EQ(meaning->value, "8192 254 255");
  EXPECT_EQ(rows.rows[2].words.find("12288"), std::string::npos) << "the type of 3000h is not known";
  EXPECT_EQ(rows.rows[3].words.find("8192"), std::string::npos) << "an abort has no value";

  Rows half;
  Decoder other(half);
  other.know(0, NodeId(5),
             {.name = "s",
              .description = sensor(),
              .settings = {{{0x1A00, 1}, {0x08, 0, 0, 0x20}}},  // 8 bits of the 16 of 2000h
              .words = std::make_shared<Named>()});
  other.entry(reading.trace.entries.front());
  ASSERT_EQ(half.rows.size(), 1U);
  EXPECT_NE(half.rows[0].words.find("Position = FEh"), std::string::npos) << half.rows[0].words;
  EXPECT_EQ(half.rows[0].words.find("(8192"), std::string::npos) << "half a value means nothing";
}

// A link's network variable: its name is the link's, whatever the description calls its place.
TEST(Decoder, AnObjectThatALinkNamesHasThatName) {
  Rows rows;
  Decoder decoder(rows, {.fields = true});
  decoder.know(0, NodeId(5),
               {.name = "s", .description = sensor(), .named = {{{0x2000, 0}, "travel", od::DataType::unsigned16}}});
  const auto reading = trace::read_candump(
      "(1.0) can0 185#FEFF0100000000\n(1.1) can0 605#2B002000FEFF0000\n(1.2) can0 585#6000200000000000\n", "t");
  for (const auto& entry : reading.trace.entries) decoder.entry(entry);
  ASSERT_EQ(rows.rows.size(), 2U);
  EXPECT_NE(rows.rows[0].words.find(": travel = 65534, "), std::string::npos) << rows.rows[0].words;
  EXPECT_NE(rows.rows[1].words.find("2000h:00 travel = 65534"), std::string::npos) << rows.rows[1].words;
  EXPECT_EQ(rows.rows[0].words.find("Position"), std::string::npos) << rows.rows[0].words;
}

// Whatever is on the bus: every frame is in exactly one row.
RC_GTEST_PROP(Decoder, NoFrameIsLost, ()) {
  Rows rows;
  Decoder decoder(rows, {.fields = true});
  decoder.know(0, NodeId(5), {.name = "s", .description = sensor()});
  const auto count = *rc::gen::inRange<unsigned>(0, 200);
  for (unsigned i = 0; i < count; ++i) {
    trace::Entry entry;
    entry.at = std::chrono::milliseconds(i);
    auto bytes = *rc::gen::container<std::vector<std::uint8_t>>(8, rc::gen::arbitrary<std::uint8_t>());
    const auto id = *rc::gen::elementOf(std::vector<std::uint32_t>{0x605, 0x585, 0x605, 0x585, 0x185, 0x85, 0x705, 0});
    // Mostly commands that mean something, of few objects.
    bytes[0] = *rc::gen::elementOf(std::vector<std::uint8_t>{0x40, 0x43, 0x41, 0x60, 0x70, 0x00, 0x10, 0x01,
                                                             0x11, 0x20, 0x30, 0x21, 0x2F, 0x80, 0xC6, 0xA4,
                                                             0xC2, 0xA2, 0xA3, 0xA1, 0xC1, 0x81, 0x02});
    bytes[1] = 0x00;
    bytes[2] = *rc::gen::elementOf(std::vector<std::uint8_t>{0x18, 0x1A, 0x20});
    bytes[3] = *rc::gen::inRange<std::uint8_t>(0, 3);
    entry.frame = can::Frame::base(id, bytes);
    decoder.entry(entry);
  }
  decoder.finish();
  unsigned frames = 0;
  for (const auto& row : rows.rows) frames += row.frames;
  RC_ASSERT(frames == count);
}

}  // namespace
}  // namespace berth::decode
