#include "berth/campaign/line_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <utility>

namespace berth::campaign {
namespace {

tl::unexpected<Error> failed(int error, const char* text) {
  return fail({.code = Errc::io, .detail = static_cast<std::uint32_t>(error), .text = text});
}

Error not_of_a_campaign(const FileRead& file) {
  const auto line =
      static_cast<std::uint32_t>(std::min<std::uint64_t>(std::max<std::uint64_t>(1, file.first_bad), UINT32_MAX));
  return {
      .code = Errc::invalid, .detail = line, .text = "it is no line of a campaign; nothing is written to this file"};
}

/// 0, or an errno. What was written of it stays when a part was.
int write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const auto written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return 0;
}

/// A process that was killed may still hold the lock by a child that is about to die.
bool lock(int fd) {
  for (int tries = 0; tries < 40; ++tries) {
    if (::flock(fd, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return true;
    ::usleep(50'000);
  }
  return false;
}

}  // namespace

LineFile::~LineFile() {
  if (fd_ >= 0) ::close(fd_);
}
LineFile::LineFile(LineFile&& other) noexcept : fd_(std::exchange(other.fd_, -1)), was_(std::move(other.was_)) {}

Result<LineFile> LineFile::open(const std::string& path, Results& into) {
  LineFile file(::open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0644), {});
  if (file.fd_ < 0) return failed(errno, "opening it");
  struct stat status {};
  if (::fstat(file.fd_, &status) != 0) return failed(errno, "opening it");
  if (!S_ISREG(status.st_mode)) return fail(Errc::invalid, "it is no plain file");
  if (!lock(file.fd_)) return fail(Errc::duplicate, "another process writes it");
  auto read = into.read(path);
  if (!read) return tl::unexpected(read.error());
  const bool foreign = read->bad_lines > 0 || (read->pieces > 0 && read->lines == 0) || read->foreign();
  if (foreign) return fail(not_of_a_campaign(*read));
  file.was_ = *read;
  if (read->torn() && ::ftruncate(file.fd_, static_cast<off_t>(read->torn_at)) != 0)
    return failed(errno, "taking its torn last line off");
  const int error = read->lacks_line_feed ? write_all(file.fd_, "\n") : 0;
  if (error != 0) return failed(error, "writing it");
  return file;
}

Result<void> LineFile::append(std::string_view line) {
  const auto before = ::lseek(fd_, 0, SEEK_END);
  const int error = write_all(fd_, std::string(line) + "\n");
  if (error == 0) return {};
  // Half a line helps nobody; where this fails too, the next start takes it off.
  if (before >= 0 && ::ftruncate(fd_, before) != 0) return failed(error, "writing it");
  return failed(error, "writing it");
}

Result<void> LineFile::sync() {
  if (::fsync(fd_) != 0 && errno != EINVAL) return failed(errno, "writing it");
  return {};
}

}  // namespace berth::campaign
