#include "berth/operate/programming.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "berth/base/crc.hpp"
#include "berth/base/part_file.hpp"
#include "berth/base/read_files.hpp"
#include "berth/device/program_image.hpp"
#include "berth/od/cia302.hpp"

namespace berth::operate {
namespace {

constexpr std::uint16_t identity = 0x1018;
constexpr std::size_t longest_program = std::size_t{16} << 20U;

std::int64_t change_of(const std::string& file) {
  std::error_code unknown;
  const auto time = std::filesystem::last_write_time(file, unknown);
  return unknown ? 0 : time.time_since_epoch().count();
}

std::string progress_text(const manager::ProgramProgress& p) {
  if (p.stage != manager::ProgramStage::downloading) {
    return fmt::format("{} program {}", name(p.stage), p.number);
  }
  return fmt::format("downloading program {}: {} of {} bytes", p.number, p.done, p.total);
}

}  // namespace

Result<ProgramImage> load_program(const std::string& file) {
  note_read(file);
  std::ifstream in(file, std::ios::binary);
  std::error_code unknown;
  const bool regular = std::filesystem::is_regular_file(file, unknown);
  if (!std::filesystem::exists(file, unknown)) return fail(Errc::io, "there is no such file");
  if (!in || !regular) return fail(Errc::io, "its program's file cannot be read");
  const auto size = std::filesystem::file_size(file, unknown);
  if (unknown || size > longest_program) return fail(Errc::invalid, "its program's file is longer than 16 MiB");
  return program_of({std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()});
}

Result<ProgramImage> program_of(std::vector<std::uint8_t> bytes) {
  ProgramImage image;
  image.bytes = std::move(bytes);
  if (image.bytes.empty()) return fail(Errc::invalid, "its program's file is empty");
  const auto head = device::read_program_head(image.bytes);
  image.identification = head ? head->crc : crc32(image.bytes);
  if (head) image.type = head->type;
  const auto content = std::span<const std::uint8_t>(image.bytes).subspan(head ? device::ProgramHead::size : 0);
  if (head && (head->length != content.size() || head->crc != crc32(content)))
    return fail(Errc::invalid, "its program's file is damaged: length or checksum is not as its head says");
  return image;
}

int replace_program(const std::string& file, std::span<const std::uint8_t> bytes) {
  const auto before = load_program(file);
  if (before) {
    const int error = replace_user_file(file + ".before",
                                        {reinterpret_cast<const char*>(before->bytes.data()), before->bytes.size()});
    if (error != 0) return error;
  }
  return replace_user_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

rt::Task<Result<void>> suits(const ProgramImage& image, co::SdoAccess& device) {
  const bool any = image.type == TypeCode{};
  for (std::uint8_t sub = 1; sub <= 2; ++sub) {
    const auto part = co_await device.read_u32(identity, sub);
    const bool lacks = !part && part.error().code == Errc::aborted;
    if (!part && !lacks) co_return fail(part.error());
    const std::uint32_t named = sub == 1 ? image.type.vendor : image.type.product;
    if (part && !any && *part != named) {
      const Error other{.code = Errc::mismatch,
                        .sub = sub,
                        .index = identity,
                        .detail = *part,
                        .text = "the image is of another product than the device; its program was left alone"};
      co_return fail(other);
    }
  }
  co_return Result<void>{};
}

const Result<ProgramImage>& Programming::image(const std::string& file) {
  Loaded& loaded = images_[file];
  const auto changed = change_of(file);
  if (!loaded.image || loaded.changed != changed) loaded.image = load_program(file);
  loaded.changed = changed;
  return loaded.image;
}

std::uint32_t Programming::expected(const places::SlotProgram& program) {
  if (program.identification) return *program.identification;
  const auto& loaded = image(program.file);
  return loaded ? loaded->identification : 0;
}

std::string Programming::unreadable(const Seat& seat) {
  for (const auto& program : seat.slot.spec.software.programs) {
    const auto& loaded = image(program.file);
    if (!loaded) return fmt::format("{}: {}", program.file, loaded.error().text);
  }
  return {};
}

void Programming::expect(const Seat& seat, manager::SlaveRules& rules) {
  const auto& software = seat.slot.spec.software;
  rules.expected.hardware_text = software.hardware;
  rules.expected.hardware = software.hardware_number;
  rules.expected.software_text = software.version;
  rules.checks_software = !software.programs.empty() || !software.version.empty();
  rules.may_update = software.updates && !software.programs.empty() && s_.may_command();
  if (software.programs.empty()) return;
  // Program 1 is the device's own; without it the text is compared, and the rest is `others`.
  const bool has_first = software.programs.front().number == 1;
  if (has_first) rules.expected.software = expected(software.programs.front());
  if (has_first && rules.expected.software == 0) rules.expected.software_text.clear();
}

rt::Task<Result<std::string>> Programming::others(Seat& seat, network::BootTarget& target) {
  for (const auto& program : seat.slot.spec.software.programs) {
    if (program.number == 1) continue;
    const auto is = co_await target.objects().read_u32(od::cia302::program_identification, program.number);
    if (!is) co_return fail(is.error());
    const std::uint32_t wanted = expected(program);
    if (*is != wanted) {
      std::string differs = fmt::format("program {}: {:08X}h instead of {:08X}h", program.number, *is, wanted);
      co_return differs;
    }
  }
  co_return std::string();
}

rt::Task<Result<void>> Programming::is_the_same(const Seat& seat, network::BootTarget& target) {
  const auto& confirmed = seat.slot.record.confirmed;
  if (!confirmed) co_return Result<void>{};
  for (std::uint8_t sub = 1; sub <= 4; ++sub) {
    const auto part = co_await target.objects().read_u32(identity, sub);
    const bool lacks = !part && part.error().code == Errc::aborted;
    if (!part && !lacks) co_return fail(part.error());
    if (part && confirmed->device.knows(sub - 1U) && *part != confirmed->device.address.part(sub - 1U)) {
      co_return fail(Error{.code = Errc::mismatch, .sub = sub, .index = identity, .text = "another device answers"});
    }
  }
  co_return Result<void>{};
}

rt::Task<Result<void>> Programming::update(Seat& seat, network::BootTarget& target) {
  std::vector<manager::ProgramWish> wishes;
  for (const auto& program : seat.slot.spec.software.programs) {
    const auto& loaded = image(program.file);
    if (!loaded) co_return fail(loaded.error());
    const auto suited = co_await suits(*loaded, target.objects());
    if (!suited) co_return suited;
    wishes.push_back({.number = program.number, .image = loaded->bytes, .identification = expected(program)});
  }
  manager::ProgramOptions options;
  options.transfers = &transfers_;
  options.restart_time = s_.bus.timing.boot_timeout;
  options.is_the_same = [this, &seat, &target] { return is_the_same(seat, target); };
  std::size_t tenth = 0;
  options.progress = [this, &seat, &tenth](const manager::ProgramProgress& p) {
    const std::size_t now = p.total == 0 ? 0 : p.done * 10 / p.total;
    const bool tells = p.stage != manager::ProgramStage::downloading || now != tenth;
    tenth = now;
    if (tells) slots_.happened(seat, SlotEvent::configures, progress_text(p));
  };
  manager::ProgramLoader loader(target.objects(), wishes, options);
  manager::ProgramReport report;
  const auto done = co_await loader.run(report);
  co_return done;
}

}  // namespace berth::operate
