#include "slot_table.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <thread>

#include "berth/base/read_files.hpp"
#include "berth/store/database.hpp"
#include "interrupt.hpp"
#include "machine_file.hpp"
#include "outputs.hpp"
#include "ports.hpp"

namespace berth::cli {

namespace fs = std::filesystem;

std::string default_store(const std::string& machine_file) {
  return fs::path(machine_file).replace_extension(".db").string();
}

SlotTable::~SlotTable() {
  store_.reset();
  std::error_code ignored;
  if (!throw_away_.empty()) fs::remove_all(throw_away_, ignored);
}

namespace {

// The times of the last writes to the store and to its write-ahead log.
std::array<fs::file_time_type, 2> written_at(const std::string& path) {
  std::error_code none;
  return {fs::last_write_time(path, none), fs::last_write_time(path + "-wal", none)};
}

}  // namespace

// Copies the store into a folder that exists as long as the object. The store may be in use: if it changed meanwhile,
// it is copied again.
tl::expected<std::string, Failure> SlotTable::copied(const std::string& path) {
  std::string pattern = (fs::temp_directory_path() / "berth-copy-XXXXXX").string();
  if (::mkdtemp(pattern.data()) == nullptr)
    return tl::unexpected(failure(Exit::failed, pattern + ": " + std::strerror(errno)));
  throw_away_ = pattern;
  const std::string copy = (fs::path(throw_away_) / "store.db").string();
  constexpr int tries = 50;
  std::error_code error;
  for (int i = 0; i < tries; ++i) {
    const auto before = written_at(path);
    fs::copy_file(path, copy, fs::copy_options::overwrite_existing, error);
    if (!error && fs::exists(path + "-wal")) {
      fs::copy_file(path + "-wal", copy + "-wal", fs::copy_options::overwrite_existing, error);
    } else {
      fs::remove(copy + "-wal");
    }
    if (written_at(path) == before) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  if (error) return tl::unexpected(failure(Exit::failed, path + ": " + error.message()));
  return copy;
}

namespace {

std::string path_of(const design::Machine& machine, const Options& options) {
  const bool real = std::ranges::any_of(machine.buses, [](const auto& b) { return is_real(b.port); });
  if (!options.store.file.empty() || !real || !options.store.used || is_ad_hoc(machine)) return options.store.file;
  const std::string path = default_store(machine.file);
  return options.store.made || fs::exists(path) ? path : std::string();
}

}  // namespace

tl::expected<std::unique_ptr<SlotTable>, Failure> SlotTable::open(const design::Machine& machine,
                                                                  const Options& options) {
  std::unique_ptr<SlotTable> table(new SlotTable);
  std::string path = path_of(machine, options);
  const bool copies = options.dry_run || options.outside.observe;
  if (copies && !path.empty() && !fs::exists(path)) path.clear();
  table->path_ = path;
  if (copies && !path.empty()) {
    auto copy = table->copied(path);
    if (!copy) return tl::unexpected(copy.error());
    path = std::move(*copy);
  }
  if (path.empty()) {
    table->store_ = std::make_unique<places::MemoryStore>();
    return table;
  }
  if (!copies) {
    if (auto bad = may_keep(path, "--store")) return tl::unexpected(*std::move(bad));
  }
  auto opened = store::Database::open(path, {.ended = ended_by(options.timeout)});
  if (!opened) return tl::unexpected(failure(Exit::failed, opened.error().message));
  table->store_ = std::move(*opened);
  note_read(path);
  return table;
}

operate::WrittenFiles::Place SlotTable::written(const std::string& machine_file) const {
  if (path_.empty()) return {};
  return {.folder = path_ + "-written", .machine_file = machine_file, .writes = throw_away_.empty()};
}

}  // namespace berth::cli
