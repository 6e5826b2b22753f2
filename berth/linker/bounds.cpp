#include "berth/linker/bounds.hpp"

#include <algorithm>

namespace berth::linker {

Unsent unsent(TransmissionType type, rt::Duration sync) noexcept {
  if (type == od::rtr_sampled_at_sync || type == od::rtr_only) return Unsent::on_remote_frames;
  return synchronous(type) && sync == rt::Duration(0) ? Unsent::waits_for_sync : Unsent::no;
}

Sending sending_of(const LinkNetwork& network, const Pdo& pdo) {
  const auto objects = static_cast<std::int64_t>(pdo.mpdo ? pdo.carried.size() : 1);
  const Bus& bus = network.buses[pdo.bus];
  return {pdo.transmission, inhibit_unit * pdo.inhibit * objects, static_cast<unsigned>(objects), bus.sync,
          bus.sync_key};
}

rt::Duration least_interval(TransmissionType type, rt::Duration inhibit, rt::Duration sync, rt::Duration said) {
  if (synchronous(type)) return sync * std::max<unsigned>(type, 1);
  return inhibit > rt::Duration(0) ? inhibit : said;
}

rt::Duration waiting(const Sending& sending) {
  if (!synchronous(sending.transmission)) return sending.inhibit;
  return sending.sync * (std::max<unsigned>(sending.transmission, 1) + 1);
}

void set_sending(analysis::Message& message, const Sending& sending, bool linked,
                 const std::optional<rt::Duration>& deadline) {
  const bool at_sync = synchronous(sending.transmission);
  if (at_sync) message.after = sending.sync_key;
  message.deadline = deadline.value_or(rt::Duration(0));
  if (!linked) return;
  message.before = waiting(sending);
  // A device may count its inhibit time from the end of the previous frame (Berth's devices do).
  if (!at_sync && message.before > rt::Duration(0)) message.frames_before = sending.objects;
  if (!at_sync) return;
  message.before -= sending.sync;
  message.counts_every = sending.sync;
}

std::optional<rt::Duration> worst_of(const LinkNetwork& network, const CrossingLink& crossing,
                                     std::span<const std::optional<rt::Duration>> pdos) {
  rt::Duration sum{};
  for (const std::size_t gateway : crossing.gateways) sum += network.gateways[gateway].delay;
  for (const std::size_t pdo : crossing.pdos) {
    if (!pdos[pdo]) return std::nullopt;
    sum += *pdos[pdo];
  }
  return sum;
}

}  // namespace berth::linker
