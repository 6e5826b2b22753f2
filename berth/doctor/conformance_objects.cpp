// Every object of the description: CiA 301 §7.4, and the access that it describes.
#include <fmt/format.h>

#include "berth/doctor/conformance_parts.hpp"
#include "berth/od/cia301.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::doctor {
namespace {

constexpr std::string_view access = "7.2.4.3.17", sub_indices = "7.4";
constexpr std::uint8_t structure_sub = 0xFF;

using od::within;

/// A write would start an action, or the object has its own rules (conformance_communication.cpp).
bool acts(std::uint16_t index) noexcept {
  return within(index, 0x1003, 0x1003) || within(index, 0x1010, 0x1011) || within(index, 0x1023, 0x1026) ||
         within(index, od::cia301::default_server, od::cia301::last_client) || od::is_pdo_record(index) ||
         within(index, 0x1F50, 0x1F9F);
}
bool communication(std::uint16_t index) noexcept { return within(index, 0x1000, 0x1FFF); }
/// Sub-index 0 counts used entries, not existing ones.
bool counts_use(std::uint16_t index) noexcept { return index == 0x1003 || od::is_pdo_mapping(index); }
/// Reserved in a PDO's communication record (§7.5.2.35).
bool reserved(std::uint16_t index, std::uint8_t sub) noexcept {
  return sub == od::pdo_sub::reserved && od::is_pdo_communication(index);
}

}  // namespace

rt::Task<void> ObjectChecks::run() {
  if (!options_.description) {
    report_.skip("7.4", {}, "the objects of the device", "no description (EDS) is given");
    co_return;
  }
  for (const auto& each : options_.description->objects()) {
    if (each.index >= 0x1000 && device_.reachable()) co_await object(each);
  }
}

rt::Task<void> ObjectChecks::object(const od::Object& object) {
  for (const auto& sub : options_.description->subs(object)) co_await sub_object(object, sub);
  using od::ObjectCode;
  const bool has_subs = object.code == ObjectCode::array || object.code == ObjectCode::record;
  if (has_subs && described_.find(object.index, 0) != nullptr) {
    co_await highest_sub(object);
  } else if (!has_subs) {
    const auto more = co_await device_.read(object.index, 1);
    report_.refused(sub_indices, {object.index, 1}, "sub-index 1 of an object without sub-objects", more,
                    codes::no_sub);
  }
}

rt::Task<void> ObjectChecks::highest_sub(const od::Object& object) {
  const auto count = co_await device_.read(object.index, 0);
  const ObjectRef ref{object.index, 0};
  if (!count.good()) co_return;  // already reported
  const auto subs = options_.description->subs(object);
  std::uint8_t highest = 0;
  for (const auto& sub : subs) {
    if (sub.sub != structure_sub) highest = std::max(highest, sub.sub);
  }
  const auto told = count.number();
  if (counts_use(object.index)) {
    report_.holds(sub_indices, ref, "sub-index 0 counts no more than there are", told <= highest || told >= 0xFE,
                  fmt::format("it says {}, {} are described", told, highest));
  } else {
    const auto& first = subs.front();
    const auto written = options_.description->default_of(first);
    const bool contradiction = written.kind == od::Literal::Kind::number && written.raw != highest;
    const char* const what = "sub-index 0 is the highest sub-index";
    if (contradiction) {
      report_.skip(sub_indices, ref, what,
                   fmt::format("the description contradicts itself: {} and {}", written.raw, highest));
    } else {
      report_.holds(sub_indices, ref, what, told == highest,
                    fmt::format("it says {}, {} are described", told, highest));
    }
  }
  if (highest >= 0xFE) co_return;
  const auto beyond = static_cast<std::uint8_t>(highest + 1);
  const auto more = co_await device_.read(object.index, beyond);
  report_.refused(sub_indices, {object.index, beyond}, "the sub-index after the highest", more, codes::no_sub);
}

rt::Task<void> ObjectChecks::sub_object(const od::Object& object, const od::SubObject& sub) {
  const std::uint16_t index = object.index;
  const ObjectRef ref{index, sub.sub};
  if (reserved(index, sub.sub)) co_return;
  const bool kept_back = ((object.obj_flags | sub.obj_flags) & od::refuse_read_on_scan) != 0;
  if (kept_back) {
    report_.skip(access, ref, "an upload", "the description says that a scan must not read it");
    co_return;
  }
  const std::size_t size = od::byte_size(sub.type);
  const auto now = co_await device_.read(index, sub.sub);
  if (!od::readable(sub.access)) {
    report_.refused(access, ref, "an upload of a write-only object", now, codes::write_only);
    co_return;
  }
  const bool may_be_empty = sub.variable_length() || (index == 0x1003 && sub.sub != 0);
  const bool empty = may_be_empty && now.code == od::AbortCode::no_data;
  report_.holds(access, ref, "an object that can be read is read", now.good() || empty, now.words());
  if (now.good() && size != 0) {
    report_.holds("7.4.7", ref, fmt::format("it has the {} bytes of its type", size), now.bytes.size() == size,
                  fmt::format("{} bytes", now.bytes.size()));
  }
  const auto initial = options_.description->default_of(sub);
  if (sub.access == od::Access::constant && size != 0 && now.good() && initial.present()) {
    const auto wanted = initial.resolve(sub.type, options_.node.value());
    report_.holds("7.4.5", ref, "a constant has the value of its description",
                  od::load(sub.type, now.bytes.data()) == wanted, fmt::format("{:X}h", now.number()));
  }
  co_await writing(sub, index, now);
}

rt::Task<void> ObjectChecks::writing(const od::SubObject& sub, std::uint16_t index, const AccessResult& now) {
  const std::size_t size = od::byte_size(sub.type);
  const ObjectRef ref{index, sub.sub};
  Bytes bytes = now.bytes;
  if (bytes.empty()) bytes.resize(size == 0 ? 1 : size);
  if (!od::writable(sub.access)) {
    const auto told = co_await device_.write(index, sub.sub, bytes);
    report_.refused(access, ref, "a download to a read-only object", told, codes::read_only);
    co_return;
  }
  if (!communication(index) && !options_.lasting) {
    report_.skip(access, ref, "downloads", "an object of the application: only a test writes to it");
    co_return;
  }
  if (size == 0 || !now.good() || index == 0x1003) co_return;
  if (index == 0x1200) co_return;  // read-only, whatever a description says
  bytes.push_back(0);
  const auto long_one = co_await device_.write(index, sub.sub, bytes);
  report_.refused(access, ref, "a value that is too long", long_one, codes::too_long);
  if (size > 1) {
    bytes.resize(size - 1);
    const auto short_one = co_await device_.write(index, sub.sub, bytes);
    report_.refused(access, ref, "a value that is too short", short_one, codes::too_short);
  }
  if (!acts(index) && !inside_limits(sub, now)) {
    report_.skip(access, ref, "the value that is there can be written",
                 "it is outside of the limits of the description");
  } else if (!acts(index)) {
    const auto same = co_await device_.write(index, sub.sub, now.bytes);
    report_.granted(access, ref, "the value that is there can be written", same);
  }
  co_await limits(sub, index);
  const auto after = co_await device_.read(index, sub.sub);
  const bool runs = sub.mappable && !communication(index);
  if (!runs && !acts(index)) {
    report_.holds(access, ref, "refused downloads change nothing", after.bytes == now.bytes,
                  fmt::format("{:X}h before, {:X}h after", now.number(), after.number()));
  }
}

bool ObjectChecks::inside_limits(const od::SubObject& sub, const AccessResult& now) const noexcept {
  const auto* const limits = options_.description->limits(sub);
  if (limits == nullptr || now.bytes.size() != od::byte_size(sub.type)) return true;
  const auto value = od::load(sub.type, now.bytes.data());
  const auto node = options_.node.value();
  const bool low = limits->low.present() && od::compare(sub.type, value, limits->low.resolve(sub.type, node)) < 0;
  const bool high = limits->high.present() && od::compare(sub.type, value, limits->high.resolve(sub.type, node)) > 0;
  return !low && !high;
}

rt::Task<void> ObjectChecks::limits(const od::SubObject& sub, std::uint16_t index) {
  const auto* const described = options_.description->limits(sub);
  const bool counts = od::is_unsigned(sub.type) || od::is_signed(sub.type);
  if (described == nullptr || !counts || acts(index)) co_return;
  const auto node = options_.node.value();
  const std::size_t size = od::byte_size(sub.type);
  if (described->high.present()) {
    const auto high = described->high.resolve(sub.type, node);
    const auto beyond = od::wrap(sub.type, high + 1);
    if (od::compare(sub.type, beyond, high) > 0)
      co_await must_refuse(index, sub.sub, size, beyond, codes::too_high, "a value above its high limit");
  }
  if (described->low.present()) {
    const auto low = described->low.resolve(sub.type, node);
    const auto beyond = od::wrap(sub.type, low - 1);
    if (od::compare(sub.type, beyond, low) < 0)
      co_await must_refuse(index, sub.sub, size, beyond, codes::too_low, "a value below its low limit");
  }
}

}  // namespace berth::doctor
