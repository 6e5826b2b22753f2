// A Berth that can die at any point: its interfaces to the world are counted and cut off.
//
// An `Axe` counts the points of one run of Berth and falls at a chosen one. From then on nothing that Berth does has an
// effect, and nothing reaches Berth; the driver of the world ends the run after the instant.
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

#include "berth/can/port.hpp"
#include "berth/store/database.hpp"
#include "tests/store/crash_vfs.hpp"

namespace berth::harness {

enum class PointKind : std::uint8_t {
  store_before,    // a writing call of the store begins
  store_after,     // it returned, and Berth does not yet know
  send_before,     // a frame is given to the controller
  send_after,      // it was acknowledged on the wire, and Berth does not yet know
  receive_before,  // a frame has come, and Berth does not yet know
  receive_after,   // Berth has handled that frame
  memory_begin,    // a device begins to write its memory
  memory_end,      // it is written, and the device has not reported it yet
  disk,            // a write, truncation, sync or deletion of the store's file
  memory_torn,     // one byte of a device's memory
  lost_by_device,  // a device loses a frame that Berth sent
  lost_by_berth,   // Berth loses a frame
  device_off,      // a device loses power when a frame was sent or has come
  count,
};
inline const char* name(PointKind k) {
  constexpr const char* names[] = {"store write, before",  "store write, after",     "frame sent, before",
                                   "frame sent, after",    "frame received, before", "frame received, after",
                                   "device memory, begin", "device memory, end",     "store file, write or sync",
                                   "device memory, torn",  "frame lost by a device", "frame lost by Berth",
                                   "device without power"};
  return names[static_cast<int>(k)];
}
inline constexpr int point_kinds = static_cast<int>(PointKind::count);

class Axe {
 public:
  // What happens at the chosen point instead of Berth's death.
  enum class Instead : std::uint8_t { nothing, lives, loses_frame };
  // A new run of Berth; the axe falls at its point `k`, from 0, unless `instead` says otherwise.
  void life(std::optional<std::uint64_t> k, std::function<Instead()> instead = {}) {
    trace_.clear();
    at_ = k;
    fallen_ = loses_ = false;
    instead_ = std::move(instead);
  }
  // One point; true if Berth is dead now. Memory points do not kill by themselves.
  bool point(PointKind kind) noexcept {
    if (fallen_) return true;
    if (!hit(kind)) return false;
    const Instead instead = instead_ ? instead_() : Instead::nothing;
    fallen_ = instead == Instead::nothing;
    loses_ = instead == Instead::loses_frame;
    return fallen_;
  }
  // The frame that has just come is lost.
  [[nodiscard]] bool loses() noexcept { return std::exchange(loses_, false); }
  // Counts one point; true if it is the chosen one.
  bool hit(PointKind kind) noexcept {
    trace_.push_back(kind);
    return at_ && trace_.size() == *at_ + 1;
  }
  void fall() noexcept { fallen_ = true; }
  [[nodiscard]] bool fallen() const noexcept { return fallen_; }
  [[nodiscard]] const std::vector<PointKind>& trace() const noexcept { return trace_; }

 private:
  std::vector<PointKind> trace_;
  std::optional<std::uint64_t> at_;
  std::function<Instead()> instead_;
  bool fallen_ = false;
  bool loses_ = false;
};

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

// Berth's port, between it and its controller. Frames that Berth gave to the controller before it died are sent, as by
// a driver, until the controller ends, too.
class MortalPort final : public can::Port, private can::Listener {
 public:
  MortalPort(Axe& axe, can::Port& beneath) : axe_(&axe), beneath_(&beneath) {}

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (axe_->point(PointKind::send_before)) return can::Queued::closed;
    const std::uint32_t own = ++last_;
    const auto queued = beneath_->send(frame, own);
    if (queued == can::Queued::yes) tags_[own] = tag;
    return queued;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    if (axe_->fallen()) return;
    for (auto it = tags_.begin(); it != tags_.end(); ++it) {
      if (it->second != tag) continue;
      beneath_->withdraw(it->first);
      tags_.erase(it);
      return;
    }
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    beneath_->listen(this, accept);
  }
  [[nodiscard]] can::Status status() const noexcept override { return beneath_->status(); }
  bool restart(std::uint32_t bit_rate) noexcept override { return !axe_->fallen() && beneath_->restart(bit_rate); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    if (axe_->point(PointKind::receive_before) || axe_->loses() || listener_ == nullptr) return;
    listener_->received(frame, at);
    axe_->point(PointKind::receive_after);
  }
  void sent(std::uint32_t own, rt::Time at) noexcept override {
    const auto it = tags_.find(own);
    const std::uint32_t tag = it == tags_.end() ? 0 : it->second;
    if (it != tags_.end()) tags_.erase(it);
    if (axe_->point(PointKind::send_after) || listener_ == nullptr) return;
    if (tag != 0) listener_->sent(tag, at);
  }
  void changed(const can::Status& status, rt::Time at) noexcept override {
    if (!axe_->fallen() && listener_ != nullptr) listener_->changed(status, at);
  }
  Axe* axe_;
  can::Port* beneath_;
  can::Listener* listener_ = nullptr;
  std::map<std::uint32_t, std::uint32_t> tags_;
  std::uint32_t last_ = 0;
};

}  // namespace berth::harness
