/// The numeric hardware version of paper 3 (S3.10): 1009h is a text, which a boot-up cannot compare. The paper puts the
/// number into 1018h:05 and what is expected into 1F90h; CiA 301 gives 1018h four sub-indices, and 1F90h is the flying
/// master's (CiA 302-2). So both are in the manufacturer-specific area here; 1018h:05 is read when that is asked for.
#pragma once

#include "berth/co/sdo_access.hpp"
#include "berth/od/description.hpp"
#include "berth/od/paper3.hpp"
#include "berth/od/values.hpp"

namespace berth::multilevel {

inline constexpr ObjectRef hardware_version_object = od::paper3::hardware_version;
inline constexpr ObjectRef literal_hardware_version_object{0x1018, 5};

/// 5F01h of a slave.
void add_hardware_version(od::DescriptionBuilder& builder, std::uint32_t version);
/// 5F02h of a master: sub-index n is what is expected of node n; 0 = anything.
void add_expected_hardware(od::DescriptionBuilder& builder, std::uint8_t most = 127);
[[nodiscard]] std::uint32_t expected_hardware(const od::Values& master, NodeId node) noexcept;

/// What a boot-up of one's own asks before it configures a slave; `network::BootSlave` does it itself. Errors: as
/// `co::SdoTransfer`; Errc::mismatch with the version that the slave has in `detail`. Nothing is asked when anything is
/// expected.
[[nodiscard]] rt::Task<Result<void>> check_hardware(co::SdoAccess& slave, std::uint32_t expected, bool literal = false);

}  // namespace berth::multilevel
