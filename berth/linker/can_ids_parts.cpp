#include "berth/linker/can_ids_parts.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <tuple>

namespace berth::linker {
namespace {

using co::PdoKind;

constexpr unsigned first_pool = 0x181;
constexpr unsigned last_pool = 0x57F;
constexpr unsigned first_low = 0x680;  // after the SDO channels; most are free (CiA 301 §7.3.5)
constexpr unsigned last_low = 0x6DF;
constexpr unsigned predefined_pdos = 4;

constexpr unsigned tpdo_id(unsigned number, NodeId id) noexcept { return 0x80U + number * 0x100U + id.value(); }
constexpr unsigned rpdo_id(unsigned number, NodeId id) noexcept { return 0x100U + number * 0x100U + id.value(); }

/// A CAN-ID that a PDO may have, and that CiA 301 §7.3.5 gives to no other service.
constexpr bool for_pdos(unsigned id) noexcept {
  return (id >= first_pool && id <= last_pool && (id & 0x7FU) != 0) || (id >= first_low && id <= last_low);
}

class Numbering {
 public:
  Numbering(const LinkNetwork& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals,
            const std::vector<bool>& linked, const Packed& packed)
      : network_(network), devices_(devices), signals_(signals), linked_(linked), bins_(packed.bins) {
    taken_.resize(network.buses.size());
    inhabited_.resize(network.buses.size());
    used_tpdos_.resize(network.nodes.size());
    used_rpdos_.resize(network.nodes.size());
    reserve();
  }

  Numbered run(const Earlier& earlier, bool by_deadline) {
    number_tpdos();
    give_ids(by_deadline);
    for (Bin& bin : bins_) {
      if (bin.tpdo != 0 && bin.can_id != 0) {
        made_.pdos.push_back(pdo_of(bin));
      } else {
        leave(bin);
      }
    }
    std::ranges::sort(made_.pdos, [](const Pdo& a, const Pdo& b) {
      return std::tie(a.bus, a.producer, a.tpdo) < std::tie(b.bus, b.producer, b.tpdo);
    });
    number_rpdos(earlier);
    std::ranges::sort(made_.left);
    return std::move(made_);
  }

 private:
  std::size_t bus_of(const Bin& bin) const noexcept { return network_.nodes[bin.producer].bus; }

  void take(std::size_t bus, std::uint32_t can_id) { taken_[bus].insert(can_id); }

  /// CAN-IDs used by others: services, PDOs that stay, and all predefined ones of unknown devices.
  void reserve() {
    for (std::size_t i = 0; i < network_.nodes.size(); ++i) {
      const Node& node = network_.nodes[i];
      inhabited_[node.bus].insert(node.id.value());
      if (!node.file) {
        reserve_all(node.bus, node.id);
        continue;
      }
      for (const auto id : devices_[i].other_ids) take(node.bus, id);
      for (const PdoKind kind : {PdoKind::tpdo, PdoKind::rpdo}) {
        for (const DevicePdo& pdo : devices_[i].of(kind)) {
          const bool stays = !linked_[i] || pdo.kept || pdo.fixed_id;
          if (pdo.valid && stays) take(node.bus, pdo.can_id);
        }
      }
    }
    for (std::size_t bus = 0; bus < network_.buses.size(); ++bus) {
      for (const auto id : network_.buses[bus].channels) take(bus, id);
      if (!network_.buses[bus].master.configured()) continue;
      inhabited_[bus].insert(network_.buses[bus].master.value());
      reserve_all(bus, network_.buses[bus].master);
    }
  }
  void reserve_all(std::size_t bus, NodeId id) {
    for (unsigned number = 1; number <= predefined_pdos; ++number) {
      take(bus, tpdo_id(number, id));
      take(bus, rpdo_id(number, id));
    }
  }

  std::vector<Bin*> in_order() {
    std::vector<Bin*> order;
    for (Bin& bin : bins_) order.push_back(&bin);
    const auto key = [this](const Bin* bin) {
      const auto first = std::ranges::min_element(bin->items, {}, [](const Item& i) { return i.entry.object; });
      return std::tuple(bin->mpdo, deadline_of(*bin, signals_).value_or(rt::Duration::max()), bin->producer,
                        first->entry.object, bin->transmission);
    };
    std::ranges::sort(order, [&](const Bin* a, const Bin* b) { return key(a) < key(b); });
    return order;
  }

  void number_tpdos() {
    for (const Bin& bin : bins_) {
      if (bin.tpdo != 0) used_tpdos_[bin.producer].insert(bin.tpdo);
    }
    for (Bin* const bin : in_order()) {
      if (bin->tpdo != 0) continue;
      for (const DevicePdo& pdo : devices_[bin->producer].tpdos) {
        const bool long_enough = bin->mpdo || bin->items.size() <= pdo.most_entries;
        if (!DevicePdos::free(pdo) || !long_enough || used_tpdos_[bin->producer].contains(pdo.number)) continue;
        bin->tpdo = pdo.number;
        used_tpdos_[bin->producer].insert(pdo.number);
        break;
      }
    }
  }

  bool free_id(std::size_t bus, unsigned can_id) const { return !taken_[bus].contains(can_id); }
  void give(Bin& bin, unsigned can_id) {
    bin.can_id = static_cast<std::uint16_t>(can_id);
    take(bus_of(bin), can_id);
  }

  void give_ids(bool by_deadline) {
    keep_ids();
    const auto order = in_order();
    if (by_deadline) {
      for (Bin* const bin : order) give_strongest(*bin);
      return;
    }
    for (Bin* const bin : order) give_predefined(*bin);
    for (Bin* const bin : order) give_own(*bin);
    for (Bin* const bin : order) give_other(*bin, true);
    for (Bin* const bin : order) give_other(*bin, false);
  }

  /// Keeps the CAN-IDs that cannot be changed, and those of the earlier plan.
  void keep_ids() {
    for (Bin& bin : bins_) {
      const DevicePdo* const pdo = devices_[bin.producer].find(PdoKind::tpdo, bin.tpdo);
      if (pdo == nullptr || !pdo->fixed_id) continue;
      const bool base = pdo->valid && pdo->can_id <= 0x7FF;
      bin.can_id = base ? static_cast<std::uint16_t>(pdo->can_id) : 0;
      if (!base) bin.tpdo = 0;
    }
    for (Bin& bin : bins_) {
      const DevicePdo* const pdo = devices_[bin.producer].find(PdoKind::tpdo, bin.tpdo);
      if (!bin.earlier || bin.can_id == 0 || (pdo != nullptr && pdo->fixed_id)) continue;
      const bool ours = for_pdos(bin.can_id) && free_id(bus_of(bin), bin.can_id);
      const unsigned id = bin.can_id;
      bin.can_id = 0;
      if (ours) give(bin, id);
    }
  }

  bool waits(const Bin& bin) const noexcept { return bin.tpdo != 0 && bin.can_id == 0; }

  void give_predefined(Bin& bin) {
    if (!waits(bin) || bin.tpdo > predefined_pdos) return;
    const unsigned id = tpdo_id(bin.tpdo, network_.nodes[bin.producer].id);
    if (free_id(bus_of(bin), id)) give(bin, id);
  }

  /// The device's RPDOs take the CAN-IDs of the TPDOs sent to them; their own become free.
  void give_own(Bin& bin) {
    for (unsigned number = predefined_pdos; number > 0 && waits(bin); --number) {
      const unsigned id = rpdo_id(number, network_.nodes[bin.producer].id);
      if (free_id(bus_of(bin), id)) give(bin, id);
    }
  }

  /// Gives the free CAN-ID with the lowest priority. `uninhabited`: only one of a node-ID that no node on the bus has.
  void give_other(Bin& bin, bool uninhabited) {
    const auto try_id = [&](unsigned id) {
      if (waits(bin) && free_id(bus_of(bin), id)) give(bin, id);
    };
    for (unsigned id = last_pool; id >= first_pool && waits(bin); --id) {
      const unsigned node = id & 0x7FU;
      if (node == 0 || (uninhabited && inhabited_[bus_of(bin)].contains(node))) continue;
      try_id(id);
    }
    if (uninhabited) return;
    for (unsigned id = first_low; id <= last_low && waits(bin); ++id) try_id(id);
  }

  void give_strongest(Bin& bin) {
    for (unsigned id = first_pool; id <= last_pool && waits(bin); ++id) {
      if ((id & 0x7FU) != 0 && free_id(bus_of(bin), id)) give(bin, id);
    }
  }

  void leave(const Bin& bin) {
    for (const Item& item : bin.items) {
      if (item.signal) made_.left.push_back(*item.signal);
    }
  }

  Pdo pdo_of(const Bin& bin) const {
    Pdo pdo{.bus = bus_of(bin),
            .producer = bin.producer,
            .tpdo = bin.tpdo,
            .can_id = bin.can_id,
            .mpdo = bin.mpdo,
            .transmission = bin.transmission,
            .deadline = deadline_of(bin, signals_)};
    unsigned at = 0;
    std::set<std::size_t> links;
    for (const Item& item : bin.items) {
      pdo.carried.push_back({item.entry.object, item.entry.bits, static_cast<std::uint8_t>(bin.mpdo ? mpdo_bits : at)});
      at += item.entry.bits;
      if (item.signal) links.insert(signals_[*item.signal].links.begin(), signals_[*item.signal].links.end());
    }
    pdo.links.assign(links.begin(), links.end());
    for (const std::size_t node : receivers_of(bin, signals_)) pdo.receivers.push_back(receiver(bin, node));
    return pdo;
  }

  Receiver receiver(const Bin& bin, std::size_t node) const {
    Receiver made{.node = node, .transmission = bin.transmission};
    if (!bin.mpdo)
      made.mapping = rpdo_mapping(bin, signals_, node, devices_[node]).value_or(std::vector<co::PdoEntry>{});
    for (std::size_t i = 0; i < bin.items.size(); ++i) {
      if (!bin.items[i].signal) continue;
      for (const Consumer& each : signals_[*bin.items[i].signal].consumers) {
        if (each.node == node) made.received.push_back({i, each.object});
      }
    }
    return made;
  }

  static std::uint16_t earlier_rpdo(const Earlier& earlier, const LinkNetwork& network, const Pdo& pdo,
                                    std::size_t node) {
    for (const EarlierPdo& old : earlier.pdos) {
      if (old.producer != network.nodes[pdo.producer].name || old.tpdo != pdo.tpdo) continue;
      for (const auto& [name, rpdo] : old.receivers) {
        if (name == network.nodes[node].name) return rpdo;
      }
    }
    return 0;
  }

  bool serves(std::size_t node, const DevicePdo& pdo, const Receiver& receiver) const {
    return DevicePdos::free(pdo) && !pdo.fixed_id && receiver.mapping.size() <= pdo.most_entries &&
           !used_rpdos_[node].contains(pdo.number);
  }

  void number_rpdos(const Earlier& earlier) {
    for (Pdo& pdo : made_.pdos) {
      for (Receiver& each : pdo.receivers) {
        const auto old = earlier_rpdo(earlier, network_, pdo, each.node);
        const DevicePdo* const there = devices_[each.node].find(PdoKind::rpdo, old);
        if (there == nullptr || !serves(each.node, *there, each)) continue;
        each.rpdo = old;
        used_rpdos_[each.node].insert(old);
      }
    }
    for (Pdo& pdo : made_.pdos) {
      for (Receiver& each : pdo.receivers) {
        for (const DevicePdo& there : devices_[each.node].rpdos) {
          if (each.rpdo != 0 || !serves(each.node, there, each)) continue;
          each.rpdo = there.number;
          used_rpdos_[each.node].insert(there.number);
        }
      }
    }
  }

  const LinkNetwork& network_;
  const std::vector<DevicePdos>& devices_;
  const std::vector<Signal>& signals_;
  const std::vector<bool>& linked_;
  std::vector<Bin> bins_;
  std::vector<std::set<std::uint32_t>> taken_;  ///< CAN-IDs, by bus
  std::vector<std::set<unsigned>> inhabited_;   ///< node-IDs in use, by bus
  std::vector<std::set<unsigned>> used_tpdos_;  ///< by node
  std::vector<std::set<unsigned>> used_rpdos_;  ///< by node
  Numbered made_;
};

}  // namespace

Numbered number(const LinkNetwork& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals,
                const std::vector<bool>& linked, const Packed& packed, const Earlier& earlier, bool by_deadline) {
  return Numbering(network, devices, signals, linked, packed).run(earlier, by_deadline);
}

}  // namespace berth::linker
