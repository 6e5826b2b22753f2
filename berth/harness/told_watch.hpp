// Checks that Berth reports nothing about a slot beneath gateways that was not asked or heard of that slot. It reads
// the frames that reach each gateway from above, on the buses and not in Berth:
//
//   asked   1F82h of the master of the slot's own bus, through the gateway above it (5F30h to 5F32h of that port); the
//           last answer must show what is reported
//   heard   EMCY 8130h on the bus at the top, with a path that leads to this slot alone. If the slot is a gateway's,
//           the loss must be its own: the layout may have cut the path of a node beneath it down to this one. Any other
//           EMCY reported of the slot was sent by its own node, on its own bus
//   silent  a gateway on the way: an access to one was aborted, or timed out, since the slot's last answer; or Berth
//           itself is off the bus: it sent no frame for longer than its heartbeat's period
//
// A duplicate node-ID of a slot is reported only if two devices have used it at one time.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "berth/design/machine.hpp"
#include "berth/network/network_requests.hpp"
#include "berth/operate/report.hpp"
#include "berth/plant/sim_gateway.hpp"
#include "berth/plant/world.hpp"

namespace berth::harness {

class ToldWatch final : private plant::World::Observer {
 public:
  // Both must outlive this.
  ToldWatch(plant::World& world, const design::Machine& machine) : world_(&world), machine_(&machine) {
    for (const auto* const bus : machine.all_buses()) {
      sim::Bus* const on = world.bus(bus->name);
      if (on == nullptr) continue;
      wires_.push_back(std::make_unique<Wire>(*this, *on));
      for (const auto& d : world.devices()) {
        if (&d->bus() == on) wires_.back()->devices.push_back(d->controller().number());
      }
      on->add_tap(*wires_.back());
    }
    world.add_observer(*this);
  }
  ~ToldWatch() {
    world_->remove_observer(*this);
    for (const auto& wire : wires_) wire->bus.remove_tap(*wire);
  }
  ToldWatch(const ToldWatch&) = delete;
  ToldWatch& operator=(const ToldWatch&) = delete;

  // The next Berth must ask for everything that the earlier one knew.
  void berth_began() {
    known_.clear();
    troubled_.clear();
  }
  // Judges an event that Berth reports now. Empty: nothing is wrong.
  [[nodiscard]] std::string judge(const operate::Event& event) const {
    const design::Slot* const slot = machine_->slot(event.slot);
    const design::Bus* const bus = slot == nullptr ? nullptr : machine_->bus(slot->spec.name.bus);
    if (bus == nullptr || bus->own_port) return {};
    std::string why;
    if (event.kind == operate::EventKind::state) why = wrong_state(*bus, slot->spec.id, event.text);
    if (event.kind == operate::EventKind::error) why = wrong_emergency(*bus, slot->spec.id, event.text);
    if (why.empty()) return {};
    return fmt::format("slot {} was told \"{}\": {}\n", event.slot, event.text, why);
  }

 private:
  using Node = std::pair<std::string, unsigned>;  // bus, node-ID

  // The answers of the bus's master to 1F82h. Berth asks for several reasons at a time, and may report an answer only
  // after it has asked for the next slot, too.
  struct Known {
    struct Answer {
      std::uint8_t state = 0;
      rt::Time at{};
    };
    std::deque<Answer> answers{};  // those of the last second, and the last one
    rt::Time lost{};               // EMCY 8130h
    [[nodiscard]] rt::Time at() const { return answers.empty() ? rt::Time{} : answers.back().at; }
    void note(Answer answer) {
      while (!answers.empty() && answer.at - answers.front().at > std::chrono::seconds(1)) answers.pop_front();
      answers.push_back(answer);
    }
    template <class Fits>
    [[nodiscard]] bool said(const Fits& fits, rt::Time since = {}) const {
      return std::ranges::any_of(answers, [&](const Answer& a) { return a.at >= since && fits(a.state); });
    }
    [[nodiscard]] bool is_lost() const { return lost != rt::Time{} && lost >= at(); }
  };

  // The accesses through a gateway's ports, as seen on the bus above it.
  struct Port {
    unsigned node = 0;                   // 5F30h
    std::optional<unsigned> asked_of{};  // sub-index of 1F82h
  };

  struct Wire final : can::Tap {
    Wire(ToldWatch& watch, sim::Bus& on) : watch_(&watch), bus(on) {}
    void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
      if (std::ranges::find(devices, sender) == devices.end()) berth_sent = at;
      watch_->frame(bus.name(), frame, at);
    }
    ToldWatch* watch_;
    sim::Bus& bus;
    std::vector<int> devices{};  // their controllers' numbers
    rt::Time berth_sent{};
  };

  [[nodiscard]] static unsigned index_of(const can::Frame& frame) noexcept {
    return frame.data[1] | unsigned{frame.data[2]} << 8U;
  }

  void frame(const std::string& bus, const can::Frame& frame, rt::Time at) noexcept {
    if (frame.extended || frame.remote || frame.size != 8) return;
    const unsigned function = frame.id & ~0x7FU, node = frame.id & 0x7FU;
    if (function == 0x080 && node != 0) emergency({bus, node}, frame, at);
    if (function == 0x580 || function == 0x600) {
      const bool aborted = frame.data[0] == 0x80;
      if (aborted) troubled_[{bus, node}] = at;
      if (function == 0x600 && !aborted) request({bus, node}, frame);
      if (function == 0x580 && !aborted) answer({bus, node}, frame, at);
    }
  }

  void request(const Node& gateway, const can::Frame& frame) {
    constexpr unsigned first = 0x5F30, last = 0x5F4F;
    const bool download = (frame.data[0] & 0xE0U) == 0x20;
    const unsigned index = index_of(frame);
    if (!download || index < first || index > last) return;
    Port& port = ports_[{gateway, 1 + (index - first) / 4}];
    const unsigned what = (index - first) % 4;
    if (what == 0) port.node = frame.data[4];
    if (what != 2) return;
    const unsigned asked = frame.data[5] | unsigned{frame.data[6]} << 8U;
    port.asked_of.reset();
    if (frame.data[4] == 0x40 && asked == 0x1F82) port.asked_of = frame.data[7];
  }

  void answer(const Node& gateway, const can::Frame& frame, rt::Time at) {
    constexpr unsigned first = 0x5F30, last = 0x5F4F;
    const bool upload = (frame.data[0] & 0xE2U) == 0x42;
    const unsigned index = index_of(frame);
    if (!upload || index < first || index > last || (index - first) % 4 != 1) return;
    const unsigned number = 1 + (index - first) / 4;
    Port& port = ports_[{gateway, number}];
    const design::Bus* const beneath = beneath_of(gateway, number);
    if (!port.asked_of || beneath == nullptr || port.node != beneath->master.value()) return;
    known_[{beneath->name, *port.asked_of}].note({frame.data[4], at});
  }

  void emergency(const Node& sender, const can::Frame& frame, rt::Time at) {
    const unsigned code = frame.data[0] | unsigned{frame.data[1]} << 8U;
    sent_.insert({sender, code});
    if (code != 0x8130 || !machine_->bus(sender.first)->own_port) return;
    std::vector<std::string> buses{sender.first};  // that the path leads to
    unsigned node = sender.second;
    for (std::size_t place = 3; place <= 5 && frame.data[place] != 0; ++place) {  // Figure 8
      buses = beneath_of(buses, node);
      node = frame.data[place];
    }
    std::erase_if(buses, [&](const std::string& bus) { return !has_slot(bus, node); });
    if (buses.size() != 1) return;
    const bool its_own = beneath_of(buses, node).empty() || is_missed(buses.front(), node);
    if (its_own) known_[{buses.front(), node}].lost = at;
  }

  // True: the gateway's own master of this bus misses the node.
  [[nodiscard]] bool is_missed(const std::string& bus, unsigned node) const {
    for (const auto& d : world_->devices()) {
      auto* const manager = static_cast<plant::GatewaySide&>(*d).inside().manager;
      if (manager == nullptr || d->bus().name() != bus) continue;
      const auto state = network::NetworkRequests(manager->network()).state(static_cast<std::uint8_t>(node));
      return state && *state <= 1;
    }
    return true;  // Berth's own bus
  }
  [[nodiscard]] bool has_slot(const std::string& bus, unsigned node) const {
    return machine_->slot(bus, NodeId(static_cast<std::uint8_t>(node & 0x7FU))) != nullptr;
  }
  // The buses beneath the gateways with this node-ID on those buses.
  [[nodiscard]] std::vector<std::string> beneath_of(const std::vector<std::string>& above, unsigned node) const {
    std::vector<std::string> buses;
    for (const auto& line : machine_->beneath) {
      const bool under = std::ranges::find(above, line.gateway->bus) != above.end();
      if (under && line.gateway->slot.value() == node) buses.push_back(line.name);
    }
    return buses;
  }

  [[nodiscard]] const design::Bus* beneath_of(const Node& gateway, unsigned port) const {
    for (const auto& line : machine_->beneath) {
      const bool there = line.gateway->bus == gateway.first && line.gateway->slot.value() == gateway.second;
      if (there && line.gateway->port == port) return &line;
    }
    return nullptr;
  }

  void plant_changed(const plant::SimDevice&) noexcept override {
    for (const auto& [one, other] : world_->duplicates()) {
      const auto t = one->truth();
      doubled_.insert({t.bus, t.active.value()});
    }
  }

  // ---- what is reported ----

  [[nodiscard]] std::string wrong_state(const design::Bus& bus, NodeId id, const std::string& text) const {
    const auto it = known_.find({bus.name, id.value()});
    const Known known = it == known_.end() ? Known{} : it->second;
    const auto said = [&](std::uint8_t state, rt::Time since = {}) {
      return known.said([state](std::uint8_t s) { return s == state; }, since);
    };
    const bool missing = known.said([](std::uint8_t s) { return s <= 1; });
    bool good = false;
    if (text.starts_with("operational")) {
      good = said(5, known.lost);
    } else if (text.starts_with("present")) {
      good = said(4) || said(127);
    } else if (text.starts_with("duplicate")) {
      good = doubled_.contains({bus.name, id.value()});
    } else if (text.find(" above does not ") != std::string::npos) {
      good = silent(bus, known.at() - std::chrono::seconds(1));
    } else if (text.starts_with("absent")) {
      good = missing || known.is_lost();
    } else {
      good = missing;
    }
    if (good) return {};
    if (known.answers.empty()) return "nothing was asked of it";
    return fmt::format("the last answer of its bus's master, at {:.3f} s, was {}{}", seconds(known.at()),
                       known.answers.back().state, known.is_lost() ? ", and then its loss was heard" : "");
  }

  [[nodiscard]] static double seconds(rt::Time at) {
    return std::chrono::duration<double>(at.time_since_epoch()).count();
  }

  // Has an access to one of the gateways on the way failed since then?
  [[nodiscard]] bool silent(const design::Bus& bus, rt::Time since) const {
    const design::Bus* at = &bus;
    for (; at != nullptr && !at->own_port; at = machine_->bus(at->gateway->bus)) {
      const auto it = troubled_.find({at->gateway->bus, at->gateway->slot.value()});
      if (it != troubled_.end() && it->second >= since) return true;
    }
    const auto top = std::ranges::find_if(wires_, [&](const auto& wire) { return wire->bus.name() == at->name; });
    return world_->executor().now() - (*top)->berth_sent > at->timing.heartbeat_period;
  }

  [[nodiscard]] std::string wrong_emergency(const design::Bus& bus, NodeId id, const std::string& text) const {
    const auto colon = text.find(": ");
    if (!text.starts_with("EMCY ") || colon == std::string::npos) return {};
    constexpr std::string_view gone = "error ";
    auto words = std::string_view(text).substr(colon + 2);
    if (words.starts_with(gone)) words.remove_prefix(gone.size());
    const auto code = static_cast<unsigned>(std::strtoul(std::string(words.substr(0, 4)).c_str(), nullptr, 16));
    constexpr unsigned of_gateways = 0xFF00;
    if (code >= of_gateways || sent_.contains({{bus.name, id.value()}, code})) return {};
    return fmt::format("its node has not sent {:04X}h", code);
  }

  plant::World* world_;
  const design::Machine* machine_;
  std::vector<std::unique_ptr<Wire>> wires_;
  std::map<std::pair<Node, unsigned>, Port> ports_;  // by gateway and port
  std::map<Node, Known> known_;                      // by the slot's node-ID
  std::map<Node, rt::Time> troubled_;                // gateways
  std::set<std::pair<Node, unsigned>> sent_;         // EMCYs
  std::set<Node> doubled_;
};

}  // namespace berth::harness
