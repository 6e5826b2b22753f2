/// The numeric hardware version of paper 3 (S3.10): 1009h is a text, which a boot-up cannot compare. The paper uses
/// 1018h:05 for the number and 1F90h for the expected one; but CiA 301 gives 1018h four sub-indices, and 1F90h belongs
/// to the flying master (CiA 302-2). So Berth has both in the manufacturer-specific area, and reads 1018h:05 on
/// request.
#pragma once

#include "berth/co/sdo_access.hpp"
#include "berth/od/description.hpp"
#include "berth/od/paper3.hpp"
#include "berth/od/values.hpp"

namespace berth::multilevel {

inline constexpr ObjectRef hardware_version_object = od::paper3::hardware_version;
inline constexpr ObjectRef literal_hardware_version_object{0x1018, 5};

/// Adds 5F01h of a slave.
void add_hardware_version(od::DescriptionBuilder& builder, std::uint32_t version);
/// Adds 5F02h of a master: sub-index n is the version expected of node n; 0 = any.
void add_expected_hardware(od::DescriptionBuilder& builder, std::uint8_t most = 127);
[[nodiscard]] std::uint32_t expected_hardware(const od::Values& master, NodeId node) noexcept;

/// Call it in your own boot-up before you configure a slave; `network::BootSlave` does it itself. Errors: as
/// `co::SdoTransfer`; Errc::mismatch with the slave's version in `detail`. It asks nothing when any version is
/// accepted.
[[nodiscard]] rt::Task<Result<void>> check_hardware(co::SdoAccess& slave, std::uint32_t expected, bool literal = false);

}  // namespace berth::multilevel
