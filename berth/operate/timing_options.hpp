/// The timeouts and retries of each service on one bus, all from the machine file's `[timing]`.
#pragma once

#include "berth/co/sdo_client.hpp"
#include "berth/design/machine.hpp"
#include "berth/lss/master.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/places/binder.hpp"

namespace berth::operate {

[[nodiscard]] lss::MasterOptions lss_options(const design::Timing& timing);
[[nodiscard]] co::SdoOptions sdo_options(const design::Timing& timing);
/// For 1010h: a timeout of seconds, one try, and no abort, which would disturb a device that is storing.
[[nodiscard]] co::SdoOptions saving_options(const design::Timing& timing);
[[nodiscard]] places::Binder::Options binder_options(const design::Timing& timing);
[[nodiscard]] manager::ConfiguratorOptions configurator_options(const design::Timing& timing);

}  // namespace berth::operate
