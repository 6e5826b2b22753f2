#include "berth/fleet/keeping.hpp"

#include <algorithm>
#include <utility>

namespace berth::fleet {
namespace {

// Numbers of entries in memory, above all that a disk gives.
constexpr std::uint64_t in_memory = std::uint64_t{1} << 63U;

}  // namespace

Keeping::Keeping(const std::string& path, std::uint64_t most_bytes) {
  if (path.empty()) return;
  auto opened = DiskBacklog::open(path, most_bytes);
  if (opened) {
    disk_ = std::move(*opened);
  } else {
    trouble_ = std::move(opened.error());
  }
}

bool Keeping::append(const sparkplug::Kept& change) {
  if (!disk_ || disk_fails_) return memory_.append(change);
  if (disk_->append(change)) {
    unsettled_.push_back(change);
    return true;
  }
  if (disk_->trouble().empty()) return false;  // its bound
  disk_failed();
  return memory_.append(change);
}

// The disk has undone what was not settled.
void Keeping::disk_failed() {
  disk_fails_ = true;
  trouble_ = disk_->trouble();
  for (const auto& each : std::exchange(unsettled_, {})) static_cast<void>(memory_.append(each));
}

std::vector<sparkplug::Backlog::Entry> Keeping::after(std::uint64_t id, std::size_t most) const {
  std::vector<Entry> entries;
  if (disk_ && id < in_memory) entries = disk_->after(id, most);
  if (entries.size() >= most) return entries;
  const std::uint64_t last = id < in_memory ? 0 : id - in_memory;
  for (auto& entry : memory_.after(last, most - entries.size())) {
    entry.id += in_memory;
    entries.push_back(std::move(entry));
  }
  return entries;
}

void Keeping::drop(std::span<const std::uint64_t> ids) {
  std::vector<std::uint64_t> disk, memory;
  for (const auto id : ids) {
    if (id < in_memory) disk.push_back(id);
    if (id >= in_memory) memory.push_back(id - in_memory);
  }
  if (disk_) disk_->drop(disk);
  memory_.drop(memory);
}

std::size_t Keeping::size() const { return memory_.size() + (disk_ ? disk_->size() : 0); }

void Keeping::settle() {
  if (!disk_) return;
  if (!disk_->settle()) return disk_failed();
  unsettled_.clear();
}

void Keeping::try_disk_again() {
  if (!disk_ || !disk_fails_) return;
  std::vector<std::uint64_t> moved;
  for (const auto& entry : memory_.after(0, memory_.size())) {
    if (!disk_->append(entry.kept)) break;
    moved.push_back(entry.id);
  }
  const bool all = moved.size() == memory_.size();
  if (!disk_->settle()) return;
  memory_.drop(moved);
  if (!all) return;  // its bound
  disk_fails_ = false;
  trouble_.clear();
}

std::uint8_t Keeping::bd_seq() const { return disk_ ? disk_->bd_seq() : std::uint8_t{0}; }

void Keeping::keep_bd_seq(std::uint8_t next) {
  settle();
  if (!disk_ || disk_->keep_bd_seq(next)) return;
  disk_failed();
}

std::string Keeping::take_trouble() {
  if (trouble_ == told_) return {};
  told_ = trouble_;
  if (trouble_.empty()) return "the disk takes what hosts have not got again";
  return trouble_ + "; what hosts have not got is kept in memory alone";
}

}  // namespace berth::fleet
