/// What CiA 301 wants of every device (§7.5.2), for a device that is made from a description which lacks it.
#pragma once

#include <memory>
#include <vector>

#include "berth/od/description.hpp"

namespace berth::device {

/// What is mandatory and not described: 1000h, 1001h, 1018h (or its vendor-ID alone, sub-index 1) and, as error
/// control, 1017h where guarding (100Ch and 100Dh) is not there either. Ascending; sub-index 0 = the whole object.
[[nodiscard]] std::vector<ObjectRef> mandatory_absent(const od::Description& description);

/// The same description, and these objects as `minimal_description` has them: device type 0 (no profile), no heartbeat
/// until 1017h is written.
[[nodiscard]] std::shared_ptr<const od::Description> with_mandatory(const od::Description& description);

/// Everything that a description has, but what its numbers stand for.
void add_all(od::DescriptionBuilder& builder, const od::Description& description);

}  // namespace berth::device
