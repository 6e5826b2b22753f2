#include "berth/manager/node_id_assigner.hpp"

#include <algorithm>

#include "berth/co/cob_id.hpp"
#include "berth/manager/dictionary_manager.hpp"
#include "berth/manager/dictionary_source.hpp"
#include "berth/rt/scope.hpp"

namespace berth::manager {
namespace {

constexpr std::uint16_t identity = 0x1018;

bool fits(const SlaveRules& rules, const LssAddress& device) noexcept {
  const bool typed = rules.vendor != 0 && rules.product != 0;
  const auto agrees = [](std::uint32_t expected, std::uint32_t is) { return expected == 0 || expected == is; };
  return typed && rules.vendor == device.vendor && rules.product == device.product &&
         agrees(rules.revision, device.revision) && agrees(rules.serial, device.serial);
}

}  // namespace

NodeIdAssigner::NodeIdAssigner(can::Dispatcher& dispatcher, co::SdoClient& sdo, const od::Values& values)
    : dispatcher_(&dispatcher),
      executor_(&dispatcher.executor()),
      sdo_(&sdo),
      values_(&values),
      lss_(dispatcher),
      rand_(dispatcher),
      methods_(discovery::Services{dispatcher, lss_}, {.configured = false}) {
  dispatcher.add(co::all_error_control, *this);
}

NodeIdAssigner::~NodeIdAssigner() {
  if (user_ != nullptr) user_->assign_by(nullptr);
  dispatcher_->remove(*this);
}

std::bitset<128> NodeIdAssigner::answered() const noexcept {
  std::bitset<128> all;
  for (const auto& each : list_) all[each.node.value()] = each.device.has_value();
  return all;
}

void NodeIdAssigner::received(const can::Frame& frame, rt::Time) noexcept { heard_.set(frame.id & 0x7FU); }

rt::Task<Result<void>> NodeIdAssigner::run(NodeId own, std::bitset<128> there) {
  list_.clear();
  heard_.reset();
  told_.reset();
  for (std::uint8_t number = 1; number <= 127; ++number) {
    const NodeId node(number);
    SlaveRules rules = slave_rules_of(*values_, node);
    if (rules.assigned && node != own)
      list_.push_back({.node = node, .rules = std::move(rules), .there = there[number]});
  }
  {
    rt::Scope questions(*executor_);
    for (auto& each : list_) {
      if (!each.there) questions.spawn(ask(each));
    }
    co_await questions.join();
  }
  const bool complete = std::ranges::all_of(list_, &Wanted::there);
  if (complete) co_return Result<void>{};
  co_return co_await search();
}

// Whatever answers has the node-ID: whether it is the right device, its boot-up says.
rt::Task<void> NodeIdAssigner::ask(Wanted& wanted) {
  co::SdoOptions options = sdo_->options();
  options.timeout = sdo_timeout;
  options.retries = 1;
  LssAddress device;
  std::uint8_t sub = 1;
  for (std::uint32_t* const part : {&device.vendor, &device.product, &device.revision, &device.serial}) {
    const auto value = co_await sdo_->read<std::uint32_t>(wanted.node, identity, sub++, options);
    if (value) *part = *value;
    wanted.there = wanted.there || value || value.error().code == Errc::aborted;
    if (!wanted.there) co_return;
  }
  wanted.device = device;
}

rt::Task<Result<void>> NodeIdAssigner::search() {
  discovery::Known known;
  for (const auto& each : list_) {
    if (each.device) known.registered.push_back(*each.device);
    const discovery::Kind kind{{each.rules.vendor, each.rules.product}, std::nullopt};
    const bool named = std::ranges::find(known.kinds, kind) != known.kinds.end();
    if (!each.there && kind.type.vendor != 0 && !named) known.kinds.push_back(kind);
  }
  if (known.kinds.empty()) co_return Result<void>{};
  discovery::Options options;
  options.assigner = this;
  options.store = true;
  options.inquire = true;
  // A device that was given its node-ID when this master was reset waits for this to use it, and answers no search.
  const auto released = co_await lss_.switch_global(lss::State::waiting);
  if (!released) co_return fail(released.error());
  const auto anybody = co_await methods_.anybody(options);
  if (!anybody) co_return fail(anybody.error());
  if (!*anybody) co_return Result<void>{};
  const auto found = co_await methods_.find(known, options);
  if (!found) co_return fail(found.error());
  const auto quiet = co_await lss_.switch_global(lss::State::waiting);
  if (!quiet) co_return fail(quiet.error());
  // RAND has found them, and they would not answer when the list has a place for them.
  for (const auto& device : found->found) {
    const bool met = std::ranges::find(met_, device.address) != met_.end();
    const bool has_one = device.assigned.configured() || device.active.configured();
    if (!met && !has_one) met_.push_back(device.address);
    if (has_one || device.by != discovery::Method::planner_rand) continue;
    const auto told = co_await rand_.switch_selective(device.address, nodeid::Identification::unknown);
    if (!told) co_return fail(told.error());
  }
  co_return Result<void>{};
}

// What the list has for it is its own, unless another device has answered under it. Else no other one gets it either.
bool NodeIdAssigner::keeps(const LssAddress& device, NodeId active) noexcept {
  if (!active.configured()) {
    const bool met = std::ranges::find(met_, device) != met_.end();
    if (!met) met_.push_back(device);
    return false;
  }
  const auto it = std::ranges::find(list_, active, &Wanted::node);
  const bool its_own = it != list_.end() && fits(it->rules, device) && it->device.value_or(device) == device;
  if (!its_own) told_.set(active.value());
  if (its_own) it->there = true;
  if (its_own) std::erase(met_, device);
  return its_own;
}

bool NodeIdAssigner::is_free(const Wanted& each, const LssAddress& device) const noexcept {
  return !each.there && still_vacant(each.node) && fits(each.rules, device);
}

NodeId NodeIdAssigner::assign(const LssAddress& device) noexcept {
  std::vector<Wanted*> free;
  for (auto& each : list_) {
    if (is_free(each, device)) free.push_back(&each);
  }
  if (free.empty()) return {};
  std::erase(met_, device);
  const auto before = static_cast<std::size_t>(std::ranges::count_if(
      met_, [&](const LssAddress& other) { return other.type() == device.type() && other < device; }));
  Wanted& chosen = *free[std::min(before, free.size() - 1)];
  chosen.there = true;
  ++given_;
  return chosen.node;
}

}  // namespace berth::manager
