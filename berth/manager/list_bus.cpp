#include "berth/manager/list_bus.hpp"

#include <algorithm>
#include <string>

#include "berth/manager/dictionary_rules.hpp"

namespace berth::manager {
namespace {

// 1F85h to 1F88h as a slot: revision and serial number are compared if they are not 0.
places::SlotSpec spec_of(NodeId node, const SlaveRules& rules) {
  places::SlotSpec spec;
  spec.name.name = std::to_string(node.value());
  spec.id = node;
  spec.type = {rules.vendor, rules.product};
  spec.when_ambiguous = places::WhenAmbiguous::in_order;
  if (rules.revision != 0) {
    spec.rule = places::RevisionRule::exact;
    spec.revision = rules.revision;
  }
  if (rules.serial != 0) spec.asks.serial = rules.serial;
  return spec;
}

}  // namespace

ListBus::ListBus(const ListServices& services)
    : s_(services), lss_(services.dispatcher), boots_(services.dispatcher, &services.sdo) {}

void ListBus::begin(NodeId own) {
  own_ = own;
  began_ = executor().now();
  s_.store.reload();
  slots.clear();
  found.clear();
  refusing.clear();
  given_up.reset();
  nobody_listens = false;
  vacancy_ = {};
  list_.clear();
  for (std::uint8_t number = 1; number <= 127; ++number) {
    const NodeId node(number);
    boots_.forget(node);
    const SlaveRules rules = slave_rules_of(s_.values, node);
    if (!rules.assigned || node == own_) continue;
    list_.push_back(spec_of(node, rules));
    if (has_fixed_node_id(s_.values, node)) list_.back().assign = places::Assign::fixed;
  }
}

void ListBus::read_list(std::bitset<128> there) {
  slots.clear();
  found.clear();
  vacancy_ = {};
  for (const auto& spec : list_) {
    ListSlot slot;
    slot.slot.spec = spec;
    slot.slot.record.slot = ListStore::slot_of(spec.id);
    slot.typed = spec.type.vendor != 0 && spec.type.product != 0;
    slot.there = there[spec.id.value()];
    slots.push_back(std::move(slot));
    refresh(slots.back());
  }
}

void ListBus::refresh(ListSlot& slot) {
  places::SlotStore& store = s_.store;
  auto record = store.load(slot.slot.record.slot);
  if (record) slot.slot.record = *std::move(record);
}

bool ListBus::knows_type(const Identity& device) const noexcept {
  constexpr std::uint8_t type_alone = 0xC;
  return std::ranges::any_of(slots, [&](const ListSlot& s) {
    Identity wanted(s.slot.spec.type.vendor, s.slot.spec.type.product, 0, 0);
    wanted.unknown = type_alone;
    return s.typed && wanted.agrees(device);
  });
}

std::vector<places::UnfinishedBlank> ListBus::formers() const {
  auto all = s_.store.unfinished_blanks();
  return all ? *std::move(all) : std::vector<places::UnfinishedBlank>();
}

ListBus::Planned ListBus::plan() {
  Planned made;
  std::vector<places::Found> known;
  std::ranges::copy_if(found, std::back_inserter(known),
                       [&](const places::Found& f) { return knows_type(f.device) || of(f.device) != nullptr; });
  for (auto& f : known) f.keeps = found.keeps_its_node_id(f) || refuses(f.device);
  std::vector<places::Slot> plain;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    const ListSlot& slot = slots[i];
    const bool met = std::ranges::find(known, slot.id(), &places::Found::active) != known.end();
    const bool taken = slot.free() && slot.there && !met;  // by a device that is not in the list
    if (!slot.typed || taken) continue;
    plain.push_back(slot.slot);
    made.slots.push_back(i);
  }
  std::vector<Identity> blanks;
  for (const auto& former : formers()) {
    if (found.find(former.device) != nullptr) blanks.push_back(former.device);
  }
  made.plan = places::plan(plain, known, blanks, own_);
  std::erase_if(made.plan.actions, [&](const places::Action& action) {
    if (refuses(action.device)) return true;
    const auto* const f = found.one_for(action.device);
    const bool stays = f != nullptr && found.keeps_its_node_id(*f);
    const bool home =
        stays && action.kind == places::Action::Kind::bind && slots[made.slots[action.slot]].id() == f->active;
    return stays && !home;
  });
  return made;
}

bool ListBus::refuses(const Identity& device) const noexcept {
  return std::ranges::find(refusing, device) != refusing.end();
}

bool ListBus::vacant(NodeId id) const noexcept {
  const auto& asked = vacancy_[id.value()];
  return asked && boots_.vacant_since(id, *asked);
}

co::SdoOptions ListBus::patience() const noexcept {
  co::SdoOptions options = s_.sdo.options();
  options.timeout = timeout;
  options.retries = 1;
  options.abort_on_timeout = false;
  return options;
}

lss::PartMask ListBus::parts_to_ask(const Identity& device) const {
  std::vector<LssAddress> others;
  for (const auto& f : found) others.push_back(f.device.address);
  for (const auto& slot : slots) {
    if (const auto sits = slot.slot.record.device()) others.push_back(sits->address);
    if (slot.device) others.push_back(slot.device->address);
  }
  for (const auto& former : formers()) others.push_back(former.device.address);
  return lss::parts_to_ask(device.address, others);
}

places::Binder::Services ListBus::binder_services() noexcept {
  return {s_.dispatcher, lss_, s_.sdo, s_.nmt, boots_, s_.store, vacancy_};
}

places::Binder::Options ListBus::binder_options() noexcept {
  places::Binder::Options options;
  options.guard_timeout = timeout;
  options.slow_inhibit = pause;
  options.lss_turn = &lss_turn_;
  options.stores_end = stores_end;
  return options;
}

}  // namespace berth::manager
