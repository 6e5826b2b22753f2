/// A device's non-volatile memory: bytes that outlive power, and records in them. A power loss during a write leaves a
/// record old or new, never mixed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "berth/rt/executor.hpp"

namespace berth::device {

/// Bytes that outlive power. A write takes time and ends with a call. If power goes meanwhile, any number of its bytes
/// is written, in order, the last of them perhaps wrong. Blank memory reads FFh.
class NvMemory {
 public:
  /// Called from a job when the write that it was passed to has ended; `ok` false: the medium refused.
  class Done {
   public:
    virtual void written(bool ok) noexcept = 0;

   protected:
    ~Done() = default;
  };

  virtual ~NvMemory() = default;
  [[nodiscard]] virtual std::size_t size() const noexcept = 0;
  /// Works at any time, also during a write. Bytes beyond the end read FFh.
  virtual void read(std::size_t at, std::span<std::uint8_t> into) const noexcept = 0;
  /// Begins a write. False, and nothing is written, if another is under way or the place is out of range. `bytes` and
  /// `done` must stay until `written` or `forget` was called.
  virtual bool write(std::size_t at, std::span<const std::uint8_t> bytes, Done& done) noexcept = 0;
  /// Begins to blank so many bytes, like `write`. False: as there, or the medium cannot.
  virtual bool erase(std::size_t at, std::size_t count, Done& done) noexcept {
    static_cast<void>(at);
    static_cast<void>(count);
    static_cast<void>(done);
    return false;
  }
  /// The device lost power or is reset: the write under way stops where it is, and its `Done` is not called.
  virtual void forget() noexcept = 0;
};

/// One record of a fixed length in two slots, each with a sequence number and a CRC-32. A write goes to the slot
/// without the valid record.
///
///     slot = sequence U32 | length U8 | payload | CRC-32 over all before, little-endian
class NvRecord final : private NvMemory::Done {
 public:
  static constexpr std::size_t most = 16;  ///< longest payload in bytes
  /// Bytes of memory that a record takes.
  [[nodiscard]] static constexpr std::size_t footprint(std::size_t payload) noexcept { return 2 * (payload + 9); }

  /// `payload` (1..`most`) bytes, in `memory` from `at` on. Reads nothing yet.
  NvRecord(NvMemory& memory, std::size_t at, std::size_t payload) noexcept
      : memory_(&memory), at_(at), payload_(static_cast<std::uint8_t>(payload <= most ? payload : most)) {}

  /// Finds the newer valid slot; false when there is none (blank or never written whole).
  bool load(std::span<std::uint8_t> into) noexcept;
  /// Begins to write. `done` is called as by `NvMemory::write`. False: busy, or the memory refuses.
  bool save(std::span<const std::uint8_t> payload, NvMemory::Done& done) noexcept;
  /// Power loss or reset: the write under way stays unfinished; call `load` before the next use.
  void forget() noexcept;
  [[nodiscard]] bool busy() const noexcept { return done_ != nullptr; }

 private:
  [[nodiscard]] std::size_t slot_size() const noexcept { return payload_ + 9; }
  bool read_slot(unsigned slot, std::span<std::uint8_t> into, std::uint32_t& sequence) const noexcept;
  void written(bool ok) noexcept override;

  NvMemory* memory_;
  std::size_t at_;
  NvMemory::Done* done_ = nullptr;
  std::uint32_t sequence_ = 0;  // of the valid record
  std::uint8_t payload_;
  std::uint8_t slot_ = 1;  // slot of the valid record; the next write goes to the other one
  std::array<std::uint8_t, most + 9> buffer_{};
};

/// How long a flash memory needs, besides the time of each write.
struct FlashTimes {
  rt::Duration byte{};    ///< for each byte written
  rt::Duration sector{};  ///< for each sector erased
  std::size_t sector_size = 4'096;
};

/// Memory of a simulated device. Outlives the device's power, and lives as long as the plant.
class SimFlash final : public NvMemory, private rt::Job {
 public:
  /// For tests and fault plans; called in the middle of a write: only note the event or cut power.
  class Watcher {
   public:
    virtual void write_began() noexcept = 0;
    virtual void write_ended() noexcept = 0;
    /// The cut planned with `cut_after` happened: the device must lose its power at once.
    virtual void cut() noexcept = 0;

   protected:
    ~Watcher() = default;
  };

  /// `duration` is how long any write takes; its bytes are written evenly over that time. Memory never written takes no
  /// space beyond the first bytes.
  SimFlash(rt::Executor& executor, std::size_t size, rt::Duration duration);

  [[nodiscard]] std::size_t size() const noexcept override { return size_; }
  void read(std::size_t at, std::span<std::uint8_t> into) const noexcept override;
  bool write(std::size_t at, std::span<const std::uint8_t> bytes, Done& done) noexcept override;
  bool erase(std::size_t at, std::size_t count, Done& done) noexcept override;
  void forget() noexcept override;

  void set_duration(rt::Duration duration) noexcept { duration_ = duration; }
  void set_times(const FlashTimes& times) noexcept { times_ = times; }
  void watch(Watcher* watcher) noexcept { watcher_ = watcher; }
  /// After `bytes` more bytes, the write stops as at a power loss; the byte where it stopped then holds `torn` (a value
  /// of 0..255) or its old content (-1). The watcher is called.
  void cut_after(std::uint64_t bytes, int torn = -1) noexcept;
  void never_cut() noexcept { cuts_ = false; }
  /// The medium refuses every write (answer to LSS store: 02).
  void broken(bool on) noexcept { broken_ = on; }
  [[nodiscard]] bool writing() const noexcept { return done_ != nullptr; }

  [[nodiscard]] std::uint64_t writes_begun() const noexcept { return begun_; }
  [[nodiscard]] std::uint64_t writes_ended() const noexcept { return ended_; }

  /// Bytes that it takes on the simulating machine.
  [[nodiscard]] std::size_t memory() const noexcept { return bytes_.capacity(); }

  /// The content up to the last byte ever written, to save and restore a plant; the rest is blank.
  [[nodiscard]] std::span<const std::uint8_t> image() const noexcept { return bytes_; }
  /// Takes as much as fits; the rest is blank.
  void restore(std::span<const std::uint8_t> image) noexcept;
  void erase() noexcept { erase(size_); }
  /// Makes the first so many bytes blank.
  void erase(std::size_t count) noexcept;

 private:
  void run() noexcept override;
  bool begin(std::size_t at, std::size_t count, rt::Duration takes, Done& done) noexcept;
  void put(std::size_t count) noexcept;

  static constexpr std::size_t at_once = 64;  // enough for the record of LSS

  rt::Executor* executor_;
  rt::Duration duration_;
  Watcher* watcher_ = nullptr;
  std::size_t size_;
  std::vector<std::uint8_t> bytes_;  // grows with writes; beyond its end the memory is blank
  Done* done_ = nullptr;
  std::span<const std::uint8_t> source_;  // empty: erasing
  FlashTimes times_;
  rt::Duration takes_{};
  std::size_t count_ = 0;  // bytes of the write or erasure under way
  std::size_t at_ = 0;
  std::size_t put_ = 0;  // how many of them are done
  rt::Time began_{};
  std::uint64_t begun_ = 0;
  std::uint64_t ended_ = 0;
  std::uint64_t left_ = 0;  // bytes until the planned cut
  int torn_ = -1;
  bool cuts_ = false;
  bool broken_ = false;
};

}  // namespace berth::device
