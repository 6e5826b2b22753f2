// The objects of the communication profile as a device shows them over SDO (docs/protocols/cia301.md §CAN-IDs, §Data
// types, §Emergencies), and those that only hold a value.
#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::device::test {
namespace {

using od::AbortCode;
using od::Access;
using od::DataType;
using od::Literal;

Options node9() { return {.address = address_of(5), .node_id = NodeId(9), .bit_rate = 500'000}; }

/// Everything that a device may have and that does not act by itself.
std::shared_ptr<const od::Description> full() {
  od::DescriptionBuilder b;
  add_device(b, {.type = 0x00020191,
                 .name = "A long name of a device",
                 .hardware_version = "H 1.0",
                 .software_version = "S 2.1",
                 .errors_kept = 4});
  add_sync(b);
  b.variable(0x1002, {.access = Access::ro, .mappable = true, .initial = Literal::number(0)});
  b.variable(0x1013, {.mappable = true, .initial = Literal::number(0)});
  b.variable(0x1021, {.type = DataType::domain, .access = Access::ro, .capacity = 4});
  b.variable(0x1022, {.type = DataType::unsigned8, .access = Access::ro, .initial = Literal::number(0)});
  b.object(0x1023, od::ObjectCode::record, "OS command");
  b.sub(0x1023, {.sub = 1, .type = DataType::octet_string, .capacity = 16});
  b.sub(0x1023, {.sub = 2, .type = DataType::unsigned8, .access = Access::ro, .initial = Literal::number(0)});
  b.sub(0x1023, {.sub = 3, .type = DataType::octet_string, .access = Access::ro, .initial = Literal::text("ok!")});
  b.variable(0x1024, {.type = DataType::unsigned8, .access = Access::wo});
  b.object(0x1025, od::ObjectCode::record, "OS debugger interface");
  b.sub(0x1025, {.sub = 1, .type = DataType::octet_string, .capacity = 16});
  b.sub(0x1025, {.sub = 2, .type = DataType::unsigned8, .access = Access::ro, .initial = Literal::number(0xFF)});
  b.object(0x1026, od::ObjectCode::array, "OS prompt");
  b.sub(0x1026, {.sub = 1, .type = DataType::unsigned8, .access = Access::wo});
  b.sub(0x1026, {.sub = 2, .type = DataType::unsigned8, .access = Access::ro, .initial = Literal::number('>')});
  b.object(0x1027, od::ObjectCode::array, "Module list");
  b.sub(0x1027, {.sub = 1, .type = DataType::unsigned16, .access = Access::ro, .initial = Literal::number(0x0A05)});
  b.sub(0x1027, {.sub = 2, .type = DataType::unsigned16, .access = Access::ro, .initial = Literal::number(0x0A06)});
  b.object(0x1028, od::ObjectCode::array, "Emergency consumer");
  for (std::uint8_t i = 1; i <= 20; ++i) {
    b.sub(0x1028, {.sub = i, .initial = Literal::number(0x8000'0000)});
  }
  b.variable(0x102A, {.type = DataType::unsigned16, .initial = Literal::number(0)});
  b.variable(0x2000, {.type = DataType::unsigned32, .mappable = true, .initial = Literal::number(0)});
  for (unsigned n = 1; n <= 5; ++n) {
    add_tpdo(b, n, {.map = {{{0x2000, 0}, 32}}});
    add_rpdo(b, n, {.map = {{{0x2000, 0}, 32}}});
  }
  return b.build();
}

struct Site {
  explicit Site(std::shared_ptr<const od::Description> description = full(), Options options = node9())
      : node(rig.world, rig.bus, std::move(options), {}, {}, std::move(description)) {
    node.on();
    rig.run(milliseconds(2));
  }
  /// The bytes of an object of any length, by SDO.
  std::string upload(std::uint16_t index, std::uint8_t sub) {
    const auto first = rig.read(index, sub);
    const auto frame = can::parse_frame(first);
    if (!frame) return "no answer";
    const auto command = frame->data[0];
    const auto* bytes = reinterpret_cast<const char*>(frame->data.data());
    if (command == 0x80) return "aborted";
    if ((command & 2U) != 0) return {bytes + 4, 4U - (command >> 2U & 3U)};
    std::string all;
    for (bool toggle = false;; toggle = !toggle) {
      const auto segment =
          can::parse_frame(rig.answer(toggle ? "609#7000000000000000" : "609#6000000000000000", milliseconds(5)));
      if (!segment || segment->data[0] == 0x80) return "aborted";
      all.append(reinterpret_cast<const char*>(segment->data.data()) + 1, 7U - (segment->data[0] >> 1U & 7U));
      if ((segment->data[0] & 1U) != 0) return all;
    }
  }
  Rig rig;
  Node node;
};

// A2.3: the mandatory objects: device type, error register, identity.
TEST(Objects, A2_3_OD_1000_OD_1001_OD_1018_MandatoryObjects) {
  Site s;
  EXPECT_EQ(s.rig.read(0x1000, 0), Rig::value(0x1000, 0, 4, 0x00020191)) << "bits 15..0 profile 401";
  EXPECT_EQ(s.rig.write(0x1000, 0, 4, 1), Rig::refused(0x1000, 0, AbortCode::read_only));
  EXPECT_EQ(s.rig.read(0x1001, 0), Rig::value(0x1001, 0, 1, 0));
  EXPECT_EQ(s.rig.read(0x1018, 0), Rig::value(0x1018, 0, 1, 4));
  const auto a = address_of(5);
  const std::array<std::uint32_t, 4> parts{a.vendor, a.product, a.revision, a.serial};
  for (std::uint8_t i = 1; i <= 4; ++i) {
    EXPECT_EQ(s.rig.read(0x1018, i), Rig::value(0x1018, i, 4, parts[i - 1U]));
    EXPECT_EQ(s.rig.write(0x1018, i, 4, 1), Rig::refused(0x1018, i, AbortCode::read_only));
  }
  Site minimal(minimal_description());
  for (const std::uint16_t index : {std::uint16_t{0x1000}, std::uint16_t{0x1001}}) {
    EXPECT_TRUE(minimal.rig.read(index, 0).starts_with("589#4"));
  }
}

// A2.2: sub-index 0 is the highest sub-index; FFh, the structure, is optional and not there.
TEST(Objects, A2_2_SubIndexZeroAndFF) {
  Site s;
  EXPECT_EQ(s.rig.read(0x1027, 0), Rig::value(0x1027, 0, 1, 2));
  EXPECT_EQ(s.rig.read(0x1028, 0), Rig::value(0x1028, 0, 1, 20));
  EXPECT_EQ(s.rig.write(0x1028, 0, 1, 3), Rig::refused(0x1028, 0, AbortCode::read_only));
  EXPECT_EQ(s.rig.read(0x1018, 5), Rig::refused(0x1018, 5, AbortCode::no_sub_index));
  EXPECT_EQ(s.rig.read(0x1018, 0xFF), Rig::refused(0x1018, 0xFF, AbortCode::no_sub_index));
  EXPECT_EQ(s.rig.read(0x1000, 1), Rig::refused(0x1000, 1, AbortCode::no_sub_index));
  EXPECT_EQ(s.rig.read(0x100E, 0), Rig::refused(0x100E, 0, AbortCode::no_object));
}

// A1.1: the predefined connection set follows the node-ID, and changes with it.
TEST(Objects, A1_1_PredefinedConnectionSet) {
  Site s;
  const auto check = [&](std::uint32_t id) {
    const auto get = [&](std::uint16_t index, std::uint8_t sub) {
      return s.node.device.values().get_or<std::uint32_t>({index, sub}, 0);
    };
    EXPECT_EQ(get(0x1014, 0), 0x080 + id);
    EXPECT_EQ(get(0x1200, 1), 0x600 + id);
    EXPECT_EQ(get(0x1200, 2), 0x580 + id);
    EXPECT_EQ(get(0x1005, 0), 0x080U);
    for (unsigned n = 0; n < 4; ++n) {
      EXPECT_EQ(get(static_cast<std::uint16_t>(0x1800 + n), 1), 0x4000'0180 + 0x100 * n + id);
      EXPECT_EQ(get(static_cast<std::uint16_t>(0x1400 + n), 1), 0x200 + 0x100 * n + id);
    }
    EXPECT_EQ(get(0x1804, 1) & 0x8000'0000, 0x8000'0000) << "the fifth has no identifier of its own";
    EXPECT_EQ(get(0x1404, 1) & 0x8000'0000, 0x8000'0000);
  };
  check(9);
  s.rig.give_id(address_of(5), 3);
  s.rig.ask("000#8209");
  EXPECT_EQ(s.node.device.node_id(), NodeId(3));
  check(3);
}

// Strings that are longer than four bytes come in segments, and nobody writes them.
TEST(Objects, OD_1008_OD_1009_OD_100A_NamesAndVersions) {
  Site s;
  EXPECT_EQ(s.upload(0x1008, 0), "A long name of a device");
  EXPECT_EQ(s.upload(0x1009, 0), "H 1.0");
  EXPECT_EQ(s.upload(0x100A, 0), "S 2.1");
  EXPECT_EQ(s.rig.write(0x1008, 0, 4, 0x41414141), Rig::refused(0x1008, 0, AbortCode::read_only));
  auto options = node9();
  options.name = "left";
  Site named(full(), options);
  EXPECT_EQ(named.upload(0x1008, 0), "left");
}

// 1002h is the maker's: the application sets it, the network reads it.
TEST(Objects, OD_1002_ManufacturerStatusRegister) {
  Site s;
  auto status = s.node.device.variable<std::uint32_t>({0x1002, 0});
  ASSERT_TRUE(status.valid());
  EXPECT_TRUE(status.set(0xCAFE0001));
  EXPECT_EQ(s.rig.read(0x1002, 0), Rig::value(0x1002, 0, 4, 0xCAFE0001));
  EXPECT_EQ(s.rig.write(0x1002, 0, 4, 0), Rig::refused(0x1002, 0, AbortCode::read_only));
}

TEST(Objects, OD_1013_OD_102A_PlainValues) {
  Site s;
  EXPECT_EQ(s.rig.write(0x1013, 0, 4, 123456), Rig::done(0x1013, 0));
  EXPECT_EQ(s.rig.read(0x1013, 0), Rig::value(0x1013, 0, 4, 123456));
  EXPECT_EQ(s.rig.write(0x102A, 0, 2, 50), Rig::done(0x102A, 0)) << "the inhibit time of an NMT master";
  EXPECT_EQ(s.rig.read(0x102A, 0), Rig::value(0x102A, 0, 2, 50));
  s.rig.ask("000#8209");
  EXPECT_EQ(s.rig.read(0x102A, 0), Rig::value(0x102A, 0, 2, 0));
}

// OD.1021, OD.1022: the stored EDS is served from where it stands, however long it is.
TEST(Objects, OD_1021_OD_1022_StoredEds) {
  EXPECT_EQ(Site().rig.read(0x1021, 0), Rig::refused(0x1021, 0, AbortCode::no_data));
  std::string eds = "[FileInfo]\r\nFileName=a.eds\r\n";
  while (eds.size() < 5000) eds += ";" + std::to_string(eds.size()) + "\n";
  Options options = node9();
  options.eds = {reinterpret_cast<const std::uint8_t*>(eds.data()), eds.size()};
  Site s(full(), std::move(options));
  EXPECT_EQ(s.upload(0x1021, 0), eds);
  EXPECT_EQ(s.upload(0x1022, 0), std::string(1, '\0')) << "0: ASCII, not compressed";
}

// Objects of an operating system on the device: values as described; what they mean is the application's.
TEST(Objects, OD_1023_OD_1024_OD_1025_OD_1026_OD_1027_AsDescribed) {
  Site s;
  EXPECT_EQ(s.rig.write(0x1023, 1, 4, 0x0A736C2F), Rig::done(0x1023, 1));
  EXPECT_EQ(s.upload(0x1023, 1), "/ls\n");
  EXPECT_EQ(s.rig.read(0x1023, 2), Rig::value(0x1023, 2, 1, 0));
  EXPECT_EQ(s.upload(0x1023, 3), "ok!");
  EXPECT_EQ(s.rig.write(0x1023, 3, 4, 0), Rig::refused(0x1023, 3, AbortCode::read_only));
  EXPECT_EQ(s.rig.write(0x1024, 0, 1, 2), Rig::done(0x1024, 0));
  EXPECT_EQ(s.rig.read(0x1024, 0), Rig::refused(0x1024, 0, AbortCode::write_only));
  EXPECT_EQ(s.rig.write(0x1025, 1, 2, 0x4142), Rig::done(0x1025, 1));
  EXPECT_EQ(s.upload(0x1025, 1), "BA");
  EXPECT_EQ(s.rig.read(0x1025, 2), Rig::value(0x1025, 2, 1, 0xFF));
  EXPECT_EQ(s.rig.write(0x1026, 1, 1, 'x'), Rig::done(0x1026, 1));
  EXPECT_EQ(s.rig.read(0x1026, 1), Rig::refused(0x1026, 1, AbortCode::write_only));
  EXPECT_EQ(s.rig.read(0x1026, 2), Rig::value(0x1026, 2, 1, '>'));
  EXPECT_EQ(s.rig.read(0x1027, 2), Rig::value(0x1027, 2, 2, 0x0A06));
}

// A6.2, OD.1003: newest first, the oldest drops out; 0 clears, anything else 0609 0030; beyond the count 0800 0024.
TEST(Objects, A6_2_OD_1003_PreDefinedErrorField) {
  Site s;
  auto& device = s.node.device;
  EXPECT_EQ(s.rig.read(0x1003, 0), Rig::value(0x1003, 0, 1, 0));
  EXPECT_EQ(s.rig.read(0x1003, 1), Rig::refused(0x1003, 1, AbortCode::no_data));
  for (unsigned i = 1; i <= 6; ++i) {
    EXPECT_TRUE(
        device.errors().raise(static_cast<std::uint16_t>(0xFF00 + i), 0x80, {static_cast<std::uint8_t>(i), 0xA0}));
  }
  EXPECT_EQ(s.rig.read(0x1003, 0), Rig::value(0x1003, 0, 1, 4)) << "as many as the dictionary has places";
  for (std::uint8_t i = 1; i <= 4; ++i) {
    EXPECT_EQ(s.rig.read(0x1003, i), Rig::value(0x1003, i, 4, 0xA000FF00U + (7U - i) + ((7U - i) << 16U)));
  }
  EXPECT_TRUE(device.errors().clear(0xFF01));
  EXPECT_EQ(s.rig.read(0x1003, 0), Rig::value(0x1003, 0, 1, 4))
      << "what is gone is no error: not kept, and kept what was";
  EXPECT_EQ(s.rig.write(0x1003, 0, 1, 2), Rig::refused(0x1003, 0, AbortCode::invalid_value));
  EXPECT_EQ(s.rig.write(0x1003, 0, 1, 0), Rig::done(0x1003, 0));
  EXPECT_EQ(s.rig.read(0x1003, 0), Rig::value(0x1003, 0, 1, 0));
  EXPECT_EQ(s.rig.read(0x1003, 1), Rig::refused(0x1003, 1, AbortCode::no_data));
  EXPECT_EQ(s.rig.read(0x1001, 0), Rig::value(0x1001, 0, 1, 0x81)) << "the errors themselves are still there";
}

// A6.3: bit 0 is set with any other; the register is what all active errors say together.
TEST(Objects, A6_3_OD_1001_ErrorRegister) {
  Site s;
  auto& device = s.node.device;
  const auto shown = [&] { return s.rig.read(0x1001, 0); };
  device.errors().raise(0x4200, co::error_register::temperature);
  EXPECT_EQ(shown(), Rig::value(0x1001, 0, 1, 0x09));
  device.errors().raise(0x2310, co::error_register::current);
  EXPECT_EQ(shown(), Rig::value(0x1001, 0, 1, 0x0B));
  device.errors().clear(0x4200);
  EXPECT_EQ(shown(), Rig::value(0x1001, 0, 1, 0x03));
  EXPECT_EQ(s.rig.record.count("089#1023030000000000"), 1U) << "what remains, with the register as it is";
  device.errors().clear(0x2310);
  EXPECT_EQ(shown(), Rig::value(0x1001, 0, 1, 0));
  EXPECT_EQ(s.rig.record.count("089#0000000000000000"), 1U);
  EXPECT_FALSE(device.errors().clear(0x2310));
  s.rig.ask("000#0109");
  device.errors().behave(0);
  EXPECT_EQ(device.state(), NmtState::operational) << "1029h:00 is a count, no class";
  device.errors().behave(9);
  EXPECT_EQ(device.state(), NmtState::pre_operational) << "a class that is not described: as the default 0";
}

// OD.1014: bit 31, the frozen identifier, restricted ones; OD.1015: the inhibit time between two messages.
TEST(Objects, OD_1014_OD_1015_EmergencyIdentifierAndInhibitTime) {
  Site s;
  EXPECT_EQ(s.rig.write(0x1014, 0, 4, 0x8A), Rig::refused(0x1014, 0, AbortCode::invalid_value));
  EXPECT_EQ(s.rig.write(0x1014, 0, 4, 0x80000089), Rig::done(0x1014, 0));
  s.node.device.errors().raise(0xFF01, 0x80);
  s.rig.run(milliseconds(5));
  EXPECT_EQ(s.rig.record.count("089#01FF810000000000"), 0U) << "not valid: it waits";
  for (const std::uint32_t restricted : {0x000U, 0x07FU, 0x101U, 0x180U, 0x581U, 0x601U, 0x6E0U, 0x701U, 0x7FFU}) {
    EXPECT_EQ(s.rig.write(0x1014, 0, 4, restricted), Rig::refused(0x1014, 0, AbortCode::invalid_value)) << restricted;
  }
  // Bits 28..11 belong to 29-bit identifiers, bit 30 is reserved (CiA 301 §7.5.2.17), valid or not.
  for (const std::uint32_t malformed : {0x889U, 0x1000'0089U, 0x4000'0089U, 0x6000'0089U, 0x8000'0889U, 0xC000'0089U}) {
    EXPECT_EQ(s.rig.write(0x1014, 0, 4, malformed), Rig::refused(0x1014, 0, AbortCode::invalid_value)) << malformed;
  }
  EXPECT_EQ(s.rig.write(0x1015, 0, 2, 100), Rig::done(0x1015, 0));  // 10 ms
  EXPECT_EQ(s.rig.write(0x1014, 0, 4, 0x0FE), Rig::done(0x1014, 0));
  EXPECT_EQ(s.rig.record.count("0FE#01FF810000000000"), 1U);
  s.rig.record.clear();
  for (unsigned i = 2; i <= 4; ++i) s.node.device.errors().raise(static_cast<std::uint16_t>(0xFF00 + i), 0x80);
  s.rig.run(milliseconds(50));
  ASSERT_EQ(s.rig.record.times.size(), 3U);
  for (unsigned i = 1; i < 3; ++i) EXPECT_GE(s.rig.record.times[i] - s.rig.record.times[i - 1], microseconds(9700));
}

// OD.1028: whom a device hears; the application is told.
TEST(Objects, OD_1028_EmergencyConsumer) {
  Site s;
  std::vector<std::pair<unsigned, unsigned>> heard;
  s.node.device.on().emergency = [&](NodeId node, const co::Emcy& message) {
    heard.emplace_back(node.value(), message.code);
  };
  s.rig.ask("083#30810100000000AA");
  EXPECT_TRUE(heard.empty());
  for (const std::uint32_t malformed : {0x883U, 0x4000'0083U, 0x8000'0883U, 0xC000'0083U}) {
    EXPECT_EQ(s.rig.write(0x1028, 3, 4, malformed), Rig::refused(0x1028, 3, AbortCode::invalid_value)) << malformed;
  }
  EXPECT_EQ(s.rig.write(0x1028, 3, 4, 0x083), Rig::done(0x1028, 3));
  EXPECT_EQ(s.rig.write(0x1028, 4, 4, 0x0FD), Rig::done(0x1028, 4)) << "another identifier for node 4";
  s.rig.ask("083#30810100000000AA");
  s.rig.ask("0FD#0023050000000000");
  s.rig.ask("084#0023050000000000");
  EXPECT_EQ(heard, (std::vector<std::pair<unsigned, unsigned>>{{3, 0x8130}, {4, 0x2300}}));
  EXPECT_EQ(s.rig.write(0x1028, 3, 4, 0x084), Rig::refused(0x1028, 3, AbortCode::invalid_value));
  EXPECT_EQ(s.rig.write(0x1028, 5, 4, 0x601), Rig::refused(0x1028, 5, AbortCode::invalid_value));
}

// A device's own handles: types that do not fit, objects that are not there.
TEST(Objects, HandlesOfTheApplication) {
  Site s;
  auto& device = s.node.device;
  EXPECT_FALSE(device.variable<std::uint8_t>({0x2000, 0}).valid()) << "cannot hold an UNSIGNED32";
  EXPECT_FALSE(device.variable<float>({0x2000, 0}).valid());
  EXPECT_FALSE(device.variable<std::uint32_t>({0x2001, 0}).valid());
  auto missing = device.variable<std::uint32_t>({0x2000, 1});
  EXPECT_FALSE(missing.set(1));
  EXPECT_FALSE(missing.store(1));
  EXPECT_EQ(missing.get(), 0U);
  auto wide = device.variable<std::uint64_t>({0x2000, 0});
  EXPECT_TRUE(wide.valid());
  EXPECT_FALSE(wide.set(0x1'0000'0000)) << "beyond the object's range";
  EXPECT_TRUE(wide.set(0xFFFF'FFFF));
  EXPECT_EQ(wide.get(), 0xFFFF'FFFFU);
  int calls = 0;
  device.on_write({0x2000, 0}, [&] { ++calls; });
  EXPECT_EQ(s.rig.write(0x2000, 0, 4, 7), Rig::done(0x2000, 0));
  EXPECT_EQ(calls, 1);
  wide.set(8);
  EXPECT_EQ(calls, 1) << "the application knows what it wrote itself";
  std::array<int, 3> entries{};
  for (std::uint8_t i = 0; i < 3; ++i)
    device.on_write({0x1028, static_cast<std::uint8_t>(i + 1)}, [&, i] { ++entries[i]; });
  device.on_write({0x1028, 2}, [&] { ++entries[1]; });
  EXPECT_EQ(s.rig.write(0x1028, 2, 4, 0x082), Rig::done(0x1028, 2));
  EXPECT_EQ(entries, (std::array<int, 3>{0, 2, 0})) << "each callback once, of its own sub-index only";
}

}  // namespace
}  // namespace berth::device::test
