/// A device's stored parameters (CiA 301 objects 1010h and 1011h; docs/protocols/cia301.md §Stored parameters): an
/// image of values in non-volatile memory that a power loss at any byte leaves old or new, never mixed.
///
/// What is stored: objects that the network may read and write, except process data (rwr or rww, mappable, outside
/// 1000h..1FFFh), DOMAINs, values that may be longer than `usual`, objects that a configuration tool must leave alone
/// (ObjFlags bit 0), and those that are commands, measurements or histories: 1001h..1003h, 1010h, 1011h, 1013h,
/// 1023h..1026h, 1F50h..1F5Fh, 1F82h, 1F83h. A device may say otherwise by a `GroupOf` of its own, of values up to
/// `longest` bytes.
///
/// An image holds what differs from the default, and every value whose default depends on $NODEID: a stored COB-ID
/// stays as it is when the node-ID changes, until 1011h. Each entry carries its type and length; when the dictionary
/// has become another (a new firmware), entries that no longer fit it, or its limits, are passed over.
///
/// Two slots, each half of the memory from `at` on; a save goes to the one that does not hold the valid image, and its
/// header is written last. Little-endian:
///
///     slot   = sequence U32 | length U32 | CRC-32 of the entries | CRC-32 of the twelve bytes before | entries
///     entry  = index U16 | sub U8 | type U8 | length U16 | value         ascending by index and sub-index
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "berth/device/nv_memory.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

/// A value that the device has after every reset instead of the description's default.
struct Preset {
  ObjectRef object;
  std::uint64_t value = 0;
};

/// Sub-indices of 1010h and 1011h.
namespace parameter_group {
inline constexpr std::uint8_t none = 0, all = 1, communication = 2, application = 3, manufacturer = 4;
}
/// The sub-index of 1010h that stores a value besides sub-index 1; `none` (0) = it is never stored.
using GroupOf = std::uint8_t (*)(const od::Description&, const od::Object&, const od::SubObject&) noexcept;
/// The rules above: 1000h..1FFFh communication, 2000h..5FFFh manufacturer (application when 1010h has no sub-index 4),
/// all others application.
[[nodiscard]] std::uint8_t default_parameter_group(const od::Description& description, const od::Object& object,
                                                   const od::SubObject& sub) noexcept;

class ParameterStore final : private NvMemory::Done {
 public:
  class Owner {
   public:
    /// The save or restore that was begun has ended; from a job. `ok` false: the medium refused, or the image has no
    /// room; the old one holds.
    virtual void parameters_written(bool ok) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  static constexpr std::size_t usual = 250;       ///< bytes of a value that is stored unless a `GroupOf` says otherwise
  static constexpr std::size_t longest = 65'535;  ///< bytes of a value
  static constexpr std::size_t header_size = 16;
  static constexpr std::size_t entry_overhead = 6;

  /// Bytes of memory, from `at` on, with which any values of such a device can be stored.
  [[nodiscard]] static std::size_t footprint(const od::Description& description,
                                             GroupOf group = default_parameter_group) noexcept;

  /// Room for the longest value that such a device stores, not under `usual`.
  [[nodiscard]] static std::size_t room_for(const od::Description& description,
                                            GroupOf group = default_parameter_group) noexcept;

  /// In `memory` from `at` to its end. `presets` count as defaults. All must outlive it. Reads nothing yet. `room`: of
  /// `room_for`; values that may be longer are not stored. Uses the heap here and nowhere else.
  ParameterStore(NvMemory& memory, std::size_t at, std::span<const Preset> presets, Owner& owner,
                 GroupOf group = default_parameter_group, std::size_t room = usual);

  /// False when the memory has no room for two slots of any use.
  [[nodiscard]] bool usable() const noexcept { return slot_size_ > 2 * header_size; }
  /// Power-on: finds the newer whole image; false when there is none. Reads it whole, for its CRC.
  bool load() noexcept;
  /// Lays the stored values of `area` over `values`, which hold the defaults. Hooks are not told.
  void apply(od::Values& values, od::Area area) const noexcept;
  [[nodiscard]] std::uint8_t group_of(const od::Description& description, ObjectRef ref) const noexcept;

  /// Begins to store the present values of a group; those of the other groups stay as stored. `values` must stay until
  /// the owner is told. Each value is taken at one instant, not all at the same one. False: busy, not usable, or the
  /// memory refuses at once.
  bool save(const od::Values& values, std::uint8_t group) noexcept { return begin(values, group, true); }
  /// Begins to forget the stored values of a group: the defaults hold from the next reset on.
  bool restore(const od::Values& values, std::uint8_t group) noexcept { return begin(values, group, false); }
  [[nodiscard]] bool busy() const noexcept { return values_ != nullptr || ending_; }
  /// A reset came: what was begun ends without a word, the old image holds; `busy` until the write under way is over.
  void abandon() noexcept;
  /// Power loss: nothing is under way any more (the memory was told to forget); call `load` before the next use.
  void forget() noexcept;

  /// Bytes beyond itself.
  [[nodiscard]] std::size_t memory() const noexcept { return chunk_.capacity() + value_.capacity(); }
  /// Bytes of entries in the valid image.
  [[nodiscard]] std::size_t stored_bytes() const noexcept { return image_.length; }

 private:
  /// The valid one.
  struct Image {
    std::uint32_t sequence = 0;
    std::uint32_t length = 0;  ///< bytes of entries
    unsigned slot = 1;
    bool loaded = false;
  };
  struct Entry {
    ObjectRef ref;
    od::DataType type = od::DataType::none;
    std::uint16_t length = 0;
  };
  /// Walks over the entries of the valid image.
  class Walk {
   public:
    explicit Walk(const ParameterStore& store) noexcept;
    [[nodiscard]] bool at_end() const noexcept { return ended_; }
    [[nodiscard]] const Entry& entry() const noexcept { return entry_; }
    void read_value(std::span<std::uint8_t> into) const noexcept;
    void next() noexcept;

   private:
    void take() noexcept;
    const ParameterStore* store_;
    std::size_t at_ = 0;
    Entry entry_;
    bool ended_ = false;
  };
  bool begin(const od::Values& values, std::uint8_t group, bool saves) noexcept;
  bool write_next() noexcept;
  bool write_header() noexcept;
  [[nodiscard]] std::size_t fill() noexcept;
  [[nodiscard]] bool put(const od::Object& object, const od::SubObject& sub, std::size_t& used) noexcept;
  [[nodiscard]] bool at_default(ObjectRef ref, const od::SubObject& sub) const noexcept;
  void end(bool ok) noexcept;
  void written(bool ok) noexcept override;
  [[nodiscard]] bool read_slot(unsigned slot, std::uint32_t& sequence, std::uint32_t& length) const noexcept;
  [[nodiscard]] std::size_t slot_at(unsigned slot) const noexcept { return at_ + slot * slot_size_; }
  [[nodiscard]] static bool fits(const Entry& entry, const od::SubObject& sub) noexcept;
  [[nodiscard]] std::size_t room() const noexcept { return chunk_.size() - entry_overhead; }

  NvMemory* memory_;
  std::size_t at_;
  std::size_t slot_size_;
  std::span<const Preset> presets_;
  Owner* owner_;
  GroupOf group_of_;
  Image image_;
  // The one that is being written
  const od::Values* values_ = nullptr;
  Walk old_;
  std::size_t object_ = 0;
  std::size_t sub_ = 0;
  std::uint32_t put_ = 0;  // bytes of entries so far
  std::uint32_t crc_ = 0;
  std::uint8_t group_ = 0;
  bool saves_ = false;
  bool header_ = false;                      // the header is being written
  bool ending_ = false;                      // abandoned, and the memory still writes
  std::vector<std::uint8_t> chunk_;          // whole entries: what the memory is given in one piece
  mutable std::vector<std::uint8_t> value_;  // what `apply` reads, where values may be longer than `usual`
};

}  // namespace berth::device
