#include "berth/linker/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <tuple>

#include "berth/linker/can_ids_parts.hpp"
#include "berth/linker/crossing_parts.hpp"
#include "berth/linker/timing_parts.hpp"

namespace berth::linker {
namespace {

using co::PdoKind;

unsigned free_pdos(const std::vector<DevicePdo>& pdos) {
  return static_cast<unsigned>(std::ranges::count_if(pdos, &DevicePdos::free));
}

class LinkPlanMaker {
 public:
  LinkPlanMaker(const LinkNetwork& network, const Earlier& earlier) : network_(network), earlier_(earlier) {
    for (const Node& node : network.nodes) devices_.push_back(node.file ? pdos_of(node) : DevicePdos{});
  }

  Planned run() {
    Resolved resolved = resolve(network_, devices_, earlier_, made_.findings);
    made_.plan.routes = cross(network_, resolved, earlier_, made_.findings);
    signals_ = std::move(resolved.signals);
    made_.plan.variables = std::move(resolved.variables);
    made_.plan.linked = std::move(resolved.linked);
    refuse_without_sync();
    const Packed packed = pack(network_, devices_, signals_, earlier_);
    for (const std::size_t signal : packed.left) refuse_left(signal);
    // The predefined CAN-IDs first; if a deadline is missed with them, new PDOs get theirs in the order of deadlines.
    Findings late;
    if (!try_numbers(packed, false, late)) {
      Findings still;
      Plan first = made_.plan;
      if (try_numbers(packed, true, still)) {
        late.clear();
      } else {
        made_.plan = std::move(first);
      }
    }
    finish_crossings(network_, made_.plan);
    std::ranges::move(late, std::back_inserter(made_.findings));
    std::ranges::sort(made_.findings, [](const Finding& a, const Finding& b) {
      return std::tie(a.line, a.column, a.key, a.message) < std::tie(b.line, b.column, b.key, b.message);
    });
    const auto same = std::ranges::unique(made_.findings);
    made_.findings.erase(same.begin(), same.end());
    return std::move(made_);
  }

 private:
  bool try_numbers(const Packed& packed, bool by_deadline, Findings& findings) {
    Numbered numbered = number(network_, devices_, signals_, made_.plan.linked, packed, earlier_, by_deadline);
    for (const std::size_t signal : numbered.left) {
      refuse(signal, findings, fmt::format("no CAN-ID is left on {}", bus_of(signal).name),
             "split the bus, or link fewer objects");
    }
    made_.plan.pdos = std::move(numbered.pdos);
    refuse_without_rpdo(findings);
    choose_types();
    return set_times(network_, devices_, signals_, made_.plan.linked, made_.plan, findings) && findings.empty();
  }

  const Bus& bus_of(std::size_t signal) const { return network_.buses[network_.nodes[signals_[signal].producer].bus]; }

  void refuse(std::size_t signal, Findings& findings, const std::string& message, const std::string& fix) const {
    for (const std::size_t link : signals_[signal].links) {
      findings.push_back(refusal(network_, link, message, fix));
    }
  }

  void refuse_without_sync() {
    std::vector<Signal> kept;
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      const bool needs = signals_[i].transmission <= 240;
      if (needs && bus_of(i).sync == rt::Duration(0)) {
        refuse(i, made_.findings, fmt::format("nothing on {} produces SYNC, which this link waits for", bus_of(i).name),
               "write [bus.NAME.sync], or set 1005h bit 30 and 1006h in the config of one device, or transmission = "
               "\"event\"");
      } else {
        kept.push_back(signals_[i]);
      }
    }
    signals_ = std::move(kept);
  }

  /// Reports whose PDOs are too few for a signal.
  void refuse_left(std::size_t at) {
    const Signal& signal = signals_[at];
    const Node& producer = network_.nodes[signal.producer];
    const DevicePdos& device = devices_[signal.producer];
    const unsigned tpdos = free_pdos(device.tpdos);
    if (tpdos == 0 && std::ranges::none_of(device.tpdos, &DevicePdo::fixed_mapping)) {
      return refuse(
          at, made_.findings,
          fmt::format("{} has no TPDO that the linker may set ({} in all)", producer.name, device.tpdos.size()),
          "take PDO settings out of its config, or use another device");
    }
    if (tpdos == 0) return refuse_fixed(at);
    for (const Consumer& each : signal.consumers) {
      const auto& rpdos = devices_[each.node].rpdos;
      const unsigned free = free_pdos(rpdos);
      if (free == 0) {
        const bool fixed = std::ranges::any_of(rpdos, &DevicePdo::fixed_mapping);
        return refuse(
            at, made_.findings,
            fmt::format("{} has no RPDO that the linker may set ({} in all{})", network_.nodes[each.node].name,
                        rpdos.size(), fixed ? ", their mappings are fixed" : ""),
            "take PDO settings out of its config, or use another device");
      }
    }
    std::string room = fmt::format("{} has {} TPDOs for links", producer.name, tpdos);
    for (const Consumer& each : signal.consumers) {
      room += fmt::format(", {} {} RPDOs", network_.nodes[each.node].name, free_pdos(devices_[each.node].rpdos));
    }
    refuse(at, made_.findings, fmt::format("no PDO is free for it: {}, and they are full", room),
           "like deadlines and consumers let objects share a PDO; dummy mapping or MPDO of the consumer would help; or "
           "link fewer objects");
  }

  void refuse_fixed(std::size_t at) {
    const Signal& signal = signals_[at];
    refuse(at, made_.findings,
           fmt::format(
               "the TPDO mappings of {} are fixed, and none carries {:04X}h:{:02X} with this transmission to devices "
               "that can skip the rest by dummy mapping",
               network_.nodes[signal.producer].name, signal.object.index, signal.object.sub),
           "link an object that one of its TPDOs carries; consumers need [DummyUsage] for what they do not want");
  }

  /// RPDOs of a device may differ in how many entries they take.
  void refuse_without_rpdo(Findings& findings) {
    for (const Pdo& pdo : made_.plan.pdos) {
      for (const Receiver& each : pdo.receivers) {
        if (each.rpdo != 0) continue;
        for (const std::size_t link : pdo.links) {
          findings.push_back(refusal(network_, link,
                                     fmt::format("no RPDO of {} is free that takes {} mapping entries",
                                                 network_.nodes[each.node].name, each.mapping.size()),
                                     "link fewer objects to this device"));
        }
      }
    }
    std::erase_if(made_.plan.pdos, [](const Pdo& pdo) {
      return std::ranges::any_of(pdo.receivers, [](const Receiver& each) { return each.rpdo == 0; });
    });
  }

  /// For a link, FEh and FFh are equivalent: the device's value stays.
  void choose_types() {
    for (Pdo& pdo : made_.plan.pdos) {
      if (pdo.transmission >= sam_mpdo) {
        const auto type = devices_[pdo.producer].find(PdoKind::tpdo, pdo.tpdo)->type;
        pdo.transmission = type >= sam_mpdo ? type : pdo.transmission;
      }
      for (Receiver& each : pdo.receivers) {
        const DevicePdo* const rpdo = devices_[each.node].find(PdoKind::rpdo, each.rpdo);
        const bool keeps = pdo.transmission >= sam_mpdo && rpdo != nullptr && rpdo->type >= sam_mpdo;
        each.transmission = keeps ? rpdo->type : pdo.transmission;
      }
    }
  }

  const LinkNetwork& network_;
  const Earlier& earlier_;
  std::vector<DevicePdos> devices_;
  std::vector<Signal> signals_;
  Planned made_;
};

}  // namespace

unsigned Pdo::bytes() const noexcept {
  if (mpdo) return 8;
  unsigned bits = 0;
  for (const Carried& each : carried) bits += each.bits;
  return (bits + 7) / 8;
}

Planned make_plan(const LinkNetwork& network, const Earlier& earlier) { return LinkPlanMaker(network, earlier).run(); }

Earlier earlier_of(const LinkNetwork& network, const Plan& plan) {
  Earlier made;
  for (const Variable& each : plan.variables) {
    made.variables.push_back({network.nodes[each.node].name, each.name, each.type, each.input, each.object});
  }
  for (const Pdo& pdo : plan.pdos) {
    EarlierPdo old{.producer = network.nodes[pdo.producer].name,
                   .tpdo = pdo.tpdo,
                   .can_id = pdo.can_id,
                   .mpdo = pdo.mpdo,
                   .transmission = pdo.transmission};
    for (const Carried& each : pdo.carried) old.objects.push_back(each.object);
    for (const Receiver& each : pdo.receivers) old.receivers.emplace_back(network.nodes[each.node].name, each.rpdo);
    made.pdos.push_back(std::move(old));
  }
  for (const Route& each : plan.routes) {
    made.routes.push_back({network.nodes[each.node].name, each.row, each.from, each.to, each.source, each.target,
                           network.nodes[each.producer].name, each.object});
  }
  return made;
}

}  // namespace berth::linker
