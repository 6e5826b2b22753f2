// TIME producer and consumer (docs/protocols/cia301.md §SYNC and TIME).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <vector>

#include "berth/co/time_stamp.hpp"
#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using co::TimeOfDay;
using od::AbortCode;

namespace time_tests {
namespace {

constexpr auto ok = AbortCode::none;

struct Time : ::testing::Test, Bench, co::TimeStamp::Observer {
  Time() { service.observe(this); }
  static std::shared_ptr<const od::Description> description() {
    od::DescriptionBuilder b;
    b.variable(0x1012, {.name = "COB-ID TIME", .initial = od::Literal::number(0x100)});
    b.variable(0x1013, {.name = "High resolution time stamp", .mappable = true});
    return b.build();
  }
  void time_of_day(const TimeOfDay& time, rt::Time) noexcept override { heard.push_back(time); }
  od::AbortCode write(std::uint32_t value) {
    std::uint8_t bytes[4];
    store_le(bytes, value);
    return values.write({0x1012, 0}, bytes);
  }
  void hear(const char* frame) {
    peer.send(frame);
    run(1ms);
  }
  Station device{wire};
  Station peer{wire};
  od::Values values{description()};
  co::TimeStamp service{device.dispatcher, values};
  std::vector<TimeOfDay> heard;
};

// Six bytes: UNSIGNED32 with ms after midnight in bits 27..0, UNSIGNED16 days since 1984-01-01.
TEST(TimeOfDayType, A5_5_SixBytes) {
  const TimeOfDay time{0x01234567, 0x89AB};
  EXPECT_EQ(time.encode(), (std::array<std::uint8_t, 6>{0x67, 0x45, 0x23, 0x01, 0xAB, 0x89}));
  EXPECT_EQ(TimeOfDay::decode(time.encode()), time);
  const std::uint8_t reserved[]{0x67, 0x45, 0x23, 0xF1, 0xAB, 0x89};
  EXPECT_EQ(TimeOfDay::decode(reserved), time) << "the upper four bits are reserved";
  EXPECT_FALSE(TimeOfDay::decode(std::span(reserved, 5)));
  const std::uint8_t late[]{0x00, 0x5C, 0x26, 0x05, 0, 0};  // 86 400 000
  EXPECT_FALSE(TimeOfDay::decode(late)) << "no day has so many milliseconds";
}

// date -u -d 1984-01-01 +%s = 441763200; 2024-02-29T12:34:56 = 1709210096: 14669 days later.
TEST(TimeOfDayType, A5_5_DaysSince1984) {
  EXPECT_EQ(TimeOfDay::from_unix(441'763'200), (TimeOfDay{0, 0}));
  EXPECT_FALSE(TimeOfDay::from_unix(441'763'199));
  EXPECT_EQ(TimeOfDay::from_unix(1'709'210'096, 789), (TimeOfDay{45'296'789, 14'669}));
  EXPECT_EQ((TimeOfDay{45'296'789, 14'669}).unix_seconds(), 1'709'210'096);
  EXPECT_EQ(TimeOfDay::from_unix(441'763'200 + 65'536LL * 86'400 - 1), (TimeOfDay{86'399'000, 65'535}));
  EXPECT_FALSE(TimeOfDay::from_unix(441'763'200 + 65'536LL * 86'400));
  EXPECT_FALSE(TimeOfDay::from_unix(1'709'210'096, 1000));
}

RC_GTEST_PROP(TimeOfDayProperty, SurvivesTheWire, (std::uint32_t ms, std::uint16_t days)) {
  const TimeOfDay time{ms % TimeOfDay::milliseconds_a_day, days};
  RC_ASSERT(TimeOfDay::decode(time.encode()) == time);
  RC_ASSERT(TimeOfDay::from_unix(time.unix_seconds(), time.milliseconds % 1000) == time);
}

// OD.1012: bit 31 consumer, bit 30 producer, neither, both.
TEST_F(Time, A5_6_OD_1012_ConsumerAndProducer) {
  service.start();
  EXPECT_FALSE(service.consumer() || service.producer());
  hear("100#6745230100AB");
  EXPECT_TRUE(heard.empty());
  EXPECT_EQ(service.send({1, 2}), can::Queued::closed);
  ASSERT_EQ(write(0x80000100), ok);
  hear("100#67452301AB89");
  EXPECT_EQ(heard, (std::vector<TimeOfDay>{{0x01234567, 0x89AB}}));
  EXPECT_EQ(service.send({1, 2}), can::Queued::closed);
  ASSERT_EQ(write(0x40000100), ok);
  wire.log.clear();
  EXPECT_EQ(service.send({1, 2}), can::Queued::yes);
  run(1ms);
  EXPECT_EQ(wire.log, Log{"100#010000000200"});
  hear("100#67452301AB89");
  EXPECT_EQ(heard.size(), 1U);
  ASSERT_EQ(write(0xC0000100), ok);
  hear("100#67452301AB89");
  EXPECT_EQ(heard.size(), 2U);
  EXPECT_EQ(service.send({1, 2}), can::Queued::yes);
  service.stop();
  EXPECT_EQ(service.send({1, 2}), can::Queued::closed);
  hear("100#67452301AB89");
  EXPECT_EQ(heard.size(), 2U);
}

TEST_F(Time, A5_5_OtherLengthsAreNotHeard) {
  ASSERT_EQ(write(0x80000100), ok);
  service.start();
  for (const char* frame : {"100#", "100#6745230189", "100#67452301AB8900", "100#R6", "100#FFFFFFFFAB89"}) hear(frame);
  EXPECT_TRUE(heard.empty());
}

// A1.2, A1.3: frozen while in use; restricted identifiers; 29 bits.
TEST_F(Time, A5_6_TheCobId) {
  EXPECT_EQ(write(0x00000101), AbortCode::invalid_value);
  EXPECT_EQ(write(0x80000000), AbortCode::invalid_value);
  EXPECT_EQ(write(0x00000900), AbortCode::invalid_value);
  ASSERT_EQ(write(0x00000090), ok);
  ASSERT_EQ(write(0x80000090), ok);
  EXPECT_EQ(write(0x80000091), AbortCode::invalid_value);
  EXPECT_EQ(write(0x00000091), AbortCode::invalid_value);
  EXPECT_EQ(write(0xA0000090), AbortCode::invalid_value);
  EXPECT_EQ(write(0xC0000090), ok) << "both bits may change";
  EXPECT_EQ(write(0x00000090), ok);
  EXPECT_EQ(write(0xE0012345), ok);
  service.start();
  EXPECT_EQ(service.send({0, 0}), can::Queued::yes);
  run(1ms);
  EXPECT_EQ(wire.log, Log{"00012345#000000000000"});
}

// A device that receives it maps it into an RPDO like any object.
TEST(TimePdo, A5_5_OD_1013_IsReceivedByPdo) {
  Rig rig;
  rig.rpdo(1, {.cob_id = 0x205, .map = {entry(0x1013, 0, 32)}});
  rig.pdos.start(Rig::node);
  rig.hear("205#78563412");
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x1013, 0}), 0x12345678U);
}

}  // namespace
}  // namespace time_tests
