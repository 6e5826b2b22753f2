#include "tests/store/crash_vfs.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>

namespace berth::store {
namespace {

struct Handle {
  sqlite3_file base;
  CrashVfs* disk;
  CrashVfs::File* file;
  bool delete_on_close;
};

CrashVfs::File& file_of(sqlite3_file* f) { return *reinterpret_cast<Handle*>(f)->file; }
CrashVfs& disk_of(sqlite3_file* f) { return *reinterpret_cast<Handle*>(f)->disk; }

void apply(std::string& to, const CrashVfs::Change& change, std::size_t bytes) {
  if (change.truncate) {
    to.resize(static_cast<std::size_t>(change.at));
    return;
  }
  const auto at = static_cast<std::size_t>(change.at);
  if (to.size() < at + bytes) to.resize(at + bytes);
  std::copy_n(change.bytes.begin(), bytes, to.begin() + static_cast<std::ptrdiff_t>(at));
}

int x_close(sqlite3_file* f) {
  f->pMethods = nullptr;
  return SQLITE_OK;
}

int x_read(sqlite3_file* f, void* to, int size, sqlite3_int64 at) {
  if (disk_of(f).crashed()) return SQLITE_IOERR_READ;
  const auto& bytes = file_of(f).now;
  const auto begin = std::min(static_cast<std::size_t>(at), bytes.size());
  const auto got = std::min(static_cast<std::size_t>(size), bytes.size() - begin);
  std::memcpy(to, bytes.data() + begin, got);
  std::memset(static_cast<char*>(to) + got, 0, static_cast<std::size_t>(size) - got);
  return got == static_cast<std::size_t>(size) ? SQLITE_OK : SQLITE_IOERR_SHORT_READ;
}

int change(sqlite3_file* f, CrashVfs::Change what) {
  auto& disk = disk_of(f);
  auto& file = file_of(f);
  const bool before = disk.crashed();
  const int rc = disk.step(true);
  if (before || rc == SQLITE_FULL) return rc;
  const auto size = what.bytes.size();
  apply(file.now, what, size);
  file.pending.push_back(std::move(what));
  disk.keep_moment();
  return rc;
}

int x_write(sqlite3_file* f, const void* from, int size, sqlite3_int64 at) {
  return change(f, {static_cast<std::uint64_t>(at),
                    std::string(static_cast<const char*>(from), static_cast<std::size_t>(size)), false});
}

int x_truncate(sqlite3_file* f, sqlite3_int64 size) { return change(f, {static_cast<std::uint64_t>(size), {}, true}); }

int x_sync(sqlite3_file* f, int) {
  const int rc = disk_of(f).step(false);
  if (rc != SQLITE_OK) return rc;
  disk_of(f).keep_moment();
  auto& file = file_of(f);
  for (const auto& change : file.pending) apply(file.synced, change, change.bytes.size());
  file.pending.clear();
  file.exists_synced = true;  // as the system's VFS, which syncs the folder with a new file's first sync
  return SQLITE_OK;
}

int x_file_size(sqlite3_file* f, sqlite3_int64* size) {
  *size = static_cast<sqlite3_int64>(file_of(f).now.size());
  return SQLITE_OK;
}
int x_lock(sqlite3_file*, int) { return SQLITE_OK; }
int x_check_lock(sqlite3_file*, int* held) {
  *held = 0;
  return SQLITE_OK;
}
int x_control(sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; }
int x_sector_size(sqlite3_file*) { return 4096; }
// As the system's VFS: a torn write leaves the bytes beside it alone.
int x_characteristics(sqlite3_file*) { return SQLITE_IOCAP_POWERSAFE_OVERWRITE; }

const sqlite3_io_methods methods{
    1,       x_close,      x_read,    x_write,       x_truncate,        x_sync,  x_file_size, x_lock,
    x_lock,  x_check_lock, x_control, x_sector_size, x_characteristics, nullptr, nullptr,     nullptr,
    nullptr, nullptr,      nullptr};

CrashVfs& disk_of(sqlite3_vfs* vfs) { return *static_cast<CrashVfs*>(vfs->pAppData); }

int x_open(sqlite3_vfs* vfs, sqlite3_filename name, sqlite3_file* f, int flags, int* out) {
  f->pMethods = nullptr;
  auto& disk = disk_of(vfs);
  if (disk.crashed()) return SQLITE_CANTOPEN;
  const std::string path = name == nullptr ? "temporary" : name;
  auto it = disk.files().find(path);
  if ((it == disk.files().end() || !it->second.exists) && (flags & SQLITE_OPEN_CREATE) == 0) return SQLITE_CANTOPEN;
  auto& file = disk.files()[path];
  file.exists = true;
  auto* handle = reinterpret_cast<Handle*>(f);
  handle->disk = &disk;
  handle->file = &file;
  handle->base.pMethods = &methods;
  if (out != nullptr) *out = flags;
  return SQLITE_OK;
}

int x_delete(sqlite3_vfs* vfs, const char* name, int sync_folder) {
  auto& disk = disk_of(vfs);
  const int rc = disk.step(false);
  if (rc != SQLITE_OK) return rc;
  disk.keep_moment();
  auto it = disk.files().find(name);
  if (it == disk.files().end() || !it->second.exists) return SQLITE_IOERR_DELETE_NOENT;
  auto& file = it->second;
  file.exists = false;
  file.now.clear();
  file.pending.clear();
  if (sync_folder != 0) {
    file.exists_synced = false;
    file.synced.clear();
  }
  return SQLITE_OK;
}

int x_access(sqlite3_vfs* vfs, const char* name, int, int* result) {
  auto& files = disk_of(vfs).files();
  const auto it = files.find(name);
  *result = it != files.end() && it->second.exists ? 1 : 0;
  return SQLITE_OK;
}

int x_full_path(sqlite3_vfs*, const char* name, int size, char* out) {
  sqlite3_snprintf(size, out, "%s", name);
  return SQLITE_OK;
}
int x_randomness(sqlite3_vfs*, int size, char* out) {
  for (int i = 0; i < size; ++i) out[i] = static_cast<char>(i * 37 + 11);
  return size;
}
int x_sleep(sqlite3_vfs*, int microseconds) { return microseconds; }
int x_time(sqlite3_vfs*, double* now) {
  *now = 2461000.5;
  return SQLITE_OK;
}
int x_last_error(sqlite3_vfs*, int, char*) { return 0; }

}  // namespace

CrashVfs::CrashVfs(std::string name) : name_(std::move(name)) {
  vfs_.iVersion = 1;
  vfs_.szOsFile = sizeof(Handle);
  vfs_.mxPathname = 256;
  vfs_.zName = name_.c_str();
  vfs_.pAppData = this;
  vfs_.xOpen = x_open;
  vfs_.xDelete = x_delete;
  vfs_.xAccess = x_access;
  vfs_.xFullPathname = x_full_path;
  vfs_.xRandomness = x_randomness;
  vfs_.xSleep = x_sleep;
  vfs_.xCurrentTime = x_time;
  vfs_.xGetLastError = x_last_error;
  sqlite3_vfs_register(&vfs_, 0);
}

CrashVfs::~CrashVfs() { sqlite3_vfs_unregister(&vfs_); }

void CrashVfs::format() {
  files_.clear();
  crash_at(std::nullopt);
  full_at(std::nullopt);
  crashed_ = false;
}

void CrashVfs::crash_at(std::optional<std::uint64_t> k) {
  crash_at_ = k;
  steps_ = 0;
}

void CrashVfs::full_at(std::optional<std::uint64_t> k) {
  full_at_ = k;
  steps_ = 0;
}

int CrashVfs::step(bool writes) {
  if (crashed_) return SQLITE_IOERR;
  const auto now = steps_++;
  if (crash_at_ && now == *crash_at_) {
    crashed_ = true;
    return SQLITE_IOERR;
  }
  if (writes && full_at_ && now >= *full_at_) {
    full_at_.reset();
    return SQLITE_FULL;
  }
  return SQLITE_OK;
}

void CrashVfs::keep_moment() {
  if (moments_ != nullptr) moments_->push_back({files_});
}

void CrashVfs::put_back(const Moment& moment) {
  files_ = moment.files;
  crashed_ = true;
}

void CrashVfs::after_crash(Loss loss, Random& random) {
  for (auto it = files_.begin(); it != files_.end();) {
    auto& file = it->second;
    std::string disk = file.synced;
    const bool keep_all = loss == Loss::none || loss == Loss::none_torn_last;
    bool exists = file.exists_synced;
    for (std::size_t i = 0; i < file.pending.size(); ++i) {
      const auto& change = file.pending[i];
      const bool last = i + 1 == file.pending.size();
      const bool torn = last && !change.truncate && loss != Loss::all && loss != Loss::none;
      const bool kept =
          keep_all || (loss == Loss::some && random.chance(500'000)) || (torn && loss == Loss::all_torn_last);
      if (!kept) continue;
      exists = true;
      apply(disk, change, torn ? random.below(change.bytes.size() + 1) : change.bytes.size());
    }
    // A deletion whose folder was not synced may or may not have come to the disk.
    if (!file.exists) exists = file.exists_synced && !keep_all && (loss != Loss::some || random.chance(500'000));
    if (!exists) {
      it = files_.erase(it);
      continue;
    }
    file = {disk, disk, {}, true, true};
    ++it;
  }
  crashed_ = false;
  crash_at(std::nullopt);
  full_at(std::nullopt);
}

}  // namespace berth::store
