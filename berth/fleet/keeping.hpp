/// Where changes are kept while hosts do not get them: on the disk, and in memory while the disk refuses.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "berth/fleet/disk_backlog.hpp"

namespace berth::fleet {

class Keeping final : public sparkplug::Backlog {
 public:
  /// `path`: empty: memory alone. `most_bytes`: of the disk; memory keeps 16 MiB at most.
  Keeping(const std::string& path, std::uint64_t most_bytes);

  [[nodiscard]] bool append(const sparkplug::Kept& change) override;
  [[nodiscard]] std::vector<Entry> after(std::uint64_t id, std::size_t most) const override;
  void drop(std::span<const std::uint64_t> ids) override;
  [[nodiscard]] std::size_t size() const override;

  /// After a turn's work: what was appended is durable, or the disk has refused it and memory has it.
  void settle();
  /// Moves what memory has to a disk that takes it again. The entries get new numbers: not while some are under way.
  void try_disk_again();
  [[nodiscard]] bool disk_fails() const noexcept { return disk_fails_; }
  [[nodiscard]] std::uint8_t bd_seq() const;
  void keep_bd_seq(std::uint8_t next);
  /// What is wrong with the disk or that it works again, in words, once for each change; empty: nothing new.
  [[nodiscard]] std::string take_trouble();

 private:
  void disk_failed();

  std::unique_ptr<DiskBacklog> disk_;  // null: there is none, or it could not be opened
  sparkplug::MemoryBacklog memory_;
  std::vector<sparkplug::Kept> unsettled_;  // appended to the disk since the last settle
  std::string trouble_;
  std::string told_;
  bool disk_fails_ = false;  // what comes goes to memory
};

}  // namespace berth::fleet
