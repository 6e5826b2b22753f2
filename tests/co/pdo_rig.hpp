// A device with PDOs, SYNC and a dictionary to map, and a peer, on the ideal wire.
#pragma once

#include <gtest/gtest.h>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/base/bytes.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/sync.hpp"
#include "wire.hpp"

namespace berth::test {

using od::Access;
using od::DataType;
using Indices = std::initializer_list<std::uint16_t>;

inline std::uint32_t entry(std::uint16_t index, std::uint8_t sub, std::uint8_t bits) {
  return co::PdoEntry{{index, sub}, bits}.raw();
}

struct RigOptions {
  unsigned rpdos = 4;
  unsigned tpdos = 4;
  std::uint8_t entries = 8;  // of each mapping record
  bool mpdo_lists = true;
  bool sync_counter = true;
};

inline void add_application_objects(od::DescriptionBuilder& b) {
  const auto variable = [&](std::uint16_t index, DataType type, Access access = Access::rw, bool mappable = true) {
    b.variable(index, {.name = "x", .type = type, .access = access, .mappable = mappable});
  };
  variable(0x1013, DataType::unsigned32);
  variable(0x2001, DataType::unsigned8);
  variable(0x2002, DataType::unsigned16);
  variable(0x2003, DataType::unsigned32);
  variable(0x2004, DataType::unsigned64);
  variable(0x2005, DataType::boolean);
  variable(0x2006, DataType::integer24);
  variable(0x2007, DataType::unsigned16, Access::rwr);
  variable(0x2008, DataType::unsigned16, Access::rww);
  variable(0x2009, DataType::unsigned8, Access::ro);
  variable(0x200A, DataType::unsigned8, Access::wo);
  variable(0x200B, DataType::unsigned8, Access::constant);
  variable(0x200C, DataType::unsigned8, Access::rw, false);
  b.variable(0x200D, {.name = "text", .type = DataType::visible_string, .mappable = true, .capacity = 8});
  b.variable(0x2012, {.name = "limited",
                      .type = DataType::unsigned8,
                      .mappable = true,
                      .low = od::Literal::number(10),
                      .high = od::Literal::number(20)});
  b.object(0x2010, od::ObjectCode::array, "words");
  b.object(0x2011, od::ObjectCode::array, "bits");
  for (std::uint8_t sub = 1; sub <= 8; ++sub) b.sub(0x2010, {.sub = sub, .name = "w", .mappable = true});
  for (std::uint8_t sub = 1; sub <= 65; ++sub) {
    b.sub(0x2011, {.sub = sub, .name = "b", .type = DataType::boolean, .mappable = true});
  }
  b.dummies(0xFE);
}

inline void add_pdo_records(od::DescriptionBuilder& b, std::uint16_t communication, std::uint8_t entries) {
  b.object(communication, od::ObjectCode::record, "PDO communication", DataType::pdo_communication);
  b.sub(communication, {.sub = 1, .name = "COB-ID", .initial = od::Literal::number(0x80000000)});
  b.sub(communication, {.sub = 2, .name = "type", .type = DataType::unsigned8, .initial = od::Literal::number(0xFF)});
  b.sub(communication, {.sub = 3, .name = "inhibit time", .type = DataType::unsigned16});
  b.sub(communication, {.sub = 4, .name = "reserved", .type = DataType::unsigned8});
  b.sub(communication, {.sub = 5, .name = "event timer", .type = DataType::unsigned16});
  b.sub(communication, {.sub = 6, .name = "SYNC start value", .type = DataType::unsigned8});
  const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
  b.object(mapping, od::ObjectCode::record, "PDO mapping", DataType::pdo_mapping);
  b.sub(mapping, {.sub = 0, .name = "count", .type = DataType::unsigned8, .initial = od::Literal::number(0)});
  for (std::uint8_t i = 1; i <= entries; ++i) b.sub(mapping, {.sub = i, .name = "entry"});
}

inline std::shared_ptr<const od::Description> pdo_description(const RigOptions& options = {}) {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = Access::ro});
  b.variable(0x1005, {.name = "COB-ID SYNC", .initial = od::Literal::number(0x80)});
  b.variable(0x1006, {.name = "Communication cycle period"});
  b.variable(0x1007, {.name = "Synchronous window length"});
  if (options.sync_counter) b.variable(0x1019, {.name = "Overflow", .type = DataType::unsigned8});
  add_application_objects(b);
  for (unsigned n = 0; n < options.rpdos; ++n)
    add_pdo_records(b, static_cast<std::uint16_t>(0x1400 + n), options.entries);
  for (unsigned n = 0; n < options.tpdos; ++n)
    add_pdo_records(b, static_cast<std::uint16_t>(0x1800 + n), options.entries);
  if (options.mpdo_lists) {
    b.object(0x1FA0, od::ObjectCode::array, "scanner list");
    b.object(0x1FD0, od::ObjectCode::array, "dispatching list");
    for (std::uint8_t i = 1; i <= 4; ++i) {
      b.sub(0x1FA0, {.sub = i, .name = "entry"});
      b.sub(0x1FD0, {.sub = i, .name = "entry", .type = DataType::unsigned64});
    }
  }
  return b.build();
}

// Keeps what the services report; checks the promise that an error is raised once and cleared once.
struct Owner final : co::ServiceOwner {
  void raise_error(std::uint16_t code, std::uint8_t bits, const std::array<std::uint8_t, 5>& info) noexcept override {
    EXPECT_TRUE(active.insert(code).second) << "raised twice";
    EXPECT_EQ(bits, co::error_register::communication);
    events.push_back(fmt(code, "on"));
    last_info = info;
  }
  void clear_error(std::uint16_t code) noexcept override {
    EXPECT_EQ(active.erase(code), 1U) << "cleared without being raised";
    events.push_back(fmt(code, "off"));
  }
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept override { return own * scale; }
  static std::string fmt(std::uint16_t code, const char* what) {
    char text[16];
    std::snprintf(text, sizeof text, "%04X %s", code, what);
    return text;
  }
  std::set<std::uint16_t> active;
  Log events;
  std::array<std::uint8_t, 5> last_info{};
  int scale = 1;
};

struct Rig : Bench, co::Pdos::Observer {
  static constexpr NodeId node{5};
  explicit Rig(const RigOptions& options = {}) : Rig(pdo_description(options)) {}
  explicit Rig(std::shared_ptr<const od::Description> description) : values(std::move(description), node) {
    pdos.observe(this);
  }
  void received(unsigned number, rt::Time) noexcept override { stored.push_back("RPDO " + std::to_string(number)); }
  void received_mpdo(ObjectRef object, rt::Time) noexcept override {
    char text[16];
    std::snprintf(text, sizeof text, "%04X:%02X", object.index, object.sub);
    stored.emplace_back(text);
  }

  // A network write.
  template <class T>
  od::AbortCode write(std::uint16_t index, std::uint8_t sub, T value) {
    std::uint8_t bytes[sizeof(T)];
    store_le(bytes, value);
    return values.write({index, sub}, bytes);
  }
  od::AbortCode write_u8(std::uint16_t index, std::uint8_t sub, unsigned value) {
    return write(index, sub, static_cast<std::uint8_t>(value));
  }
  od::AbortCode write_u16(std::uint16_t index, std::uint8_t sub, unsigned value) {
    return write(index, sub, static_cast<std::uint16_t>(value));
  }
  od::AbortCode write_u32(std::uint16_t index, std::uint8_t sub, std::uint32_t value) {
    return write(index, sub, value);
  }

  struct Pdo {
    std::uint32_t cob_id = 0;
    std::uint8_t type = 0xFF;
    std::vector<std::uint32_t> map = {};
    std::uint16_t inhibit = 0;
    std::uint16_t timer = 0;
    std::uint8_t start = 0;
  };
  // The standard's sequence, over the network.
  void configure(std::uint16_t communication, const Pdo& pdo) {
    const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
    const auto none = od::AbortCode::none;
    EXPECT_EQ(write_u32(communication, 1, 0x80000000U | pdo.cob_id), none);
    EXPECT_EQ(write_u8(mapping, 0, 0), none);
    EXPECT_EQ(write_u8(communication, 2, pdo.type), none);
    EXPECT_EQ(write_u16(communication, 3, pdo.inhibit), none);
    EXPECT_EQ(write_u16(communication, 5, pdo.timer), none);
    EXPECT_EQ(write_u8(communication, 6, pdo.start), none);
    std::uint8_t sub = 0;
    for (const auto raw : pdo.map) EXPECT_EQ(write_u32(mapping, ++sub, raw), none);
    EXPECT_EQ(write_u8(mapping, 0, sub), none);
    EXPECT_EQ(write_u32(communication, 1, pdo.cob_id), none);
  }
  void tpdo(unsigned number, const Pdo& pdo) { configure(static_cast<std::uint16_t>(0x17FF + number), pdo); }
  void rpdo(unsigned number, const Pdo& pdo) { configure(static_cast<std::uint16_t>(0x13FF + number), pdo); }

  // The peer sends; all of it is done when this returns.
  void hear(const char* frame) {
    peer.send(frame);
    run(1ms);
    std::erase(wire.log, frame);
  }
  // What the device sent since the last call.
  Log take() {
    wire.times.clear();
    return std::exchange(wire.log, {});
  }
  Log take_stored() { return std::exchange(stored, {}); }

  Station device{wire};
  Station peer{wire};
  od::Values values;
  Owner owner;
  co::Pdos pdos{device.dispatcher, values, owner};
  Log stored;
};

}  // namespace berth::test
