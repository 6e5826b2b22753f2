/// A node-ID for a device whose address is known. Internal to `discovery`.
#pragma once

#include "berth/discovery/discovery.hpp"
#include "berth/lss/select_alone.hpp"

namespace berth::discovery {

/// What came of it.
struct ByName {
  NodeId id{};             ///< it took this; unconfigured: none for it, or it refused, or is gone
  bool not_alone = false;  ///< another device is in configuration too: none was changed, and it may be tried again
};
/// Selects the device and proves that it is alone (`lss::select_alone`), asks the assigner, configures what it says,
/// stores when asked to, switches to waiting. `parts`: what tells it from others.
/// Error: `bus`.
[[nodiscard]] rt::Task<Result<ByName>> assign_by_name(lss::Master& lss, LssAddress device, lss::PartMask parts,
                                                      const Options& options);
/// `assign_by_name` for each device of the report that has none, when there is an assigner; one that was not alone is
/// tried again after the others. Tells the observer again.
[[nodiscard]] rt::Task<Result<void>> assign_all(lss::Master& lss, const Known& known, Report& report,
                                                const Options& options);
/// What tells `device` from all devices that are known, found, or of a known kind.
[[nodiscard]] lss::PartMask parts_that_tell(const LssAddress& device, const Known& known, const Report& report);

}  // namespace berth::discovery
