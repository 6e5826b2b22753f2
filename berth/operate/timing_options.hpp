/// How patient each service is on one bus, from the machine file's `[timing]`: the one place where that is said.
#pragma once

#include "berth/co/sdo_client.hpp"
#include "berth/design/machine.hpp"
#include "berth/lss/master.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/places/binder.hpp"

namespace berth::operate {

[[nodiscard]] lss::MasterOptions lss_options(const design::Timing& timing);
[[nodiscard]] co::SdoOptions sdo_options(const design::Timing& timing);
/// For 1010h: seconds, once, and a device that is busy storing is not disturbed by an abort.
[[nodiscard]] co::SdoOptions saving_options(const design::Timing& timing);
[[nodiscard]] places::Binder::Options binder_options(const design::Timing& timing);
[[nodiscard]] manager::ConfiguratorOptions configurator_options(const design::Timing& timing);

}  // namespace berth::operate
