#include "berth/device/node_id_methods.hpp"

namespace berth::device {
namespace {

nodeid::RandSlaveOptions rand_options(const NodeIdMethods::Options& options) noexcept {
  return {.address = options.address, .literal = options.rand == RandMode::literal, .resume = options.rand_resume};
}

}  // namespace

NodeIdMethods::NodeIdMethods(const Options& options) noexcept
    : options_(options), rand_(rand_options(options)), and_(options.address) {}

void NodeIdMethods::power_on(const LssAddress& address) noexcept {
  options_.address = address;
  rand_ = nodeid::RandSlave(rand_options(options_));
  and_ = research::AndSlave(address);
}

void NodeIdMethods::listen(can::Dispatcher& dispatcher, can::Handler& ear) const {
  if (options_.rand != RandMode::off) dispatcher.add(nodeid::rand_requests, ear);
  if (options_.and_protocol) dispatcher.add(research::and_requests, ear);
}

bool NodeIdMethods::hears(std::uint32_t key) const noexcept {
  return nodeid::rand_requests.contains(key) || research::and_requests.contains(key);
}

std::optional<can::Frame> NodeIdMethods::handle(const can::Frame& frame, bool in_lss_configuration) noexcept {
  if (research::and_requests.contains(frame.key())) return and_.handle(frame);
  return rand_.handle(frame, in_lss_configuration);
}

}  // namespace berth::device
