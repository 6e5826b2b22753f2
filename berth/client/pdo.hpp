/// PDOs of a remote node (CiA 301 §7.2.2): values by the names of its objects. Named from the device's view, as in CiA
/// 301: the node sends a `Tpdo` and the application receives it; the application sends an `Rpdo`.
///
/// Made by `RemoteNode::subscribe` and `RemoteNode::open`. They may outlive their node, but are dead then: `next` and
/// `send` end with Errc::cancelled.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/client/failure.hpp"
#include "berth/client/inbox.hpp"
#include "berth/client/names.hpp"
#include "berth/client/value.hpp"
#include "berth/co/cob_id.hpp"
#include "berth/co/pdo_mapping.hpp"

namespace berth::client {

class RemoteNode;

/// "it is UNSIGNED32, which cannot be read as std::uint16_t; use std::uint32_t"; `verb`: "read as", "written from".
[[nodiscard]] Failure wrong_type(const Names& names, NodeId node, ObjectRef ref, od::DataType type, CppType cpp,
                                 const char* verb);

/// The places of objects in a PDO. Immutable; shared with the samples, so that these outlive the node.
struct PdoLayout {
  struct Field {
    ObjectRef object;
    od::DataType type = od::DataType::none;  ///< as described; none: bits of an undescribed object
    unsigned at = 0;                         ///< first bit
    unsigned bits = 0;
  };
  std::shared_ptr<const Names> names;
  NodeId node;
  std::vector<Field> fields;  ///< without dummies
  unsigned bits = 0;
  [[nodiscard]] std::size_t size() const noexcept { return (bits + 7) / 8; }
  [[nodiscard]] Outcome<const Field*> find(Selector selector) const;
};

/// One received PDO.
struct PdoSample {
  std::shared_ptr<const PdoLayout> layout;
  rt::Time at{};  ///< end of the frame
  std::array<std::uint8_t, 8> data{};

  /// The value of a mapped object. Errc::not_found when it is not mapped; types as for `RemoteNode::read`.
  template <class T>
  [[nodiscard]] Outcome<T> get(Selector selector) const {
    const auto field = layout->find(selector);
    if (!field) return tl::unexpected(field.error());
    const CppType wanted = cpp_type<T>();
    if (!readable_as(type_of(**field), wanted)) return tl::unexpected(wrong_type(**field, wanted));
    T value{};
    const Bytes bytes = bytes_of(**field);
    const Complaint complaint = from_bytes(type_of(**field), bytes, value);
    if (complaint.what != nullptr) return tl::unexpected(refused(**field, complaint));
    return value;
  }

 private:
  [[nodiscard]] static od::DataType type_of(const PdoLayout::Field& field) noexcept;
  [[nodiscard]] Bytes bytes_of(const PdoLayout::Field& field) const;
  [[nodiscard]] Failure wrong_type(const PdoLayout::Field& field, CppType wanted) const;
  [[nodiscard]] Failure refused(const PdoLayout::Field& field, Complaint complaint) const;
};

/// A PDO that the node sends.
class Tpdo final : private can::Handler {
 public:
  ~Tpdo() = default;
  static constexpr std::size_t kept = 64;  ///< samples that wait for `next`

  /// Calls `call` for each PDO, from the executor; replaces the previous one, empty ends it. It may do anything, even
  /// destroy the node.
  void on_pdo(std::function<void(const PdoSample&)> call);
  /// `const auto sample = co_await pdo.next(deadline);` gives `Result<PdoSample>`: the oldest not yet taken.
  [[nodiscard]] Inbox<PdoSample>::Next next(rt::Time deadline) noexcept { return inbox_.next(deadline); }
  /// Forgets the waiting samples.
  void clear() noexcept { inbox_.clear(); }
  [[nodiscard]] const std::optional<PdoSample>& newest() const noexcept { return newest_; }

  [[nodiscard]] unsigned number() const noexcept { return number_; }
  [[nodiscard]] co::CobId cob_id() const noexcept { return cob_id_; }
  [[nodiscard]] const PdoLayout& layout() const noexcept { return *layout_; }
  [[nodiscard]] std::uint64_t received() const noexcept { return count_; }
  /// Frames shorter than the mapping, which are not decoded. Surplus bytes of longer frames are ignored.
  [[nodiscard]] std::uint64_t too_short() const noexcept { return too_short_; }
  /// Samples lost because `next` did not take them.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return inbox_.dropped(); }

 private:
  friend class NodePdos;
  Tpdo(RemoteNode& node, unsigned number, co::CobId cob_id, std::shared_ptr<const PdoLayout> layout);
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void end() noexcept;

  RemoteNode* node_;  // null: destroyed
  unsigned number_;
  co::CobId cob_id_;
  std::shared_ptr<const PdoLayout> layout_;
  std::shared_ptr<const std::function<void(const PdoSample&)>> call_;
  Inbox<PdoSample> inbox_{kept};
  std::optional<PdoSample> newest_;
  std::uint64_t count_ = 0;
  std::uint64_t too_short_ = 0;
};

/// A PDO that the node receives. Its initial values are the description's defaults.
class Rpdo final {
 public:
  /// Sets a mapped object's value; nothing is sent. Type, range and limits as for `RemoteNode::write`.
  Outcome<void> set(Selector selector, Input value);
  /// Queues the PDO with the current values. Errc::bus: the port refuses it.
  Outcome<void> send();

  [[nodiscard]] unsigned number() const noexcept { return number_; }
  [[nodiscard]] co::CobId cob_id() const noexcept { return cob_id_; }
  [[nodiscard]] const PdoLayout& layout() const noexcept { return *layout_; }

 private:
  friend class NodePdos;
  Rpdo(RemoteNode& node, unsigned number, co::CobId cob_id, std::shared_ptr<const PdoLayout> layout);
  void put(const PdoLayout::Field& field, std::span<const std::uint8_t> bytes) noexcept;

  RemoteNode* node_;  // null: destroyed
  unsigned number_;
  co::CobId cob_id_;
  std::shared_ptr<const PdoLayout> layout_;
  std::array<std::uint8_t, 8> data_{};
};

}  // namespace berth::client
