// The store of a Berth that can die at any point (berth/harness/axe.hpp).
#pragma once

#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/harness/axe.hpp"
#include "berth/store/database.hpp"
#include "tests/store/crash_vfs.hpp"

namespace berth::harness {

// A disk with an empty store on it, closed. Making its tables costs more than the short life that would follow.
inline const store::CrashVfs::Moment& disk_with_store() {
  static const auto made = [] {
    store::CrashVfs disk("kill-made");
    if (!store::Database::open("berth.db", {.vfs = disk.name(), .lock = false})) std::abort();
    return store::CrashVfs::Moment{disk.files()};
  }();
  return made;
}

// The real store on a disk that keeps only what was synced. A dead Berth writes nothing.
class MortalStore final : public places::SlotStore {
 public:
  MortalStore(Axe& axe, store::CrashVfs& disk) : axe_(&axe), disk_(&disk) {}

  // Empty: it is open.
  std::string open() {
    auto opened = store::Database::open("berth.db", {.vfs = disk_->name(), .lock = false});
    if (disk_->crashed()) axe_->fall();
    if (!opened) return opened.error().message;
    database_ = std::move(*opened);
    database_->set_clock(clock());
    return {};
  }
  // Ends the process: nothing more is written, not even what closing would write.
  void die() {
    if (!disk_->crashed()) disk_->crash_at(0);
    database_.reset();
  }
  void close() { database_.reset(); }

  Result<places::SlotId> declare(const places::SlotName& name) override {
    return write([&] { return database_->declare(name); });
  }
  Result<std::vector<places::SlotRecord>> load(std::string_view machine) override {
    return read([&] { return database_->load(machine); });
  }
  Result<places::SlotRecord> load(places::SlotId slot) override {
    return read([&] { return database_->load(slot); });
  }
  Result<void> ask(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override {
    return write([&] { return database_->ask(slot, seat, reason); });
  }
  Result<void> confirm(places::SlotId slot, const places::Assignment& seat, std::string_view reason) override {
    return write([&] { return database_->confirm(slot, seat, reason); });
  }
  Result<void> clear(places::SlotId slot, std::string_view reason) override {
    return write([&] { return database_->clear(slot, reason); });
  }
  Result<void> configure(places::SlotId slot, const places::Configured& configured, std::string_view reason) override {
    return write([&] { return database_->configure(slot, configured, reason); });
  }
  Result<void> ask_blank(const places::UnfinishedBlank& blank, std::string_view reason) override {
    return write([&] { return database_->ask_blank(blank, reason); });
  }
  Result<void> confirm_blank(const places::BusDevice& who, std::string_view reason) override {
    return write([&] { return database_->confirm_blank(who, reason); });
  }
  Result<void> drop_blank(const places::BusDevice& who, std::string_view reason) override {
    return write([&] { return database_->drop_blank(who, reason); });
  }
  Result<std::vector<places::UnfinishedBlank>> unfinished_blanks() override {
    return read([&] { return database_->unfinished_blanks(); });
  }
  Result<void> mark(places::Mark mark, const places::BusDevice& who, NodeId id, std::string_view reason) override {
    return write([&] { return database_->mark(mark, who, id, reason); });
  }
  Result<void> unmark(places::Mark mark, const places::BusDevice& who, std::string_view reason) override {
    return write([&] { return database_->unmark(mark, who, reason); });
  }
  Result<std::vector<places::Marked>> marked(places::Mark mark) override {
    return read([&] { return database_->marked(mark); });
  }
  Result<bool> is_marked(places::Mark mark, const places::BusDevice& who) override {
    return read([&] { return database_->is_marked(mark, who); });
  }
  Result<void> lend(const places::LentId& lent) override {
    return write([&] { return database_->lend(lent); });
  }
  Result<void> give_back(const places::BusDevice& who) override {
    return write([&] { return database_->give_back(who); });
  }
  Result<std::vector<places::LentId>> lent() override {
    return read([&] { return database_->lent(); });
  }
  Result<std::vector<places::HistoryEntry>> history_of(const places::BusDevice& who) override {
    return read([&] { return database_->history_of(who); });
  }
  Result<void> note(const places::HistoryEntry& entry) override {
    return write([&] { return database_->note(entry); });
  }
  Result<std::vector<places::HistoryEntry>> history(std::optional<places::SlotId> slot) override {
    return read([&] { return database_->history(slot); });
  }
  void set_clock(const places::StoreClock* clock) noexcept override {
    SlotStore::set_clock(clock);
    if (database_) database_->set_clock(clock);
  }

 private:
  template <class Call>
  auto read(const Call& call) -> decltype(call()) {
    if (axe_->fallen() || !database_) return fail(Errc::io, "Berth is dead");
    return call();
  }
  template <class Call>
  auto write(const Call& call) -> decltype(call()) {
    if (!database_ || axe_->point(PointKind::store_before)) return fail(Errc::io, "Berth is dead");
    auto result = call();
    if (disk_->crashed()) axe_->fall();
    if (axe_->point(PointKind::store_after)) return fail(Errc::io, "Berth is dead");
    return result;
  }
  Axe* axe_;
  store::CrashVfs* disk_;
  std::unique_ptr<store::Database> database_;
};

}  // namespace berth::harness
