// A search: what is done with a device once its serial number is known.
#include <algorithm>

#include "berth/discovery/walk_search.hpp"

namespace berth::discovery {

namespace {
constexpr unsigned most_again = 3;  // one address so often: it cannot be taken out
}  // namespace

// The device with this serial number goes to configuration, if it is there.
rt::Task<Walker::Search::Outcome> Walker::Search::settle(std::uint32_t serial) {
  const LssAddress device = address(serial);
  const bool alone = options_.assigner != nullptr;
  if (alone && !parked_.empty()) {
    co_await release();
    co_await rt::sleep_for(asker_.longest());
  }
  // Without an assigner the parked devices would answer every inquiry, so the answer itself has to be beyond doubt:
  // nobody owes one for an earlier request.
  if (!alone) co_await rt::sleep_until(asker_.settled());
  held_ = true;
  const Prefix whole{serial, 0};
  const Heard heard = co_await ask_once(whole, 0, Wait::bound);
  if (broken_) co_return Outcome::nobody;
  if (!heard.yes()) {
    co_await nobody_selected();
    co_return heard.late ? Outcome::late : Outcome::nobody;
  }
  co_return co_await selected(device);
}

// It may be there and have been slow, or its answer lost.
rt::Task<void> Walker::Search::nobody_selected() {
  const bool all_parked = options_.assigner == nullptr && !parked_.empty();
  co_await release();
  if (all_parked || !parked_.empty()) co_await park_again();
}

rt::Task<Walker::Search::Outcome> Walker::Search::selected(const LssAddress& device) {
  const rt::Time at = walker_.services_.dispatcher.executor().now();
  Found found{.address = device, .at = at, .active = {}, .assigned = {}, .by = walker_.method()};
  if (options_.assigner == nullptr) {
    const bool real = co_await by_its_address(device);
    if (!real) {
      co_await nobody_selected();
      co_return Outcome::nobody;
    }
    counted_ = device;
    parked_.push_back(device);
    keep(found);
    co_return Outcome::found;
  }
  const bool same = co_await itself(device);
  if (!same) {
    co_await nobody_selected();
    co_return Outcome::nobody;
  }
  bool clone = false;
  if (asker_.answers() > 1) clone = co_await twice(device);
  found.possible_clone = clone;
  const NodeId id = co_await give(device);
  found.assigned = id;
  if (broken_) co_return Outcome::nobody;
  keep(found);
  if (!found.assigned.configured()) parked_.push_back(device);
  if (!parked_.empty()) co_await park_again();
  co_return Outcome::found;
}

// The selected device says who it is.
rt::Task<bool> Walker::Search::itself(const LssAddress& device) {
  // Somebody may have been left in configuration, unheard: it would take the same node-ID, and it answers here too. Of
  // one whom a master before us left nothing is learnt yet, and while it stored it heard no `04 00`.
  const lss::ServiceOptions first = strangers_ ? service(true) : one_by_one();
  strangers_ = true;
  const lss::ServiceOptions others = service(false);
  for (unsigned part = 4; part-- > 0;) {
    if (part < 3 && !varied_[part]) continue;
    const auto& options = part == 3 ? first : others;
    const auto reply = co_await lss_.inquire(part, options);
    if (!reply || reply->differ || reply->value() != device.part(part)) co_return false;
    asker_.sent_elsewhere(reply->sent);
  }
  strangers_ = false;
  co_return true;
}

// 40h to 43h: nobody but who has the whole address answers 44h, whoever else is in configuration. A device that missed
// an 80h may stand at the serial number of another type.
rt::Task<bool> Walker::Search::by_its_address(const LssAddress& device) {
  const lss::ServiceOptions options = one_by_one();
  const auto reply = co_await lss_.switch_selective(device, options);
  if (!reply && reply.error().code == Errc::bus) broken(reply.error());
  if (reply) asker_.sent_elsewhere(reply->sent);
  if (reply && reply->answers > 1) suspects_.push_back(device);
  co_return reply.has_value();
}

// Asked once more, it answers twice again: a doubled frame would be a coincidence.
rt::Task<bool> Walker::Search::twice(const LssAddress& device) {
  const lss::ServiceOptions options = service(true);
  const auto reply = co_await lss_.switch_selective(device, options);
  co_return reply.has_value() && reply->answers > 1;
}

rt::Task<NodeId> Walker::Search::give(const LssAddress& device) {
  const NodeId id = options_.assigner->assign(device);
  if (!id.configured()) co_return NodeId();
  const lss::ServiceOptions options = service(false);
  const auto reply = co_await lss_.configure_node_id(id, options);
  if (!reply || reply->differ) co_return NodeId();
  if (options_.store) {
    const auto stored = co_await lss_.store();
    if (!stored && stored.error().code == Errc::bus) broken(stored.error());
  }
  co_await release();
  co_return id;
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

// Those that stay without a node-ID would answer every question again.
rt::Task<void> Walker::Search::park_again() {
  held_ = true;
  for (std::size_t i = 0; i < parked_.size() && !broken_; ++i) {
    const LssAddress device = parked_[i];
    const lss::ServiceOptions options = service(false);
    const auto reply = co_await lss_.switch_selective(device, options);
    if (!reply && reply.error().code == Errc::bus) broken(reply.error());
    if (reply) asker_.sent_elsewhere(reply->sent);
  }
}

rt::Task<void> Walker::Search::look_for_clones() {
  co_await rt::sleep_until(asker_.settled());
  if (counted_ && asker_.answers() > 1) suspects_.push_back(*counted_);
  for (std::size_t i = 0; i < suspects_.size(); ++i) {
    const LssAddress device = suspects_[i];
    const bool clone = co_await twice(device);
    if (!clone) continue;
    const auto found = std::ranges::find(report_.found, device, &Found::address);
    if (found != report_.found.end()) found->possible_clone = true;
    if (found != report_.found.end() && options_.observer != nullptr) options_.observer->found(*found);
  }
}

void Walker::Search::keep(const Found& device) {
  report_.known = device.at;
  auto known = std::ranges::find(report_.found, device.address, &Found::address);
  if (known == report_.found.end()) {
    const LssAddress& a = device.address;
    paths_.insert(paths_.begin(), Path{.part = {a.vendor, a.product, a.revision, 0}, .parts = 3});
    known = report_.found.insert(known, device);
  } else {
    known->possible_clone = true;  // it was taken out, and is there again
    if (!known->assigned.configured()) known->assigned = device.assigned;
    if (++again_ > most_again) stuck_ = true;
  }
  if (options_.observer != nullptr) options_.observer->found(*known);
}

}  // namespace berth::discovery
