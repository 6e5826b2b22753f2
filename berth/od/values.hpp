/// The values of one device's object dictionary.
///
/// Two sides use it. The *network* side (SDO server, and what acts for it) goes through access rules, limits and
/// hooks and gets abort codes: `size`, `view`, `read`, `check_write`, `write`. The *local* side (the device's own
/// services and application) reads and writes what is stored, whatever the access type: `get`, `set`, `bytes`.
/// No call uses the heap; memory is reserved by the constructor: `Description::value_bytes()` and a few words.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/description.hpp"
#include "berth/od/stream.hpp"

namespace berth::od {

class Values;

/// Looks on when the network reads or writes objects of a range of indices; may supply the value or refuse. Derive,
/// then `Values::attach`. Leaves by itself when destroyed; `Values` may also go first.
class Hook {
 public:
  Hook(const Hook&) = delete;
  Hook& operator=(const Hook&) = delete;

  /// The network reads. `value` is what is stored; to supply another, point it at memory of your own, which must stay
  /// as it is until the next access to the same object. An answer other than `none` refuses the access.
  virtual AbortCode reading(const Values& values, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept;
  /// The network writes `value`, whose length, access and limits are already checked; not stored yet. To change what
  /// is stored, refuse and set it yourself, or change it in `written`. `pending`: the write was taken, its answer comes
  /// later by `co::SdoServer::complete`; nothing is stored and `written` is not called, that is the hook's to do.
  virtual AbortCode writing(const Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  /// A network write has been stored.
  virtual void written(Values& values, ObjectRef ref) noexcept;

 protected:
  Hook() = default;
  ~Hook();

 private:
  friend class Values;
  Values* values_ = nullptr;
};

/// Which part of the dictionary a reset concerns (CiA 301 §7.3.2.2.2): communication 1000h..1FFFh, application all
/// other indices (2000h..9FFFh, and A000h upwards).
enum class Area : std::uint8_t { communication, application, all };
[[nodiscard]] constexpr Area area_of(std::uint16_t index) noexcept {
  return index >= 0x1000 && index <= 0x1FFF ? Area::communication : Area::application;
}

class Values {
 public:
  /// All values at their defaults for `node_id`.
  explicit Values(std::shared_ptr<const Description> description, NodeId node_id = {});
  ~Values();
  Values(const Values&) = delete;
  Values& operator=(const Values&) = delete;

  [[nodiscard]] const Description& description() const noexcept { return *description_; }
  [[nodiscard]] const std::shared_ptr<const Description>& shared_description() const noexcept { return description_; }
  /// The node-ID of the last `reset`.
  [[nodiscard]] NodeId node_id() const noexcept { return node_id_; }
  /// Back to the defaults; `$NODEID` counts as 0 while the node-ID is unconfigured. Hooks are not told.
  void reset(NodeId node_id, Area area = Area::all) noexcept;

  /// @name The network side
  /// Refusals in this order: no_object 0602 0000, no_sub_index 0609 0011, write_only 0601 0001 or read_only
  /// 0601 0002, length 0607 0012/0013, value 0609 0030/31/32/36, then the hooks'. A string or DOMAIN without a
  /// described length that does not fit: out_of_memory 0504 0005. A DOMAIN that was never given a value answers no_data
  /// 0800 0024.
  /// @{
  /// The value to upload, without a copy; valid until the next access to the same object.
  [[nodiscard]] Answer<std::span<const std::uint8_t>> view(ObjectRef ref) const noexcept;
  /// The same of a readable scalar without hooks, which most are, in few instructions. Empty: `view` says.
  [[nodiscard]] std::span<const std::uint8_t> view_plain(ObjectRef ref) const noexcept {
    const Object* const object = description_->find(ref.index);
    if (object == nullptr || hooked(*object)) return {};
    const SubObject* const sub = description_->find(*object, ref.sub);
    if (sub == nullptr || !readable(sub->access) || !sub->fixed) return {};
    return {data_.data() + sub->offset, sub->capacity};
  }
  [[nodiscard]] Answer<std::size_t> size(ObjectRef ref) const noexcept;
  /// Copies the value to `into`; returns its length. `into` too small: out_of_memory 0504 0005.
  [[nodiscard]] Answer<std::size_t> read(ObjectRef ref, std::span<std::uint8_t> into) const noexcept;
  /// Would a write of `length` bytes be let in? What an SDO server asks when a transfer begins, before data is there.
  [[nodiscard]] AbortCode check_write(ObjectRef ref, std::size_t length) const noexcept;
  /// The same when the client did not indicate the size.
  [[nodiscard]] AbortCode check_write(ObjectRef ref) const noexcept;
  /// An expedited download without indicated size (e=1, s=0) brings `available` bytes: how many of them count
  /// (the object's own size; all of them for strings).
  [[nodiscard]] Answer<std::size_t> length_of_unsized(ObjectRef ref, std::size_t available) const noexcept;
  /// `pending`: a hook will answer later (`Hook::writing`).
  [[nodiscard]] AbortCode write(ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  /// Would an upload be let in? Hooks are not asked.
  [[nodiscard]] AbortCode check_read(ObjectRef ref) const noexcept;
  /// What transfers this object piece by piece; null: its value stands here. Ask `check_read` or `check_write`
  /// before. `view` and `size` of such an object are refused with 0601 0000; `read` and `write` go to the stream.
  [[nodiscard]] Stream* stream(ObjectRef ref) const noexcept { return streams_.empty() ? nullptr : find_stream(ref); }
  /// @}

  /// @name The local side
  /// @{
  /// What is stored now; empty when there is no such sub-object or it has no value.
  [[nodiscard]] std::span<const std::uint8_t> bytes(ObjectRef ref) const noexcept;
  [[nodiscard]] std::span<const std::uint8_t> stored(const SubObject& sub) const noexcept;
  /// Where a scalar's bytes stand, for a PDO's copy: the address is stable for the life of this object.
  [[nodiscard]] std::uint8_t* scalar(const SubObject& sub) noexcept { return data_.data() + sub.offset; }
  /// Stores without regard to access type and limits, but never a wrong length.
  AbortCode set_bytes(ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  AbortCode set_text(ObjectRef ref, std::string_view text) noexcept;
  [[nodiscard]] std::string_view get_text(ObjectRef ref) const noexcept;
  /// `get<std::uint32_t>({0x1018, 1})`. Any arithmetic T that can hold every value of the object's type; else
  /// length_mismatch 0607 0010. Integers from integers, float and double from reals.
  template <class T>
  [[nodiscard]] Answer<T> get(ObjectRef ref) const noexcept {
    const auto raw = raw_for(ref, class_of<T>(), sizeof(T) * 8);
    if (!raw) return refuse(raw.error());
    if constexpr (std::is_floating_point_v<T>) {
      return static_cast<T>(std::bit_cast<double>(*raw));
    } else {
      return static_cast<T>(*raw);
    }
  }
  /// The same with what to take when the object is missing or of another kind.
  template <class T>
  [[nodiscard]] T get_or(ObjectRef ref, T otherwise) const noexcept {
    const auto value = get<T>(ref);
    return value ? *value : otherwise;
  }
  /// Stores a number of any arithmetic type; value_too_high / value_too_low when the object's type cannot hold it
  /// (the description's limits are not asked).
  template <class T>
  AbortCode set(ObjectRef ref, T value) noexcept {
    static_assert(std::is_arithmetic_v<T>);
    if constexpr (std::is_floating_point_v<T>) {
      return set_real(ref, static_cast<double>(value));
    } else if constexpr (std::is_signed_v<T>) {
      return set_integer(ref, static_cast<std::uint64_t>(static_cast<std::int64_t>(value)), value < 0);
    } else {
      return set_integer(ref, static_cast<std::uint64_t>(value), false);
    }
  }
  /// @}

  /// Calls `hook` for accesses to `first`..`last`. Several hooks may look at one object; they are asked in the order
  /// in which they were attached, and the first refusal ends it. A hook belongs to one `Values`. Uses the heap.
  void attach(Hook& hook, std::uint16_t first, std::uint16_t last);
  void attach(Hook& hook, std::uint16_t index) { attach(hook, index, index); }
  void detach(Hook& hook) noexcept;
  /// Gives the DOMAIN `ref` to `stream`; false when there is no such DOMAIN. A stream belongs to one `Values` and may
  /// have several objects; an object has one stream, the last. Hooks of the object are not asked. Uses the heap.
  bool attach(Stream& stream, ObjectRef ref);
  void detach(Stream& stream) noexcept;

  /// Bytes this instance holds, without the shared description.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  enum class Class : std::uint8_t { boolean, unsigned_integer, signed_integer, real };
  template <class T>
  static constexpr Class class_of() noexcept {
    static_assert(std::is_arithmetic_v<T>);
    if (std::is_floating_point_v<T>) return Class::real;
    if (std::is_same_v<T, bool>) return Class::boolean;
    return std::is_signed_v<T> ? Class::signed_integer : Class::unsigned_integer;
  }
  struct Binding {
    std::uint16_t first;
    std::uint16_t last;
    Hook* hook;
  };
  struct StreamBinding {
    ObjectRef ref;
    Stream* stream;
  };
  struct Found {
    const Object* object;
    const SubObject* sub;
  };
  [[nodiscard]] Answer<Found> find(ObjectRef ref) const noexcept;
  [[nodiscard]] Stream* find_stream(ObjectRef ref) const noexcept;
  [[nodiscard]] static AbortCode write_whole(Stream& stream, ObjectRef ref,
                                             std::span<const std::uint8_t> value) noexcept;
  [[nodiscard]] static Answer<std::size_t> read_whole(Stream& stream, ObjectRef ref,
                                                      std::span<std::uint8_t> into) noexcept;
  [[nodiscard]] bool hooked(const Object& object) const noexcept {
    if (hooked_.empty()) return false;
    const auto position = static_cast<std::size_t>(&object - description_->objects_.data());
    return ((hooked_[position / 64] >> (position % 64)) & 1U) != 0;
  }
  [[nodiscard]] Answer<std::span<const std::uint8_t>> view_hooked(ObjectRef ref, const SubObject& sub) const noexcept;
  void mark_hooked() noexcept;
  [[nodiscard]] std::size_t slot_of(std::uint32_t index) const noexcept;
  [[nodiscard]] AbortCode check_length(const SubObject& sub, std::size_t length) const noexcept;
  [[nodiscard]] AbortCode check_value(const SubObject& sub, std::span<const std::uint8_t> value) const noexcept;
  void put(const SubObject& sub, std::span<const std::uint8_t> value) noexcept;
  /// The raw of an integer, sign-extended; of a real the bits of a double.
  [[nodiscard]] Answer<std::uint64_t> raw_for(ObjectRef ref, Class wanted, unsigned bits) const noexcept;
  AbortCode set_integer(ObjectRef ref, std::uint64_t raw, bool negative) noexcept;
  AbortCode set_real(ObjectRef ref, double value) noexcept;

  std::shared_ptr<const Description> description_;
  std::vector<std::uint8_t> data_;  ///< as `Description::image_`; variable length: U32 length, then the bytes
  std::vector<Binding> bindings_;
  std::vector<StreamBinding> streams_;
  std::vector<std::uint64_t> hooked_;  ///< one bit per object, so that an object without hooks costs one test
  NodeId node_id_;
};

}  // namespace berth::od
