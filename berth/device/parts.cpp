#include "berth/device/parts.hpp"

namespace berth::device {

DeviceParts::DeviceParts(const Surroundings& on, const Options& options, od::Values& values, co::NmtSlave& nmt,
                         LssSlave::Owner& lss_owner, NodeIdSchemes::Owner& schemes_owner)
    : host(on.port, on.timing),
      application(values),
      errors(*on.dispatcher, values, nmt, host, services),
      error_control(*on.dispatcher, values, errors, host, options.never_seen, application),
      bus_off(*on.dispatcher, host, errors, options.bus_off_recovery),
      services(*on.dispatcher, values, application, errors,
               {.send_at_start = options.send_tpdos_at_start, .detect_collision = options.detect_collision}),
      lss(*on.dispatcher, options, on.memory, host, lss_owner),
      schemes(*on.dispatcher, options, on.memory, host, lss, errors, schemes_owner),
      own_identifiers(*on.dispatcher, values, nmt, errors, schemes, options.detect_collision),
      stored(values, services.sdo(), on.memory, options, host, lss),
      node_id_object(options.node_id_object
                         ? std::make_unique<NodeIdObject>(values, services.sdo(), options, lss, stored)
                         : nullptr),
      programming(Programming::make(on.dispatcher->executor(), values, on.programs,
                                    {options.address.vendor, options.address.product}, nmt, services.sdo())) {}

std::size_t DeviceParts::memory() const noexcept {
  return application.memory() + errors.memory() + error_control.memory() + services.memory() + lss.memory() +
         schemes.memory() + stored.memory() + (node_id_object ? sizeof(NodeIdObject) : 0) +
         (programming ? sizeof(Programming) : 0);
}

}  // namespace berth::device
