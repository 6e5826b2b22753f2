/// A node-ID that is an object: devices without LSS often get theirs so (paper 4; S4.2). The object is written, kept in
/// non-volatile memory (with a signature in another object if the maker wants one), and in use after a reset. The write
/// that stores it is answered when it is in memory.
///
/// Refused:
/// - not a node-ID of 1 to 127, or bytes after it that are not 0: 0609 0030
/// - another signature, or one without a node-ID before it: 0800 0020
/// - while memory is being written: 0800 0022
/// - a memory that fails: 0606 0000
#pragma once

#include "berth/co/sdo_servers.hpp"
#include "berth/device/lss_slave.hpp"
#include "berth/device/options.hpp"
#include "berth/device/stored_objects.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

class NodeIdObject final : private od::Hook, private NvMemory::Done {
 public:
  /// `options` must have a `node_id_object`. All must outlive it.
  NodeIdObject(od::Values& values, co::SdoServers& sdo, const Options& options, LssSlave& lss,
               const StoredObjects& stored);

  /// Sets the object's value to the active node-ID.
  void show() noexcept;

 private:
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values&, ObjectRef) noexcept override {}
  void written(bool ok) noexcept override;
  [[nodiscard]] od::AbortCode sign(ObjectRef ref, std::span<const std::uint8_t> value) noexcept;
  [[nodiscard]] od::AbortCode keep(ObjectRef ref, NodeId id) noexcept;

  od::Values* values_;
  co::SdoServers* sdo_;
  const Options* options_;
  LssSlave* lss_;
  const StoredObjects* stored_;
  ObjectRef awaited_{};  // the pending write: of the node-ID's object or of its signature's
};

}  // namespace berth::device
