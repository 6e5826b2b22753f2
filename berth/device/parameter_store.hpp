/// A device's stored parameters (CiA 301 objects 1010h and 1011h; docs/protocols/cia301.md §Stored parameters): an
/// image of values in non-volatile memory. A power loss at any byte leaves it old or new, never mixed.
///
/// Stored are objects that the network may read and write, except:
/// - process data (rwr or rww, mappable, outside 1000h..1FFFh)
/// - DOMAINs, and values that may be longer than `usual`
/// - objects that a configuration tool must leave alone (ObjFlags bit 0)
/// - commands, measurements and histories: 1001h..1003h, 1010h, 1011h, 1013h, 1023h..1026h, 1F50h..1F5Fh, 1F82h, 1F83h
///
/// A device may choose differently by its own `GroupOf`, for values up to `longest` bytes.
///
/// An image holds values that differ from the default, and every value whose default depends on $NODEID: a stored
/// COB-ID stays the same when the node-ID changes, until 1011h. Each entry carries its type and length; if the
/// dictionary changed (a new firmware), entries that no longer fit it, or its limits, are skipped.
///
/// Two slots, each half of the memory from `at` on; a save goes to the slot without the valid image, and writes its
/// header last. Little-endian:
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

/// A value that the device has after every reset, in place of the description's default.
struct Preset {
  ObjectRef object;
  std::uint64_t value = 0;
};

/// Sub-indices of 1010h and 1011h.
namespace parameter_group {
inline constexpr std::uint8_t none = 0, all = 1, communication = 2, application = 3, manufacturer = 4;
}
/// The sub-index of 1010h that stores a value, besides sub-index 1; `none` (0) = it is never stored.
using GroupOf = std::uint8_t (*)(const od::Description&, const od::Object&, const od::SubObject&) noexcept;
/// The rules above: 1000h..1FFFh communication, 2000h..5FFFh manufacturer (application when 1010h has no sub-index 4),
/// all others application.
[[nodiscard]] std::uint8_t default_parameter_group(const od::Description& description, const od::Object& object,
                                                   const od::SubObject& sub) noexcept;

class ParameterStore final : private NvMemory::Done {
 public:
  class Owner {
   public:
    /// The save or restore has ended; called from a job. `ok` false: the medium refused, or the image has no room; the
    /// old image stays valid.
    virtual void parameters_written(bool ok) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  static constexpr std::size_t usual = 250;       ///< longest value in bytes that is stored by default
  static constexpr std::size_t longest = 65'535;  ///< bytes of a value
  static constexpr std::size_t header_size = 16;
  static constexpr std::size_t entry_overhead = 6;

  /// Bytes of memory, from `at` on, that are enough for all values of such a device.
  [[nodiscard]] static std::size_t footprint(const od::Description& description,
                                             GroupOf group = default_parameter_group) noexcept;

  /// Bytes of the longest value that such a device stores, at least `usual`.
  [[nodiscard]] static std::size_t room_for(const od::Description& description,
                                            GroupOf group = default_parameter_group) noexcept;

  /// In `memory` from `at` to its end. `presets` count as defaults. All must outlive it. Reads nothing yet. `room`:
  /// from `room_for`; values that may be longer are not stored. Only the constructor uses the heap.
  ParameterStore(NvMemory& memory, std::size_t at, std::span<const Preset> presets, Owner& owner,
                 GroupOf group = default_parameter_group, std::size_t room = usual);

  /// False when the memory is too small for two usable slots.
  [[nodiscard]] bool usable() const noexcept { return slot_size_ > 2 * header_size; }
  /// Power-on: finds the newer complete image; false when there is none. Reads it completely, for its CRC.
  bool load() noexcept;
  /// Writes the stored values of `area` over `values`, which hold the defaults. Hooks are not called.
  void apply(od::Values& values, od::Area area) const noexcept;
  [[nodiscard]] std::uint8_t group_of(const od::Description& description, ObjectRef ref) const noexcept;

  /// Begins to store the present values of a group; the other groups stay as stored. `values` must stay until the owner
  /// is called. Each value is read at one instant, but not all at the same one. False: busy, not usable, or the memory
  /// refuses at once.
  bool save(const od::Values& values, std::uint8_t group) noexcept { return begin(values, group, true); }
  /// Begins to forget the stored values of a group: the defaults apply from the next reset on.
  bool restore(const od::Values& values, std::uint8_t group) noexcept { return begin(values, group, false); }
  [[nodiscard]] bool busy() const noexcept { return values_ != nullptr || ending_; }
  /// A reset came: a save or restore under way ends without a call, and the old image stays valid; `busy` until the
  /// write under way is over.
  void abandon() noexcept;
  /// Power loss: nothing is under way any more (the memory was told to forget); call `load` before the next use.
  void forget() noexcept;

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept { return chunk_.capacity() + value_.capacity(); }
  /// Bytes of entries in the valid image.
  [[nodiscard]] std::size_t stored_bytes() const noexcept { return image_.length; }

 private:
  /// The valid image.
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
  /// Iterates over the entries of the valid image.
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
  // The image that is being written
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
  std::vector<std::uint8_t> chunk_;          // whole entries, given to the memory in one piece
  mutable std::vector<std::uint8_t> value_;  // read buffer of `apply`, if values may be longer than `usual`
};

}  // namespace berth::device
