#include "berth/operate/timing_options.hpp"

#include <algorithm>

namespace berth::operate {

lss::MasterOptions lss_options(const design::Timing& t) {
  lss::MasterOptions o;
  o.service.timeout = t.lss_timeout;
  o.identify.timeout = t.lss_timeout;
  o.store.timeout = t.store_timeout;
  return o;
}

co::SdoOptions sdo_options(const design::Timing& t) {
  co::SdoOptions o;
  o.timeout = t.sdo_timeout;
  o.retries = t.tries - 1;
  return o;
}

co::SdoOptions saving_options(const design::Timing& t) {
  co::SdoOptions o = sdo_options(t);
  o.timeout = t.save_timeout;
  o.retries = 0;
  o.abort_on_timeout = false;
  return o;
}

places::Binder::Options binder_options(const design::Timing& t) {
  places::Binder::Options o;
  o.tries = t.tries;
  o.boot_timeout = t.boot_timeout;
  o.guard_timeout = t.guard_timeout;
  o.slow_inhibit = t.rand_response;
  return o;
}

// A device that did not answer the save command is asked for as long again as the save may take.
manager::ConfiguratorOptions configurator_options(const design::Timing& t) {
  manager::ConfiguratorOptions o;
  o.tries = t.tries;
  o.ask_pause = std::max<rt::Duration>(t.save_timeout / 10, std::chrono::milliseconds(1));
  o.asks = 10;
  return o;
}

}  // namespace berth::operate
