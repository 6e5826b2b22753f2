#include "berth/network/boot_slave.hpp"

#include <fmt/format.h>

#include <utility>

#include "berth/manager/program_loader.hpp"
#include "berth/od/cia302.hpp"
#include "berth/od/paper3.hpp"

namespace berth::network {
namespace {

constexpr std::uint16_t boot_device_type = 0x1000;
constexpr std::uint16_t boot_identity = 0x1018;
constexpr std::uint16_t boot_date = 0x1020;
constexpr std::uint16_t hardware_version = 0x1009;
constexpr std::uint16_t software_version = 0x100A;
constexpr std::size_t longest_version = 250;  // bytes

bool says_it_has_none(const Error& error) noexcept {
  const auto abort = static_cast<od::AbortCode>(error.detail);
  return error.code == Errc::aborted && (abort == od::AbortCode::no_object || abort == od::AbortCode::no_sub_index);
}

bool fits(std::uint32_t is, const manager::SlaveRules& rules) noexcept {
  if (rules.revision_check == manager::RevisionCheck::equal) return is == rules.revision;
  return is >> 16U == rules.revision >> 16U && (is & 0xFFFFU) >= (rules.revision & 0xFFFFU);
}

}  // namespace

rt::Task<bool> BootTarget::runs() { co_return false; }

rt::Task<void> BootTarget::start_sent() { co_return; }

rt::Task<Result<void>> BootSource::configure(BootTarget&, manager::SlaveRules&) { co_return Result<void>{}; }

rt::Task<Result<std::string>> BootSource::other_programs(BootTarget&, const manager::SlaveRules&) {
  co_return std::string();
}

rt::Task<Result<void>> BootSource::update(BootTarget&, const manager::SlaveRules&) {
  co_return fail(Errc::unsupported, "there is no program for it (1F58h)");
}

std::string BootResult::text() const {
  const std::string what(manager::text(status));
  const std::string begin = status == manager::BootStatus::booted ? what : fmt::format("{}: {}", letter(status), what);
  return detail.empty() ? begin : fmt::format("{}: {}", begin, detail);
}

rt::Task<BootResult> BootSlave::run() {
  const manager::BootStatus status = co_await steps();
  result_.status = status;
  co_return result_;
}

rt::Task<manager::BootStatus> BootSlave::steps() {
  if (!rules_.assigned) co_return manager::BootStatus::a;
  manager::BootStatus good = manager::BootStatus::booted;
  for (bool again = rules_.boots; again;) {
    again = false;
    const Verdict stranger = co_await check_identity();
    if (stranger) co_return *stranger;
    const Verdict state = co_await check_state();
    if (state == manager::BootStatus::l) good = manager::BootStatus::l;
    if (state == manager::BootStatus::l) break;
    if (state) co_return *state;
    const Verdict software = co_await check_software(again);
    if (software) co_return *software;
    if (again) continue;
    const Verdict configured = co_await configure();
    if (configured) co_return *configured;
  }
  const Verdict lost = co_await start_error_control();
  co_return lost.value_or(good);
}

void BootSlave::differs(std::uint32_t is, std::uint32_t expected) {
  result_.detail = fmt::format("{:08X}h instead of {:08X}h", is, expected);
}

// ---- steps 2 and 3 --------------------------------------------------------------------------------------------------

rt::Task<BootSlave::Verdict> BootSlave::check_identity() {
  found_ = options_.identified;
  if (options_.identified && options_.typed && rules_.device_type == 0) co_return co_await check_hardware();
  const auto type = co_await device_type();
  // A slave that refuses 1000h is on the bus, but its type is unknown and so matches no expected one.
  const bool refused = !type && type.error().code == Errc::aborted;
  if (!type && !refused) {
    result_.detail = describe(type.error());
    co_return manager::BootStatus::b;
  }
  found_ = true;
  const bool other = rules_.device_type != 0 && (refused || *type != rules_.device_type);
  if (other && refused) result_.detail = describe(type.error());
  if (other && !refused) differs(*type, rules_.device_type);
  if (other) co_return manager::BootStatus::c;
  if (options_.identified) co_return co_await check_hardware();
  const Expected all[] = {{1, rules_.vendor, manager::BootStatus::d},
                          {2, rules_.product, manager::BootStatus::m},
                          {3, rules_.revision, manager::BootStatus::n},
                          {4, rules_.serial, manager::BootStatus::o}};
  for (const Expected& expected : all) {
    const Expected each = expected;
    if (each.value == 0) continue;
    const bool right = co_await is_as(each);
    if (!right) co_return each.status;
  }
  co_return co_await check_hardware();
}

rt::Task<BootSlave::Verdict> BootSlave::check_hardware() {
  if (!rules_.expected.hardware_text.empty()) {
    const Software is = co_await compare_text(hardware_version, rules_.expected.hardware_text);
    if (is != Software::right) co_return manager::BootStatus::n;
  }
  if (rules_.expected.hardware == 0) co_return Verdict{};
  constexpr ObjectRef object = od::paper3::hardware_version;
  const auto number = co_await target_->objects().read_u32(object.index, object.sub);
  if (number && *number == rules_.expected.hardware) co_return Verdict{};
  result_.detail = number ? fmt::format("hardware version (5F01h) {} instead of {}", *number, rules_.expected.hardware)
                          : describe(number.error());
  co_return manager::BootStatus::n;
}

rt::Task<BootSlave::Software> BootSlave::compare_text(std::uint16_t index, const std::string& expected) {
  const auto value = co_await target_->objects().read_up_to(index, 0, longest_version);
  if (!value) {
    result_.detail = describe(value.error());
    co_return Software::untold;
  }
  std::string is(value->bytes().begin(), value->bytes().end());
  while (is.ends_with('\0')) is.pop_back();
  if (is == expected) co_return Software::right;
  result_.detail = fmt::format("{:04X}h is \"{}\" instead of \"{}\"", index, is, expected);
  co_return Software::other;
}

bool BootSlave::asks_on() const noexcept { return rules_.mandatory || source_->polls(); }

rt::Task<Result<std::uint32_t>> BootSlave::device_type() {
  for (;;) {
    auto type = co_await target_->objects().read_u32(boot_device_type, 0);
    // A request that no node acknowledges counts as silence, too: perhaps no device has been switched on yet.
    const bool silent = !type && type.error().code != Errc::aborted && type.error().code != Errc::cancelled;
    if (!silent) co_return type;
    if (executor_->now() + options_.pause > options_.give_up || !asks_on()) co_return type;
    co_await rt::sleep_for(options_.pause);
    if (!asks_on()) co_return type;
  }
}

rt::Task<bool> BootSlave::is_as(Expected expected) {
  const auto is = co_await target_->objects().read_u32(boot_identity, expected.sub);
  // In CiA 301, only the vendor-ID is mandatory, and some devices on the market lack even that. So a part that the
  // slave does not have is unknown and not compared. But if the serial number is expected (1F88h), the slave must
  // report it.
  const bool unknown = !is && expected.sub != 4 && says_it_has_none(is.error());
  if (unknown) co_return true;
  if (!is) {
    result_.detail = describe(is.error());
    co_return false;
  }
  const bool right = expected.sub == 3 ? fits(*is, rules_) : *is == expected.value;
  if (!right) differs(*is, expected.value);
  co_return right;
}

// ---- step 4 ---------------------------------------------------------------------------------------------------------

rt::Task<BootSlave::Verdict> BootSlave::check_state() {
  if (!rules_.keep_alive && !options_.may_run) co_return Verdict{};
  std::optional<NmtState> state;
  const bool by_heartbeat = rules_.heartbeat.count() > 0;
  if (by_heartbeat) {
    state = co_await target_->heartbeat(rules_.heartbeat);
  } else {
    state = co_await target_->guard();
  }
  if (!state && rules_.keep_alive) co_return by_heartbeat ? manager::BootStatus::e : manager::BootStatus::f;
  if (state == NmtState::operational) co_return manager::BootStatus::l;
  const auto sent = co_await target_->command(co::NmtCommand::reset_communication);
  if (!sent) {
    result_.detail = describe(sent.error());
    co_return manager::BootStatus::b;
  }
  const bool booted = co_await target_->boots(*sent, *sent + options_.boot_timeout);
  if (!booted) result_.detail = "no boot-up message after the reset communication command";
  co_return booted ? Verdict{} : Verdict{manager::BootStatus::b};
}

// ---- steps 5 and 6 --------------------------------------------------------------------------------------------------

rt::Task<BootSlave::Verdict> BootSlave::check_software(bool& begin_again) {
  if (!rules_.checks_software) co_return Verdict{};
  const Software is = co_await compare_programs();
  if (is == Software::untold) co_return manager::BootStatus::g;
  if (is == Software::right) {
    result_.detail.clear();
    co_return co_await run_program(begin_again);
  }
  if (!rules_.may_update || rules_.keep_alive) co_return manager::BootStatus::h;
  if (result_.updated) co_return manager::BootStatus::i;  // it took the program, but still reports other software
  const auto updated = co_await source_->update(*target_, rules_);
  if (!updated) {
    result_.detail = describe(updated.error());
    co_return manager::BootStatus::i;
  }
  result_.updated = begin_again = true;
  co_return Verdict{};
}

rt::Task<BootSlave::Software> BootSlave::compare_programs() {
  const Software first = co_await compare_software();
  if (first != Software::right) co_return first;
  auto others = co_await source_->other_programs(*target_, rules_);
  if (!others) {
    result_.detail = describe(others.error());
    co_return Software::untold;
  }
  if (others->empty()) co_return Software::right;
  result_.detail = std::move(*others);
  co_return Software::other;
}

rt::Task<BootSlave::Software> BootSlave::compare_software() {
  if (rules_.expected.software == 0) {
    const bool dated = rules_.expected.software_date != 0 || rules_.expected.software_time != 0;
    if (dated) co_return co_await compare_software_date();
    if (rules_.expected.software_text.empty()) co_return Software::untold;
    co_return co_await compare_text(software_version, rules_.expected.software_text);
  }
  const auto is = co_await target_->objects().read_u32(od::cia302::program_identification, 1);
  if (!is) {
    result_.detail = describe(is.error());
    co_return Software::untold;
  }
  if (*is == rules_.expected.software) co_return Software::right;
  differs(*is, rules_.expected.software);
  co_return Software::other;
}

// By date and time, as in DSP 302 version 3 and paper 5.
rt::Task<BootSlave::Software> BootSlave::compare_software_date() {
  const auto date = co_await target_->objects().read_u32(od::cia302::program_date, 1);
  if (!date) {
    result_.detail = describe(date.error());
    co_return Software::untold;
  }
  const auto time = co_await target_->objects().read_u32(od::cia302::program_date, 2);
  if (!time) {
    result_.detail = describe(time.error());
    co_return Software::untold;
  }
  if (*date == rules_.expected.software_date && *time == rules_.expected.software_time) co_return Software::right;
  result_.detail = fmt::format("1F52h is {} days, {} ms instead of {} days, {} ms", *date, *time,
                               rules_.expected.software_date, rules_.expected.software_time);
  co_return Software::other;
}

// A download that was interrupted after its last byte leaves the right program, but the device in its boot loader.
rt::Task<BootSlave::Verdict> BootSlave::run_program(bool& begin_again) {
  const bool stopped = co_await manager::is_stopped(target_->objects(), 1);
  if (!stopped || rules_.keep_alive) co_return Verdict{};
  if (ran_) co_return manager::BootStatus::i;  // it was started before, and stopped again
  manager::ProgramOptions options;
  options.expects_boot_up = [this] { target_->expect_boot_up(); };
  const auto started = co_await start_program(target_->objects(), 1, options);
  if (!started) {
    result_.detail = describe(started.error());
    co_return manager::BootStatus::i;
  }
  ran_ = begin_again = true;
  co_return Verdict{};
}

// ---- steps 7 and 8 --------------------------------------------------------------------------------------------------

rt::Task<bool> BootSlave::has_expected_date() {
  if (rules_.expected_date == 0 || rules_.expected_time == 0) co_return false;
  const auto date = co_await target_->objects().read_u32(boot_date, 1);
  if (!date || *date != rules_.expected_date) co_return false;
  const auto time = co_await target_->objects().read_u32(boot_date, 2);
  co_return time&&* time == rules_.expected_time;
}

rt::Task<BootSlave::Verdict> BootSlave::configure() {
  const bool done = co_await has_expected_date();
  if (done) co_return Verdict{};
  const auto configured = co_await source_->configure(*target_, rules_);
  if (!configured) result_.detail = describe(configured.error());
  if (!configured) co_return manager::BootStatus::j;
  result_.configured = true;
  co_return Verdict{};
}

// ---- step 9 ---------------------------------------------------------------------------------------------------------

rt::Task<BootSlave::Verdict> BootSlave::start_error_control() {
  const bool by_heartbeat = rules_.heartbeat.count() > 0;
  if (by_heartbeat) {
    const auto state = co_await target_->heartbeat(rules_.heartbeat);
    if (!state) co_return manager::BootStatus::k;
  }
  target_->supervise(rules_);
  co_return Verdict{};
}

}  // namespace berth::network
