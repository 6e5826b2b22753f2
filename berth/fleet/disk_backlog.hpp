/// What hosts have not got yet, in a file beside the slot table: SQLite behind `sparkplug::Backlog`. Besides, the
/// number of the next session (bdSeq), which must go on after a restart.
///
/// **Guarantees.** What was appended before `settle` returned true survives a crash at any instant, also a power
/// failure. A file that is damaged, not Berth's, or of a newer Berth is refused and not changed. A foreign file can do
/// no harm: its schema is compared with Berth's to the letter, and SQLite is in defensive mode.
///
/// While it is open, `<file>-wal` belongs to it. One thread at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/sparkplug/backlog.hpp"

namespace berth::fleet {

class DiskBacklog final : public sparkplug::Backlog {
 public:
  /// Opens the file, or makes it. `most_bytes`: of names and values; the file may be twice as large. The error is for
  /// people: file, cause, what to do.
  [[nodiscard]] static tl::expected<std::unique_ptr<DiskBacklog>, std::string> open(const std::string& path,
                                                                                    std::uint64_t most_bytes);
  ~DiskBacklog();
  DiskBacklog(const DiskBacklog&) = delete;
  DiskBacklog& operator=(const DiskBacklog&) = delete;

  [[nodiscard]] bool append(const sparkplug::Kept& change) override;
  [[nodiscard]] std::vector<Entry> after(std::uint64_t id, std::size_t most) const override;
  void drop(std::span<const std::uint64_t> ids) override;
  [[nodiscard]] std::size_t size() const override;
  [[nodiscard]] std::uint64_t bytes() const noexcept;

  /// Makes what was appended and dropped since the last call durable. False: the disk refused it, now or in a call
  /// since then; all of that is undone, and `trouble` says why.
  bool settle();
  /// Why the last call failed, for people; empty: it did not. Being full by `most_bytes` is no failure.
  [[nodiscard]] const std::string& trouble() const noexcept;
  [[nodiscard]] std::uint8_t bd_seq() const;
  /// Durable when it returns true.
  bool keep_bd_seq(std::uint8_t next);

 private:
  struct Impl;
  explicit DiskBacklog(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::fleet
