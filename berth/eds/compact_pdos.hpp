/// [DeviceInfo] CompactPDO: PDOs without sections exist, with these sub-indices of the communication record. Internal
/// to room `eds`.
#pragma once

#include <cstdint>

#include "berth/eds/keys.hpp"
#include "berth/od/pdo_objects.hpp"

namespace berth::eds {

class CompactPdos {
 public:
  /// `dcf`: switches off the PDOs that it does not describe.
  CompactPdos(const DeviceInfo& device, bool dcf, od::DescriptionBuilder& builder, ReadBudget& budget,
              DcfValues& values) noexcept
      : device_(device), dcf_(dcf), builder_(builder), budget_(budget), values_(values) {}
  void add_all();

 private:
  void add(od::PdoKind kind, unsigned number);
  void add_sub(std::uint16_t index, const od::SubSpec& spec);

  const DeviceInfo& device_;
  bool dcf_;
  od::DescriptionBuilder& builder_;
  ReadBudget& budget_;
  DcfValues& values_;
};

}  // namespace berth::eds
