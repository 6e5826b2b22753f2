#include "berth/operate/written_files.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "berth/base/crc.hpp"
#include "berth/base/kept.hpp"
#include "berth/base/part_file.hpp"
#include "berth/base/private_file.hpp"
#include "berth/base/real_path.hpp"

namespace berth::operate {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t longest_name = 200;

const char* extension(WrittenFiles::Form form) noexcept { return form == WrittenFiles::Form::dcf ? ".dcf" : ".cdcf"; }

// Users choose the names: characters that a file name cannot have, or that a program may misread, are written like %2F.
std::string escaped(std::string_view name, bool dots) {
  std::string made;
  for (const char c : name) {
    const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || c == '-' ||
                       c == '_' || (dots && c == '.');
    if (plain) {
      made += c;
    } else {
      made += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  return made;
}

tl::unexpected<Error> failed(const fs::path& path, int error) {
  Error made{.code = Errc::io, .detail = static_cast<std::uint32_t>(error)};
  made.text = kept(path.string() + ": " + std::strerror(error));
  return fail(made);
}

}  // namespace

fs::path WrittenFiles::path_of(const places::SlotName& slot, Form form) const {
  std::string name = escaped(slot.machine, false) + '.' + escaped(slot.bus, false) + '.' + escaped(slot.name, true);
  if (name.size() > longest_name) {
    const std::span whole(reinterpret_cast<const std::uint8_t*>(name.data()), name.size());
    const std::uint32_t sum = crc32(whole);
    name = fmt::format("{}%{:08X}", name.substr(0, longest_name), sum);
  }
  return place_.folder / (name + extension(form));
}

std::string WrittenFiles::of(const places::SlotName& slot) const {
  if (place_.folder.empty()) return {};
  std::error_code no_dcf;
  std::error_code no_concise;
  const fs::path dcf = path_of(slot, Form::dcf);
  const fs::path concise = path_of(slot, Form::concise);
  const auto dcf_at = fs::last_write_time(dcf, no_dcf);
  const auto concise_at = fs::last_write_time(concise, no_concise);
  if (no_dcf && no_concise) return {};
  const bool is_dcf = !no_dcf && (no_concise || dcf_at > concise_at);
  return (is_dcf ? dcf : concise).string();
}

Result<std::string> WrittenFiles::keep(const places::SlotName& slot, Form form,
                                       std::span<const std::uint8_t> bytes) const {
  if (place_.folder.empty() || !place_.writes) return std::string();
  if (::mkdir(place_.folder.c_str(), 0700) != 0 && errno != EEXIST) return failed(place_.folder, errno);
  const fs::path path = path_of(slot, form);
  PartFile part(path.string());
  int error = part.write({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, private_mode(path.string()));
  if (error == 0) error = part.replace();
  if (error != 0) return failed(path, error);
  ::unlink(path_of(slot, form == Form::dcf ? Form::concise : Form::dcf).c_str());
  return path.string();
}

Result<void> WrittenFiles::drop(const places::SlotName& slot) const {
  if (place_.folder.empty() || !place_.writes) return {};
  for (const Form form : {Form::dcf, Form::concise}) {
    const fs::path path = path_of(slot, form);
    if (::unlink(path.c_str()) != 0 && errno != ENOENT) return failed(path, errno);
  }
  sync_folder_of(path_of(slot, Form::dcf).string());
  return {};
}

std::string WrittenFiles::as_named(const std::string& path) const {
  const fs::path from = real_path(fs::path(place_.machine_file).parent_path() / ".");
  const fs::path whole = real_path(path);
  return place_.machine_file.empty() || from.empty() || !is_beneath(whole, from)
             ? whole.string()
             : whole.lexically_relative(from).string();
}

}  // namespace berth::operate
