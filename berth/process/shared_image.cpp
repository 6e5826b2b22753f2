#include "berth/process/shared_image.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

namespace berth::process {

namespace {

constexpr std::size_t most_bytes = 16 * std::size_t{largest_part};
constexpr std::size_t longest_image_name = 100;

std::int64_t monotonic() noexcept {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

struct flock lock_of(SharedMemory::Side side) noexcept {
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  lock.l_start = static_cast<off_t>(side);
  lock.l_len = 1;
  return lock;
}

bool take_lock(int file, SharedMemory::Side side) noexcept {
  auto lock = lock_of(side);
  return ::fcntl(file, F_OFD_SETLK, &lock) == 0;
}

bool has_lock(int file, SharedMemory::Side side) noexcept {
  auto lock = lock_of(side);
  return ::fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

bool good_name(std::string_view name) noexcept {
  const auto good = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' ||
           c == '.';
  };
  return !name.empty() && name.size() <= longest_image_name && std::ranges::all_of(name, good);
}

tl::unexpected<std::string> refused(std::string_view name, std::string_view why) {
  return tl::unexpected(fmt::format("process image \"{}\": {}", name, why));
}

tl::unexpected<std::string> refused_by_system(std::string_view name) {
  return refused(name, fmt::format("{}: /dev/shm/berth-{}", std::strerror(errno), name));
}

tl::unexpected<std::string> refused_name(std::string_view name) {
  return refused(name, "a name has letters, digits, \"-\", \"_\" and \".\", 100 at most");
}

/// Removes an image that an earlier process left. False: a process uses it.
bool remove_old(const std::string& path) noexcept {
  const int old = ::shm_open(path.c_str(), O_RDWR | O_CLOEXEC, 0);
  if (old < 0) return true;
  const bool there = has_lock(old, SharedMemory::Side::network);
  ::close(old);
  if (!there) ::shm_unlink(path.c_str());
  return !there;
}

}  // namespace

SharedMemory::SharedMemory(SharedMemory&& other) noexcept
    : path_(std::move(other.path_)),
      side_(other.side_),
      file_(std::exchange(other.file_, -1)),
      bytes_(std::exchange(other.bytes_, {})) {}

SharedMemory::~SharedMemory() {
  if (!bytes_.empty()) ::munmap(bytes_.data(), bytes_.size());
  if (file_ < 0) return;
  // Another process may have taken the name meanwhile, because this one ended slowly.
  struct stat mine {};
  struct stat named {};
  const int now = side_ == Side::network ? ::shm_open(path_.c_str(), O_RDONLY | O_CLOEXEC, 0) : -1;
  if (now >= 0) {
    if (::fstat(file_, &mine) == 0 && ::fstat(now, &named) == 0 && mine.st_ino == named.st_ino) {
      ::shm_unlink(path_.c_str());
    }
    ::close(now);
  }
  ::close(file_);
}

bool SharedMemory::map(std::size_t size) noexcept {
  void* const memory = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file_, 0);
  if (memory == MAP_FAILED) return false;
  bytes_ = {static_cast<std::uint8_t*>(memory), size};
  return true;
}

bool SharedMemory::other() const noexcept {
  return has_lock(file_, side_ == Side::network ? Side::application : Side::network);
}

tl::expected<SharedMemory, std::string> SharedMemory::create(std::string_view name, std::size_t size) {
  if (!good_name(name)) return refused_name(name);
  SharedMemory made(fmt::format("/berth-{}", name), Side::network);
  constexpr auto has = "another process has it; end that, or take another name";
  if (!remove_old(made.path_)) return refused(name, has);
  made.file_ = ::shm_open(made.path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (made.file_ < 0) return errno == EEXIST ? refused(name, has) : refused_by_system(name);
  if (!take_lock(made.file_, Side::network)) return refused(name, has);
  // Not `ftruncate`: it promises memory that may be missing, and a later write would end the program.
  if (const int error = ::posix_fallocate(made.file_, 0, static_cast<off_t>(size)); error != 0) {
    errno = error;
    return refused_by_system(name);
  }
  if (!made.map(size)) return refused_by_system(name);
  return made;
}

tl::expected<SharedMemory, std::string> SharedMemory::open(std::string_view name) {
  if (!good_name(name)) return refused_name(name);
  SharedMemory found(fmt::format("/berth-{}", name), Side::application);
  constexpr auto gone = "it is not there; start the program of the device first";
  found.file_ = ::shm_open(found.path_.c_str(), O_RDWR | O_CLOEXEC, 0);
  if (found.file_ < 0) return errno == ENOENT ? refused(name, gone) : refused_by_system(name);
  if (!found.other()) return refused(name, gone);
  if (!take_lock(found.file_, Side::application)) {
    return refused(name, "another application uses it; only one at a time can");
  }
  struct stat its {};
  if (::fstat(found.file_, &its) != 0) return refused_by_system(name);
  // Anybody who may write to /dev/shm could offer values of their own.
  if (its.st_uid != ::geteuid()) return refused(name, "it is another user's; run both programs as one user");
  const auto size = static_cast<std::size_t>(its.st_size);
  if (size == 0 || size > most_bytes) return refused(name, "it is being made; try again");
  if (!found.map(size)) return refused_by_system(name);
  return found;
}

SharedImage::SharedImage(SharedMemory memory, const Layout& layout, const ImageFormat& format)
    : memory_(std::move(memory)), layout_(layout), network_(memory_.bytes().data(), layout_, format, monotonic) {}

tl::expected<std::unique_ptr<SharedImage>, std::string> SharedImage::create(std::string_view name,
                                                                            const Layout& layout) {
  const ImageFormat format(layout);
  if (format.size() > most_bytes) return refused(name, "it has more than 16 MiB; take fewer variables");
  auto memory = SharedMemory::create(name, format.size());
  if (!memory) return tl::unexpected(std::move(memory.error()));
  format.begin(memory->bytes().data());
  return std::unique_ptr<SharedImage>(new SharedImage(std::move(*memory), layout, format));
}

SharedApplication::SharedApplication(SharedMemory memory, Layout layout)
    : memory_(std::move(memory)), layout_(std::move(layout)), side_(memory_.bytes().data(), ImageFormat(layout_)) {}

tl::expected<std::unique_ptr<SharedApplication>, std::string> SharedApplication::open(std::string_view name) {
  auto memory = SharedMemory::open(name);
  if (!memory) return tl::unexpected(std::move(memory.error()));
  auto layout = read_layout(memory->bytes());
  if (!layout) return refused(name, layout.error());
  return std::unique_ptr<SharedApplication>(new SharedApplication(std::move(*memory), std::move(*layout)));
}

std::optional<rt::Duration> SharedApplication::age_now(std::uint32_t output) const noexcept {
  const auto then = side_.age_of(output);
  if (!then) return then;
  return *then + rt::Duration(monotonic() - side_.head().monotonic_ns);
}

}  // namespace berth::process
