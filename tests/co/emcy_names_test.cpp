// Emergency codes, the consumer object 1028h, and the rows that concern both ends (docs/protocols/cia301.md
// §Emergencies).
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/co/emcy_list.hpp"
#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using od::AbortCode;
namespace reg = berth::co::error_register;

namespace {

constexpr auto ok = AbortCode::none;

// Every class of CiA 301 and every single code, and CiA 401's.
TEST(EmcyNames, A6_4_EveryCodeOfTheStandard) {
  const std::vector<std::pair<std::uint16_t, const char*>> codes{{0x0000, "error reset"},
                                                                 {0x1000, "generic"},
                                                                 {0x2000, "current"},
                                                                 {0x2100, "input side"},
                                                                 {0x2200, "inside"},
                                                                 {0x2300, "output side"},
                                                                 {0x3000, "voltage"},
                                                                 {0x3100, "mains"},
                                                                 {0x3200, "inside"},
                                                                 {0x3300, "output"},
                                                                 {0x4000, "temperature"},
                                                                 {0x4100, "ambient"},
                                                                 {0x4200, "device"},
                                                                 {0x5000, "hardware"},
                                                                 {0x6000, "software"},
                                                                 {0x6100, "internal"},
                                                                 {0x6200, "user"},
                                                                 {0x6300, "data set"},
                                                                 {0x7000, "modules"},
                                                                 {0x8000, "monitoring"},
                                                                 {0x8100, "communication"},
                                                                 {0x8110, "overrun"},
                                                                 {0x8120, "error passive"},
                                                                 {0x8130, "heartbeat"},
                                                                 {0x8140, "bus-off"},
                                                                 {0x8150, "collision"},
                                                                 {0x8200, "protocol"},
                                                                 {0x8210, "length"},
                                                                 {0x8220, "length exceeded"},
                                                                 {0x8230, "MPDO"},
                                                                 {0x8240, "SYNC"},
                                                                 {0x8250, "RPDO time-out"},
                                                                 {0x9000, "external"},
                                                                 {0xF000, "additional"},
                                                                 {0xFF00, "device specific"},
                                                                 {0x2310, "too high"},
                                                                 {0x2320, "short circuit"},
                                                                 {0x2330, "load dump"},
                                                                 {0x3110, "input voltage too high"},
                                                                 {0x3120, "input voltage too low"},
                                                                 {0x3210, "internal voltage too high"},
                                                                 {0x3220, "internal voltage too low"},
                                                                 {0x3310, "output voltage too high"},
                                                                 {0x3320, "output voltage too low"}};
  std::set<std::string> texts;
  for (const auto& [code, words] : codes) {
    EXPECT_NE(std::string(co::emcy_text(code)).find(words), std::string::npos) << std::hex << code;
    EXPECT_TRUE(texts.insert(co::emcy_text(code)).second) << std::hex << code << " has another one's name";
  }
}

// A6.1, HC2.9: eight bytes; 0000h only when the register is 0; none while off; the inhibit time defers.
TEST(EmcyFrame, A6_1_HC2_9_ErrorResetInhibitAndStates) {
  Bench b;
  Station device(b.wire);
  co::EmcyProducer producer(device.dispatcher);
  producer.set_cob_id(co::CobId(co::emcy_id(NodeId(5))));
  producer.set_inhibit(10ms);
  EXPECT_TRUE(producer.raise(0x8130, reg::communication, {1, 2, 3, 4, 5}));
  b.run(50ms);
  EXPECT_TRUE(b.wire.log.empty()) << "initialising or stopped";
  producer.enable(true);
  EXPECT_TRUE(producer.raise(0x4210, reg::temperature));
  EXPECT_TRUE(producer.clear(0x8130));
  EXPECT_TRUE(producer.clear(0x4210));
  b.run(100ms);
  EXPECT_EQ(b.wire.log,
            (Log{"085#3081110102030405", "085#1042190000000000", "085#1042090000000000", "085#0000000000000000"}));
  for (std::size_t i = 1; i < b.wire.times.size(); ++i) EXPECT_GE(b.wire.times[i] - b.wire.times[i - 1], 10ms);
}

struct List : ::testing::Test, Bench, co::EmcyConsumer::Observer {
  static std::shared_ptr<const od::Description> description() {
    od::DescriptionBuilder b;
    b.object(0x1028, od::ObjectCode::array, "Emergency consumer object");
    for (std::uint8_t node = 1; node <= 127; ++node) {
      b.sub(0x1028, {.sub = node, .name = "Node", .initial = od::Literal::number(0x80000000)});
    }
    b.initial({0x1028, 9}, od::Literal::number(0));  // what some descriptions say
    b.initial({0x1028, 7}, od::Literal::number(0x87));
    return b.build();
  }
  void emergency(NodeId node, const co::Emcy& message, rt::Time) noexcept override {
    char text[48];
    std::snprintf(text, sizeof text, "%u %04X %02X %02X", node.value(), message.code, message.error_register,
                  message.info[4]);
    heard.emplace_back(text);
  }
  od::AbortCode write(std::uint8_t sub, std::uint32_t value) {
    std::uint8_t bytes[4];
    store_le(bytes, value);
    return values.write({0x1028, sub}, bytes);
  }
  void hear(const char* frame) {
    peer.send(frame);
    run(1ms);
  }
  Station device{wire};
  Station peer{wire};
  od::Values values{description()};
  co::EmcyList list{device.dispatcher, values, *this};
  Log heard;
};

TEST_F(List, A6_5_OD_1028_HearsWhomTheListNames) {
  hear("087#3081110000000055");
  EXPECT_TRUE(heard.empty()) << "not started";
  list.start();
  hear("087#3081110000000055");
  hear("085#3081110000000055");
  hear("000#3081110000000055");
  EXPECT_EQ(heard, Log{"7 8130 11 55"});
  ASSERT_EQ(write(5, 0x85), ok);
  hear("085#1042090000000001");
  EXPECT_EQ(heard.back(), "5 4210 09 01");
  ASSERT_EQ(write(5, 0x80000085), ok);
  hear("085#1042090000000001");
  EXPECT_EQ(heard.size(), 2U);
  ASSERT_EQ(write(5, 0x20012345), ok);
  hear("00012345#0000000000000000");
  EXPECT_EQ(heard.back(), "5 0000 00 00") << "sub-index 5 is node 5, whatever the identifier";
  list.stop();
  hear("087#3081110000000055");
  EXPECT_EQ(heard.size(), 3U);
}

TEST_F(List, A6_5_OtherFramesAreNoEmergencies) {
  list.start();
  for (const char* frame : {"087#30811100000000", "087#", "087#R8", "00000087#3081110000000055"}) hear(frame);
  EXPECT_TRUE(heard.empty());
}

TEST_F(List, A6_5_A1_2_TheCobIdIsCheckedAndFrozenWhileValid) {
  for (const std::uint32_t id : {0x000, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x6FF, 0x701, 0x7FF}) {
    EXPECT_EQ(write(3, id), AbortCode::invalid_value) << id;
  }
  ASSERT_EQ(write(3, 0x83), ok);
  EXPECT_EQ(write(3, 0x84), AbortCode::invalid_value);
  EXPECT_EQ(write(3, 0x83), ok);
  EXPECT_EQ(write(3, 0x80000084), ok);
  EXPECT_EQ(write(3, 0x84), ok);
  EXPECT_EQ(values.get<std::uint32_t>({0x1028, 3}), 0x84U);
}

}  // namespace
