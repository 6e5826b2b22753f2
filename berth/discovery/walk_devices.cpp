#include "berth/discovery/walk_devices.hpp"

#include <algorithm>
#include <utility>

namespace berth::discovery::walk {

Memory Memory::for_a_search(bool in_slices, const Memory& last) {
  if (!in_slices || last.aside.nameless()) return {};
  return {.aside = last.aside, .stayers = last.stayers, .some_stay = last.some_stay};
}

void PutAside::put(const LssAddress& device, bool has_node_id) {
  if (!has(device)) devices_.push_back(device);
  nameless_ = nameless_ || !has_node_id;
  now_ = true;
}

bool PutAside::has(const LssAddress& device) const { return std::ranges::find(devices_, device) != devices_.end(); }

Devices::Devices(Questions& questions, const Services& services, Method by, const Known& known, const Options& options,
                 KnownPaths& paths, Memory& memory, Report& report) noexcept
    : q_(questions),
      services_(services),
      by_(by),
      known_(known),
      options_(options),
      paths_(paths),
      memory_(memory),
      report_(report) {}

Devices::~Devices() {
  if (held_) services_.dispatcher.send(lss::request(lss::Command::switch_global, 0));
}

rt::Task<Outcome> Devices::settle(std::uint32_t serial) {
  const LssAddress device = q_.way().address(serial);
  if (memory_.aside.has(device)) co_return Outcome::nobody;
  const bool held = std::exchange(held_, true);
  const Prefix whole{serial, 0};
  const Heard heard = co_await q_.ask_once(whole, 0, Wait::bound);
  if (q_.is_broken()) co_return Outcome::nobody;
  if (!heard.sent) {  // no device was selected then, and `04 00` would make some slaves forget their part
    held_ = held;
    co_return Outcome::late;
  }
  if (!heard.yes()) {
    // A device may be there: it was slow, or its answer was lost.
    services_.lss.suspect_strangers();
    co_await release();
    co_return heard.late ? Outcome::late : Outcome::nobody;
  }
  co_return co_await selected(device);
}

// A device that missed an 80h may be at the serial number of another type.
lss::AloneOptions Devices::alone_options() const noexcept {
  lss::PartMask parts = lss::serial_part;
  for (unsigned part = 0; part < 3; ++part) {
    if (q_.way().varied(part)) parts = static_cast<lss::PartMask>(parts | 1U << part);
  }
  return {.parts = parts, .longest = q_.asker().longest()};
}

// The selected device reports its LSS address itself and is proven to be alone. Then it gets its node-ID.
rt::Task<Outcome> Devices::selected(LssAddress device) {
  rt::Executor& executor = services_.dispatcher.executor();
  Found found{.address = device, .at = executor.now(), .active = {}, .assigned = {}, .by = by_};
  lss::AloneOptions how = alone_options();
  // 40h to 43h would select its equals, too. They have their node-IDs; this device answers Fastscan.
  how.without_node_id = std::ranges::find(known_.equals, device) != known_.equals.end();
  how.followed = !services_.lss.lacks().has(device, lss::Lackable::inquire_node_id);
  const rt::Duration window = lss::window_of(services_.lss, how);
  const auto proof = co_await lss::prove_alone(services_.lss, device, how);
  const auto now = executor.now();
  q_.asker().sent_elsewhere(now);
  if (!proof) {
    q_.broken(proof.error());
    co_return Outcome::nobody;
  }
  const bool clones = *proof == lss::Selection::clones;
  const bool alone = *proof == lss::Selection::alone;
  held_ = alone;
  if (!alone && !clones) {
    ++report_.unproven;
    released_ = true;
    co_return Outcome::nobody;
  }
  found.possible_clone = clones;
  bool says_none = false;
  if (alone) {
    const auto told = co_await active_id(device, window);
    if (told.by_others) {
      ++report_.unproven;
      co_await release();
      co_return Outcome::nobody;
    }
    found.active = told.id.value_or(NodeId());
    says_none = told.id && !told.id->configured();
  }
  const bool told = is_found(device);
  if (alone && (told || found.active.configured())) {
    co_await release();
    const Outcome outcome = co_await stays(found, told);
    co_return outcome;
  }
  if (alone) {
    const NodeId id = co_await give(device, says_none);
    found.assigned = id;
  }
  if (q_.is_broken()) co_return Outcome::nobody;
  keep(found);
  // If some devices stay in the search, this one may stay, too. The walk goes round it; that only costs time if it
  // leaves.
  if (!found.assigned.configured() || memory_.some_stay) memory_.aside.put(device, found.assigned.configured());
  co_return Outcome::found;
}

// Lely core's slaves answer Fastscan with a node-ID, too. A device that does not report one (5Eh) has none. 5Eh is the
// last question before the 11h: a device in configuration that heard none of the proof may hear it.
rt::Task<Devices::ActiveId> Devices::active_id(LssAddress device, rt::Duration window) {
  const lss::ServiceOptions service{
      .timeout = q_.asker().longest(), .retries = 0, .full_window = false, .listen = window};
  const auto told = co_await lss::ask_node_id(services_.lss, device, service);
  const auto now = services_.dispatcher.executor().now();
  q_.asker().sent_elsewhere(now);
  if (told && !*told) co_return ActiveId{};
  const bool others = told && lss::suspicious(**told);
  if (others) services_.lss.suspect_strangers();
  if (told) co_return ActiveId{NodeId::make((*told)->byte()).value_or(NodeId()), others};
  if (told.error().code == Errc::bus || told.error().code == Errc::cancelled) q_.broken(told.error());
  services_.lss.suspect_strangers();  // its answer may come during the next question
  co_return ActiveId{};
}

// The device was proven alone and has no node-ID from this search that would end its answers. Meeting it again does not
// make it a clone.
rt::Task<Outcome> Devices::stays(const Found& device, bool told) {
  if (q_.is_broken()) co_return Outcome::nobody;
  memory_.some_stay = memory_.some_stay || device.active.configured();
  if (is_registered(device.address)) {
    memory_.stayers.note(true);
  } else if (!told) {
    keep(device);
  }
  memory_.aside.put(device.address, device.active.configured());
  if (!told) co_return Outcome::found;
  // The other devices of its type will stay, too.
  for (const Found& f : report_.found) {
    if (f.address.type() == device.address.type())
      memory_.aside.put(f.address, f.assigned.configured() || f.active.configured());
  }
  co_return Outcome::found;
}

rt::Task<NodeId> Devices::give(LssAddress device, bool says_none) {
  NodeId id;
  if (options_.assigner != nullptr) id = options_.assigner->assign(device, says_none);
  if (!id.configured()) {
    co_await release();
    co_return id;
  }
  lss::AloneOptions how = alone_options();
  how.vacancy = options_.assigner;
  const auto given = co_await lss::configure_alone(services_.lss, device, id, options_.store, how);
  const auto now = services_.dispatcher.executor().now();
  q_.asker().sent_elsewhere(now);
  if (!given) {
    q_.broken(given.error());
    co_return NodeId();
  }
  held_ = false;
  co_return given->outcome == lss::Given::Outcome::taken ? id : NodeId();
}

rt::Task<void> Devices::release() {
  const auto sent = co_await services_.lss.switch_global(lss::State::waiting);
  if (!sent) {
    q_.broken(sent.error());
    co_return;
  }
  q_.asker().sent_elsewhere(sent->sent);
  held_ = false;
  released_ = true;
}

void Devices::keep(const Found& device) {
  report_.known = device.at;
  auto known = std::ranges::find(report_.found, device.address, &Found::address);
  if (known == report_.found.end()) {
    paths_.put_first(device.address);
    known = report_.found.insert(known, device);
  } else {
    known->possible_clone = known->possible_clone || device.possible_clone;
  }
  if (options_.observer != nullptr) options_.observer->found(*known);
}

bool Devices::is_found(const LssAddress& device) const {
  return std::ranges::find(report_.found, device, &Found::address) != report_.found.end();
}

bool Devices::is_registered(const LssAddress& device) const {
  return std::ranges::find(known_.registered, device) != known_.registered.end();
}

}  // namespace berth::discovery::walk
