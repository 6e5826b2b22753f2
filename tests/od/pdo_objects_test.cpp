// What the records of a PDO say, whoever has the values.
#include "berth/od/pdo_objects.hpp"

#include <map>

#include "berth/od/cia301.hpp"
#include "berth/od/mapping_text.hpp"
#include "tests/pch.hpp"

namespace berth::od {
namespace {

using Given = std::map<ObjectRef, std::uint32_t>;

/// What is asked for, in this order, and what is made of the answers.
std::pair<std::vector<ObjectRef>, PdoParameters> read(const Given& given, PdoKind kind, unsigned number,
                                                      PdoReader::Scope scope = PdoReader::Scope::all) {
  std::vector<ObjectRef> asked;
  PdoReader reader(kind, number, scope);
  while (const auto ref = reader.next()) {
    asked.push_back(*ref);
    const auto it = given.find(*ref);
    reader.give(it == given.end() ? std::nullopt : std::optional(it->second));
  }
  return {asked, reader.parameters()};
}

TEST(PdoObjects, RecordsStandWhereCia301HasThem) {
  EXPECT_EQ(communication_index(PdoKind::rpdo, 1), 0x1400);
  EXPECT_EQ(communication_index(PdoKind::rpdo, 512), 0x15FF);
  EXPECT_EQ(mapping_index(PdoKind::rpdo, 512), 0x17FF);
  EXPECT_EQ(communication_index(PdoKind::tpdo, 1), 0x1800);
  EXPECT_EQ(mapping_index(PdoKind::tpdo, 512), 0x1BFF);
  for (unsigned index = 0x1000; index <= 0x2000; ++index) {
    const auto i = static_cast<std::uint16_t>(index);
    const bool communication = (index >= 0x1400 && index <= 0x15FF) || (index >= 0x1800 && index <= 0x19FF);
    const bool mapping = (index >= 0x1600 && index <= 0x17FF) || (index >= 0x1A00 && index <= 0x1BFF);
    ASSERT_EQ(is_pdo_communication(i), communication) << index;
    ASSERT_EQ(is_pdo_mapping(i), mapping) << index;
    ASSERT_EQ(is_pdo_record(i), communication || mapping) << index;
    if (mapping) {
      ASSERT_EQ(communication_of(i), index - 0x200) << index;
    }
    if (communication) {
      ASSERT_EQ(communication_of(i), index) << index;
      ASSERT_EQ(mapping_of(i), index + 0x200) << index;
    }
    ASSERT_EQ(cia301::is_additional_channel(i), index >= 0x1201 && index <= 0x12FF) << index;
    ASSERT_EQ(cia301::is_server(i), index >= 0x1200 && index <= 0x127F) << index;
  }
}

TEST(PdoObjects, AReaderAsksForOneAfterAnother) {
  const Given given{{{0x1801, 1}, 0x285}, {{0x1801, 2}, 254},         {{0x1801, 3}, 100},         {{0x1801, 5}, 50},
                    {{0x1A01, 0}, 2},     {{0x1A01, 1}, 0x6000'0110}, {{0x1A01, 2}, 0x6000'0208}, {{0x1A01, 3}, 1}};
  const auto [asked, pdo] = read(given, PdoKind::tpdo, 2);
  EXPECT_EQ(asked, (std::vector<ObjectRef>{
                       {0x1801, 1}, {0x1801, 2}, {0x1801, 3}, {0x1801, 5}, {0x1A01, 0}, {0x1A01, 1}, {0x1A01, 2}}));
  EXPECT_EQ(pdo.cob_id.key(), 0x285U);
  EXPECT_EQ(pdo.type, 254);
  EXPECT_EQ(pdo.inhibit, 100);
  EXPECT_EQ(pdo.timer, 50);
  EXPECT_EQ(pdo.entries, (std::vector<PdoEntry>{{{0x6000, 1}, 16}, {{0x6000, 2}, 8}}));
  EXPECT_EQ(pdo.bits(), 24U);
  EXPECT_TRUE(pdo.maps({0x6000, 2}));
  EXPECT_FALSE(pdo.maps({0x6000, 3}));
  const auto [few, layout] = read(given, PdoKind::tpdo, 2, PdoReader::Scope::layout);
  EXPECT_EQ(few, (std::vector<ObjectRef>{{0x1801, 1}, {0x1A01, 0}, {0x1A01, 1}, {0x1A01, 2}}))
      << "a device is not asked for what nobody wants";
  EXPECT_EQ(layout.entries, pdo.entries);
}

TEST(PdoObjects, WhatIsNotThereIsAPdoThatIsNotValid) {
  const auto [asked, pdo] = read({}, PdoKind::rpdo, 512);
  EXPECT_EQ(asked.back(), (ObjectRef{0x17FF, 0}));
  EXPECT_FALSE(pdo.cob_id.valid());
  EXPECT_EQ(pdo.type, 0xFF);
  EXPECT_TRUE(pdo.entries.empty());
  EXPECT_FALSE(pdo.is_mpdo());
}

// Values that no such object can hold, as a device with other types gives them.
TEST(PdoObjects, ValuesOutOfRangeCountAsNone) {
  const auto [asked, pdo] =
      read({{{0x1400, 2}, 300}, {{0x1400, 3}, 70'000}, {{0x1400, 5}, 70'000}, {{0x1600, 0}, 256}}, PdoKind::rpdo, 1);
  EXPECT_EQ(pdo.type, 0xFF);
  EXPECT_EQ(pdo.inhibit, 0);
  EXPECT_EQ(pdo.timer, 0);
  EXPECT_EQ(pdo.count, 0);
}

TEST(PdoObjects, AnMpdoHasNoEntries) {
  for (const unsigned count : {65U, 253U, 254U, 255U}) {
    const auto [asked, pdo] = read({{{0x1600, 0}, count}, {{0x1600, 1}, 0x6000'0108}}, PdoKind::rpdo, 1);
    EXPECT_EQ(asked.back(), (ObjectRef{0x1600, 0})) << count;
    EXPECT_TRUE(pdo.entries.empty()) << count;
    EXPECT_EQ(pdo.is_mpdo(), count >= 254) << count;
  }
  const auto [asked, pdo] = read({{{0x1600, 0}, 64}}, PdoKind::rpdo, 1);
  EXPECT_EQ(pdo.entries.size(), 64U);
}

TEST(PdoObjects, ADictionarysValuesAreRead) {
  DescriptionBuilder b;
  b.object(0x1800, ObjectCode::record, "TPDO 1");
  b.sub(0x1800, {.sub = 1, .type = DataType::unsigned32, .initial = Literal::node_id_plus(0x180)});
  b.sub(0x1800, {.sub = 2, .type = DataType::unsigned8, .initial = Literal::number(1)});
  b.object(0x1A00, ObjectCode::record, "Mapping 1");
  b.sub(0x1A00, {.sub = 0, .type = DataType::unsigned8, .initial = Literal::number(1)});
  b.sub(0x1A00, {.sub = 1, .type = DataType::unsigned32, .initial = Literal::number(0x0005'0008)});
  b.object(0x1803, ObjectCode::record, "TPDO 4");
  b.sub(0x1803, {.sub = 1, .type = DataType::unsigned32, .initial = Literal::number(0x8000'0000)});
  const std::shared_ptr<const Description> description = b.build();
  const Values values(description, NodeId(7));
  const auto pdo = read_pdo(values, PdoKind::tpdo, 1);
  EXPECT_EQ(pdo.cob_id.key(), 0x187U);
  EXPECT_EQ(pdo.type, 1);
  ASSERT_EQ(pdo.entries.size(), 1U);
  EXPECT_TRUE(pdo.entries[0].dummy());
  std::vector<unsigned> numbers;
  for_each_communication(*description, PdoKind::tpdo, [&](unsigned number) { numbers.push_back(number); });
  EXPECT_EQ(numbers, (std::vector<unsigned>{1, 4}));
  for_each_communication(*description, PdoKind::rpdo, [](unsigned) { FAIL() << "there is none"; });
}

TEST(PdoObjects, ARestrictedCanIdSaysWhatItIsKeptFor) {
  EXPECT_STREQ(restricted_use(0), "NMT");
  EXPECT_STREQ(restricted_use(0x585), "the default SDO, server to client");
  EXPECT_EQ(restricted_use(0x181), nullptr);
  EXPECT_EQ(restricted_use(0x1'0000), nullptr) << "of 29 bits";
  // CiA 301 §7.3.5, table 40: what is between the ranges may be given to PDOs.
  for (const std::uint32_t free : {0x80U, 0x100U, 0x181U, 0x580U, 0x600U, 0x680U, 0x6DFU, 0x700U}) {
    EXPECT_FALSE(restricted(free)) << free;
  }
  for (const std::uint32_t kept : {0x01U, 0x7FU, 0x101U, 0x180U, 0x5FFU, 0x601U, 0x67FU, 0x6E0U, 0x701U, 0x7FFU}) {
    EXPECT_TRUE(restricted(kept)) << kept;
  }
}

}  // namespace
}  // namespace berth::od
