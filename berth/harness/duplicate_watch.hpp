// Checks that Berth never makes two devices hold one node-ID, or makes that unavoidable. It checks from the first
// instant, by the ground truth and the frames on the wire; docs/faults.md has the guarantees. It covers every bus of
// the machine: beneath a gateway, its own master assigns node-IDs, with the same guarantees. Below, "Berth" is the
// master of the bus.
//
// Four failures, each reported at the instant at which it happens:
//
//   one request, two devices   by Berth's 11h, a node-ID is pending in two devices at once
//   owned                      a node-ID is given (11h) or stored (17h) while another device has it by Berth: pending,
//                              or written into its memory
//   held                       a node-ID that Berth gave becomes active while another device uses it, which was heard
//                              under it after Berth's question for it
//   unblanked                  a device comes back with a node-ID that Berth has noted as taken away from it
//
// A node-ID that a device has by Berth counts through any time without power and any number of runs of Berth. This ends
// when the device's memory has another node-ID or none, and in the cases of `given_up`.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/lss/frames.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/sim_gateway.hpp"
#include "berth/plant/world.hpp"

namespace berth::harness {

class DuplicateWatch final : public plant::World::Observer {
 public:
  // `store`: read for slots cleared by `replacement = "auto"`; may be null if no slot has that.
  DuplicateWatch(plant::World& world, const design::Machine& machine, places::SlotStore* store)
      : world_(&world), machine_(&machine), store_(store) {
    for (const auto* const bus : machine.all_buses()) {
      sim::Bus* const on = world.bus(bus->name);
      if (on == nullptr) continue;
      wires_.push_back(std::make_unique<Wire>(*this, *on, *bus));
      on->add_tap(*wires_.back());
    }
    for (const auto& d : world.devices()) note(*d);
    world_->add_observer(*this);
  }
  ~DuplicateWatch() {
    world_->remove_observer(*this);
    for (const auto& wire : wires_) wire->bus.remove_tap(*wire);
  }
  DuplicateWatch(const DuplicateWatch&) = delete;
  DuplicateWatch& operator=(const DuplicateWatch&) = delete;

  // A new Berth begins. The earlier one's questions prove nothing to it, but count for what that one brought into use.
  void berth_began() {
    for (const auto& wire : wires_) {
      if (wire->master == nullptr) wire->master_began(now());
    }
  }
  // Berth's controller delivered this frame.
  void berth_heard(const std::string& bus, const can::Frame& frame, rt::Time at) noexcept {
    for (const auto& wire : wires_) {
      if (wire->bus.name() == bus) wire->received(frame, at);
    }
  }
  // The user gave `berth replace` for the slot of this device, or of another with its address on its bus: the user
  // cannot know which of them was there.
  void replaced_by_a_person(const std::string& device) {
    for (const auto& d : world_->devices()) {
      for (const auto& same : world_->devices()) {
        const auto t = same->truth();
        const bool equal = t.bus == d->truth().bus && t.address == d->truth().address;
        if (d->name() == device && equal) replaced_.insert(t.name);
      }
    }
  }

  [[nodiscard]] const std::string& failure() const noexcept { return failure_; }
  // A gateway's master has written the node-ID into the device's memory and read the device's identity under it, while
  // no other device used it: nothing prevents that master from confirming the device.
  [[nodiscard]] bool is_confirmed(const std::string& device) const {
    const auto it = lives_.find(device);
    return it != lives_.end() && it->second.confirmed;
  }
  // The node-ID that Berth put into the device's memory; unconfigured: none.
  [[nodiscard]] NodeId owned(const std::string& device) const {
    const auto it = lives_.find(device);
    return it == lives_.end() ? NodeId() : it->second.owned;
  }
  // The slot of this node-ID was rightly given away although the device has the node-ID by Berth: the user did so, or
  // the machine file has `replacement = "auto"` and the device was silent. `held` judges whether it really was.
  [[nodiscard]] bool given_up(const plant::Truth& t, NodeId id) const {
    return replaced_.contains(t.name) || cleared_automatically(t, id) || left_its_slot(t, id);
  }
  // The device has power and uses a node-ID that no master has activated since power-on: it came with it from
  // elsewhere, or its slot was given away during its absence. No master can prevent that before the device boots.
  [[nodiscard]] bool came_by_itself(const plant::SimDevice& device) const {
    const auto it = lives_.find(device.name());
    if (it == lives_.end()) return false;
    const Life& life = it->second;
    const auto t = device.truth();
    const bool brought = life.came_with == t.active && life.given != t.active;
    return brought && (life.owned != t.active || given_up(t, t.active));
  }

 private:
  struct Life {
    bool powered = false;
    bool booting = false;
    rt::Time boot_began{};
    NodeId came_with;  // memory at power-on
    rt::Time on_since{};
    NodeId active;
    NodeId last_used;  // since power-on
    NodeId pending;
    NodeId given;  // pending by Berth's 11h
    NodeId persistent;
    NodeId owned;         // in memory by Berth's 17h
    bool seated = false;  // a gateway's master read its identity under that node-ID
    rt::Time seated_at{};
    bool confirmed = false;    // `seated`, and no other device used it
    std::uint64_t writes = 0;  // completed
  };

  // The frames on one bus that count as a question to a node-ID, or as a device's message under it.
  struct Wire final : can::Tap, private can::Handler {
    struct Asked {
      rt::Time first{}, last{};
      rt::Time identity{};  // 1018h:01, the first question to a device that got a node-ID
      bool over = false;    // ended by guarding, which follows when 1000h stays unanswered
    };
    struct Said {
      std::uint32_t key = 0;
      rt::Time at{};
      std::string who;
      bool identifies = false;  // reports 1018h:04, the last question to a device that got a node-ID
    };
    Wire(DuplicateWatch& watch, sim::Bus& on, const design::Bus& described) : watch_(&watch), bus(on), plan(described) {
      for (const auto& d : watch.world_->devices()) {
        if (&d->bus() != &bus) continue;
        devices.push_back(d.get());
        if (!described.own_port && d->plan().does.master) master = d.get();
      }
      if (master == nullptr) return;
      // Identifiers that the master receives anyway: listening to them adds no frame to its receive buffer.
      auto& ears = *static_cast<plant::GatewaySide&>(*master).inside().dispatcher;
      for (const std::uint32_t function : {0x080U, 0x580U, 0x700U})
        ears.add(can::IdRange{function + 1, function + 127}, *this);
    }
    // The bus's master begins anew.
    void master_began(rt::Time now) {
      asked_before = std::exchange(asked, {});
      began = now;
    }
    void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
      const std::uint32_t key = frame.key();
      if (key == lss::master_cob_id) {
        note_hearing(frame);
        if (frame.data[0] == static_cast<std::uint8_t>(lss::Command::configure_node_id)) {
          configured = frame.data[1];
          configured_at = at;
          told_at[configured & 0xFFU] = at;
        }
        if (frame.data[0] == 0x04 && frame.data[1] == 0x00) moved.push_back(at);
      } else if (key == 0x000) {
        moved.push_back(at);
      } else if (asks(frame, sender)) {
        Asked& a = asked[key & 0x7FU];
        const bool anew = a.last == rt::Time{} || a.over;
        if (anew || at - a.last > longest_wait()) a.first = at;
        a.last = at;
        a.over = false;
        if (frame.data[1] == 0x18 && frame.data[2] == 0x10 && frame.data[3] == 0x01) a.identity = at;
      } else if (frame.remote && (key & ~0x7FU) == 0x700) {
        asked[key & 0x7FU].over = true;
      }
      const std::uint32_t function = key & ~0x7FU;
      if (frame.remote || (function != 0x080 && function != 0x580 && function != 0x700) || (key & 0x7FU) == 0) return;
      const std::string who = name_of(*this, sender);
      if (who.empty()) return;
      const bool identifies =
          function == 0x580 && frame.data[1] == 0x18 && frame.data[2] == 0x10 && frame.data[3] == 0x04;
      said = {key, at, who, identifies};
      if (master != nullptr) {
        on_the_way.push_back(said);
        if (on_the_way.size() > most_on_the_way) on_the_way.pop_front();
      } else if (heard_key == key && heard_at == at) {
        note_heard(said, at);
      }
    }
    // Berth's own reception, or that of a gateway's master, whose firmware handles a frame when it has time.
    void received(const can::Frame& frame, rt::Time at) noexcept override {
      if (master != nullptr) {
        const auto it =
            std::ranges::find_if(on_the_way, [&](const Said& s) { return s.key == frame.key() && s.at == at; });
        if (it != on_the_way.end()) note_heard(*it, watch_->now());
        return;
      }
      heard_key = frame.key();
      heard_at = at;
      if (said.key == heard_key && said.at == at) note_heard(said, at);
    }
    void note_heard(const Said& what, rt::Time at) {
      auto& times = voices[{what.who, what.key & 0x7FU}];
      if (times.size() == most_voices) times.erase(times.begin(), times.begin() + most_voices / 2);
      times.push_back(at);
      if (master == nullptr || (what.key & ~0x7FU) != 0x580) return;
      const NodeId id(static_cast<std::uint8_t>(what.key & 0x7FU));
      watch_->answered_beside(*this, what.who, id);
      if (what.identifies) watch_->seated(*this, what.who, id);
    }
    // Berth asks for 1000h. A gateway's master is the only SDO client of its bus: each of its uploads asks who is
    // there.
    [[nodiscard]] bool asks(const can::Frame& frame, int sender) const noexcept {
      if ((frame.key() & ~0x7FU) != 0x600 || frame.data[0] != 0x40) return false;
      if (master != nullptr) return master->controller().number() == sender;
      return frame.data[1] == 0x00 && frame.data[2] == 0x10;
    }
    // The longest time between two questions of one series.
    [[nodiscard]] rt::Duration longest_wait() const noexcept {
      constexpr auto of_a_gateway = std::chrono::milliseconds(100);  // `NodeIdAssigner::sdo_timeout`
      const rt::Duration timeout =
          master != nullptr ? rt::Duration(of_a_gateway) : rt::Duration(plan.timing.sdo_timeout);
      return timeout + std::chrono::milliseconds(100);
    }
    // Notes the devices that received no frame between Berth's last `04 00` and its `11h`.
    void note_hearing(const can::Frame& frame) noexcept {
      if (frame.data[0] == static_cast<std::uint8_t>(lss::Command::configure_node_id)) {
        deaf.clear();
        for (const auto& [name, count] : received_last) {
          if (count == received_at_waiting[name]) deaf.insert(name);
        }
      }
      received_last.clear();
      for (auto* const d : devices) received_last[d->name()] = d->host().delivered();
      if (frame.data[0] == 0x04 && frame.data[1] == 0x00) received_at_waiting = received_last;
    }
    // Did a frame of this device under this node-ID reach Berth from `from` on, before `until`?
    [[nodiscard]] bool heard(const std::string& who, NodeId id, rt::Time from, rt::Time until) const {
      const auto it = voices.find({who, id.value()});
      return it != voices.end() &&
             std::ranges::any_of(it->second, [&](rt::Time at) { return at >= from && at < until; });
    }
    // The last frame that could bring a node-ID into use, at `when` or before.
    [[nodiscard]] rt::Time moved_before(rt::Time when) const {
      for (auto it = moved.rbegin(); it != moved.rend(); ++it) {
        if (*it <= when) return *it;
      }
      return {};
    }
    // When the sender of a frame at `when` asked for this node-ID, in its last series of questions; null: it did not.
    [[nodiscard]] const Asked* asked_by(rt::Time when, NodeId id) const {
      const auto& questions = when < began ? asked_before : asked;
      const auto it = questions.find(id.value());
      return it == questions.end() ? nullptr : &it->second;
    }
    // A frame that Berth receives this long before its own frame is on the wire may still have come after Berth gave
    // that to its controller: two of the longest frames.
    [[nodiscard]] rt::Duration margin() const {
      return rt::Duration(320 * std::int64_t{1'000'000'000} / plan.bitrate) + std::chrono::milliseconds(1);
    }

    DuplicateWatch* watch_;
    sim::Bus& bus;
    const design::Bus& plan;
    std::vector<plant::SimDevice*> devices{};
    plant::SimDevice* master = nullptr;  // the gateway's own node; null: Berth has a port here
    static constexpr std::size_t most_on_the_way = 256;
    std::deque<Said> on_the_way;             // frames to the gateway's master
    std::map<unsigned, Asked> asked;         // by node-ID: this Berth's last series of questions
    std::map<unsigned, Asked> asked_before;  // those of the Berth before it
    rt::Time began{};                        // of this Berth
    static constexpr std::size_t most_voices = 512;
    std::map<std::pair<std::string, unsigned>, std::vector<rt::Time>> voices;  // by device, node-ID: what reached Berth
    std::vector<rt::Time> moved;
    std::map<std::string, std::uint64_t> received_at_waiting, received_last;
    std::set<std::string> deaf;  // received nothing of the proof before the last 11h
    unsigned configured = 0;
    rt::Time configured_at{};
    std::array<rt::Time, 256> told_at{};  // by node-ID: the last 11h with it
    Said said;
    std::uint32_t heard_key = 0;
    rt::Time heard_at{};
  };

  [[nodiscard]] Wire* wire_of(const std::string& bus) const {
    for (const auto& wire : wires_) {
      if (wire->bus.name() == bus) return wire.get();
    }
    return nullptr;
  }
  // Empty also for a gateway's own master: its frames do not show who is there.
  [[nodiscard]] static std::string name_of(const Wire& wire, int sender) {
    for (auto* const d : wire.devices) {
      if (d != wire.master && d->controller().number() == sender) return d->name();
    }
    return {};
  }
  // A gateway's master read this device's identity under this node-ID. If another device answered the same questions,
  // the master cannot know which one it heard, and keeps waiting for the device that it assigned the node-ID. It knows
  // nothing of another device that is bus-off, or whose answers do not reach it.
  void seated(const Wire& wire, const std::string& device, NodeId id) {
    Life& life = lives_[device];
    if (life.owned != id) return;
    const auto* const asked = wire.asked_by(now(), id);
    const bool alone =
        asked != nullptr && std::ranges::none_of(wire.devices, [&](const plant::SimDevice* other) {
          return other->name() != device && wire.heard(other->name(), id, asked->identity, rt::Time::max());
        });
    if (alone && !life.seated) life.seated_at = now();
    life.seated = life.seated || alone;
    const bool only = std::ranges::none_of(wire.devices, [&](const plant::SimDevice* other) {
      const auto t = other->truth();
      return t.powered && t.active == id && t.name != device;
    });
    life.confirmed = life.confirmed || only;
  }
  // An answer after that of the identified device, and before any other question, is a second answer to the last
  // question.
  void answered_beside(const Wire& wire, const std::string& device, NodeId id) {
    const auto* const asked = wire.asked_by(now(), id);
    for (const auto* const other : wire.devices) {
      Life& life = lives_[other->name()];
      const bool to_the_same = life.seated && life.owned == id && asked != nullptr && asked->last <= life.seated_at;
      if (other->name() != device && to_the_same) life.seated = false;
    }
  }
  [[nodiscard]] rt::Time now() const { return world_->executor().now(); }
  void fail_with(const std::string& text) {
    if (failure_.empty()) failure_ = text;
  }

  void note(const plant::SimDevice& device) {
    const auto t = device.truth();
    Life& life = lives_[t.name];
    life.persistent = t.persistent;
    life.writes = t.memory_written;
    life.powered = t.powered;
    life.booting = t.booting;
    life.pending = t.pending;
    life.active = t.active;
    life.came_with = t.persistent;
  }

  void plant_changed(const plant::SimDevice& device) noexcept override {
    const auto t = device.truth();
    Life& life = lives_[t.name];
    Wire* const wire = wire_of(t.bus);
    if (wire == nullptr) return;
    const bool begins = &device == wire->master && t.powered && (!life.powered || (t.booting && !life.booting));
    if (begins) wire->master_began(now());
    const bool on = t.powered && !life.powered;
    const bool off = !t.powered && life.powered;
    if (on || off) {
      life.given = life.last_used = NodeId();
      life.pending = t.pending;
    }
    if (on) life.came_with = t.persistent;
    if (on) life.on_since = now();
    // A memory rewritten with the device's own node-ID is Berth's work too, by LSS or configuration. A write that a
    // reset or a loss of power interrupts leaves the old content.
    const bool storing = device.device().stored().storing();
    const bool written = t.persistent != life.persistent || (t.memory_written != life.writes && !storing);
    // A device that comes with a slot's node-ID while the slot's device saves its configuration (1010h) receives that
    // command, too, and saves the node-ID that it came with. Since its power-on no 11h had that node-ID, so Berth gave
    // it nothing.
    const bool as_it_came = t.persistent == life.came_with && wire->told_at[t.persistent.value()] < life.on_since;
    // A write that was under way when the power went says nothing: an interrupted blanking leaves the old content. No
    // master gives what the switches set.
    const bool gets = written && !as_it_came && !has_switches(t) && !off && t.persistent.configured() &&
                      t.pending == t.persistent && life.owned != t.persistent;
    if (t.persistent != life.persistent) life.owned = NodeId();
    if (t.persistent != life.persistent) life.seated = life.confirmed = false;
    if (written && !off && t.persistent.configured() && t.pending == t.persistent && !has_switches(t))
      life.owned = t.persistent;
    if (written) life.writes = t.memory_written;
    life.persistent = t.persistent;
    if (t.booting && !life.booting) life.boot_began = now();
    const bool configures = t.powered && t.pending != life.pending && t.pending.value() == wire->configured &&
                            now() - wire->configured_at < std::chrono::seconds(1);
    if (t.pending != life.pending) life.given = configures && t.pending.configured() ? t.pending : NodeId();
    const bool gives = t.pending != life.pending && life.given.configured() && life.given != t.active;
    const bool woke = t.powered && !t.booting && t.active.configured() && t.active != life.active;
    life.powered = t.powered;
    life.booting = t.booting;
    life.pending = t.pending;
    life.active = t.active;
    if (!failure_.empty()) return;
    if (gives) given(t, t.pending, *wire);
    if (gets) given(t, t.persistent, *wire);
    if (woke) in_use(t, life, *wire);
    if (t.active.configured()) life.last_used = t.active;
  }

  // Berth takes devices with one LSS address for one device until they answer at once: those states are judged at the
  // end. A device with a node-ID that nobody can change is known by that.
  [[nodiscard]] bool others(const plant::Truth& a, const plant::Truth& b) const {
    const bool apart = a.address != b.address || has_switches(a) != has_switches(b);
    return a.name != b.name && a.bus == b.bus && apart;
  }
  [[nodiscard]] bool has_switches(const plant::Truth& t) const {
    return world_->find(t.name)->plan().source == plant::NodeIdSource::switches;
  }

  void given(const plant::Truth& t, NodeId id, const Wire& wire) {
    const std::string what = "Berth gave node-ID " + std::to_string(id.value()) + " to " + t.name;
    // Its own node-ID, left in place by an interrupted memory write, was not given.
    if (id == wire.plan.master && id != lives_[t.name].came_with) fail_with(what + ", and it is the master's");
    for (const auto& other : world_->devices()) {
      const auto o = other->truth();
      if (!others(t, o)) continue;
      const Life& life = lives_[o.name];
      // A device that takes a node-ID only at power-on never uses a pending one: the power-off clears that, unless it
      // is stored.
      const bool comes = !other->plan().storing.power_cycle_after;
      // A stored node-ID is also pending until the next power-on; its slot may have been given away by then.
      const bool kept_rightly = life.owned == id && given_up(o, id);
      const bool unheard = wire.deaf.contains(o.name) || wire.deaf.contains(t.name);
      if (comes && o.powered && life.given == id && o.pending == id && !kept_rightly && !unheard) {
        fail_with(what + " while it is pending, by Berth, in " + o.name);
      } else if (life.owned == id && !given_up(o, id)) {
        fail_with(what + ", and it stands, by Berth, in the memory of " + o.name +
                  (o.powered ? "" : ", which is away"));
      }
    }
  }

  void in_use(const plant::Truth& t, const Life& life, const Wire& wire) {
    const NodeId id = t.active;
    // The device booted again with the node-ID that it used: devices that took this node-ID meanwhile were judged then.
    if (life.last_used == id) return;
    const bool brought = life.came_with == id && life.given != id;
    const bool clone = std::ranges::count_if(world_->devices(), [&](const auto& d) {
                         return d->truth().bus == t.bus && d->truth().address == t.address;
                       }) > 1;
    if (brought && life.owned != id && !clone && was_blanked(t)) {
      fail_with(t.name + " came back with node-ID " + std::to_string(id.value()) + ", which Berth took away from it");
    }
    // The device came with it from elsewhere, was off when Berth asked for it, and Berth never changed it; or it has it
    // by Berth and its slot was given away, which `given` has judged. `EndJudge` judges the rest.
    if (brought) return;
    for (const auto& other : world_->devices()) {
      const auto o = other->truth();
      if (!others(t, o) || !o.powered || o.booting || o.active != id) continue;
      const std::string what =
          "Berth gave node-ID " + std::to_string(id.value()) + " to " + t.name + " while " + o.name;
      const rt::Time moved = wire.moved_before(life.boot_began);
      const auto* const asked = wire.asked_by(moved, id);
      if (asked == nullptr) {
        fail_with(what + " holds it, and did not ask who has it");
        continue;
      }
      // The holder came from elsewhere, or sat here and was given up. It is excused if nothing of it reached Berth
      // between the question for the node-ID and the frame that activated it: off, cut off, deaf, or its frames were
      // lost.
      if (wire.heard(o.name, id, asked->first, moved - wire.margin())) fail_with(what + " was heard to have it");
    }
  }

  // The device's memory still has the node-ID that the store notes as taken away, and nothing was asked of it since.
  [[nodiscard]] bool was_blanked(const plant::Truth& t) const {
    if (store_ == nullptr) return false;
    const auto lines = store_->history_of({Identity(t.address).with(t.active), {machine_->name, t.bus}});
    if (!lines) return false;
    bool blanked = false;
    for (const auto& line : *lines) {
      if (line.event == "blanked") blanked = true;
      if (line.event == "asked") blanked = false;
    }
    return blanked;
  }

  [[nodiscard]] bool cleared_automatically(const plant::Truth& t, NodeId id) const {
    const design::Slot* const slot = machine_->slot(t.bus, id);
    if (store_ == nullptr || slot == nullptr || slot->spec.replacement != places::Replacement::automatic) return false;
    const auto lines = store_->history_of({Identity(t.address).with(id), {machine_->name, t.bus}});
    if (!lines) return false;
    bool confirmed = false;
    bool cleared = false;
    for (const auto& line : *lines) {
      if (line.event == "confirmed") confirmed = line.id == id;
      if (line.event == "asked" && line.id == id) cleared = false;
      // Only a device that was confirmed in the slot can be missed there; an intention is no seat.
      if (line.event == "cleared") cleared = confirmed;
    }
    return cleared;
  }

  // Beneath a gateway no user gives slots away. If a device identified itself to its master under the node-ID from that
  // master, and is silent now, a replacement gets its slot. A device that got a node-ID and did not come that far keeps
  // its slot: the master still waits for it.
  [[nodiscard]] bool left_its_slot(const plant::Truth& t, NodeId id) const {
    const Wire* const wire = wire_of(t.bus);
    const auto it = lives_.find(t.name);
    return wire != nullptr && wire->master != nullptr && it != lives_.end() && it->second.owned == id &&
           it->second.seated;
  }

  plant::World* world_;
  const design::Machine* machine_;
  places::SlotStore* store_;
  std::vector<std::unique_ptr<Wire>> wires_;
  std::map<std::string, Life> lives_;
  std::set<std::string> replaced_;
  std::string failure_;
};

// Between Berth and its controller: reports to the watch what Berth really received.
class HeardPort final : public can::Port, private can::Listener {
 public:
  HeardPort(DuplicateWatch& watch, std::string bus, can::Port& beneath)
      : watch_(&watch), bus_(std::move(bus)), beneath_(&beneath) {}

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override { return beneath_->send(frame, tag); }
  void withdraw(std::uint32_t tag) noexcept override { beneath_->withdraw(tag); }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    beneath_->listen(this, accept);
  }
  [[nodiscard]] can::Status status() const noexcept override { return beneath_->status(); }
  bool restart(std::uint32_t bit_rate) noexcept override { return beneath_->restart(bit_rate); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override {
    watch_->berth_heard(bus_, frame, at);
    if (listener_ != nullptr) listener_->received(frame, at);
  }
  void sent(std::uint32_t tag, rt::Time at) noexcept override {
    if (listener_ != nullptr) listener_->sent(tag, at);
  }
  void changed(const can::Status& status, rt::Time at) noexcept override {
    if (listener_ != nullptr) listener_->changed(status, at);
  }
  DuplicateWatch* watch_;
  std::string bus_;
  can::Port* beneath_;
  can::Listener* listener_ = nullptr;
};

}  // namespace berth::harness
