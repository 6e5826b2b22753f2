// PDO mapping and the records 1400h..1BFFh (docs/protocols/cia301.md §CAN-IDs, §PDO; HC2.1, HC2.2).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "berth/base/random.hpp"
#include "pdo_rig.hpp"

using namespace berth;
using namespace berth::test;
using co::PdoKind;
using od::AbortCode;

namespace pdo_tests {
namespace {

constexpr auto ok = AbortCode::none;

// The predefined connection set: 180h/280h/380h/480h TPDO, 200h..500h RPDO, all plus the node-ID.
TEST(CobIds, A1_1_PredefinedConnectionSet) {
  constexpr NodeId node(5);
  EXPECT_EQ(co::nmt_command_id, 0x000U);
  EXPECT_EQ(co::sync_id, 0x080U);
  EXPECT_EQ(co::emcy_id(node), 0x085U);
  EXPECT_EQ(co::time_id, 0x100U);
  EXPECT_EQ(co::tpdo_id(1, node), 0x185U);
  EXPECT_EQ(co::rpdo_id(1, node), 0x205U);
  EXPECT_EQ(co::tpdo_id(2, node), 0x285U);
  EXPECT_EQ(co::rpdo_id(2, node), 0x305U);
  EXPECT_EQ(co::tpdo_id(3, node), 0x385U);
  EXPECT_EQ(co::rpdo_id(3, node), 0x405U);
  EXPECT_EQ(co::tpdo_id(4, NodeId(127)), 0x4FFU);
  EXPECT_EQ(co::rpdo_id(4, NodeId(127)), 0x57FU);
  EXPECT_EQ(co::sdo_response_id(node), 0x585U);
  EXPECT_EQ(co::sdo_request_id(node), 0x605U);
  EXPECT_EQ(co::error_control_id(node), 0x705U);
}

// Every identifier: refused exactly in the ranges of CiA 301 §7.3.5, for either kind of PDO.
TEST(PdoRecord, A1_2_HC2_2_RestrictedIdentifiersAreRefused) {
  const std::vector<std::pair<unsigned, unsigned>> ranges{{0x000, 0x07F}, {0x101, 0x180}, {0x581, 0x5FF},
                                                          {0x601, 0x67F}, {0x6E0, 0x6FF}, {0x701, 0x7FF}};
  Rig rig;
  for (std::uint32_t id = 0; id <= 0x7FF; ++id) {
    const bool restricted = std::ranges::any_of(ranges, [&](auto r) { return id >= r.first && id <= r.second; });
    for (const std::uint16_t record : Indices{0x1400, 0x1800}) {
      EXPECT_EQ(rig.write_u32(record, 1, id), restricted ? AbortCode::invalid_value : ok) << std::hex << id;
      EXPECT_EQ(rig.write_u32(record, 1, 0x80000000U | id), ok) << "not valid: any number will do";
    }
  }
}

// Bit 31 not valid, bit 30 no RTR, bit 29 frame format; bits 28..11 belong to 29-bit identifiers only.
TEST(PdoRecord, A1_3_BitsOfACobId) {
  EXPECT_FALSE(co::CobId(0x80000185).valid());
  EXPECT_EQ(co::CobId(0x40000185).key(), 0x185U);
  EXPECT_EQ(co::CobId(0x20012345).key(), 0x80012345U);
  EXPECT_TRUE(co::CobId(0x20000001).allowed()) << "restricted are 11-bit identifiers";
  Rig rig;
  EXPECT_EQ(rig.write_u32(0x1800, 1, 0x00000985), AbortCode::invalid_value);
  EXPECT_EQ(rig.write_u32(0x1800, 1, 0x00012345), AbortCode::invalid_value);
  EXPECT_EQ(rig.write_u32(0x1800, 1, 0x80012345), AbortCode::invalid_value) << "no COB-ID, valid or not";
  EXPECT_EQ(rig.write_u32(0x1800, 1, 0x20012345), ok);
}

// HC2.2, OD.1400, OD.1800: bits 29..0 are frozen while the PDO is and stays valid; bit 30 and bit 31 are not.
TEST(PdoRecord, A8_1_TheCobIdIsFrozenWhileValid) {
  Rig rig;
  for (const std::uint16_t record : Indices{0x1400, 0x1800}) {
    ASSERT_EQ(rig.write_u32(record, 1, 0x00000285), ok);
    EXPECT_EQ(rig.write_u32(record, 1, 0x00000286), AbortCode::invalid_value);
    EXPECT_EQ(rig.write_u32(record, 1, 0x20000285), AbortCode::invalid_value);
    EXPECT_EQ(rig.write_u32(record, 1, 0x00000285), ok) << "nothing changes";
    EXPECT_EQ(rig.write_u32(record, 1, 0x40000285), ok) << "bit 30";
    EXPECT_EQ(rig.values.get<std::uint32_t>({record, 1}), 0x40000285U) << "a refused write stores nothing";
    EXPECT_EQ(rig.write_u32(record, 1, 0x80000286), ok) << "made invalid and changed at once";
    EXPECT_EQ(rig.write_u32(record, 1, 0x00000287), ok);
  }
}

TEST(PdoRecord, A8_1_InhibitTimeAndStartValueAreFrozenTypeAndTimerAreNot) {
  Rig rig;
  EXPECT_EQ(rig.write_u16(0x1800, 3, 100), ok);
  EXPECT_EQ(rig.write_u8(0x1800, 6, 240), ok);
  EXPECT_EQ(rig.write_u8(0x1800, 6, 241), AbortCode::invalid_value) << "no SYNC counter is above 240";
  ASSERT_EQ(rig.write_u32(0x1800, 1, 0x185), ok);
  EXPECT_EQ(rig.write_u16(0x1800, 3, 101), AbortCode::invalid_value);
  EXPECT_EQ(rig.write_u16(0x1800, 3, 100), ok) << "nothing changes";
  EXPECT_EQ(rig.write_u8(0x1800, 6, 1), AbortCode::invalid_value);
  EXPECT_EQ(rig.write_u8(0x1800, 2, 1), ok);
  EXPECT_EQ(rig.write_u16(0x1800, 5, 500), ok);
}

// Sub-index 4 is reserved, whatever a description says.
TEST(PdoRecord, A8_1_SubIndex4IsNotThere) {
  Rig rig;
  for (const std::uint16_t record : Indices{0x1400, 0x1800}) {
    EXPECT_EQ(rig.write_u8(record, 4, 0), AbortCode::no_sub_index);
    EXPECT_EQ(rig.values.view({record, 4}).error(), AbortCode::no_sub_index);
    EXPECT_TRUE(rig.values.view({record, 5}).has_value());
  }
}

// A8.3, A8.4: all 256 values.
TEST(PdoRecord, A8_1_ReservedTransmissionTypesAreRefused) {
  Rig rig;
  for (unsigned type = 0; type <= 0xFF; ++type) {
    const bool reserved = type >= 0xF1 && type <= 0xFB;
    const bool rtr = type == 0xFC || type == 0xFD;
    EXPECT_EQ(rig.write_u8(0x1800, 2, type), reserved ? AbortCode::invalid_value : ok) << type;
    EXPECT_EQ(rig.write_u8(0x1400, 2, type), reserved || rtr ? AbortCode::invalid_value : ok) << type;
  }
}

// HC2.1: the sequence of CiA 301 §7.5.2.36, and every step out of order.
TEST(PdoRecord, A8_6_HC2_1_OD_1600_OD_1A00_ReMappingSequence) {
  Rig rig;
  for (const std::uint16_t communication : Indices{0x1400, 0x1800}) {
    const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
    const std::uint32_t one = entry(0x2003, 0, 32), other = entry(0x2010, 1, 32);
    rig.configure(communication, {.cob_id = 0x285, .map = {one}});
    EXPECT_EQ(rig.write_u32(mapping, 1, other), AbortCode::unsupported_access) << "valid";
    EXPECT_EQ(rig.write_u8(mapping, 0, 0), AbortCode::unsupported_access) << "valid";
    ASSERT_EQ(rig.write_u32(communication, 1, 0x80000285), ok);
    EXPECT_EQ(rig.write_u32(mapping, 1, other), AbortCode::unsupported_access) << "sub-index 0 is 1";
    EXPECT_EQ(rig.write_u32(mapping, 2, other), AbortCode::unsupported_access);
    ASSERT_EQ(rig.write_u8(mapping, 0, 0), ok);
    EXPECT_EQ(rig.write_u32(mapping, 1, other), ok);
    EXPECT_EQ(rig.write_u32(mapping, 2, one), ok);
    EXPECT_EQ(rig.write_u8(mapping, 0, 2), ok);
    EXPECT_EQ(rig.write_u32(communication, 1, 0x285), ok);
    EXPECT_EQ(rig.values.get<std::uint32_t>({mapping, 1}), other);
  }
}

// While running, a remapped TPDO carries the new objects from its next transmission on, none in between.
TEST(PdoRecord, A8_6_ReMappingWhileOperational) {
  Rig rig;
  rig.tpdo(1, {.cob_id = 0x185, .map = {entry(0x2001, 0, 8)}});
  rig.values.set({0x2001, 0}, 0x11);
  rig.values.set({0x2002, 0}, 0x2233);
  rig.pdos.start(Rig::node);
  rig.run(1ms);
  EXPECT_EQ(rig.take(), Log{"185#11"});
  rig.tpdo(1, {.cob_id = 0x186, .map = {entry(0x2002, 0, 16), entry(0x2001, 0, 8)}});
  rig.run(1ms);
  EXPECT_TRUE(rig.take().empty());
  EXPECT_TRUE(rig.pdos.event(1));
  rig.run(1ms);
  EXPECT_EQ(rig.take(), Log{"186#332211"});
  ASSERT_EQ(rig.write_u32(0x1800, 1, 0x80000186), ok);
  EXPECT_FALSE(rig.pdos.event(1));
}

// HC2.1: object missing, not mappable, wrong direction, wrong length. CiA's conformance test accepts 0602 0000,
// 0604 0041 and 0604 0042.
TEST(PdoRecord, A8_7_HC2_1_WrongObjects) {
  Rig rig;
  struct Case {
    std::uint32_t raw;
    AbortCode rpdo;
    AbortCode tpdo;
    const char* why;
  };
  const auto no = AbortCode::not_mappable, missing = AbortCode::no_object;
  for (const Case& c : {Case{entry(0x2001, 0, 8), ok, ok, "rw"},
                        {entry(0x2007, 0, 16), no, ok, "rwr: TPDO only"},
                        {entry(0x2008, 0, 16), ok, no, "rww: RPDO only"},
                        {entry(0x2009, 0, 8), no, ok, "ro"},
                        {entry(0x200A, 0, 8), ok, no, "wo"},
                        {entry(0x200B, 0, 8), no, ok, "const"},
                        {entry(0x200C, 0, 8), no, no, "PDOMapping=0"},
                        {entry(0x200D, 0, 64), no, no, "VISIBLE_STRING"},
                        {entry(0x2001, 0, 7), no, no, "length too small"},
                        {entry(0x2001, 0, 16), no, no, "length too large"},
                        {entry(0x2001, 0, 0), no, no, "length 0"},
                        {entry(0x2005, 0, 8), no, no, "BOOLEAN has one bit"},
                        {entry(0x2005, 0, 1), ok, ok, "BOOLEAN"},
                        {entry(0x2006, 0, 24), ok, ok, "INTEGER24"},
                        {entry(0x2001, 1, 8), missing, missing, "no such sub-index"},
                        {entry(0x5555, 0, 8), missing, missing, "no such object"},
                        {entry(0x0005, 0, 8), ok, no, "dummy"},
                        {entry(0x0005, 1, 8), no, no, "a dummy has sub-index 0"},
                        {entry(0x0005, 0, 16), no, no, "a dummy has its type's length"},
                        {entry(0x0008, 0, 32), no, no, "a dummy that the description does not allow"},
                        {entry(0x0009, 0, 8), no, no, "no fixed length"},
                        {entry(0x0000, 0, 8), missing, missing, "index 0"},
                        {0, ok, ok, "0 fills the rest of a record"}}) {
    EXPECT_EQ(rig.write_u32(0x1600, 1, c.raw), c.rpdo) << c.why;
    EXPECT_EQ(rig.write_u32(0x1A00, 1, c.raw), c.tpdo) << c.why;
  }
  EXPECT_EQ(rig.write_u8(0x1A00, 0, 1), missing) << "but 0 is not counted";
}

TEST(PdoRecord, A8_7_MoreThan64BitsOrEntries) {
  Rig rig;
  for (std::uint8_t i = 1; i <= 3; ++i) ASSERT_EQ(rig.write_u32(0x1A00, i, entry(0x2010, i, 32)), ok);
  EXPECT_EQ(rig.write_u8(0x1A00, 0, 3), AbortCode::pdo_length);
  EXPECT_EQ(rig.values.get<std::uint8_t>({0x1A00, 0}), 0);
  EXPECT_EQ(rig.write_u8(0x1A00, 0, 2), ok);
  EXPECT_EQ(rig.write_u8(0x1A01, 0, 9), AbortCode::pdo_length) << "the record has 8";
  EXPECT_EQ(rig.write_u8(0x1A01, 0, 65), AbortCode::pdo_length);
  EXPECT_EQ(rig.write_u8(0x1A01, 0, 253), AbortCode::pdo_length);
  Rig wide({.rpdos = 1, .tpdos = 1, .entries = 64});
  for (std::uint8_t i = 1; i <= 64; ++i) ASSERT_EQ(wide.write_u32(0x1A00, i, entry(0x2011, i, 1)), ok);
  EXPECT_EQ(wide.write_u8(0x1A00, 0, 64), ok) << "64 BOOLEANs";
  EXPECT_EQ(wide.write_u8(0x1A00, 0, 0), ok);
  ASSERT_EQ(wide.write_u32(0x1A00, 64, entry(0x2001, 0, 8)), ok);
  EXPECT_EQ(wide.write_u8(0x1A00, 0, 64), AbortCode::pdo_length) << "71 bits";
}

// HU.34: a description's default that the standard forbids keeps the PDO silent, and the reason can be asked.
TEST(PdoRecord, HU_34_FaultyDefaultsDoNotAct) {
  od::DescriptionBuilder b;
  add_application_objects(b);
  for (const std::uint16_t record : Indices{0x1800, 0x1801, 0x1802, 0x1803}) {
    add_pdo_records(b, record, 2);
    b.initial({record, 1}, od::Literal::number(0x185));
    b.initial({static_cast<std::uint16_t>(record + 0x200), 1}, od::Literal::number(entry(0x2001, 0, 8)));
    b.initial({static_cast<std::uint16_t>(record + 0x200), 0}, od::Literal::number(1));
  }
  b.initial({0x1800, 1}, od::Literal::number(0x005));                // an NMT identifier
  b.initial({0x1801, 2}, od::Literal::number(0xF1));                 // reserved type
  b.initial({0x1A02, 1}, od::Literal::number(entry(0x200C, 0, 8)));  // not mappable
  Rig rig(b.build());
  rig.pdos.start(Rig::node);
  rig.run(1ms);
  EXPECT_EQ(rig.take(), Log{"185#00"}) << "only the fourth";
  EXPECT_EQ(rig.pdos.problem(PdoKind::tpdo, 1), AbortCode::invalid_value);
  EXPECT_EQ(rig.pdos.problem(PdoKind::tpdo, 2), AbortCode::invalid_value);
  EXPECT_EQ(rig.pdos.problem(PdoKind::tpdo, 3), AbortCode::not_mappable);
  EXPECT_EQ(rig.pdos.problem(PdoKind::tpdo, 4), ok);
  EXPECT_EQ(rig.pdos.problem(PdoKind::tpdo, 5), AbortCode::no_object);
  EXPECT_EQ(rig.pdos.problem(PdoKind::rpdo, 1), AbortCode::no_object);
  EXPECT_TRUE(rig.pdos.active(PdoKind::tpdo, 4));
  EXPECT_FALSE(rig.pdos.active(PdoKind::tpdo, 1));
}

TEST(PdoRecord, NumbersWithGaps) {
  od::DescriptionBuilder b;
  add_application_objects(b);
  for (const std::uint16_t record : Indices{0x1402, 0x15FF, 0x1805, 0x19FF}) add_pdo_records(b, record, 2);
  b.object(0x1810, od::ObjectCode::record, "without mapping");
  b.sub(0x1810, {.sub = 1, .name = "COB-ID"});
  Rig rig(b.build());
  EXPECT_EQ(rig.pdos.count(PdoKind::rpdo), 2U);
  EXPECT_EQ(rig.pdos.count(PdoKind::tpdo), 2U);
  rig.tpdo(6, {.cob_id = 0x185, .map = {entry(0x2001, 0, 8)}});
  rig.tpdo(512, {.cob_id = 0x186, .map = {entry(0x2001, 0, 8)}});
  rig.rpdo(512, {.cob_id = 0x205, .map = {entry(0x2002, 0, 16)}});
  rig.pdos.start(Rig::node);
  rig.run(1ms);
  EXPECT_EQ(rig.take(), (Log{"185#00", "186#00"}));
  rig.hear("205#3412");
  EXPECT_EQ(rig.take_stored(), Log{"RPDO 512"});
  EXPECT_EQ(rig.values.get<std::uint16_t>({0x2002, 0}), 0x1234);
  EXPECT_FALSE(rig.pdos.event(1));
  EXPECT_FALSE(rig.pdos.event(17));
  EXPECT_FALSE(rig.pdos.event(0));
  EXPECT_FALSE(rig.pdos.event(513));
  EXPECT_EQ(rig.pdos.problem(PdoKind::tpdo, 17), AbortCode::no_object);
}

TEST(PdoRecord, A8_12_512Of) {
  Rig rig({.rpdos = 512, .tpdos = 512, .entries = 1});
  ASSERT_EQ(rig.pdos.count(PdoKind::rpdo), 512U);
  ASSERT_EQ(rig.pdos.count(PdoKind::tpdo), 512U);
  for (unsigned n = 1; n <= 512; ++n) {
    rig.tpdo(n, {.cob_id = 0x20010000U + n, .type = 1, .map = {entry(0x2003, 0, 32)}});
    rig.rpdo(n, {.cob_id = 0x20020000U + n, .map = {entry(0x2010, static_cast<std::uint8_t>(1 + n % 8), 32)}});
  }
  rig.values.set({0x2003, 0}, 0x01020304U);
  rig.pdos.start(Rig::node);
  rig.pdos.sync(0, rig.executor.now());
  rig.run(1s);
  const auto log = rig.take();
  ASSERT_EQ(log.size(), 512U) << "the port's queue holds 32: the others wait";
  for (unsigned n = 1; n <= 512; ++n) {
    char text[32];
    std::snprintf(text, sizeof text, "%08X#04030201", 0x10000U + n);
    EXPECT_NE(std::ranges::find(log, text), log.end()) << text;
  }
  rig.hear("00020200#78563412");
  EXPECT_EQ(rig.take_stored(), Log{"RPDO 512"});
  EXPECT_EQ(rig.values.get<std::uint32_t>({0x2010, 1}), 0x12345678U);
  for (unsigned n = 1; n <= 512; ++n) EXPECT_TRUE(rig.pdos.active(PdoKind::rpdo, n));
}

TEST(PdoRecord, FourOfEachAreSmall) {
  const Rig rig({.mpdo_lists = false});
  EXPECT_LT(rig.pdos.memory(), 1300U);
}

TEST(PdoRecord, WithoutPdosNothingHappens) {
  Rig rig({.rpdos = 0, .tpdos = 0});
  EXPECT_FALSE(rig.pdos.any());
  rig.pdos.start(Rig::node);
  rig.pdos.sync(1, rig.executor.now(), 1ms);
  EXPECT_FALSE(rig.pdos.event(1));
  EXPECT_FALSE(rig.pdos.changed({0x2001, 0}));
  rig.run(10ms);
  EXPECT_TRUE(rig.take().empty());
}

// --- Packing, against a model that moves one bit at a time ---------------------------------------------------------

struct Model {
  static bool bit(const std::vector<std::uint8_t>& bytes, std::size_t at) {
    return ((bytes[at / 8] >> (at % 8)) & 1U) != 0;
  }
  static void set(std::vector<std::uint8_t>& bytes, std::size_t at, bool on) {
    const auto mask = static_cast<std::uint8_t>(1U << (at % 8));
    bytes[at / 8] = static_cast<std::uint8_t>(on ? bytes[at / 8] | mask : bytes[at / 8] & ~mask);
  }
};

const std::vector<DataType>& scalars() {
  static const auto list = [] {
    std::vector<DataType> found;
    for (const auto type : od::all_data_types()) {
      if (od::bit_length(type) != 0) found.push_back(type);
    }
    return found;
  }();
  return list;
}

// Objects of random types in random order, some of them twice, with dummies between: what is packed is what the model
// packs, and unpacking changes those values and no other byte.
RC_GTEST_PROP(PdoMappingProperty, AnyMappingOfAnyLengthsAgreesWithABitByBitModel, (std::uint64_t seed)) {
  Random random(seed);
  const PdoKind kind = random.below(2) == 0 ? PdoKind::rpdo : PdoKind::tpdo;
  od::DescriptionBuilder b;
  b.dummies(0xFE);
  std::vector<DataType> types;
  for (unsigned i = 0; i < 24; ++i) {
    const bool boolean = random.below(3) == 0;
    types.push_back(boolean ? DataType::boolean : scalars()[random.below(scalars().size())]);
    b.variable(static_cast<std::uint16_t>(0x2000 + i), {.name = "x", .type = types.back(), .mappable = true});
  }
  od::Values values(b.build());
  std::vector<std::uint32_t> entries;
  std::vector<int> mapped;  // object number, -1 = dummy
  unsigned bits = 0;
  std::set<std::size_t> used;
  for (unsigned tries = 0; tries < 40; ++tries) {
    if (kind == PdoKind::rpdo && random.below(5) == 0) {
      const auto type = static_cast<std::uint16_t>(1 + random.below(7));
      const unsigned length = od::bit_length(static_cast<DataType>(type));
      if (bits + length > 64) continue;
      entries.push_back(entry(type, 0, static_cast<std::uint8_t>(length)));
      mapped.push_back(-1);
      bits += length;
      continue;
    }
    const auto which = random.below(3) == 0 && !mapped.empty() && mapped.back() >= 0 && mapped.back() < 23
                           ? static_cast<std::size_t>(mapped.back() + 1)  // a neighbour in memory
                           : random.below(types.size());
    const unsigned length = od::bit_length(types[which]);
    if (bits + length > 64 || (kind == PdoKind::rpdo && !used.insert(which).second)) continue;
    entries.push_back(entry(static_cast<std::uint16_t>(0x2000 + which), 0, static_cast<std::uint8_t>(length)));
    mapped.push_back(static_cast<int>(which));
    bits += length;
  }
  std::vector<co::PdoField> room(entries.size());
  co::PdoMapping mapping(room);
  RC_ASSERT(mapping.resolve(values.description(), entries, kind) == ok);
  RC_ASSERT(mapping.bits() == bits);
  RC_ASSERT(mapping.size() == (bits + 7) / 8);

  std::vector<std::vector<std::uint8_t>> objects;
  for (std::size_t i = 0; i < types.size(); ++i) {
    std::vector<std::uint8_t> raw(od::byte_size(types[i]));
    for (auto& byte : raw) byte = static_cast<std::uint8_t>(random.next());
    if (types[i] == DataType::boolean) raw[0] &= 1U;
    RC_ASSERT(values.set_bytes({static_cast<std::uint16_t>(0x2000 + i), 0}, raw) == ok);
    objects.push_back(raw);
  }
  std::vector<std::uint8_t> frame(8);
  if (kind == PdoKind::rpdo) {
    for (auto& byte : frame) byte = static_cast<std::uint8_t>(random.next());
  }
  std::size_t at = 0;
  for (std::size_t k = 0; k < mapped.size(); ++k) {
    const int which = mapped[k];
    const auto type = which < 0 ? static_cast<DataType>(entries[k] >> 16) : types[static_cast<std::size_t>(which)];
    for (unsigned bit = 0; bit < od::bit_length(type); ++bit, ++at) {
      if (which < 0) continue;
      auto& object = objects[static_cast<std::size_t>(which)];
      if (kind == PdoKind::tpdo) {
        Model::set(frame, at, Model::bit(object, bit));
      } else {
        Model::set(object, bit, Model::bit(frame, at));
      }
    }
  }
  if (kind == PdoKind::tpdo) {
    std::vector<std::uint8_t> packed(8);
    mapping.pack(co::PdoMapping::base_of(values), packed.data());
    RC_ASSERT(packed == frame);
  } else {
    mapping.unpack(co::PdoMapping::base_of(values), frame.data());
  }
  for (std::size_t i = 0; i < types.size(); ++i) {
    const auto stored = values.bytes({static_cast<std::uint16_t>(0x2000 + i), 0});
    RC_ASSERT(std::vector<std::uint8_t>(stored.begin(), stored.end()) == objects[i]);
  }
}

// Neighbours are joined into one copy; what lies between two mapped objects is not touched.
TEST(PdoMapping, A8_2_NeighboursAreOneField) {
  Rig rig;
  std::vector<co::PdoField> room(8);
  co::PdoMapping mapping(room);
  const auto resolve = [&](std::vector<std::uint32_t> entries) {
    EXPECT_EQ(mapping.resolve(rig.values.description(), entries, PdoKind::rpdo), ok);
    return mapping.fields().size();
  };
  EXPECT_EQ(resolve({entry(0x2010, 1, 32), entry(0x2010, 2, 32)}), 1U);
  EXPECT_EQ(resolve({entry(0x2010, 2, 32), entry(0x2010, 1, 32)}), 2U);
  EXPECT_EQ(resolve({entry(0x2010, 1, 32), entry(0x2010, 3, 32)}), 2U);
  EXPECT_EQ(resolve({entry(0x0005, 0, 8), entry(0x0005, 0, 8)}), 2U);
  EXPECT_EQ(resolve({}), 0U);
  EXPECT_TRUE(mapping.empty());
}

// A mapping entry: index, sub-index, length, from the most significant byte down.
TEST(PdoMapping, A8_2_Entry) {
  const auto e = co::PdoEntry::of(0x60410208);
  EXPECT_EQ(e.object, (ObjectRef{0x6041, 2}));
  EXPECT_EQ(e.bits, 8);
  EXPECT_EQ(e.raw(), 0x60410208U);
}

}  // namespace
}  // namespace pdo_tests
