#include "berth/device/programs.hpp"

#include <algorithm>
#include <utility>

#include "berth/base/bytes.hpp"
#include "berth/base/crc.hpp"
#include "berth/od/cia302.hpp"

namespace berth::device {
namespace {

namespace cia302 = od::cia302;
using od::AbortCode;
using od::Access;
using od::DataType;

// The commands of 1F51h, and the values that are read from it.
constexpr std::uint8_t stopped = 0, running = 1, to_reset = 2, cleared = 3;

struct ArrayOf {
  std::uint16_t index;
  std::string_view name;
  DataType type;
  Access access;
};
constexpr std::array program_arrays{
    ArrayOf{cia302::program_data, "Program data", DataType::domain, Access::wo},
    ArrayOf{cia302::program_control, "Program control", DataType::unsigned8, Access::rw},
    ArrayOf{cia302::program_identification, "Program software identification", DataType::unsigned32, Access::ro},
    ArrayOf{cia302::flash_status, "Flash status identification", DataType::unsigned32, Access::ro}};

}  // namespace

void add_programs(od::DescriptionBuilder& builder, std::uint8_t count) {
  constexpr std::uint32_t not_stored_here = 8;  // the bytes go to flash memory
  for (const auto& array : program_arrays) {
    builder.object(array.index, od::ObjectCode::array, array.name, array.type);
    for (unsigned n = 1; n <= count; ++n) {
      builder.sub(array.index, {.sub = static_cast<std::uint8_t>(n),
                                .name = array.name,
                                .type = array.type,
                                .access = array.access,
                                .capacity = array.type == DataType::domain ? not_stored_here : 0});
    }
  }
  builder.object(cia302::program_date, od::ObjectCode::record, "Verify application software");
  builder.sub(cia302::program_date, {.sub = 1, .name = "Application software date", .access = Access::ro});
  builder.sub(cia302::program_date, {.sub = 2, .name = "Application software time", .access = Access::ro});
}

Programs::Programs(rt::Executor& executor, od::Values& values, const ProgramOptions& options, TypeCode type,
                   Owner& owner)
    : executor_(&executor),
      options_(options),
      type_(type),
      owner_(&owner),
      memory_(*options.memory, options.layout, *this),
      started_(options.layout.count),
      errors_(options.layout.count) {
  values.attach(*this, cia302::program_control, cia302::program_date);
  values.attach(*this, cia302::program_identification, cia302::flash_status);
  for (unsigned n = 1; n <= options.layout.count; ++n) {
    values.attach(*this, ObjectRef{cia302::program_data, static_cast<std::uint8_t>(n)});
  }
}

// ---- power and restarts

void Programs::power_on() noexcept {
  into_loader_ = false;
  memory_.load();
  start_valid();
}

void Programs::power_off() noexcept {
  cancel();
  memory_.forget();
  awaited_ = {};
  open_ = into_loader_ = false;
  std::fill(started_.begin(), started_.end(), false);
}

void Programs::restarted() noexcept {
  cancel();
  awaited_ = {};
  memory_.load();
  start_valid();
  if (std::exchange(into_loader_, false)) started_[0] = false;
}

void Programs::start_valid() noexcept {
  for (unsigned i = 0; i < options_.layout.count; ++i) {
    const bool valid = memory_.program(static_cast<std::uint8_t>(i + 1)).valid;
    started_[i] = valid;
    errors_[i] = valid ? FlashError::none : FlashError::no_program;
  }
}

void Programs::run() noexcept { owner_->restart(); }

// ---- objects

AbortCode Programs::reading(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept {
  const bool is_program = ref.sub <= options_.layout.count || ref.index == cia302::program_date;
  if (ref.sub == 0 || !is_program || value.size() > shown_.size()) return AbortCode::none;
  store_le(shown_.data(), shown(ref));
  value = std::span(shown_).first(value.size());
  return AbortCode::none;
}

std::uint32_t Programs::shown(ObjectRef ref) const noexcept {
  if (ref.index == cia302::program_date) {
    std::pair<std::uint32_t, std::uint32_t> latest;
    for (unsigned n = 1; n <= options_.layout.count; ++n) {
      const auto& program = memory_.program(static_cast<std::uint8_t>(n));
      if (program.valid) latest = std::max(latest, {program.date, program.time});
    }
    return ref.sub == 1 ? latest.first : latest.second;
  }
  const auto& program = memory_.program(ref.sub);
  if (ref.index == cia302::program_identification) return program.valid ? program.identification : 0;
  if (ref.index == cia302::flash_status) {
    return (memory_.busy() ? 1U : 0U) | static_cast<std::uint32_t>(errors_[ref.sub - 1U]) << 1U;
  }
  if (started_[ref.sub - 1U]) return running;
  return program.valid ? stopped : cleared;
}

AbortCode Programs::writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t> value) noexcept {
  if (ref.index != cia302::program_control || ref.sub == 0 || ref.sub > options_.layout.count || value.empty()) {
    return AbortCode::none;
  }
  return control(ref.sub, value[0]);
}

AbortCode Programs::control(std::uint8_t number, std::uint8_t command) noexcept {
  if (command > cleared) return AbortCode::invalid_value;
  if (memory_.busy() || timed()) return AbortCode::device_state;
  const bool valid = memory_.program(number).valid;
  switch (command) {
    case stopped: return started_[number - 1U] ? set_started(number, false) : AbortCode::none;
    case running:
      if (!valid) return AbortCode::no_data;
      return started_[number - 1U] ? AbortCode::none : set_started(number, true);
    case to_reset: return valid ? set_started(number, true) : AbortCode::no_data;
    default: break;
  }
  if (started_[number - 1U]) return AbortCode::device_state;
  number_ = number;
  errors_[number - 1U] = FlashError::no_program;
  return memory_.clear(number) ? AbortCode::none : AbortCode::hardware;
}

AbortCode Programs::set_started(std::uint8_t number, bool on) noexcept {
  if (number != 1) {
    started_[number - 1U] = on;
    return AbortCode::none;
  }
  into_loader_ = !on;
  if (!on) started_[0] = false;
  executor_->after(options_.restart, *this);
  return AbortCode::none;
}

// ---- download

AbortCode Programs::open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept {
  if (memory_.busy() || timed() || started_[ref.sub - 1U]) return AbortCode::device_state;
  number_ = ref.sub;
  const std::size_t most = options_.layout.longest + (options_.checked ? ProgramHead::size : 0);
  if (size && *size > most) return refuse(FlashError::address, AbortCode::out_of_memory);
  received_ = content_ = 0;
  crc_ = 0;
  head_ = {};
  switch (memory_.begin(number_)) {
    case ProgramMemory::Begun::ready: break;
    case ProgramMemory::Begun::soon: awaited_ = ref; break;
    case ProgramMemory::Begun::not_cleared: return refuse(FlashError::not_cleared, AbortCode::not_stored);
    case ProgramMemory::Begun::busy: return AbortCode::device_state;
  }
  open_ = true;
  errors_[number_ - 1U] = FlashError::none;
  return awaited_.index != 0 ? AbortCode::pending : AbortCode::none;
}

AbortCode Programs::write(std::span<const std::uint8_t> bytes) noexcept {
  if (options_.checked && received_ < ProgramHead::size) {
    const auto head = bytes.first(std::min(bytes.size(), ProgramHead::size - received_));
    std::ranges::copy(head, raw_head_.begin() + static_cast<std::ptrdiff_t>(received_));
    received_ += head.size();
    bytes = bytes.subspan(head.size());
    if (received_ < ProgramHead::size) return AbortCode::none;
    if (const auto code = take_head(); code != AbortCode::none) return code;
  }
  return bytes.empty() ? AbortCode::none : take_content(bytes);
}

AbortCode Programs::take_head() noexcept {
  const auto head = read_program_head(raw_head_);
  const bool known = raw_head_[0] == 'B' && raw_head_[1] == 'P' && raw_head_[2] == 'R' && raw_head_[3] == 'G';
  if (!head) return refuse(known ? FlashError::damaged : FlashError::format, AbortCode::not_stored);
  const bool any = head->type == TypeCode{};
  if (!any && head->type != type_) return refuse(FlashError::damaged, AbortCode::not_stored);
  if (head->length > options_.layout.longest) return refuse(FlashError::address, AbortCode::out_of_memory);
  head_ = *head;
  return AbortCode::none;
}

AbortCode Programs::take_content(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() > ProgramMemory::longest_piece || content_ + bytes.size() > options_.layout.longest) {
    return refuse(FlashError::address, AbortCode::out_of_memory);
  }
  content_ += bytes.size();
  received_ += bytes.size();
  crc_ = crc32(bytes, crc_);
  if (options_.checked && content_ > head_.length) return refuse(FlashError::damaged, AbortCode::not_stored);
  switch (memory_.put(bytes)) {
    case ProgramMemory::Put::taken: return AbortCode::none;
    case ProgramMemory::Put::waits: awaited_ = {cia302::program_data, number_}; return AbortCode::pending;
    case ProgramMemory::Put::refused: break;
  }
  return refuse(FlashError::write, AbortCode::hardware);
}

// The device writes its flash memory on after the answer: 1F57h reports until when.
AbortCode Programs::close(ObjectRef, bool complete) noexcept {
  open_ = false;
  awaited_ = {};
  auto& error = errors_[number_ - 1U];
  const bool whole = content_ > 0 && (!options_.checked || (content_ == head_.length && crc_ == head_.crc));
  if (complete && whole) {
    memory_.end(head_);
    return AbortCode::none;
  }
  memory_.abandon();
  if (error == FlashError::none) error = complete ? FlashError::damaged : FlashError::no_program;
  return AbortCode::not_stored;
}

AbortCode Programs::refuse(FlashError error, AbortCode code) noexcept {
  errors_[number_ - 1U] = error;
  return code;
}

void Programs::memory_ready(bool ok) noexcept {
  if (!ok) errors_[number_ - 1U] = FlashError::write;
  const ObjectRef object = std::exchange(awaited_, ObjectRef{});
  if (object.index != 0) owner_->answer(object, ok ? AbortCode::none : AbortCode::hardware);
}

}  // namespace berth::device
