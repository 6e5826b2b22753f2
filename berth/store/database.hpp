/// The slot table in a file: SQLite behind `places::SlotStore`.
///
/// **Guarantees.** Every writing call is one transaction, synced to the disk before it returns (write-ahead log,
/// `synchronous = FULL`). A crash at any instant, even if all unsynced writes are lost and the last one is torn, leaves
/// the state before or after the call. One process owns a store at a time. A file that is damaged, not Berth's, or of a
/// newer Berth is refused with a message and not changed by one byte.
///
/// A foreign store can do no harm: its whole schema is compared with Berth's before anything of it is run (so it has no
/// trigger, view, CHECK or default of its own), and it is opened in SQLite's defensive mode.
///
/// User input also exists outside the file; the file holds what Berth learnt. While a store is open, or after a crash,
/// `<file>-wal` belongs to it: move both or neither. `<file>.lock` holds the owner's process id and is removed when the
/// store is closed; after a crash it remains and blocks nobody.
///
/// One thread. SQLite's errors are returned as `Errc::io` with SQLite's extended code in `Error::detail`; the failed
/// call has changed nothing, and the store can still be used.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/places/slot_store.hpp"

namespace berth::store {

/// The schema that this Berth writes. Opening a store converts an older one to it, in one transaction.
inline constexpr int schema_version = 8;

/// A device ever named in the store, by its identity alone: twins on several buses count as one.
struct DeviceSeen {
  Identity device;
  std::int64_t first_ms = 0;  ///< `HistoryEntry::stamp_ms` of the first line about it
  std::int64_t last_ms = 0;   ///< and of the last
  std::int64_t lines = 0;     ///< how many there are
  friend bool operator==(const DeviceSeen&, const DeviceSeen&) = default;
};

/// Why a store could not be opened: for programs and for users.
struct OpenError {
  Error error;          ///< `exhausted` owned by another process; `invalid` damaged, foreign or newer; `io` the rest
  std::string message;  ///< with the file's name, and the owner's process id
};

struct OpenOptions {
  /// False: nothing is synced, for stores about simulated buses, whose devices also forget at a power failure. Killing
  /// the process still loses nothing; a power failure may lose or damage the store.
  bool sync = true;
  std::string vfs{};  ///< name of a SQLite VFS; empty = the system's
  /// Asked every few milliseconds while SQLite works: true ends the call (`io`), which has then changed nothing. For
  /// signals and deadlines.
  std::function<bool()> ended{};
  bool lock = true;  ///< false only if no other process can reach the file (tests with their own VFS)
};

class Database final : public places::SlotStore {
 public:
  using Opened = tl::expected<std::unique_ptr<Database>, OpenError>;

  /// Opens the store at `path`, or makes it. The folder must exist.
  [[nodiscard]] static Opened open(const std::string& path, const OpenOptions& options = {});
  ~Database() override;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  Result<places::SlotId> declare(const places::SlotName& name) override;
  /// Finds or makes all of them in one transaction (one sync instead of one each); ids in the same order.
  Result<std::vector<places::SlotId>> declare_all(const std::vector<places::SlotName>& names);
  Result<std::vector<places::SlotRecord>> load(std::string_view machine) override;
  Result<places::SlotRecord> load(places::SlotId slot) override;
  Result<void> ask(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override;
  Result<void> confirm(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override;
  Result<void> clear(places::SlotId slot, std::string_view reason) override;
  Result<void> configure(places::SlotId slot, const places::Configured& configured, std::string_view reason) override;
  Result<void> ask_blank(const places::UnfinishedBlank& blank, std::string_view reason) override;
  Result<void> confirm_blank(const places::BusDevice& who, std::string_view reason) override;
  Result<void> drop_blank(const places::BusDevice& who, std::string_view reason) override;
  Result<std::vector<places::UnfinishedBlank>> unfinished_blanks() override;
  Result<void> mark(places::Mark mark, const places::BusDevice& who, NodeId id, std::string_view reason) override;
  Result<void> unmark(places::Mark mark, const places::BusDevice& who, std::string_view reason) override;
  Result<std::vector<places::Marked>> marked(places::Mark mark) override;
  Result<bool> is_marked(places::Mark mark, const places::BusDevice& who) override;
  Result<void> lend(const places::LentId& lent) override;
  Result<void> give_back(const places::BusDevice& who) override;
  Result<std::vector<places::LentId>> lent() override;
  Result<void> note(const places::HistoryEntry& entry) override;
  Result<std::vector<places::HistoryEntry>> history(std::optional<places::SlotId> slot) override;
  Result<std::vector<places::HistoryEntry>> history_of(const places::BusDevice& who) override;

  /// All devices ever named, in the order of their identities.
  Result<std::vector<DeviceSeen>> devices();

  struct Impl;

 private:
  explicit Database(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Checks the bytes of a store that is not in a file yet: reports, under `name`, what `Database::open` would refuse.
/// Writes nothing. `options`: `ended` only.
[[nodiscard]] tl::expected<void, OpenError> look(std::string bytes, const std::string& name,
                                                 const OpenOptions& options = {});

}  // namespace berth::store
