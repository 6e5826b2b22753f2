/// The values of a device's objects after a reset, and which are kept. The layers are the description's default, a
/// `Preset`, the values stored by 1010h, and the device's identity (1018h, 1008h). 1010h "save" and 1011h "load" are
/// answered when the memory has finished (`ParameterStore`; CiA 301 §7.5.2.13, §7.5.2.14). A write that changes a
/// stored value sets 1020h to 0, because the configuration is no longer the verified one. 1021h uploads the EDS given
/// in the options.
///
/// Refused: another signature, or no memory: 0800 0020; while memory is being written: 0800 0022; a memory that fails:
/// 0606 0000. No heap after construction.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "berth/co/sdo_servers.hpp"
#include "berth/device/host.hpp"
#include "berth/device/lss_slave.hpp"
#include "berth/device/options.hpp"
#include "berth/device/parameter_store.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

/// Start of the stored objects in a device's non-volatile memory; before them are the settings of LSS and the last
/// node-ID of a negotiation.
inline constexpr std::size_t parameters_at = 64;
/// Bytes of memory that are enough for such a device.
[[nodiscard]] inline std::size_t memory_size(const od::Description& description,
                                             GroupOf group_of = default_parameter_group) noexcept {
  return parameters_at + ParameterStore::footprint(description, group_of);
}

class StoredObjects final : private ParameterStore::Owner, private od::Hook {
 public:
  /// `options`: presets, name, EDS and parameter group. `lss`: address and node-ID that the objects show. `memory`:
  /// null = nothing is stored. All must outlive it.
  StoredObjects(od::Values& values, co::SdoServers& sdo, NvMemory* memory, const Options& options, Host& host,
                const LssSlave& lss);
  ~StoredObjects();

  /// Power comes on: finds the stored image.
  void power_on() noexcept;
  /// Call after `LssSlave::power_off`, which stops the memory.
  void power_off() noexcept;
  /// A reset begins: gives up a save, which would contain values from after the reset.
  void resetting() noexcept;
  /// Resets the values of `area`; hooks are not called. Without power the stored values and the node-ID do not apply.
  void reset_values(od::Area area) noexcept;

  /// True while non-volatile memory is being written: 1010h, 1011h, LSS store or a node-ID written as an object.
  [[nodiscard]] bool storing() const noexcept { return lss_->storing() || (parameters_ && parameters_->busy()); }

  /// 1010h was written before: the memory holds an image.
  [[nodiscard]] bool saved_once() const noexcept { return saved_; }

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept {
    return (parameters_ ? sizeof(ParameterStore) + parameters_->memory() : 0) +
           (configuration_ ? sizeof(ConfigurationWatch) : 0);
  }

 private:
  /// Sees every write that changes a stored value.
  class ConfigurationWatch final : public od::Hook {
   public:
    explicit ConfigurationWatch(GroupOf group_of) noexcept : group_of_(group_of) {}

   private:
    od::AbortCode writing(const od::Values& values, ObjectRef ref,
                          std::span<const std::uint8_t> value) noexcept override;
    void written(od::Values& values, ObjectRef ref) noexcept override;
    GroupOf group_of_;
    bool changes_ = false;
  };
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void parameters_written(bool ok) noexcept override;

  od::Values* values_;
  co::SdoServers* sdo_;
  NvMemory* memory_;
  const Options* options_;
  Host* host_;
  const LssSlave* lss_;
  std::unique_ptr<ParameterStore> parameters_;         // only with object 1010h and a memory that has room
  std::unique_ptr<ConfigurationWatch> configuration_;  // only with object 1020h
  bool saved_ = false;                                 // the memory holds an image
  ObjectRef storing_{};                  // the sub-object of 1010h or 1011h whose write is to be confirmed
  std::array<std::uint8_t, 4> shown_{};  // returned by `reading`
};

}  // namespace berth::device
