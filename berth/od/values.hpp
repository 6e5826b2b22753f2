/// The values of one device's object dictionary.
///
/// Two sides use it. The *network* side (SDO server, and others acting for the network) obeys access rules, limits and
/// hooks and gets abort codes: `size`, `view`, `read`, `check_write`, `write`. The *local* side (the device's own
/// services and application) reads and writes stored values, whatever the access type: `get`, `set`, `bytes`
/// (stored_values.hpp).
/// No call uses the heap; the constructor reserves the memory: `Description::value_bytes()` and a few words.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/channels.hpp"
#include "berth/od/stored_values.hpp"
#include "berth/od/stream.hpp"

namespace berth::od {

class Values;

/// Called when the network reads or writes objects of a range of indices; may supply the value or refuse. Derive, then
/// call `Values::attach`. A destroyed hook detaches itself; `Values` may also be destroyed first.
class Hook {
 public:
  Hook(const Hook&) = delete;
  Hook& operator=(const Hook&) = delete;

  /// The network reads. `value` is the stored value; to supply another, point it at memory of your own, which must not
  /// change until the next access to the same object. An answer other than `none` refuses the access.
  virtual AbortCode reading(const Values& values, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept;
  /// The network writes `value`; its length, access and limits are checked, but it is not stored yet. To store
  /// something else, refuse and set it yourself, or change it in `written`. `pending`: the write was accepted, and
  /// `Channels::answer` answers it later; nothing is stored and `written` is not called, the hook must do that.
  virtual AbortCode writing(const Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  /// A network write has been stored.
  virtual void written(Values& values, ObjectRef ref) noexcept;
  /// The client waiting for the answer to an access of `ref` (`pending`) has given up: it aborted, or it requested
  /// something else, or its server was stopped.
  virtual void abandoned(Values& values, ObjectRef ref) noexcept;

 protected:
  Hook() = default;
  ~Hook();

 private:
  friend class Values;
  Values* values_ = nullptr;
};

/// The stored values with the network's side: access rules, limits, hooks and streams.
class Values final : public StoredValues {
 public:
  /// All values at their defaults for `node_id`.
  explicit Values(std::shared_ptr<const Description> description, NodeId node_id = {});
  ~Values();

  /// @name The network side
  /// Refusals in this order: no_object 0602 0000, no_sub_index 0609 0011, write_only 0601 0001 or read_only 0601 0002,
  /// length 0607 0012/0013, value 0609 0030/31/32/36, then the hooks'. A string or DOMAIN without a described length
  /// that does not fit: out_of_memory 0504 0005. A DOMAIN that was never given a value: no_data 0800 0024.
  /// @{
  /// The value to upload, without a copy; valid until the next access to the same object.
  [[nodiscard]] Answer<std::span<const std::uint8_t>> view(ObjectRef ref) const noexcept;
  /// A fast path for readable scalars without hooks, as most are. Empty: use `view`.
  [[nodiscard]] std::span<const std::uint8_t> view_plain(ObjectRef ref) const noexcept {
    const Object* const object = description().find(ref.index);
    if (object == nullptr || hooked(*object)) return {};
    const SubObject* const sub = description().find(*object, ref.sub);
    if (sub == nullptr || !readable(sub->access) || !sub->fixed) return {};
    return scalar(*sub);
  }
  [[nodiscard]] Answer<std::size_t> size(ObjectRef ref) const noexcept;
  /// Copies the value to `into`; returns its length. `into` too small: out_of_memory 0504 0005.
  [[nodiscard]] Answer<std::size_t> read(ObjectRef ref, std::span<std::uint8_t> into) const noexcept;
  /// Checks a write of `length` bytes: an SDO server calls it when a transfer begins, before it has data.
  [[nodiscard]] AbortCode check_write(ObjectRef ref, std::size_t length) const noexcept;
  /// The same when the client did not indicate the size.
  [[nodiscard]] AbortCode check_write(ObjectRef ref) const noexcept;
  /// Number of valid bytes when an expedited download without indicated size (e=1, s=0) brings `available` bytes: the
  /// object's own size; all of them for strings.
  [[nodiscard]] Answer<std::size_t> length_of_unsized(ObjectRef ref, std::size_t available) const noexcept;
  /// `pending`: a hook will answer later (`Hook::writing`).
  [[nodiscard]] AbortCode write(ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  /// Checks an upload, without calling hooks.
  [[nodiscard]] AbortCode check_read(ObjectRef ref) const noexcept;
  /// The stream that transfers this object piece by piece; null: its value is stored here. Call `check_read` or
  /// `check_write` before. `view` and `size` of such an object are refused with 0601 0000; `read` and `write` go to the
  /// stream.
  [[nodiscard]] Stream* stream(ObjectRef ref) const noexcept { return streams_.empty() ? nullptr : find_stream(ref); }
  /// No client waits any more for the answer that was `pending`: informs the hooks of `ref`.
  void abandon(ObjectRef ref) noexcept;
  /// The SDO channels that access this dictionary.
  [[nodiscard]] Channels& channels() noexcept { return channels_; }
  /// @}

  /// Calls `hook` for accesses to `first`..`last`. Several hooks may watch one object; they are called in the order in
  /// which they were attached, until the first refusal. A hook belongs to one `Values`. Uses the heap.
  void attach(Hook& hook, std::uint16_t first, std::uint16_t last);
  void attach(Hook& hook, std::uint16_t index) { attach(hook, index, index); }
  void detach(Hook& hook) noexcept;
  /// Connects the DOMAIN `ref` to `stream`; false when there is no such DOMAIN. A stream belongs to one `Values` and
  /// may have several objects; an object has one stream, the last. Hooks of the object are not called. Uses the heap.
  bool attach(Stream& stream, ObjectRef ref);
  void detach(Stream& stream) noexcept;

  /// Bytes held by this instance, without the shared description.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  struct Binding {
    std::uint16_t first;
    std::uint16_t last;
    Hook* hook;
  };
  struct StreamBinding {
    ObjectRef ref;
    Stream* stream;
  };
  [[nodiscard]] Stream* find_stream(ObjectRef ref) const noexcept;
  [[nodiscard]] static AbortCode write_whole(Stream& stream, ObjectRef ref,
                                             std::span<const std::uint8_t> value) noexcept;
  [[nodiscard]] static Answer<std::size_t> read_whole(Stream& stream, ObjectRef ref,
                                                      std::span<std::uint8_t> into) noexcept;
  [[nodiscard]] bool hooked(const Object& object) const noexcept {
    if (hooked_.empty()) return false;
    const auto position = static_cast<std::size_t>(&object - description().objects().data());
    return ((hooked_[position / 64] >> (position % 64)) & 1U) != 0;
  }
  [[nodiscard]] Answer<std::span<const std::uint8_t>> view_hooked(ObjectRef ref, const SubObject& sub) const noexcept;
  void mark_hooked() noexcept;
  [[nodiscard]] AbortCode check_value(const SubObject& sub, std::span<const std::uint8_t> value) const noexcept;

  std::vector<Binding> bindings_;
  std::vector<StreamBinding> streams_;
  std::vector<std::uint64_t> hooked_;  ///< one bit per object, so that an object without hooks costs one test
  Channels channels_;
};

}  // namespace berth::od
