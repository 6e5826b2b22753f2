// The communication objects and their rules: CiA 301 §7.5.2.
#include <fmt/format.h>

#include "berth/co/pdo_mapping.hpp"
#include "berth/doctor/conformance_parts.hpp"
#include "berth/od/cia301.hpp"

namespace berth::doctor {
namespace {

using co::CobId;

constexpr std::uint32_t wrong_signature = 0x1234'5678;
constexpr std::uint8_t vendor_id = 1;  // of 1018h, the mandatory one

}  // namespace

rt::Task<void> CommunicationChecks::mandatory() {
  const auto type = co_await device_.read(0x1000, 0);
  report_.holds("7.5.2.1", {0x1000, 0}, "the device type is there, four bytes", type.good() && type.bytes.size() == 4,
                type.words());
  if (type.good()) {
    const auto told = co_await device_.write(0x1000, 0, type.bytes);
    report_.refused("7.5.2.1", {0x1000, 0}, "a download to the device type", told, codes::read_only);
  }
  co_await error_register();
  co_await error_control();
  co_await identity();
}

rt::Task<void> CommunicationChecks::error_register() {
  const auto error = co_await device_.read(0x1001, 0);
  report_.holds("7.5.2.2", {0x1001, 0}, "the error register is there, one byte",
                error.good() && error.bytes.size() == 1, error.words());
  if (!error.good()) co_return;
  const auto bits = error.number();
  const bool generic = bits == 0 || (bits & 1U) != 0;
  report_.holds("7.5.2.2", {0x1001, 0}, "bit 0 is set when another is, bit 6 is not", generic && (bits & 0x40U) == 0,
                fmt::format("{:02X}h", bits));
  const auto told = co_await device_.write(0x1001, 0, error.bytes);
  report_.refused("7.5.2.2", {0x1001, 0}, "a download to the error register", told, codes::read_only);
}

// One of the two is mandatory.
rt::Task<void> CommunicationChecks::error_control() {
  const auto heartbeat = co_await device_.read(0x1017, 0);
  const auto guard_time = co_await device_.read(0x100C, 0);
  const auto life_time = co_await device_.read(0x100D, 0);
  report_.holds("7.5.2.20", {0x1017, 0}, "heartbeat (1017h) or node guarding (100Ch, 100Dh) is there",
                heartbeat.good() || (guard_time.good() && life_time.good()), heartbeat.words());
}

rt::Task<void> CommunicationChecks::identity() {
  const auto count = co_await device_.read(0x1018, 0);
  const auto parts = count.number();
  const bool few = count.good() && count.bytes.size() == 1 && parts >= 1 && parts <= 4;
  report_.holds("7.5.2.21", {0x1018, 0}, "the identity has one to four parts", few, count.words());
  for (std::uint8_t sub = 1; few && sub <= parts; ++sub) {
    const auto part = co_await device_.read(0x1018, sub);
    if (sub != vendor_id && described_.leaves_out(0x1018, sub, part)) {
      report_.skip("7.5.2.21", {0x1018, sub}, "a part of the identity is there",
                   "sub-index 0 counts what is not described");
      continue;
    }
    report_.holds("7.5.2.21", {0x1018, sub}, "a part of the identity is there, four bytes",
                  part.good() && part.bytes.size() == 4, part.words());
    if (!part.good()) continue;
    const auto told = co_await device_.write(0x1018, sub, part.bytes);
    report_.refused("7.5.2.21", {0x1018, sub}, "a download to the identity", told, codes::read_only);
  }
  if (few && parts < 4) {
    const auto beyond = static_cast<std::uint8_t>(parts + 1);
    const auto more = co_await device_.read(0x1018, beyond);
    report_.refused("7.5.2.21", {0x1018, beyond}, "a part of the identity after the last", more, codes::no_sub);
  }
}

rt::Task<void> CommunicationChecks::optional() {
  co_await errors();
  co_await storage();
  co_await identifiers();
  co_await sync_objects();
  co_await default_channel();
}

rt::Task<void> CommunicationChecks::errors() {
  if (!described_.has(0x1003)) co_return;
  const auto count = co_await device_.read(0x1003, 0);
  const auto errors = count.number();
  const auto* const object = options_.description->find(0x1003);
  const auto most = static_cast<std::uint64_t>(object->count) - 1;
  report_.holds("7.5.2.4", {0x1003, 0}, "it counts no more errors than it has room for", errors <= most, count.words());
  if (errors < most && errors < 0xFE) {
    const auto beyond = static_cast<std::uint8_t>(errors + 1);
    const auto empty = co_await device_.read(0x1003, beyond);
    report_.refused("7.5.2.4", {0x1003, beyond}, "an entry without an error", empty, codes::no_data);
  }
  if (!described_.settable(0x1003, 0, 1)) co_return;
  for (const unsigned value : std::array<unsigned, 2>{1, 255}) {
    const auto told = co_await device_.write_number(0x1003, 0, 1, value);
    report_.refused("7.5.2.4", {0x1003, 0}, fmt::format("the number {}", value), told, codes::bad_value);
  }
  if (!options_.lasting) co_return;
  const auto cleared = co_await device_.write_number(0x1003, 0, 1, 0);
  report_.granted("7.5.2.4", {0x1003, 0}, "0 clears the list", cleared);
  const auto now = co_await device_.read(0x1003, 0);
  report_.holds("7.5.2.4", {0x1003, 0}, "then it counts none", now.good() && now.number() == 0, now.words());
}

rt::Task<void> CommunicationChecks::storage() {
  for (const std::uint16_t index : std::array<std::uint16_t, 2>{0x1010, 0x1011}) {
    const auto* const object = options_.description ? options_.description->find(index) : nullptr;
    if (object == nullptr) continue;
    for (const auto& sub : options_.description->subs(*object)) {
      if (sub.sub == 0 || !described_.settable(index, sub.sub, 4)) continue;
      const auto able = co_await device_.read(index, sub.sub);
      const std::uint32_t known = index == 0x1010 ? 3U : 1U;
      report_.holds(paragraph_of(index), {index, sub.sub}, "its capability has no reserved bit set",
                    able.good() && (able.number() & ~std::uint64_t{known}) == 0, fmt::format("{:X}h", able.number()));
      const auto told = co_await device_.write_number(index, sub.sub, 4, wrong_signature);
      report_.refused(paragraph_of(index), {index, sub.sub}, "a wrong signature", told, codes::wrong_signature);
    }
  }
}

// COB-IDs of SYNC, TIME, EMCY and of EMCY's consumers. `in_use`: the bits that mark use; EMCY's bit 31 has the opposite
// meaning.
rt::Task<void> CommunicationChecks::identifiers() {
  co_await cob_id(0x1005, 0, CobId::second_bit);
  co_await cob_id(0x1012, 0, CobId::second_bit | CobId::invalid_bit);
  co_await cob_id(0x1014, 0, CobId::invalid_bit);
  const auto* const list = options_.description ? options_.description->find(0x1028) : nullptr;
  if (list == nullptr) co_return;
  for (const auto& sub : options_.description->subs(*list)) {
    if (sub.sub != 0 && sub.sub <= 2) co_await cob_id(0x1028, sub.sub, CobId::invalid_bit);
  }
}

rt::Task<void> CommunicationChecks::cob_id(std::uint16_t index, std::uint8_t sub, std::uint32_t in_use) {
  if (!described_.settable(index, sub, 4)) co_return;
  const bool emcy = in_use == CobId::invalid_bit;
  const auto now = co_await device_.read(index, sub);
  const auto value = static_cast<std::uint32_t>(now.number());
  const ObjectRef ref{index, sub};
  report_.holds(paragraph_of(index), ref, "the COB-ID has no bits above its identifier", CobId(value).well_formed(),
                fmt::format("{:08X}h", value));
  const std::uint32_t base = emcy ? 0 : value & ~(in_use | can::extended_mask);
  co_await must_refuse(index, sub, 4, base | malformed_bit | 0x81U, codes::bad_cob_id,
                       "bit 11 of an 11-bit identifier");
  co_await must_refuse(index, sub, 4, base | 0x1000'0081U, codes::bad_cob_id, "bit 28 of an 11-bit identifier");
  if (emcy) co_await must_refuse(index, sub, 4, value | CobId::second_bit, codes::bad_cob_id, "the reserved bit 30");
  for (const auto id : restricted) {
    co_await must_refuse(index, sub, 4, base | id, codes::bad_cob_id, "a restricted CAN-ID");
  }
  const bool used = emcy ? CobId(value).valid() : (value & in_use) != 0;
  if (!used) co_return;
  co_await must_refuse(index, sub, 4, value ^ 0x04U, codes::frozen, "another CAN-ID while it is in use");
  co_await must_refuse(index, sub, 4, value ^ CobId::frame_bit, codes::frozen, "another frame format while it is used");
}

rt::Task<void> CommunicationChecks::sync_objects() {
  if (!described_.settable(0x1019, 0, 1)) co_return;
  for (const unsigned value : std::array<unsigned, 3>{1, 241, 255}) {
    co_await must_refuse(0x1019, 0, 1, value, codes::bad_value, "an overflow value that is reserved");
  }
  const auto overflow = co_await device_.read(0x1019, 0);
  const auto period = co_await device_.read(0x1006, 0);
  const std::uint64_t other = overflow.number() == 20 ? 21 : 20;
  if (period.good() && period.number() != 0) {
    co_await must_refuse(0x1019, 0, 1, other, codes::state, "another value while 1006h is not 0");
    co_return;
  }
  if (!options_.lasting || !described_.settable(0x1006, 0, 4)) co_return;
  const auto set = co_await device_.write_number(0x1006, 0, 4, 100'000);
  report_.granted("7.5.2.6", {0x1006, 0}, "a period can be set", set);
  co_await must_refuse(0x1019, 0, 1, other, codes::state, "another value while 1006h is not 0");
  co_await device_.write_number(0x1006, 0, 4, 0);
}

rt::Task<void> CommunicationChecks::default_channel() {
  if (described_.has(0x1200)) {
    const std::uint32_t node = options_.node.value();
    const std::array<std::uint32_t, 2> wanted{0x600 + node, 0x580 + node};
    for (std::uint8_t sub = 1; sub <= 2; ++sub) {
      if (described_.find(0x1200, sub) == nullptr) continue;
      const auto told = co_await device_.read(0x1200, sub);
      report_.holds("7.5.2.33", {0x1200, sub}, "the default channel's COB-ID follows the node-ID",
                    told.number() == wanted[sub - 1U], fmt::format("{:X}h", told.number()));
      const auto other = co_await device_.write_number(0x1200, sub, 4, wanted[sub - 1U]);
      report_.refused("7.5.2.33", {0x1200, sub}, "a download to the default channel", other, codes::read_only);
    }
  }
  for (std::uint16_t index = od::cia301::first_server; index <= od::cia301::last_client; ++index) {
    if (!described_.has(index)) continue;
    for (std::uint8_t sub = 1; sub <= 2; ++sub) {
      if (!described_.settable(index, sub, 4)) continue;
      co_await must_refuse(index, sub, 4, malformed_bit, codes::bad_cob_id, "bit 11 of an 11-bit identifier");
      for (const std::uint32_t id : {restricted.front(), restricted.back()}) {
        co_await must_refuse(index, sub, 4, id, codes::bad_cob_id, "a restricted CAN-ID");
      }
    }
  }
}

rt::Task<void> CommunicationChecks::consumer_entries() {
  if (!described_.settable(0x1016, 1, 4)) co_return;
  co_await must_refuse(0x1016, 1, 4, 0x0100'0000U, codes::bad_value, "a reserved bit");
  if (!described_.settable(0x1016, 2, 4)) co_return;
  const auto one = co_await device_.read(0x1016, 1);
  const auto two = co_await device_.read(0x1016, 2);
  const auto empty = co_await device_.write_number(0x1016, 2, 4, 0);
  report_.granted("7.5.2.19", {0x1016, 2}, "0 ends supervision", empty);
  const auto set = co_await device_.write_number(0x1016, 1, 4, 0x007E'03E8U);
  report_.granted("7.5.2.19", {0x1016, 1}, "a node can be supervised", set);
  const auto twice = co_await device_.write_number(0x1016, 2, 4, 0x007E'07D0U);
  report_.refused("7.5.2.19", {0x1016, 2}, "one node in two entries", twice, codes::twice);
  co_await device_.write(0x1016, 1, one.bytes);
  co_await device_.write(0x1016, 2, two.bytes);
}

}  // namespace berth::doctor
