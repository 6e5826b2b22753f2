// A search: what is done with a device once its serial number is known.
#include <algorithm>
#include <utility>

#include "berth/discovery/walk_search.hpp"

namespace berth::discovery {

// The device with this serial number goes to configuration, if it is there.
rt::Task<Walker::Search::Outcome> Walker::Search::settle(std::uint32_t serial) {
  const LssAddress device = address(serial);
  if (is_aside(device)) co_return Outcome::nobody;
  const bool held = std::exchange(held_, true);
  const Prefix whole{serial, 0};
  const Heard heard = co_await ask_once(whole, 0, Wait::bound);
  if (broken_) co_return Outcome::nobody;
  if (!heard.sent) {  // so no device was selected, and a `04 00` would make some slaves forget their part
    held_ = held;
    co_return Outcome::late;
  }
  if (!heard.yes()) {
    // It may be there and have been slow, or its answer lost.
    lss_.suspect_strangers();
    co_await release();
    co_return heard.late ? Outcome::late : Outcome::nobody;
  }
  co_return co_await selected(device);
}

// A device that missed an 80h may stand at the serial number of another type.
lss::AloneOptions Walker::Search::alone_options() const noexcept {
  lss::PartMask parts = lss::serial_part;
  for (unsigned part = 0; part < 3; ++part) {
    if (varied_[part]) parts = static_cast<lss::PartMask>(parts | 1U << part);
  }
  return {.parts = parts, .longest = asker_.longest()};
}

// The selected device says itself who it is, and that it is alone; then it gets its node-ID.
rt::Task<Walker::Search::Outcome> Walker::Search::selected(LssAddress device) {
  rt::Executor& executor = walker_.services_.dispatcher.executor();
  Found found{.address = device, .at = executor.now(), .active = {}, .assigned = {}, .by = walker_.method()};
  const lss::AloneOptions how = alone_options();
  const auto proof = co_await lss::prove_alone(lss_, device, how);
  const auto now = executor.now();
  asker_.sent_elsewhere(now);
  if (!proof) {
    broken(proof.error());
    co_return Outcome::nobody;
  }
  const bool twins = *proof == lss::Selection::twins;
  const bool alone = *proof == lss::Selection::alone;
  held_ = alone;
  if (!alone && !twins) {
    ++report_.unproven;
    co_return Outcome::nobody;
  }
  found.possible_clone = twins;
  if (alone) {
    const NodeId has = co_await active_id();
    found.active = has;
  }
  const bool told = is_found(device);
  if (alone && (told || found.active.configured())) {
    co_await release();
    const Outcome outcome = co_await stays(found, told);
    co_return outcome;
  }
  if (alone) {
    const NodeId id = co_await give(device);
    found.assigned = id;
  }
  if (broken_) co_return Outcome::nobody;
  keep(found);
  // Where some stay, this one may stay too: it is gone round, which costs time only when it does not.
  if (!found.assigned.configured() || some_stay_) put_aside(device, found.assigned.configured());
  co_return Outcome::found;
}

// Lely core's slaves answer Fastscan whatever node-ID they have.
rt::Task<NodeId> Walker::Search::active_id() {
  const lss::ServiceOptions service{.timeout = asker_.longest(), .retries = 0, .full_window = false};
  const auto told = co_await lss_.inquire_node_id(service);
  const auto now = walker_.services_.dispatcher.executor().now();
  asker_.sent_elsewhere(now);
  if (told) co_return NodeId::make(told->byte()).value_or(NodeId());
  if (told.error().code == Errc::bus || told.error().code == Errc::cancelled) broken(told.error());
  lss_.suspect_strangers();  // its answer may come to the next question
  co_return NodeId();
}

// It was proven alone, and no node-ID of ours takes it out of the search. That it is met again makes it no clone.
rt::Task<Walker::Search::Outcome> Walker::Search::stays(const Found& device, bool told) {
  if (broken_) co_return Outcome::nobody;
  some_stay_ = some_stay_ || device.active.configured();
  if (is_registered(device.address)) {
    stayers_.note(true);
  } else if (!told) {
    keep(device);
  }
  put_aside(device.address, device.active.configured());
  if (!told) co_return Outcome::found;
  // The others of its type stay too.
  for (const Found& f : report_.found) {
    if (f.address.type() == device.address.type())
      put_aside(f.address, f.assigned.configured() || f.active.configured());
  }
  co_return Outcome::found;
}

rt::Task<NodeId> Walker::Search::give(LssAddress device) {
  NodeId id;
  if (options_.assigner != nullptr) id = options_.assigner->assign(device);
  if (!id.configured()) {
    co_await release();
    co_return id;
  }
  lss::AloneOptions how = alone_options();
  how.vacancy = options_.assigner;
  const auto given = co_await lss::configure_alone(lss_, device, id, options_.store, how);
  const auto now = walker_.services_.dispatcher.executor().now();
  asker_.sent_elsewhere(now);
  if (!given) {
    broken(given.error());
    co_return NodeId();
  }
  held_ = false;
  co_return given->outcome == lss::Given::Outcome::taken ? id : NodeId();
}

rt::Task<void> Walker::Search::release() {
  const auto sent = co_await lss_.switch_global(lss::State::waiting);
  if (!sent) {
    broken(sent.error());
    co_return;
  }
  asker_.sent_elsewhere(sent->sent);
  held_ = false;
}

void Walker::Search::put_aside(const LssAddress& device, bool has_node_id) {
  if (!is_aside(device)) aside_.push_back(device);
  nameless_ = nameless_ || !has_node_id;
  set_aside_ = true;
}

void Walker::Search::keep(const Found& device) {
  report_.known = device.at;
  auto known = std::ranges::find(report_.found, device.address, &Found::address);
  if (known == report_.found.end()) {
    const LssAddress& a = device.address;
    paths_.insert(paths_.begin(), Path{.part = {a.vendor, a.product, a.revision, 0}, .parts = 3});
    known = report_.found.insert(known, device);
  } else {
    known->possible_clone = known->possible_clone || device.possible_clone;
  }
  if (options_.observer != nullptr) options_.observer->found(*known);
}

}  // namespace berth::discovery
