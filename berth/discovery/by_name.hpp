/// Gives a node-ID to a device whose address is known. Internal to `discovery`.
#pragma once

#include "berth/discovery/discovery.hpp"
#include "berth/lss/select_alone.hpp"

namespace berth::discovery {

/// The outcome.
struct ByName {
  NodeId id{};             ///< it took this; unconfigured: there was none for it, or it refused, or is gone
  bool not_alone = false;  ///< another device is in configuration too: nothing was changed; may be tried again
};
/// Selects the device and proves that it is alone (`lss::select_alone`), asks the assigner, configures the node-ID,
/// stores it if wanted, switches to waiting. `parts`: the parts that distinguish it from others. Error: `bus`.
[[nodiscard]] rt::Task<Result<ByName>> assign_by_name(lss::Master& lss, LssAddress device, lss::PartMask parts,
                                                      const Options& options);
/// `assign_by_name` for each device of the report without a node-ID, if there is an assigner; retries a device that was
/// not alone after the others. Informs the observer again.
[[nodiscard]] rt::Task<Result<void>> assign_all(lss::Master& lss, const Known& known, Report& report,
                                                const Options& options);
/// The parts that distinguish `device` from all devices that are known, found, or of a known kind.
[[nodiscard]] lss::PartMask parts_that_tell(const LssAddress& device, const Known& known, const Report& report);

}  // namespace berth::discovery
