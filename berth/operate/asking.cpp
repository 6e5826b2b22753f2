#include "berth/operate/asking.hpp"

#include <algorithm>

#include "berth/operate/timing_options.hpp"
#include "berth/places/inquiry.hpp"

namespace berth::operate {

co::SdoOptions Asking::patience(unsigned retries) const {
  co::SdoOptions patience = s_.sdo.options();
  patience.timeout = s_.bus.timing.guard_timeout;
  patience.retries = retries;
  patience.abort_on_timeout = false;
  return patience;
}

co::SdoOptions Asking::first_patience() const {
  co::SdoOptions patience = s_.sdo.options();
  patience.timeout = std::max(s_.bus.timing.guard_timeout, s_.bus.timing.sdo_timeout);
  patience.retries = 0;
  patience.abort_on_timeout = false;
  return patience;
}

std::size_t Asking::most_first_at_once() const noexcept {
  if (s_.bus.timing.at_once != 0) return s_.bus.timing.at_once;
  constexpr double question_bits = 300;  // the answers take as much again
  const double timeout = std::chrono::duration<double>(first_patience().timeout).count();
  return std::max<std::size_t>(2, static_cast<std::size_t>(timeout * s_.bus.bitrate / question_bits));
}

// More questions at once would fill the bus: a guarding remote frame, which has the lower priority, would wait until
// its own timeout.
std::size_t Asking::most_at_once() const noexcept {
  if (s_.bus.timing.at_once != 0) return s_.bus.timing.at_once;
  constexpr double question_bits = 150;  // eight bytes of data with all stuff bits, and room for others
  const double timeout = std::chrono::duration<double>(s_.bus.timing.guard_timeout).count();
  return std::max<std::size_t>(2, static_cast<std::size_t>(timeout * s_.bus.bitrate / question_bits));
}

lss::MasterOptions Asking::with_pauses() const {
  lss::MasterOptions slower = s_.lss.options();
  slower.inhibit = std::max(slower.inhibit, s_.bus.timing.rand_response);
  return slower;
}

rt::Task<bool> Asking::answers_at(NodeId id) {
  const co::SdoOptions how = patience(s_.bus.timing.tries - 1);
  places::Inquiry inquiry(binder_services());
  co_return co_await inquiry.answers_at(id, how, s_.bus.timing.guard_timeout);
}

rt::Task<void> Asking::vacancy(NodeId id) { co_await answers_at(id); }

bool has_equals(const SlotTable& slots, const FoundDevices& found, const Identity& device, std::optional<NodeId> own) {
  if (device.has_serial()) return false;
  const auto equal = [&](const Identity& other) {
    return other.address == device.address && other.at != device.at && other.at != own;
  };
  return std::ranges::any_of(found.all(), [&](const places::Found& f) { return equal(f.device); }) ||
         std::ranges::any_of(slots.seats(), [&](const auto& seat) {
           const auto sits = seat->slot.record.device();
           return sits && seat->is_accounted_for() && equal(*sits);
         });
}

bool has_no_address(const SlotTable& slots, const FoundDevices& found, const Identity& device) {
  const Identity one = found.one_for(device);
  return one.unknown != 0 || (one.at.configured() && has_equals(slots, found, one, device.at));
}

rt::Task<Result<NodeId>> Asking::active_id(Identity device) {
  if (has_equals(device)) co_return fail(Errc::timeout, "several devices have its LSS address");
  places::Inquiry inquiry(binder_services());
  co_return co_await inquiry.active_id(device.address, may_be_doubled(device), s_.bus.timing.rand_response);
}

rt::Task<Result<NodeId>> Asking::active_id_once(Identity device) {
  if (has_equals(device)) co_return fail(Errc::timeout, "several devices have its LSS address");
  places::Inquiry inquiry(binder_services());
  co_return co_await inquiry.active_id_once(device.address, may_be_doubled(device));
}

// If a slot's device is there and RAND still gets an answer, another device may have its address.
bool Asking::may_be_doubled(const Identity& device) const {
  const Seat* const seat = slots_.of(device);
  return seat != nullptr && seat->there();
}

// Every address seen on this bus or seated on it: any of these devices may be in LSS configuration unnoticed.
lss::PartMask Asking::parts_to_ask(const Identity& device) const {
  std::vector<LssAddress> others = found_.addresses();
  for (const auto& seat : slots_.seats()) {
    if (const auto sits = seat->slot.record.device()) others.push_back(sits->address);
  }
  return lss::parts_to_ask(device.address, others);
}

rt::Task<Result<void>> Asking::select_alone(Identity device) {
  if (has_equals(device)) co_return fail(Errc::timeout, "several devices have its LSS address");
  const lss::AloneOptions options{.parts = parts_to_ask(device)};
  auto selected = co_await lss::select_alone(s_.lss, device.address, options);
  const bool unheard = selected && *selected == lss::Selection::absent;
  if (unheard) {
    // Again with pauses: a single-slot receive buffer loses frames that come back to back.
    const lss::MasterOptions before = s_.lss.options();
    s_.lss.set_options(with_pauses());
    selected = co_await lss::select_alone(s_.lss, device.address, options);
    s_.lss.set_options(before);
  }
  if (!selected) co_return fail(selected.error());
  switch (*selected) {
    case lss::Selection::alone: break;
    case lss::Selection::absent: co_return fail(Errc::timeout, "it does not answer to its LSS address");
    case lss::Selection::not_alone: co_return fail(Errc::mismatch, "another device is in LSS configuration beside it");
    case lss::Selection::clones: co_return fail(Errc::duplicate, "two devices answer to its LSS address");
  }
  co_return Result<void>{};
}

places::Binder::Services Asking::binder_services() const noexcept {
  return {s_.dispatcher, s_.lss, s_.sdo, s_.nmt, s_.boots, slots_.store(), s_.vacancy};
}

places::Binder::Options Asking::binder_options() const {
  places::Binder::Options options = operate::binder_options(s_.bus.timing);
  options.lss_turn = &s_.lss_turn;
  options.before_step = slots_.events().before_step();
  options.on = slots_.bus();
  options.stores_end = s_.foreign_stores.end();
  return options;
}

}  // namespace berth::operate
