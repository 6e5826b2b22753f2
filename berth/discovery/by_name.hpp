/// A node-ID for a device whose address is known. Internal to `discovery`.
#pragma once

#include "berth/discovery/discovery.hpp"
#include "berth/lss/master.hpp"

namespace berth::discovery {

/// Selects the device (40h to 43h), configures what the assigner says, stores when asked to, switches to waiting. The
/// node-ID it took; unconfigured: none for it, or it refused or is gone. Error: `bus`.
[[nodiscard]] rt::Task<Result<NodeId>> assign_by_name(lss::Master& lss, const LssAddress& device,
                                                      const Options& options);
/// `assign_by_name` for each device of the report that has none, when there is an assigner; tells the observer again.
[[nodiscard]] rt::Task<Result<void>> assign_all(lss::Master& lss, Report& report, const Options& options);

}  // namespace berth::discovery
