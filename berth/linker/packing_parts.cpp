#include "berth/linker/packing_parts.hpp"

#include <algorithm>
#include <bit>
#include <map>
#include <tuple>

namespace berth::linker {
namespace {

using co::PdoKind;

constexpr unsigned most_bits = 64;
constexpr int no_deadline_class = 99;

const Consumer* consumer_at(const Signal& signal, std::size_t node) noexcept {
  const auto found = std::ranges::find(signal.consumers, node, &Consumer::node);
  return found == signal.consumers.end() ? nullptr : &*found;
}

unsigned bits_of(const Bin& bin) noexcept {
  unsigned bits = 0;
  for (const Item& item : bin.items) bits += item.entry.bits;
  return bits;
}

/// Deadlines within a factor of two are of one class.
int deadline_class(const std::optional<rt::Duration>& deadline) noexcept {
  if (!deadline) return no_deadline_class;
  return static_cast<int>(std::bit_width(static_cast<std::uint64_t>(deadline->count())));
}

/// About how often a PDO is sent in a second, at most.
double rate(const std::optional<rt::Duration>& deadline) noexcept {
  constexpr double otherwise = 0.02;
  const double seconds = deadline ? std::chrono::duration<double>(*deadline).count() : otherwise;
  return 1 / seconds;
}

class Packer {
 public:
  Packer(const LinkNetwork& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals)
      : network_(network), devices_(devices), signals_(signals), placed_(signals.size()) {
    room_.resize(network.nodes.size());
    for (std::size_t node = 0; node < devices.size(); ++node) room_[node] = room_of(devices[node]);
  }

  Packed run(const Earlier& earlier) {
    for (const EarlierPdo& pdo : earlier.pdos) take_over(pdo);
    for (std::size_t i = 0; i < signals_.size(); ++i) take_fixed(i);
    fill_groups();
    squeeze();
    Packed packed;
    packed.bins = std::move(bins_);
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      if (!placed_[i]) packed.left.push_back(i);
    }
    return packed;
  }

 private:
  struct Room {
    unsigned tpdos = 0;
    unsigned rpdos = 0;
    unsigned tpdo_entries = 0;
    unsigned rpdo_entries = 0;
  };

  static Room room_of(const DevicePdos& device) {
    Room room;
    for (const DevicePdo& pdo : device.tpdos) {
      if (!DevicePdos::free(pdo)) continue;
      ++room.tpdos;
      room.tpdo_entries = std::max(room.tpdo_entries, pdo.most_entries);
    }
    for (const DevicePdo& pdo : device.rpdos) {
      if (!DevicePdos::free(pdo) || pdo.fixed_id) continue;
      ++room.rpdos;
      room.rpdo_entries = std::max(room.rpdo_entries, pdo.most_entries);
    }
    return room;
  }

  void put(Bin& bin, std::size_t signal) const {
    bin.items.push_back({{signals_[signal].object, signals_[signal].bits}, signal});
  }

  bool mpdo_can(const Bin& bin, const Signal& signal) const {
    if (signal.crosses || signal.bits > mpdo_bits || signal.transmission < sam_mpdo) return false;
    if (bin.items.size() >= devices_[bin.producer].scanner) return false;
    return std::ranges::all_of(signal.consumers, [&](const Consumer& each) {
      return mpdo_entries(each.node) < devices_[each.node].dispatching;
    });
  }
  std::size_t mpdo_entries(std::size_t node) const {
    std::size_t count = 0;
    for (const Bin& bin : bins_) {
      if (!bin.mpdo) continue;
      for (const Item& item : bin.items) count += consumer_at(signals_[*item.signal], node) != nullptr ? 1 : 0;
    }
    return count;
  }

  /// All receivers can take the PDO as it is.
  bool feasible(const Bin& bin) const {
    if (bin.mpdo) return true;
    if (bits_of(bin) > most_bits) return false;
    if (!bin.fixed && bin.items.size() > room_[bin.producer].tpdo_entries) return false;
    return std::ranges::all_of(receivers_of(bin, signals_), [&](std::size_t node) {
      const auto mapping = rpdo_mapping(bin, signals_, node, devices_[node]);
      return mapping && mapping->size() <= room_[node].rpdo_entries;
    });
  }

  /// All objects in a gateway's TPDO come from one device.
  bool same_origin(const Bin& bin, const Signal& wanted) const {
    return std::ranges::all_of(bin.items, [&](const Item& item) {
      if (!item.signal) return true;
      const Signal& there = signals_[*item.signal];
      const auto from = [](const Signal& each) { return each.crosses ? each.origin : each.producer; };
      return from(there) == from(wanted);
    });
  }

  bool can_take(const Bin& bin, std::size_t signal) const {
    const Signal& wanted = signals_[signal];
    if (bin.fixed || bin.producer != wanted.producer || bin.transmission != wanted.transmission) return false;
    if (bin.mpdo) return mpdo_can(bin, wanted);
    if (!same_origin(bin, wanted)) return false;
    if (bits_of(bin) + wanted.bits > most_bits) return false;
    Bin with = bin;
    put(with, signal);
    return feasible(with);
  }

  std::optional<std::size_t> signal_of(std::size_t node, ObjectRef object, TransmissionType type) const {
    const auto found = std::ranges::find_if(signals_, [&](const Signal& each) {
      return each.producer == node && each.object == object && each.transmission == type;
    });
    if (found == signals_.end()) return std::nullopt;
    return static_cast<std::size_t>(found - signals_.begin());
  }

  /// Objects stay in their PDO and in their order while the receivers can still take it.
  void take_over(const EarlierPdo& pdo) {
    const auto node = std::ranges::find(network_.nodes, pdo.producer, &Node::name);
    if (node == network_.nodes.end()) return;
    const auto producer = static_cast<std::size_t>(node - network_.nodes.begin());
    const DevicePdo* const device = devices_[producer].find(PdoKind::tpdo, pdo.tpdo);
    if (device == nullptr || !DevicePdos::free(*device)) return;
    const bool taken =
        std::ranges::any_of(bins_, [&](const Bin& each) { return each.producer == producer && each.tpdo == pdo.tpdo; });
    if (taken) return;
    Bin bin{.producer = producer,
            .transmission = one_of_kind(pdo.transmission),
            .mpdo = pdo.mpdo,
            .earlier = true,
            .tpdo = pdo.tpdo,
            .can_id = pdo.can_id};
    for (const ObjectRef object : pdo.objects) {
      const auto signal = signal_of(producer, object, bin.transmission);
      if (!signal || placed_[*signal] || !can_take(bin, *signal)) continue;
      put(bin, *signal);
      placed_[*signal] = true;
    }
    if (!bin.items.empty()) bins_.push_back(std::move(bin));
  }

  /// A device with fixed mappings: uses the PDO that has the object.
  void take_fixed(std::size_t signal) {
    const Signal& wanted = signals_[signal];
    if (placed_[signal] || room_[wanted.producer].tpdos > 0) return;
    for (const DevicePdo& pdo : devices_[wanted.producer].tpdos) {
      const auto entry = std::ranges::find(pdo.mapping, wanted.object, &co::PdoEntry::object);
      if (pdo.kept || !pdo.fixed_mapping || entry == pdo.mapping.end()) continue;
      const auto there = std::ranges::find_if(
          bins_, [&](const Bin& each) { return each.producer == wanted.producer && each.tpdo == pdo.number; });
      Bin bin = there != bins_.end() ? *there : fixed_bin(wanted, pdo);
      if (bin.transmission != wanted.transmission) continue;
      bin.items[static_cast<std::size_t>(entry - pdo.mapping.begin())].signal = signal;
      if (!feasible(bin)) continue;
      placed_[signal] = true;
      if (there != bins_.end()) {
        *there = std::move(bin);
      } else {
        bins_.push_back(std::move(bin));
      }
      return;
    }
  }
  static Bin fixed_bin(const Signal& wanted, const DevicePdo& pdo) {
    Bin bin{.producer = wanted.producer, .transmission = wanted.transmission, .fixed = true, .tpdo = pdo.number};
    for (const auto& entry : pdo.mapping) bin.items.push_back({entry, std::nullopt});
    return bin;
  }

  using Group = std::tuple<std::size_t, TransmissionType, int, std::vector<std::size_t>>;
  Group group_of(const Signal& signal) const {
    std::vector<std::size_t> nodes;
    for (const Consumer& each : signal.consumers) nodes.push_back(each.node);
    return {signal.producer, signal.transmission, deadline_class(signal.deadline), nodes};
  }
  Group group_of(const Bin& bin) const {
    return {bin.producer, bin.transmission, deadline_class(deadline_of(bin, signals_)), receivers_of(bin, signals_)};
  }

  /// Objects of one group share PDOs, the longest first.
  void fill_groups() {
    std::map<Group, std::vector<std::size_t>> groups;
    for (std::size_t i = 0; i < signals_.size(); ++i) {
      if (!placed_[i] && room_[signals_[i].producer].tpdos > 0) groups[group_of(signals_[i])].push_back(i);
    }
    for (auto& [group, members] : groups) {
      std::vector<std::size_t> open;
      for (std::size_t i = 0; i < bins_.size(); ++i) {
        if (!bins_[i].mpdo && group_of(bins_[i]) == group) open.push_back(i);
      }
      std::ranges::stable_sort(members, std::ranges::greater{}, [&](std::size_t s) { return signals_[s].bits; });
      for (const std::size_t signal : members) first_fit(signal, open);
    }
  }
  void first_fit(std::size_t signal, std::vector<std::size_t>& open) {
    const auto fits = std::ranges::find_if(open, [&](std::size_t bin) { return can_take(bins_[bin], signal); });
    if (fits != open.end()) {
      put(bins_[*fits], signal);
      placed_[signal] = true;
      return;
    }
    Bin bin{.producer = signals_[signal].producer, .transmission = signals_[signal].transmission};
    put(bin, signal);
    if (!feasible(bin)) return;
    open.push_back(bins_.size());
    bins_.push_back(std::move(bin));
    placed_[signal] = true;
  }

  // -- too few PDOs --

  /// The number of missing PDOs, and the devices that lack them.
  unsigned shortage(const std::vector<Bin>& bins, std::vector<bool>* who = nullptr) const {
    std::vector<std::pair<unsigned, unsigned>> need(network_.nodes.size());
    for (const Bin& bin : bins) {
      if (bin.items.empty()) continue;
      if (!bin.fixed) ++need[bin.producer].first;
      for (const std::size_t node : receivers_of(bin, signals_)) ++need[node].second;
    }
    unsigned sum = 0;
    for (std::size_t node = 0; node < need.size(); ++node) {
      unsigned over = need[node].first > room_[node].tpdos ? need[node].first - room_[node].tpdos : 0;
      over += need[node].second > room_[node].rpdos ? need[node].second - room_[node].rpdos : 0;
      sum += over;
      if (who != nullptr) (*who)[node] = over > 0;
    }
    return sum;
  }

  double cost(const Bin& bin) const {
    constexpr double overhead = 60;
    constexpr double a_receiver = 1;
    const auto frames = static_cast<double>(bin.mpdo ? bin.items.size() : 1);
    return rate(deadline_of(bin, signals_)) * (overhead + bits_of(bin)) * frames +
           a_receiver * static_cast<double>(receivers_of(bin, signals_).size());
  }

  /// The bins without this one, with its signals in others of its producer; empty if they do not fit. `grown`: the
  /// cost.
  std::optional<std::vector<Bin>> without(std::size_t gone, double& grown) const {
    std::vector<Bin> bins = bins_;
    std::vector<Item> items = std::move(bins[gone].items);
    bins[gone].items.clear();
    grown = -cost(bins_[gone]);
    std::ranges::stable_sort(items, std::ranges::greater{}, [](const Item& item) { return item.entry.bits; });
    for (const Item& item : items) {
      Bin* best = nullptr;
      double least = 0;
      for (std::size_t i = 0; i < bins.size(); ++i) {
        if (i == gone || bins[i].producer != bins[gone].producer || !can_take(bins[i], *item.signal)) continue;
        Bin with = bins[i];
        put(with, *item.signal);
        const double more = cost(with) - cost(bins[i]);
        if (best != nullptr && more >= least) continue;
        best = &bins[i];
        least = more;
      }
      if (best == nullptr) return std::nullopt;
      put(*best, *item.signal);
      grown += least;
    }
    return bins;
  }

  bool dissolve_one() {
    std::vector<bool> short_of(network_.nodes.size());
    const unsigned now = shortage(bins_, &short_of);
    std::optional<std::vector<Bin>> best;
    double least = 0;
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      if (bins_[i].earlier || bins_[i].fixed || bins_[i].mpdo) continue;
      const auto nodes = receivers_of(bins_[i], signals_);
      const bool concerned =
          short_of[bins_[i].producer] || std::ranges::any_of(nodes, [&](std::size_t node) { return short_of[node]; });
      if (!concerned) continue;
      double grown = 0;
      auto bins = without(i, grown);
      if (!bins || shortage(*bins) >= now || (best && grown >= least)) continue;
      best = std::move(bins);
      least = grown;
    }
    if (!best) return false;
    std::erase_if(*best, [](const Bin& bin) { return bin.items.empty(); });
    bins_ = std::move(*best);
    return true;
  }

  /// For a producer that lacks PDOs: turns its least frequent PDO into an MPDO. At most one per producer.
  bool make_mpdo() {
    std::vector<bool> short_of(network_.nodes.size());
    (void)shortage(bins_, &short_of);
    std::optional<std::size_t> chosen;
    for (std::size_t i = 0; i < bins_.size(); ++i) {
      const Bin& bin = bins_[i];
      if (bin.earlier || bin.fixed || bin.mpdo || !short_of[bin.producer]) continue;
      const bool has =
          std::ranges::any_of(bins_, [&](const Bin& each) { return each.mpdo && each.producer == bin.producer; });
      if (has || !all_by_mpdo(bin)) continue;
      if (!chosen || cost(bin) < cost(bins_[*chosen])) chosen = i;
    }
    if (!chosen) return false;
    bins_[*chosen].mpdo = true;
    return true;
  }
  bool all_by_mpdo(const Bin& bin) const {
    Bin mpdo{.producer = bin.producer, .transmission = bin.transmission, .mpdo = true};
    for (const Item& item : bin.items) {
      if (!mpdo_can(mpdo, signals_[*item.signal])) return false;
      mpdo.items.push_back(item);
    }
    return true;
  }

  void squeeze() {
    while (shortage(bins_) > 0) {
      if (dissolve_one()) continue;
      if (!make_mpdo()) break;
    }
    give_up();
  }

  /// Removes new PDOs, those with the longest deadlines first, until the rest has room.
  void give_up() {
    std::vector<bool> short_of(network_.nodes.size());
    while (shortage(bins_, &short_of) > 0) {
      std::optional<std::size_t> chosen;
      for (std::size_t i = 0; i < bins_.size(); ++i) {
        const auto nodes = receivers_of(bins_[i], signals_);
        const bool concerned = (short_of[bins_[i].producer] && !bins_[i].fixed) ||
                               std::ranges::any_of(nodes, [&](std::size_t node) { return short_of[node]; });
        if (concerned && (!chosen || weaker(bins_[i], bins_[*chosen]))) chosen = i;
      }
      if (!chosen) return;
      for (const Item& item : bins_[*chosen].items) {
        if (item.signal) placed_[*item.signal] = false;
      }
      bins_.erase(bins_.begin() + static_cast<std::ptrdiff_t>(*chosen));
    }
  }
  bool weaker(const Bin& a, const Bin& b) const {
    if (a.earlier != b.earlier) return !a.earlier;
    const auto most = rt::Duration::max();
    return deadline_of(a, signals_).value_or(most) > deadline_of(b, signals_).value_or(most);
  }

  const LinkNetwork& network_;
  const std::vector<DevicePdos>& devices_;
  const std::vector<Signal>& signals_;
  std::vector<Room> room_;
  std::vector<Bin> bins_;
  std::vector<bool> placed_;
};

/// Dummies for a gap; false if the available lengths do not fill it.
bool fill(std::vector<co::PdoEntry>& mapping, unsigned gap, const DevicePdos& device) {
  for (const unsigned type : device.dummies) {
    const unsigned bits = od::bit_length(static_cast<od::DataType>(type));
    for (; gap >= bits; gap -= bits) {
      mapping.push_back({{static_cast<std::uint16_t>(type), 0}, static_cast<std::uint8_t>(bits)});
    }
  }
  return gap == 0;
}

}  // namespace

std::vector<std::size_t> receivers_of(const Bin& bin, const std::vector<Signal>& signals) {
  std::vector<std::size_t> nodes;
  for (const Item& item : bin.items) {
    if (!item.signal) continue;
    for (const Consumer& each : signals[*item.signal].consumers) nodes.push_back(each.node);
  }
  std::ranges::sort(nodes);
  const auto rest = std::ranges::unique(nodes);
  nodes.erase(rest.begin(), rest.end());
  return nodes;
}

std::optional<rt::Duration> deadline_of(const Bin& bin, const std::vector<Signal>& signals) {
  std::optional<rt::Duration> least;
  for (const Item& item : bin.items) {
    if (!item.signal || !signals[*item.signal].deadline) continue;
    const rt::Duration deadline = *signals[*item.signal].deadline;
    least = std::min(least.value_or(deadline), deadline);
  }
  return least;
}

std::optional<std::vector<co::PdoEntry>> rpdo_mapping(const Bin& bin, const std::vector<Signal>& signals,
                                                      std::size_t node, const DevicePdos& device) {
  std::vector<co::PdoEntry> mapping;
  unsigned gap = 0;
  for (const Item& item : bin.items) {
    const Consumer* const wants = item.signal ? consumer_at(signals[*item.signal], node) : nullptr;
    if (wants == nullptr) {
      gap += item.entry.bits;
      continue;
    }
    if (!fill(mapping, gap, device)) return std::nullopt;
    gap = 0;
    mapping.push_back({wants->object, item.entry.bits});
  }
  if (!fill(mapping, gap, device)) return std::nullopt;
  return mapping;
}

Packed pack(const LinkNetwork& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals,
            const Earlier& earlier) {
  return Packer(network, devices, signals).run(earlier);
}

}  // namespace berth::linker
