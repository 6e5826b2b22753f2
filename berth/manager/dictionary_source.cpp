#include "berth/manager/dictionary_source.hpp"

#include "berth/eds/concise_dcf.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/manager/program_loader.hpp"
#include "berth/manager/stored_dcf.hpp"
#include "berth/od/cia302.hpp"
#include "berth/od/paper3.hpp"

namespace berth::manager {
namespace {

namespace cia302 = od::cia302;
constexpr auto restart_time = std::chrono::seconds(5);

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

Error error_of(const Failure& failure, NodeId node) noexcept {
  Error error = failure.error;
  switch (failure.why) {
    case Failure::Why::error: break;
    case Failure::Why::differs:
      error = {.code = Errc::mismatch, .text = "it has another value, which none may write"};
      break;
    case Failure::Why::not_kept: error = {.code = Errc::mismatch, .text = "it did not keep what was written"}; break;
    case Failure::Why::restarted: error = {.code = Errc::mismatch, .text = "it restarted meanwhile"}; break;
    case Failure::Why::not_allowed: error = {.code = Errc::cancelled, .text = "it may not be changed"}; break;
    case Failure::Why::not_saved: error = {.code = Errc::timeout, .text = "it did not save its configuration"}; break;
  }
  error.node = node.value();
  error.index = failure.object.index;
  error.sub = failure.object.sub;
  return error;
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
                      has_concise ? "what is stored is no concise DCF, or sets nothing"
                                  : "what is stored is no DCF, or sets nothing"));
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

void DictionarySource::renew(SlaveRules& rules) const noexcept {
  const SlaveRules now = slave_rules_of(number(*values_, cia302::slave_assignment, node_.value()));
  rules.boots = now.boots;
  rules.mandatory = now.mandatory;
}

rt::Task<Result<void>> DictionarySource::configure(BootTarget& target, SlaveRules& rules) {
  if (rules.restores && rules.restore_sub != 0) {
    const auto restored = co_await restore(target, rules.restore_sub);
    if (!restored) co_return restored;
  }
  const auto wanted = wanted_of(*values_, node_);
  if (!wanted) co_return fail(wanted.error());
  if (wanted->entries.empty()) co_return Result<void>{};
  const auto same = co_await is_for(target, wanted->type);
  if (!same) co_return same;
  ConfiguratorOptions options;
  options.trust_date = false;  // step 7 has looked at it: without an expected date every value is compared
  Configurator configurator(target.objects(), target.objects(), *wanted, options);
  ConfigurationReport report;
  co_await configurator.run(report);
  if (report.failure) co_return fail(error_of(*report.failure, node_));
  co_return Result<void>{};
}

// A DCF says what it is for; 0 in a part says nothing.
rt::Task<Result<void>> DictionarySource::is_for(BootTarget& target, TypeCode type) {
  constexpr std::uint16_t identity = 0x1018;
  for (const auto& [sub, expected] :
       {std::pair{std::uint8_t{1}, type.vendor}, std::pair{std::uint8_t{2}, type.product}}) {
    if (expected == 0) continue;
    const std::uint8_t part = sub;
    const auto is = co_await target.objects().read_u32(identity, part);
    if (!is && is.error().code != Errc::aborted) co_return fail(is.error());
    if (is && *is != expected) {
      co_return fail(wrong(cia302::store_dcf, node_, "its DCF is for another product", Errc::mismatch));
    }
  }
  co_return Result<void>{};
}

rt::Task<Result<void>> DictionarySource::update(BootTarget& target, const SlaveRules& rules) {
  const auto image = values_->bytes({cia302::program_of_slave, node_.value()});
  if (image.empty())
    co_return fail(wrong(cia302::program_of_slave, node_, "there is no program for it", Errc::unsupported));
  const std::array wishes{ProgramWish{.number = 1, .image = image, .identification = rules.expected.software}};
  ProgramOptions options;
  options.transfers = transfers_;
  options.expects_boot_up = [&target] { target.expect_boot_up(); };
  ProgramLoader loader(target.objects(), wishes, options);
  ProgramReport report;
  const auto done = co_await loader.run(report);
  if (done) co_return done;
  Error error = done.error();
  error.node = node_.value();
  co_return fail(error);
}

rt::Task<Result<void>> DictionarySource::restore(BootTarget& target, std::uint8_t sub) {
  constexpr std::uint32_t load = 0x6461'6F6C;  // "load"
  const auto told = co_await target.objects().write_u32(0x1011, sub, load);
  if (!told) co_return told;
  // 1011h:02 is about communication parameters; all others need the whole device to start anew.
  const auto command = sub == 2 ? co::NmtCommand::reset_communication : co::NmtCommand::reset_node;
  const auto sent = co_await target.command(command);
  if (!sent) co_return fail(sent.error());
  const bool booted = co_await target.boots(*sent, *sent + restart_time);
  Error silent{.code = Errc::timeout, .node = node_.value(), .text = "no boot-up message after its restore and reset"};
  if (!booted) co_return fail(silent);
  co_return Result<void>{};
}

}  // namespace berth::manager
