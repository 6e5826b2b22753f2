#include "berth/manager/program_loader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "berth/od/abort_code.hpp"
#include "berth/od/cia302.hpp"

namespace berth::manager {
namespace {

using od::AbortCode;

constexpr std::array<const char*, 6> stage_names{"stopping", "clearing", "downloading",
                                                 "flashing", "checking", "starting"};
constexpr std::array<const char*, 9> flash_errors{"",
                                                  "it has no valid program",
                                                  "it does not know the data format of the program",
                                                  "the program's format, product or checksum is wrong",
                                                  "its flash memory was not cleared before it was written",
                                                  "its flash memory could not be written",
                                                  "the program does not fit its addresses",
                                                  "its flash memory is secured against writing",
                                                  "its flash memory reports an error"};

bool is_aborted(const Error& error, AbortCode code) noexcept {
  return error.code == Errc::aborted && error.detail == static_cast<std::uint32_t>(code);
}

// The device has no such object, or knows no such command.
bool is_missing(const Error& error) noexcept {
  return is_aborted(error, AbortCode::no_object) || is_aborted(error, AbortCode::no_sub_index);
}

// 1F57h, bits 1 to 7 (CiA 302-3).
constexpr std::uint32_t error_code(std::uint32_t status) noexcept { return status >> 1U & 0x7FU; }
constexpr std::uint32_t no_valid_program = 1;

// The device may be back, or ready, in a moment.
bool is_passing(const Error& error) noexcept {
  // It took the whole image but has none: it lost its power while writing.
  if (error.index == od::cia302::flash_status && error.detail == no_valid_program) return true;
  if (error.code != Errc::aborted) return error.code == Errc::timeout || error.code == Errc::bus;
  constexpr std::array passing{AbortCode::timeout,         AbortCode::crc,
                               AbortCode::general,         AbortCode::device_state,
                               AbortCode::sequence_number, AbortCode::command_specifier};
  return std::ranges::any_of(passing, [&](AbortCode code) { return is_aborted(error, code); });
}

Error wrong(std::uint16_t index, std::uint8_t number, const char* text) noexcept {
  return {.code = Errc::mismatch, .sub = number, .index = index, .text = text};
}

/// `Clock clock; const rt::Time now = co_await clock;`
class Clock final : public rt::Operation<Clock> {
 public:
  bool start() noexcept {
    now_ = executor().now();
    return false;
  }
  [[nodiscard]] rt::Time await_resume() const noexcept { return now_; }

 private:
  rt::Time now_{};
};

rt::Task<rt::Time> clock_now() {
  Clock clock;
  co_return co_await clock;
}

/// An image; reports its progress in hundredths.
class ImageSource final : public co::SdoSource {
 public:
  ImageSource(const ProgramWish& wish, const ProgramOptions& options) noexcept : wish_(&wish), options_(&options) {}
  [[nodiscard]] std::optional<std::size_t> size() const noexcept override { return wish_->image.size(); }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    const std::size_t count = std::min(into.size(), wish_->image.size() - at_);
    std::copy_n(wish_->image.begin() + static_cast<std::ptrdiff_t>(at_), count, into.begin());
    at_ += count;
    const std::size_t hundredth = wish_->image.empty() ? 100 : at_ * 100 / wish_->image.size();
    if (hundredth != told_ && options_->progress) {
      options_->progress({ProgramStage::downloading, wish_->number, at_, wish_->image.size()});
    }
    told_ = hundredth;
    return count;
  }
  bool rewind() noexcept override {
    at_ = 0;
    return true;
  }

 private:
  const ProgramWish* wish_;
  const ProgramOptions* options_;
  std::size_t at_ = 0;
  std::size_t told_ = 0;
};

rt::Duration pause_of(const ProgramOptions& options) noexcept {
  return options.transfers == nullptr ? options.poll : std::max(options.poll, options.transfers->poll());
}

rt::Task<Result<void>> control(co::SdoAccess& device, std::uint8_t number, ProgramControl what) {
  const std::array<std::uint8_t, 1> byte{static_cast<std::uint8_t>(what)};
  const std::span<const std::uint8_t> data(byte);
  co_return co_await device.write(od::cia302::program_control, number, data);
}

rt::Task<Result<ProgramControl>> state_of(co::SdoAccess& device, std::uint8_t number) {
  const auto value = co_await device.read_up_to(od::cia302::program_control, number, 4);
  if (!value) co_return fail(value.error());
  const auto state = value->bytes().empty() ? std::uint8_t{0} : value->bytes().front();
  co_return static_cast<ProgramControl>(state);
}

// Commands stop or start, and asks until the program is stopped or started. The device may answer the command and then
// restart, or restart without an answer.
rt::Task<Result<void>> control_until_done(co::SdoAccess& device, std::uint8_t number, ProgramControl what,
                                          const ProgramOptions& options) {
  const bool starts = what == ProgramControl::start;
  if (options.expects_boot_up) options.expects_boot_up();
  const auto told = co_await control(device, number, what);
  const bool refused = !told && told.error().code == Errc::aborted;
  if (refused) co_return told;
  const rt::Time began = co_await clock_now();
  for (rt::Time now = began; now < began + options.restart_time;) {
    const rt::Duration pause = pause_of(options);
    co_await rt::sleep_for(pause);
    const auto state = co_await state_of(device, number);
    const bool done = state && (*state == ProgramControl::start) == starts;
    if (done) co_return Result<void>{};
    now = co_await clock_now();
  }
  const Error error{.code = Errc::timeout,
                    .sub = number,
                    .index = od::cia302::program_control,
                    .text = starts ? "its program did not start" : "it did not come back from the stop of its program"};
  co_return fail(error);
}

// Reads 1F57h until it is idle; returns its status. Without 1F57h: 0 at once. A device may not answer while it writes.
rt::Task<Result<std::uint32_t>> wait_for_flash(co::SdoAccess& device, std::uint8_t number,
                                               const ProgramOptions& options) {
  const rt::Time began = co_await clock_now();
  for (;;) {
    const auto status = co_await device.read_u32(od::cia302::flash_status, number);
    const bool idle = status && !flash_busy(*status);
    if (idle) co_return status;
    if (!status && is_missing(status.error())) co_return 0U;
    const bool silent = !status && status.error().code == Errc::timeout;
    if (!status && !silent) co_return fail(status.error());
    const rt::Time now = co_await clock_now();
    if (now >= began + options.flash_time) {
      const Error error{.code = Errc::timeout,
                        .sub = number,
                        .index = od::cia302::flash_status,
                        .text = "its flash memory was not ready in time"};
      co_return fail(error);
    }
    const rt::Duration pause = pause_of(options);
    co_await rt::sleep_for(pause);
  }
}

}  // namespace

std::string_view name(ProgramControl state) noexcept {
  switch (state) {
    case ProgramControl::stop:
    case ProgramControl::reset: return "stopped";
    case ProgramControl::start: return "started";
    case ProgramControl::clear: return "no program";
    default: return "unknown";
  }
}

std::string_view name(ProgramStage stage) noexcept { return stage_names.at(static_cast<std::size_t>(stage)); }

const char* flash_error(std::uint32_t status) noexcept {
  const std::size_t code = error_code(status);
  return flash_errors.at(std::min(code, flash_errors.size() - 1));
}

std::string describe(const ProgramReport& report, const Error& error) {
  return fmt::format("program {}: {}: {}", report.number, name(report.stage), berth::describe(error));
}

// ---- control --------------------------------------------------------------------------------------------------------

rt::Task<bool> is_stopped(co::SdoAccess& device, std::uint8_t number) {
  const auto state = co_await state_of(device, number);
  co_return state && (*state == ProgramControl::stop || *state == ProgramControl::reset);
}

rt::Task<Result<void>> stop_program(co::SdoAccess& device, std::uint8_t number, const ProgramOptions& options) {
  const auto before = co_await state_of(device, number);
  if (!before && is_missing(before.error())) co_return Result<void>{};
  const bool runs = !before || *before == ProgramControl::start;
  if (!runs) co_return Result<void>{};
  co_return co_await control_until_done(device, number, ProgramControl::stop, options);
}

rt::Task<Result<void>> start_program(co::SdoAccess& device, std::uint8_t number, const ProgramOptions& options) {
  const auto before = co_await state_of(device, number);
  if (!before && is_missing(before.error())) co_return Result<void>{};
  co_return co_await control_until_done(device, number, ProgramControl::start, options);
}

rt::Task<Result<void>> clear_program(co::SdoAccess& device, std::uint8_t number, const ProgramOptions& options) {
  const auto before = co_await state_of(device, number);
  const bool absent = !before && before.error().code != Errc::aborted;
  if (absent) co_return fail(before.error());
  const auto told = co_await control(device, number, ProgramControl::clear);
  const bool has_none = !told && (is_missing(told.error()) || is_aborted(told.error(), AbortCode::invalid_value));
  const bool silent = !told && told.error().code == Errc::timeout;
  if (!told && !has_none && !silent) co_return told;
  const auto status = co_await wait_for_flash(device, number, options);
  if (!status) co_return fail(status.error());
  co_return Result<void>{};
}

// ---- download -------------------------------------------------------------------------------------------------------

rt::Task<Result<void>> ProgramLoader::run(ProgramReport& report) {
  const ProgramTransfers::Loader loader(options_->transfers);
  for (;;) {
    ++report.tries;
    report.bytes = 0;
    const auto done = co_await once(report);
    const bool again = !done && is_passing(done.error()) && report.tries < options_->tries;
    if (!again) co_return done;
    const rt::Duration pause = pause_of(*options_);
    co_await rt::sleep_for(pause);
  }
}

rt::Task<Result<void>> ProgramLoader::once(ProgramReport& report) {
  for (const auto& wish : wishes_) {
    const auto brought = co_await bring(wish, report);
    if (!brought) co_return brought;
  }
  for (const auto& wish : wishes_) {
    const auto same = co_await identify();
    if (!same) co_return same;
    enter(report, ProgramStage::starting, wish);
    const auto started = co_await start_program(*device_, wish.number, *options_);
    if (!started) co_return started;
  }
  co_return Result<void>{};
}

rt::Task<Result<void>> ProgramLoader::identify() {
  if (!options_->is_the_same) co_return Result<void>{};
  co_return co_await options_->is_the_same();
}

rt::Task<Result<void>> ProgramLoader::bring(const ProgramWish& wish, ProgramReport& report) {
  const auto same = co_await identify();
  if (!same) co_return same;
  enter(report, ProgramStage::stopping, wish);
  const auto stopped = co_await stop_program(*device_, wish.number, *options_);
  if (!stopped) co_return stopped;
  const auto still = co_await identify();
  if (!still) co_return still;
  enter(report, ProgramStage::clearing, wish);
  const auto cleared = co_await clear_program(*device_, wish.number, *options_);
  if (!cleared) co_return cleared;
  const auto downloaded = co_await download(wish, report);
  if (!downloaded) co_return downloaded;
  report.bytes += wish.image.size();
  enter(report, ProgramStage::checking, wish);
  co_return co_await check(wish);
}

// The device's reason against the image is in 1F57h; the abort code says little.
rt::Task<Result<void>> ProgramLoader::download(const ProgramWish& wish, ProgramReport& report) {
  enter(report, ProgramStage::downloading, wish);
  co::SdoOptions how;
  how.timeout = options_->answer_time;
  how.mode = options_->block ? co::SdoMode::automatic : co::SdoMode::segmented;
  ImageSource source(wish, *options_);
  Result<void> done;
  if (options_->transfers != nullptr) {
    const auto ticket = co_await options_->transfers->enter();
    how.pace = &options_->transfers->pace();
    done = co_await device_->download(od::cia302::program_data, wish.number, source, how);
  } else {
    done = co_await device_->download(od::cia302::program_data, wish.number, source, how);
  }
  const bool silent = !done && done.error().code != Errc::aborted;
  if (silent) co_return done;
  enter(report, ProgramStage::flashing, wish);
  const auto status = co_await wait_for_flash(*device_, wish.number, *options_);
  if (!status && !done) co_return done;
  if (!status) co_return fail(status.error());
  const char* const error = flash_error(*status);
  // "No program" is a result of the interrupted download, not its cause.
  const bool explains = *error != '\0' && (done || error_code(*status) != no_valid_program);
  if (!explains) co_return done;
  Error failed = wrong(od::cia302::flash_status, wish.number, error);
  failed.detail = error_code(*status);
  co_return fail(failed);
}

rt::Task<Result<void>> ProgramLoader::check(const ProgramWish& wish) {
  if (wish.identification == 0) co_return Result<void>{};
  const auto is = co_await device_->read_u32(od::cia302::program_identification, wish.number);
  if (!is) co_return fail(is.error());
  if (*is == wish.identification) co_return Result<void>{};
  Error other = wrong(od::cia302::program_identification, wish.number,
                      "it took the program, and reports another identification than the expected one");
  other.detail = *is;
  co_return fail(other);
}

void ProgramLoader::enter(ProgramReport& report, ProgramStage stage, const ProgramWish& wish) const {
  report.stage = stage;
  report.number = wish.number;
  if (options_->progress) options_->progress({stage, wish.number, 0, wish.image.size()});
}

}  // namespace berth::manager
