// Multiplex PDOs (docs/protocols/cia301.md §PDO; HU.34).
#include <gtest/gtest.h>
#include <cstdint>

#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using od::AbortCode;

namespace mpdo_tests {
namespace {

constexpr auto ok = AbortCode::none;
constexpr std::uint8_t dam = 0xFF, sam = 0xFE;

struct Mpdo : ::testing::Test, Rig {
  void multiplex(std::uint16_t communication, std::uint32_t cob_id, std::uint8_t mode, std::uint16_t inhibit = 0) {
    const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
    ASSERT_EQ(write_u32(communication, 1, 0x80000000U | cob_id), ok);
    ASSERT_EQ(write_u8(mapping, 0, 0), ok);
    ASSERT_EQ(write_u16(communication, 3, inhibit), ok);
    ASSERT_EQ(write_u8(mapping, 0, mode), ok);
    ASSERT_EQ(write_u32(communication, 1, cob_id), ok);
  }
};

// Byte 0: bit 7 = 1, destination; bytes 1..3 index and sub-index; bytes 4..7 data.
TEST_F(Mpdo, A8_10_HU_34_DamProducer) {
  multiplex(0x1800, 0x185, dam);
  EXPECT_EQ(pdos.send_dam(9, {0x6200, 1}, {}), can::Queued::closed) << "not operational";
  pdos.start(node);
  run(1ms);
  EXPECT_TRUE(take().empty());
  const std::uint8_t data[]{0x11, 0x22, 0x33, 0x44, 0x55};
  EXPECT_EQ(pdos.send_dam(9, {0x6200, 1}, std::span(data, 4)), can::Queued::yes);
  EXPECT_EQ(pdos.send_dam(0, {0x6200, 0xFF}, std::span(data, 1)), can::Queued::yes) << "all nodes";
  run(1ms);
  EXPECT_EQ(take(), (Log{"185#8900620111223344", "185#800062FF11000000"}));
  EXPECT_EQ(pdos.send_dam(128, {0x6200, 1}, {}), can::Queued::closed);
  EXPECT_EQ(pdos.send_dam(1, {0x6200, 1}, std::span(data, 5)), can::Queued::closed);
  EXPECT_FALSE(pdos.event(1)) << "an MPDO has no event of its own";
  EXPECT_FALSE(pdos.changed({0x2001, 0}));
}

TEST_F(Mpdo, A8_10_DamProducerAndInhibitTime) {
  multiplex(0x1800, 0x185, dam, 100);
  pdos.start(node);
  const std::uint8_t data[]{1};
  EXPECT_EQ(pdos.send_dam(9, {0x6200, 1}, data), can::Queued::yes);
  run(5ms);
  EXPECT_EQ(pdos.send_dam(9, {0x6200, 1}, data), can::Queued::full);
  run(6ms);
  EXPECT_EQ(pdos.send_dam(9, {0x6200, 1}, data), can::Queued::yes);
}

TEST_F(Mpdo, A8_10_DamConsumer) {
  multiplex(0x1400, 0x205, dam);
  pdos.start(node);
  hear("205#8502200034120000");
  EXPECT_EQ(values.get<std::uint16_t>({0x2002, 0}), 0x1234);
  EXPECT_EQ(take_stored(), Log{"2002:00"});
  hear("205#8010200378563412");
  EXPECT_EQ(values.get<std::uint32_t>({0x2010, 3}), 0x12345678U) << "to all nodes";
  take_stored();
  hear("205#8602200099990000");
  EXPECT_EQ(values.get<std::uint16_t>({0x2002, 0}), 0x1234) << "to another node";
  hear("205#0502200099990000");
  EXPECT_EQ(values.get<std::uint16_t>({0x2002, 0}), 0x1234) << "source address mode";
  EXPECT_TRUE(take_stored().empty());
  EXPECT_TRUE(owner.events.empty());
}

// EMCY 8230h, gone with the next good one.
TEST_F(Mpdo, A8_10_DestinationNotAvailable) {
  multiplex(0x1400, 0x205, dam);
  pdos.start(node);
  for (const char* wrong : {
           "205#8555550001000000",  // no such object
           "205#8502200101000000",  // no such sub-index
           "205#850C200001000000",  // not mappable
           "205#8507200001000000",  // a TPDO's object only
           "205#8509200001000000",  // read only
           "205#8504200001000000",  // 64 bits
           "205#850D200001000000",  // a string
           "205#8512200005000000",  // below its limit
           "205#8505200002000000",  // no BOOLEAN
           "205#8505000001000000",  // a data type, no object
       }) {
    owner.events.clear();
    hear(wrong);
    EXPECT_EQ(owner.events, Log{"8230 on"}) << wrong;
    EXPECT_EQ(owner.last_info,
              (std::array<std::uint8_t, 5>{1, 0, can::parse_frame(wrong)->data[1], can::parse_frame(wrong)->data[2],
                                           can::parse_frame(wrong)->data[3]}));
    hear("205#850120007F000000");
    EXPECT_EQ(owner.events, (Log{"8230 on", "8230 off"}));
  }
  EXPECT_EQ(values.get<std::uint8_t>({0x2001, 0}), 0x7F);
}

TEST_F(Mpdo, A8_10_AnMpdoHasEightBytes) {
  multiplex(0x1400, 0x205, dam);
  pdos.start(node);
  hear("205#850120007F");
  EXPECT_EQ(owner.events, Log{"8210 on"});
  EXPECT_EQ(values.get<std::uint8_t>({0x2001, 0}), 0);
  hear("205#850120007F000000");
  EXPECT_EQ(owner.events, (Log{"8210 on", "8210 off"}));
}

// OD.1FA0: bits 31..24 block size, 23..8 index, 7..0 sub-index.
TEST_F(Mpdo, A8_11_OD_1FA0_SamProducerSendsWhatTheScannerListNames) {
  ASSERT_EQ(write_u32(0x1FA0, 1, 0x01200300), ok);
  ASSERT_EQ(write_u32(0x1FA0, 2, 0x03201002), ok);  // 2010h:02..04
  ASSERT_EQ(write_u32(0x1FA0, 3, 0x00200200), ok);  // block size 0: unused
  ASSERT_EQ(write_u32(0x1FA0, 4, 0x01200400), ok);  // 64 bits do not fit
  multiplex(0x1800, 0x185, sam);
  pdos.start(node);
  values.set({0x2003, 0}, 0x11223344U);
  values.set({0x2010, 4}, 0x55U);
  EXPECT_TRUE(pdos.changed({0x2003, 0}));
  EXPECT_TRUE(pdos.changed({0x2010, 4}));
  EXPECT_FALSE(pdos.changed({0x2010, 1}));
  EXPECT_FALSE(pdos.changed({0x2010, 5}));
  EXPECT_FALSE(pdos.changed({0x2002, 0}));
  EXPECT_FALSE(pdos.changed({0x2004, 0}));
  run(1ms);
  EXPECT_EQ(take(), (Log{"185#0503200044332211", "185#0510200455000000"})) << "byte 0: bit 7 = 0, the producer";
}

// Different objects queue up; one object that changes twice is sent once, with its last value.
TEST_F(Mpdo, A8_11_SamProducerAndInhibitTime) {
  ASSERT_EQ(write_u32(0x1FA0, 1, 0x08201001), ok);
  multiplex(0x1800, 0x185, sam, 100);
  pdos.start(node);
  for (std::uint8_t sub = 1; sub <= 4; ++sub) EXPECT_TRUE(pdos.changed({0x2010, sub}));
  values.set({0x2010, 3}, 0xAAU);
  EXPECT_TRUE(pdos.changed({0x2010, 3}));
  run(100ms);
  EXPECT_EQ(wire.log,
            (Log{"185#0510200100000000", "185#0510200200000000", "185#05102003AA000000", "185#0510200400000000"}));
  for (std::size_t i = 1; i < wire.times.size(); ++i) EXPECT_GE(wire.times[i] - wire.times[i - 1], 10ms);
}

TEST_F(Mpdo, A8_11_SamProducerWithAFullQueue) {
  ASSERT_EQ(write_u32(0x1FA0, 1, 0x08201001), ok);
  multiplex(0x1800, 0x185, sam);
  pdos.start(node);
  device.port.refuses = can::Queued::full;
  EXPECT_TRUE(pdos.changed({0x2010, 1}));
  EXPECT_TRUE(pdos.changed({0x2010, 2}));
  run(5ms);
  device.port.refuses.reset();
  run(5ms);
  EXPECT_EQ(take(), (Log{"185#0510200100000000", "185#0510200200000000"}));
}

// OD.1FD0: bits 63..56 block size (a peer shifts by 54), 55..40 local index, 39..32 local sub-index, 31..16 producer's
// index, 15..8 its sub-index, 7..0 its node-ID.
TEST_F(Mpdo, A8_11_OD_1FD0_SamConsumerStoresWhereTheDispatchingListSays) {
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 1, 0x01'2003'00'6000'05'09ULL), ok);
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 2, 0x03'2010'02'6100'01'09ULL), ok);  // 6100h:01..03 -> 2010h:02..04
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 3, 0x01'2001'00'6000'05'0AULL), ok);
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 4, 0x00'2002'00'6000'05'09ULL), ok);  // unused
  multiplex(0x1400, 0x205, sam);
  pdos.start(node);
  hear("205#0900600578563412");
  EXPECT_EQ(values.get<std::uint32_t>({0x2003, 0}), 0x12345678U);
  EXPECT_EQ(take_stored(), Log{"2003:00"});
  hear("205#09006103FF000000");
  EXPECT_EQ(take_stored(), Log{"2010:04"});
  hear("205#0A0060057F123456");
  EXPECT_EQ(take_stored(), Log{"2001:00"});
  EXPECT_EQ(values.get<std::uint8_t>({0x2001, 0}), 0x7F) << "as many bytes as the object has";
  for (const char* unlisted : {"205#0B00600578563412", "205#0900600478563412", "205#0900600678563412",
                               "205#0900610478563412", "205#0900610078563412", "205#8900600500000000"}) {
    hear(unlisted);
    EXPECT_TRUE(take_stored().empty()) << unlisted;
  }
  EXPECT_EQ(values.get<std::uint16_t>({0x2002, 0}), 0);
  EXPECT_TRUE(owner.events.empty());
}

// One producer's object may go to several places, and a bad entry stops none of them.
TEST_F(Mpdo, A8_11_SeveralDestinations) {
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 1, 0x01'7777'00'6000'01'09ULL), ok);  // not there
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 2, 0x01'2001'00'6000'01'09ULL), ok);
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 3, 0x02'2003'FF'6000'00'09ULL), ok);  // beyond sub-index 255
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 4, 0x01'2002'00'6000'01'09ULL), ok);
  multiplex(0x1400, 0x205, sam);
  pdos.start(node);
  hear("205#090060017F010000");
  EXPECT_EQ(take_stored(), (Log{"2001:00", "2002:00"}));
}

// An RPDO of one mode does not hear the other.
TEST_F(Mpdo, A8_10_A8_11_ModesAreNotMixed) {
  ASSERT_EQ(write<std::uint64_t>(0x1FD0, 1, 0x01'2003'00'2002'00'05ULL), ok);
  multiplex(0x1400, 0x205, dam);
  pdos.start(node);
  hear("205#0502200078563412");
  EXPECT_TRUE(take_stored().empty());
  pdos.stop();
  ASSERT_EQ(write_u32(0x1400, 1, 0x80000205), ok);
  ASSERT_EQ(write_u8(0x1600, 0, sam), ok);
  ASSERT_EQ(write_u32(0x1400, 1, 0x205), ok);
  pdos.start(node);
  hear("205#8502200078563412");
  EXPECT_TRUE(take_stored().empty());
  hear("205#0502200078563412");
  EXPECT_EQ(take_stored(), Log{"2003:00"});
}

// Types FEh and FFh only; one producer a device.
TEST_F(Mpdo, A8_10_A8_11_Rules) {
  ASSERT_EQ(write_u8(0x1800, 2, 1), ok);
  EXPECT_EQ(write_u8(0x1A00, 0, dam), AbortCode::parameter_incompatible) << "type 1";
  ASSERT_EQ(write_u8(0x1800, 2, 0xFE), ok);
  EXPECT_EQ(write_u8(0x1A00, 0, dam), ok);
  EXPECT_EQ(write_u8(0x1800, 2, 1), AbortCode::invalid_value) << "DAM";
  EXPECT_EQ(write_u8(0x1A01, 0, sam), AbortCode::parameter_incompatible) << "a second producer";
  EXPECT_EQ(write_u8(0x1A01, 0, dam), AbortCode::parameter_incompatible);
  EXPECT_EQ(write_u32(0x1A00, 1, entry(0x2001, 0, 8)), AbortCode::unsupported_access) << "sub-index 0 is not 0";
  EXPECT_EQ(write_u8(0x1600, 0, dam), ok);
  EXPECT_EQ(write_u8(0x1601, 0, sam), ok) << "consumers as many as one likes";
  EXPECT_EQ(write_u8(0x1A00, 0, 0), ok);
  EXPECT_EQ(write_u8(0x1A01, 0, sam), ok);
  EXPECT_EQ(write_u8(0x1402, 2, 0), ok);
  EXPECT_EQ(write_u8(0x1602, 0, sam), AbortCode::parameter_incompatible);
}

TEST_F(Mpdo, A8_11_TheDeadlineIsSupervisedToo) {
  multiplex(0x1400, 0x205, sam);
  ASSERT_EQ(write_u16(0x1400, 5, 20), ok);
  pdos.start(node);
  hear("205#0900600578563412");
  run(30ms);
  EXPECT_EQ(owner.events, Log{"8250 on"});
  hear("205#0900600578563412");
  EXPECT_EQ(owner.events, (Log{"8250 on", "8250 off"}));
}

}  // namespace
}  // namespace mpdo_tests
