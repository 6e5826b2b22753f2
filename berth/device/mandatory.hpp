/// The objects that CiA 301 requires of every device (§7.5.2), for a description that lacks them.
#pragma once

#include <memory>
#include <vector>

#include "berth/od/description.hpp"

namespace berth::device {

/// The mandatory objects that are not described: 1000h, 1001h, 1018h (or only its vendor-ID, sub-index 1) and, as error
/// control, 1017h if guarding (100Ch and 100Dh) is missing too. Ascending; sub-index 0 = the whole object.
[[nodiscard]] std::vector<ObjectRef> mandatory_absent(const od::Description& description);

/// The same description plus these objects as in `minimal_description`: device type 0 (no profile), no heartbeat until
/// 1017h is written.
[[nodiscard]] std::shared_ptr<const od::Description> with_mandatory(const od::Description& description);

/// Adds everything in a description except the meaning of its numbers.
void add_all(od::DescriptionBuilder& builder, const od::Description& description);

}  // namespace berth::device
