#include "berth/network/dictionary_source.hpp"

#include "berth/manager/configurator.hpp"
#include "berth/manager/program_loader.hpp"
#include "berth/od/cia302.hpp"

namespace berth::network {
namespace {

namespace cia302 = od::cia302;
constexpr auto restart_time = std::chrono::seconds(5);

Error wrong(std::uint16_t index, NodeId node, const char* text, Errc code = Errc::invalid) noexcept {
  return {.code = code, .sub = node.value(), .index = index, .text = text};
}

Error error_of(const manager::Failure& failure, NodeId node) noexcept {
  Error error = failure.error;
  switch (failure.why) {
    case manager::Failure::Why::error: break;
    case manager::Failure::Why::differs:
      error = {.code = Errc::mismatch, .text = "it has another value and cannot be written"};
      break;
    case manager::Failure::Why::not_kept:
      error = {.code = Errc::mismatch, .text = "it did not keep what was written"};
      break;
    case manager::Failure::Why::restarted: error = {.code = Errc::mismatch, .text = "it restarted meanwhile"}; break;
    case manager::Failure::Why::not_allowed: error = {.code = Errc::cancelled, .text = "it may not be changed"}; break;
    case manager::Failure::Why::not_saved:
      error = {.code = Errc::timeout, .text = "it did not save its configuration"};
      break;
  }
  error.node = node.value();
  error.index = failure.object.index;
  error.sub = failure.object.sub;
  return error;
}

}  // namespace

void DictionarySource::renew(manager::SlaveRules& rules) const noexcept {
  const manager::SlaveRules now =
      manager::slave_rules_of(values_->get_or<std::uint32_t>({cia302::slave_assignment, node_.value()}, 0));
  rules.boots = now.boots;
  rules.mandatory = now.mandatory;
}

rt::Task<Result<void>> DictionarySource::configure(BootTarget& target, manager::SlaveRules& rules) {
  if (rules.restores && rules.restore_sub != 0) {
    const auto restored = co_await restore(target, rules.restore_sub);
    if (!restored) co_return restored;
  }
  const auto wanted = manager::wanted_of(*values_, node_);
  if (!wanted) co_return fail(wanted.error());
  if (wanted->entries.empty()) co_return Result<void>{};
  const auto same = co_await is_for(target, wanted->type);
  if (!same) co_return same;
  manager::ConfiguratorOptions options;
  options.trust_date = false;  // step 7 has checked the date: without an expected one, every value is compared
  manager::Configurator configurator(target.objects(), target.objects(), *wanted, options);
  manager::ConfigurationReport report;
  co_await configurator.run(report);
  if (report.failure) co_return fail(error_of(*report.failure, node_));
  co_return Result<void>{};
}

// Is the device of the type that the DCF names? 0 in a part of the type fits every device.
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

rt::Task<Result<void>> DictionarySource::update(BootTarget& target, const manager::SlaveRules& rules) {
  const auto image = values_->bytes({cia302::program_of_slave, node_.value()});
  if (image.empty())
    co_return fail(wrong(cia302::program_of_slave, node_, "there is no program for it", Errc::unsupported));
  const std::array wishes{manager::ProgramWish{.number = 1, .image = image, .identification = rules.expected.software}};
  manager::ProgramOptions options;
  options.transfers = transfers_;
  options.expects_boot_up = [&target] { target.expect_boot_up(); };
  manager::ProgramLoader loader(target.objects(), wishes, options);
  manager::ProgramReport report;
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
  // 1011h:02 restores only communication parameters; the other sub-indices need a reset of the whole device.
  const auto command = sub == 2 ? co::NmtCommand::reset_communication : co::NmtCommand::reset_node;
  const auto sent = co_await target.command(command);
  if (!sent) co_return fail(sent.error());
  const bool booted = co_await target.boots(*sent, *sent + restart_time);
  Error silent{.code = Errc::timeout, .node = node_.value(), .text = "no boot-up message after its restore and reset"};
  if (!booted) co_return fail(silent);
  co_return Result<void>{};
}

}  // namespace berth::network
