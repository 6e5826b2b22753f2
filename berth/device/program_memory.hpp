/// The programs of a device in its flash memory: one or two images of each. A power loss at any byte leaves the old
/// program, the new one or none, never a mixed one.
///
///     slot = head (32 bytes) | content, both from the beginning of a sector
///     head = sequence U32 | length U32 | date U32 | time U32 | CRC-32 of the content | 0 U32, twice | CRC-32 before
///
/// A download goes to a slot without a valid image (of two: the other one), and its head is written last. Clearing
/// erases the older image first. The content's CRC-32 is its identification (1F56h).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "berth/device/nv_memory.hpp"
#include "berth/device/program_image.hpp"

namespace berth::device {

/// How a device stores its programs.
struct ProgramLayout {
  std::uint8_t count = 1;        ///< programs, 1..254
  unsigned images = 2;           ///< of each, 1 or 2
  std::size_t longest = 65'536;  ///< bytes of a program's image
  std::size_t sector = 4'096;    ///< bytes that are erased together
};

class ProgramMemory final : private NvMemory::Done {
 public:
  static constexpr std::size_t head_size = 32;
  static constexpr std::size_t longest_piece = 1'024;  ///< for `put`

  class Owner {
   public:
    /// An action has ended: clearing, making room, a piece, the end; called from a job. False: the medium refused.
    virtual void memory_ready(bool ok) noexcept = 0;

   protected:
    ~Owner() = default;
  };

  /// Bytes of memory for the programs.
  [[nodiscard]] static std::size_t footprint(const ProgramLayout& layout) noexcept;

  /// Content of the first program's first slot if it has this program: for memories that are made with one.
  [[nodiscard]] static std::vector<std::uint8_t> holding(const ProgramHead& head,
                                                         std::span<const std::uint8_t> content);

  ProgramMemory(NvMemory& memory, const ProgramLayout& layout, Owner& owner);

  /// Power-on: forgets unfinished actions and finds the complete images. Reads them all, for their CRCs.
  void load() noexcept;
  /// Power loss, or the firmware restarts: the write under way stops where it is.
  void forget() noexcept;

  struct Program {
    std::uint32_t sequence = 0;
    std::uint32_t length = 0;  ///< bytes of content
    std::uint32_t identification = 0;
    std::uint32_t date = 0;
    std::uint32_t time = 0;
    unsigned slot = 0;
    bool valid = false;
  };
  /// `number` 1..count.
  [[nodiscard]] const Program& program(std::uint8_t number) const noexcept { return programs_[number - 1U]; }
  [[nodiscard]] const ProgramLayout& layout() const noexcept { return layout_; }
  void read(std::uint8_t number, std::size_t at, std::span<std::uint8_t> into) const noexcept;
  [[nodiscard]] bool busy() const noexcept { return work_ != Work::none; }

  /// Begins to blank the program's memory; false: busy.
  [[nodiscard]] bool clear(std::uint8_t number) noexcept;
  enum class Begun : std::uint8_t {
    ready,        ///< pieces may be put
    soon,         ///< when the owner is called
    not_cleared,  ///< the only image is not blank
    busy,
  };
  /// Begins to write a program.
  [[nodiscard]] Begun begin(std::uint8_t number) noexcept;
  enum class Put : std::uint8_t {
    taken,    ///< more may be put at once
    waits,    ///< taken; more when the owner is called
    refused,  ///< by the medium
  };
  /// Copies the next 1 to `longest_piece` bytes; the caller checks that all fit `longest`, and waits.
  [[nodiscard]] Put put(std::span<const std::uint8_t> bytes) noexcept;
  /// All bytes were put and are correct: writes the head after them and calls the owner. `head`: date and time.
  void end(const ProgramHead& head) noexcept;
  /// The bytes put are no program; the slot is no longer blank.
  void abandon() noexcept;

 private:
  enum class Work : std::uint8_t { none, clearing, making_room, writing, ending, head };
  struct Piece {
    std::array<std::uint8_t, longest_piece> bytes{};
    std::size_t size = 0;
  };
  void written(bool ok) noexcept override;
  void finish(bool ok) noexcept;
  bool write_piece() noexcept;
  void write_head() noexcept;
  void clear_next() noexcept;
  void piece_written() noexcept;
  [[nodiscard]] std::size_t slot_size() const noexcept;
  [[nodiscard]] std::size_t slot_at(std::uint8_t number, unsigned slot) const noexcept;
  [[nodiscard]] bool blank(std::uint8_t number, unsigned slot) const noexcept;
  [[nodiscard]] Program read_slot(std::uint8_t number, unsigned slot) const noexcept;
  [[nodiscard]] bool erase(unsigned slot) noexcept;

  NvMemory* memory_;
  ProgramLayout layout_;
  Owner* owner_;
  std::vector<Program> programs_;
  std::array<Piece, 2> pieces_;  // one is written while the other is filled
  ProgramHead ending_;
  Work work_ = Work::none;
  std::uint8_t number_ = 1;
  unsigned slot_ = 0;        // being written or erased
  unsigned erased_ = 0;      // slots that clearing has erased
  std::size_t put_ = 0;      // bytes taken
  std::size_t flashed_ = 0;  // bytes in the memory
  std::uint32_t crc_ = 0;
  unsigned next_piece_ = 0;  // in the memory's hands, or the next to be
  bool writes_ = false;
  bool owner_waits_ = false;
};

}  // namespace berth::device
