#include "whole_files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "options.hpp"

namespace berth::cli {
namespace {

Failure wrong(const std::string& path, int error) {
  return failure(error == EEXIST ? Exit::no : Exit::failed,
                 path + ": " + (error == EEXIST ? "is there already" : std::strerror(error)));
}

/// One file on its way to its place. What is not kept is taken away, and what was there before is there again.
class Placing {
 public:
  explicit Placing(const std::string& path)
      : path_(path),
        part_(fmt::format("{}.{}.part", path, ::getpid())),
        before_(fmt::format("{}.{}.before", path, ::getpid())) {}
  ~Placing() {
    if (written_) ::unlink(part_.c_str());
    if (placed_ && !kept_ && !saved_) ::unlink(path_.c_str());
    if (saved_ && !kept_) ::rename(before_.c_str(), path_.c_str());
    if (saved_ && kept_) ::unlink(before_.c_str());
  }
  Placing(const Placing&) = delete;
  Placing& operator=(const Placing&) = delete;

  /// 0, or what went wrong.
  [[nodiscard]] int write(std::string_view bytes) {
    const int fd = ::open(part_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd < 0) return errno;
    written_ = true;
    int error = 0;
    while (!bytes.empty() && error == 0) {
      const auto n = ::write(fd, bytes.data(), bytes.size());
      if (n > 0) bytes.remove_prefix(static_cast<std::size_t>(n));
      if (n < 0 && errno != EINTR) error = errno;
    }
    if (error == 0 && ::fsync(fd) != 0) error = errno;
    ::close(fd);
    return error;
  }
  [[nodiscard]] int place(bool replace) {
    if (replace && ::link(path_.c_str(), before_.c_str()) == 0) saved_ = true;
    placed_ = replace ? ::rename(part_.c_str(), path_.c_str()) == 0 : place_new();
    return placed_ ? 0 : errno;
  }
  void keep() noexcept { kept_ = true; }

 private:
  // Never over a file that came meanwhile; a file system that cannot say so may have links.
  [[nodiscard]] bool place_new() const {
    if (::renameat2(AT_FDCWD, part_.c_str(), AT_FDCWD, path_.c_str(), RENAME_NOREPLACE) == 0) return true;
    if (errno != EINVAL && errno != ENOSYS) return false;
    return ::link(part_.c_str(), path_.c_str()) == 0;
  }
  std::string path_;
  std::string part_;
  std::string before_;
  bool written_ = false;
  bool saved_ = false;
  bool placed_ = false;
  bool kept_ = false;
};

}  // namespace

std::optional<Failure> write_whole(const std::vector<WholeFile>& files, bool replace) {
  std::vector<std::unique_ptr<Placing>> placing;
  for (const auto& file : files) {
    std::error_code none;
    const auto there = std::filesystem::symlink_status(file.path, none);
    if (!replace && std::filesystem::exists(there)) return wrong(file.path, EEXIST);
    if (std::filesystem::is_directory(there)) return wrong(file.path, EISDIR);
    placing.push_back(std::make_unique<Placing>(file.path));
    if (const int error = placing.back()->write(file.bytes); error != 0) return wrong(file.path, error);
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (const int error = placing[i]->place(replace); error != 0) return wrong(files[i].path, error);
  }
  for (const auto& each : placing) each->keep();
  return std::nullopt;
}

std::optional<Failure> make_folder(const std::string& path) {
  if (::mkdir(path.c_str(), 0777) == 0 || errno == EEXIST) return std::nullopt;
  return failure(Exit::failed, path + ": " + std::strerror(errno));
}

}  // namespace berth::cli
