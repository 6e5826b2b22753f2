// Checks by the ground truth that what Berth reports about a slot is true when it is reported:
//
//   two devices    Berth reports a duplicate node-ID only if two devices of that bus have used it at one time in this
//                  world
//   not found      Berth does not report of a slot that no device of its type was found if a device of its type is
//                  there that an event has named since its power-on and that sits in no other slot, and as many of them
//                  are there as slots without a device: nothing decides which of more slots stay empty
#pragma once

#include <algorithm>
#include <chrono>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "berth/harness/rig.hpp"

namespace berth::harness {

class WordJudge final : private plant::World::Observer {
 public:
  WordJudge(Rig& rig, const design::Machine& machine) : rig_(&rig), machine_(&machine) {
    for (const auto& d : rig.world().devices()) note(*d);
    rig.world().add_observer(*this);
  }
  ~WordJudge() { rig_->world().remove_observer(*this); }
  WordJudge(const WordJudge&) = delete;
  WordJudge& operator=(const WordJudge&) = delete;

  void berth_began() { named_.clear(); }
  // All faults have ended: a powered device can be heard.
  void all_is_quiet() noexcept { quiet_ = true; }

  void told(const operate::Event& event) {
    using operate::EventKind;
    for (const auto& d : rig_->world().devices()) {
      const auto t = d->truth();
      if (t.bus == event.bus && t.powered && !has_equals(t) &&
          event.text.find(to_string(t.address)) != std::string::npos)
        named_.emplace(t.name, event.at);
    }
    const auto slot = std::ranges::find_if(
        machine_->slots, [&](const auto& s) { return s.spec.name.bus == event.bus && s.spec.name.name == event.slot; });
    const bool doubled = event.kind == EventKind::duplicate ||
                         (event.kind == EventKind::state && event.text.starts_with("duplicate: two devices answer"));
    if (doubled) judge_double(event, slot == machine_->slots.end() ? 0U : slot->spec.id.value());
    if (event.kind == EventKind::state && slot != machine_->slots.end()) judge_not_found(slot->spec, event.text);
  }
  // A state that a slot shows for long is no news, but must still be true when its bus is at rest.
  void look(const operate::SlotReport& report) {
    quiet_since_ = rig_->now() - std::chrono::seconds(2);
    const auto* const slot = machine_->slot(report.bus, report.id);
    judge_not_found(slot->spec, std::string(places::name(report.state)) + ": " + report.reason);
    quiet_since_ = rt::never;
  }

  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }

 private:
  void say(const std::string& text) {
    if (failure_.empty()) failure_ = text;
  }
  // Without serial numbers it is unknown which of them was named.
  [[nodiscard]] bool has_equals(const plant::Truth& t) const {
    return t.address.serial == 0 && std::ranges::any_of(rig_->world().devices(), [&](const auto& d) {
             const auto o = d->truth();
             return o.name != t.name && o.bus == t.bus && o.address == t.address;
           });
  }
  void note(const plant::SimDevice& device) {
    const auto t = device.truth();
    if (!t.powered) named_.erase(t.name);
    if (!t.powered || !t.active.configured()) return;
    for (const auto& other : rig_->world().devices()) {
      const auto o = other->truth();
      if (o.name != t.name && o.bus == t.bus && o.powered && o.active == t.active)
        shared_.insert({t.bus, t.active.value()});
    }
  }
  void plant_changed(const plant::SimDevice& device) noexcept override { note(device); }

  // "node 5 answered one SDO request twice: two devices hold this node-ID, or ..."
  void judge_double(const operate::Event& event, unsigned id) {
    if (event.text.starts_with("node ")) id = static_cast<unsigned>(std::stoul(event.text.substr(5)));
    const bool names_one = event.text.find("two devices") != std::string::npos && id != 0;
    if (names_one && !shared_.contains({event.bus, id}))
      say("told \"" + event.text + "\", and no two devices have used node-ID " + std::to_string(id));
  }

  void judge_not_found(const places::SlotSpec& spec, const std::string& text) {
    if (!quiet_ || text.find("no device of its type was found") == std::string::npos) return;
    const auto records = rig_->store().load(machine_->name);
    if (!records) return;
    std::vector<std::string> devices;
    for (const auto& d : rig_->world().devices()) {
      const auto t = d->truth();
      const auto named = named_.find(t.name);
      const bool there = t.bus == spec.name.bus && t.powered && !t.booting && named != named_.end();
      const bool seated = std::ranges::any_of(
          *records, [&](const auto& r) { return r.name.bus == t.bus && r.device() && t.is_or_will_be(*r.device()); });
      if (there && !seated && named->second < quiet_since_ && places::fits(spec, t.address)) devices.push_back(t.name);
    }
    const auto is_open = [&](const design::Slot& slot) {
      return slot.spec.name.bus == spec.name.bus && slot.spec.type == spec.type &&
             std::ranges::none_of(*records, [&](const auto& r) { return r.name == slot.spec.name && r.device(); });
    };
    if (devices.empty() || std::ssize(devices) < std::ranges::count_if(machine_->slots, is_open)) return;
    say("slot " + spec.name.name + " says \"" + text + "\", and an event has named " + devices.front() +
        ", which fits it");
  }

  Rig* rig_;
  const design::Machine* machine_;
  std::map<std::string, rt::Time> named_;              // by device: first named since its power-on
  std::set<std::pair<std::string, unsigned>> shared_;  // bus, node-ID: two have used it
  bool quiet_ = false;
  rt::Time quiet_since_ = rt::never;  // devices named before it count
  std::string failure_;
};

}  // namespace berth::harness
