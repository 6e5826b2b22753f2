#include "berth/manager/dictionary_rules.hpp"

#include "berth/eds/concise_dcf.hpp"
#include "berth/manager/stored_dcf.hpp"
#include "berth/od/cia302.hpp"
#include "berth/od/paper3.hpp"

namespace berth::manager {
namespace {

namespace cia302 = od::cia302;

std::uint32_t number(const od::Values& values, std::uint16_t index, std::uint8_t sub) noexcept {
  return values.get_or<std::uint32_t>({index, sub}, 0);
}

rt::Duration heartbeat_time_of(const od::Values& values, NodeId node) noexcept {
  const auto* const consumer = values.description().find(0x1016);
  if (consumer == nullptr) return {};
  for (const auto& sub : values.description().subs(*consumer)) {
    const std::uint32_t entry = number(values, 0x1016, sub.sub);
    const bool is_its = sub.sub != 0 && (entry >> 16U) == node.value();
    if (is_its) return std::chrono::milliseconds(entry & 0xFFFFU);
  }
  return {};
}

Error wrong(std::uint16_t index, NodeId node, const char* text, Errc code = Errc::invalid) noexcept {
  return {.code = code, .sub = node.value(), .index = index, .text = text};
}

}  // namespace

Result<Startup> startup_of(const od::Values& values) noexcept {
  return startup_of(number(values, cia302::nmt_startup, 0));
}

SlaveRules slave_rules_of(const od::Values& values, NodeId node) noexcept {
  const std::uint8_t sub = node.value();
  SlaveRules rules = slave_rules_of(number(values, cia302::slave_assignment, sub));
  rules.device_type = number(values, cia302::expected_type, sub);
  rules.vendor = number(values, cia302::expected_vendor, sub);
  rules.product = number(values, cia302::expected_product, sub);
  rules.revision = number(values, cia302::expected_revision, sub);
  rules.serial = number(values, cia302::expected_serial, sub);
  rules.restore_sub = static_cast<std::uint8_t>(number(values, cia302::restore_configuration, sub));
  rules.expected_date = number(values, cia302::configuration_date, sub);
  rules.expected_time = number(values, cia302::configuration_time, sub);
  rules.expected.software_date = number(values, cia302::expected_program_date, sub);
  rules.expected.software_time = number(values, cia302::expected_program_time, sub);
  rules.expected.software = number(values, cia302::expected_program, sub);
  rules.expected.hardware = number(values, od::paper3::expected_hardware, sub);
  rules.heartbeat = heartbeat_time_of(values, node);
  return rules;
}

bool has_fixed_node_id(const od::Values& values, NodeId node) noexcept {
  const unsigned id = node.value();
  return (number(values, od::paper3::fixed_node_ids, static_cast<std::uint8_t>(1 + id / 32)) >> id % 32 & 1U) != 0;
}

rt::Duration boot_time_of(const od::Values& values) noexcept {
  return std::chrono::milliseconds(number(values, cia302::boot_time, 0));
}

rt::Duration nmt_inhibit_time_of(const od::Values& values) noexcept {
  return std::chrono::microseconds(100) * number(values, 0x102A, 0);
}

FlyingOptions flying_options_of(const od::Values& values, NodeId own) noexcept {
  constexpr std::uint16_t index = 0x1F90;
  const auto ms = [&](std::uint8_t sub) { return std::chrono::milliseconds(number(values, index, sub)); };
  FlyingOptions options;
  options.own = {static_cast<std::uint8_t>(number(values, index, 3)), own};
  options.timing = {.detection = ms(1), .delay = ms(2), .priority_slot = ms(4), .device_slot = ms(5), .cycle = ms(6)};
  for (std::uint8_t node = 1; node <= 127; ++node) {
    if (slave_rules_of(number(values, cia302::slave_assignment, node)).keep_alive) options.resets_when_cold = false;
  }
  return options;
}

rt::Duration master_heartbeat_of(const od::Values& values, NodeId master) noexcept {
  const auto entry = heartbeat_time_of(values, master);
  return entry.count() > 0 ? entry : 2 * std::chrono::milliseconds(number(values, 0x1017, 0));
}

Result<Wanted> wanted_of(const od::Values& values, NodeId node) {
  const std::uint8_t sub = node.value();
  const auto concise = values.bytes({cia302::concise_dcf, sub});
  const auto packed = values.bytes({cia302::store_dcf, sub});
  // A stream of four zeros is an empty one: nothing is to be configured.
  const bool has_concise = concise.size() > sizeof(std::uint32_t);
  if (!has_concise && packed.empty()) return Wanted{};
  const std::uint16_t index = has_concise ? cia302::concise_dcf : cia302::store_dcf;
  const auto format = values.get_or<std::uint8_t>({cia302::dcf_format, sub}, stored_format::ascii);
  auto text = has_concise ? Result<std::string>() : unpack_stored(format, packed);
  if (!text) {
    const bool unknown = text.error().code == Errc::unsupported;
    return fail(wrong(unknown ? cia302::dcf_format : index, node, text.error().text, text.error().code));
  }
  const auto loaded =
      has_concise ? read_concise_configuration(concise, "1F22h") : read_configuration(std::move(*text), "1F20h");
  if (!loaded.usable()) {
    return fail(wrong(index, node,
                      has_concise ? "what is stored is not a concise DCF, or sets nothing"
                                  : "what is stored is not a DCF, or sets nothing"));
  }
  auto made = wanted(loaded.configuration, node);
  const ConfigurationDate expected{number(values, cia302::configuration_date, sub),
                                   number(values, cia302::configuration_time, sub)};
  if (made && expected.valid()) made->date = expected;
  return made;
}

od::AbortCode configure_itself(od::Values& values, NodeId own) {
  const ObjectRef row{cia302::concise_dcf, own.value()};
  const auto stream = eds::decode_concise_dcf(values.bytes(row));
  if (!stream || stream->entries.empty()) return od::AbortCode::not_stored;
  for (const auto& entry : stream->entries) {
    if (entry.object.index == cia302::request_configuration) return od::AbortCode::general;
    const auto code = values.write(entry.object, entry.data);
    if (code != od::AbortCode::none) return code;
  }
  values.set_bytes(row, {});
  return od::AbortCode::none;
}

}  // namespace berth::manager
