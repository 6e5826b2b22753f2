#include "berth/operate/manager_views.hpp"

#include <algorithm>
#include <filesystem>

#include "berth/eds/concise_dcf.hpp"
#include "berth/operate/error_control.hpp"
#include "berth/operate/programming.hpp"
#include "berth/text/file.hpp"

namespace berth::operate {
namespace {

const places::SlotProgram* first_program(const Seat& seat) noexcept {
  const auto& programs = seat.slot.spec.software.programs;
  return programs.empty() || programs.front().number != 1 ? nullptr : &programs.front();
}

}  // namespace

std::string dcf_of(const Seat& seat) {
  if (!seat.configuration.uploaded.empty()) return seat.configuration.uploaded;
  const std::filesystem::path path(seat.configuration.path);
  Findings findings;
  if (path.extension() != ".dcf") return {};
  return text::read_file(path.string(), findings).value_or(std::string());
}

std::vector<std::uint8_t> concise_dcf_of(const Seat& seat) {
  if (!seat.configuration.wanted) return {};
  const auto wanted = manager::wanted(*seat.configuration.wanted, seat.id());
  if (!wanted) return {};
  eds::ConciseDcf dcf;
  for (const auto& entry : wanted->entries) {
    if (!entry.compare_only) dcf.entries.push_back({entry.object, entry.bytes});
  }
  return eds::encode(eds::in_working_order(std::move(dcf)));
}

manager::ConfigurationDate expected_date(const Seat& seat) {
  if (!seat.configuration.wanted || seat.slot.spec.configuring.when == places::Configure::each_boot) return {};
  if (seat.configuration.wanted->date.valid()) return seat.configuration.wanted->date;
  const auto& noted = seat.slot.record.configured;
  return noted ? manager::ConfigurationDate{noted->days, noted->ms} : manager::ConfigurationDate{};
}

std::uint32_t expected_program(const Seat& seat) {
  const auto* const program = first_program(seat);
  if (program == nullptr) return 0;
  if (program->identification) return *program->identification;
  const auto image = load_program(program->file);
  return image ? image->identification : 0;
}

std::vector<std::uint8_t> program_of(const Seat& seat) {
  const auto* const program = first_program(seat);
  if (program == nullptr) return {};
  auto image = load_program(program->file);
  return image ? std::move(image->bytes) : std::vector<std::uint8_t>();
}

std::uint32_t consumer_of(const design::Timing& timing, const Seat& seat) {
  if (seat.guarded || seat.rate.by_sdo || !seat.there()) return 0;
  return std::uint32_t{seat.id().value()} << 16U | co::whole_ms(heartbeat_timeout(timing, seat));
}

}  // namespace berth::operate
