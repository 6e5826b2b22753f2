#include "berth/linker/crossing_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "berth/linker/bounds.hpp"
#include "berth/multilevel/routing.hpp"
#include "berth/multilevel/routing_objects.hpp"

namespace berth::linker {
namespace {

using multilevel::RouteEntry;
using multilevel::RoutingObjects;

double in_ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

std::optional<std::size_t> gateway_above(const LinkNetwork& network, std::size_t bus) {
  const auto found = std::ranges::find(network.gateways, bus, &Gateway::bus);
  if (found == network.gateways.end()) return std::nullopt;
  return static_cast<std::size_t>(found - network.gateways.begin());
}

/// The gateways above a bus, nearest first.
std::vector<std::size_t> up_from(const LinkNetwork& network, std::size_t bus) {
  std::vector<std::size_t> ups;
  for (auto at = gateway_above(network, bus); at && ups.size() < network.buses.size();
       at = gateway_above(network, network.nodes[network.gateways[ups.back()].above].bus)) {
    ups.push_back(*at);
  }
  return ups;
}

std::uint8_t side(const LinkNetwork& network, Hop hop, bool entry) {
  return hop.down == entry ? std::uint8_t{0} : network.gateways[hop.gateway].port;
}

rt::Duration delay_of(const LinkNetwork& network, const std::vector<Hop>& hops) {
  rt::Duration sum{};
  for (const Hop hop : hops) sum += network.gateways[hop.gateway].delay;
  return sum;
}

/// The buses of a way, the first one too.
std::vector<std::size_t> buses_of(const LinkNetwork& network, std::size_t first, const std::vector<Hop>& hops) {
  std::vector<std::size_t> buses{first};
  for (const Hop hop : hops) buses.push_back(network.nodes[exit_of(network, hop)].bus);
  return buses;
}

// Is the object in an SRDO's mapping, by default or by the configuration?
bool safety_relevant(const Node& node, ObjectRef object) {
  constexpr std::uint16_t first_mapping = 0x1381, last_mapping = 0x13C0;
  if (multilevel::is_safety_relevant(*node.file->description, object)) return true;
  const auto wanted = static_cast<std::uint32_t>(object.index) << 16U | static_cast<std::uint32_t>(object.sub) << 8U;
  return std::ranges::any_of(node.file->parameters, [&](const eds::Parameter& each) {
    const bool mapping = each.object.index >= first_mapping && each.object.index <= last_mapping;
    return mapping && each.object.sub != 0 && (each.value.raw & 0xFFFF'FF00U) == wanted;
  });
}

std::optional<CannotCross> cannot_carry(const LinkNetwork& network, Hop hop, unsigned bytes) {
  const Gateway& gateway = network.gateways[hop.gateway];
  const Node& above = network.nodes[gateway.above];
  const std::string& bus = network.buses[gateway.bus].name;
  if (!above.file) {
    return CannotCross{fmt::format("the gateway {} is on the way, and nothing is known of it", above.name),
                       "add eds = \"FILE\" to its slot"};
  }
  const auto unknown =
      fmt::format("the gateway {} is on the way, and nothing is known of its own node on {}", above.name, bus);
  if (!gateway.beneath) {
    return CannotCross{unknown, fmt::format("add to the gateway of [bus.{}] eds = \"FILE\", or, where Berth has a port "
                                            "on that bus, node = ID: its slot there",
                                            bus)};
  }
  if (const Node& beneath = network.nodes[*gateway.beneath]; !beneath.file) {
    return CannotCross{unknown + ", " + beneath.name, "add eds = \"FILE\" to its slot"};
  }
  if (above.file->description->find({RoutingObjects::routes, 1}) == nullptr) {
    return CannotCross{fmt::format("the gateway {} has no routing objects (5F11h): it forwards no signals", above.name),
                       "describe them, where it has them (docs/multilevel.md)"};
  }
  const auto places = *multilevel::signal_places(bytes);
  for (const std::size_t node : {gateway.above, *gateway.beneath}) {
    if (network.nodes[node].file->description->find({places, 1}) != nullptr) continue;
    return CannotCross{
        fmt::format("{} has no places for signals of {} bytes ({:04X}h)", network.nodes[node].name, bytes, places),
        "describe them, where it has them (docs/multilevel.md)"};
  }
  return std::nullopt;
}

class Crossing {
 public:
  Crossing(const LinkNetwork& network, const Earlier& earlier, Findings& findings)
      : network_(network), earlier_(earlier), findings_(findings) {}

  std::vector<Route> run(Resolved& resolved) {
    take_what_is_there(resolved);
    std::vector<Signal> all;
    // Signals of the earlier plan keep their places; then others take free ones.
    for (Signal& signal : resolved.signals) {
      if (!crosses(signal)) {
        all.push_back(std::move(signal));
      } else {
        reserve(signal);
        waiting_.push_back(std::move(signal));
      }
    }
    for (const Signal& signal : waiting_) split(signal, all);
    std::ranges::sort(all, [](const Signal& a, const Signal& b) {
      return std::tie(a.producer, a.object, a.transmission) < std::tie(b.producer, b.object, b.transmission);
    });
    for (const Signal& signal : all) {
      resolved.linked[signal.producer] = true;
      for (const Consumer& each : signal.consumers) resolved.linked[each.node] = true;
    }
    resolved.signals = std::move(all);
    std::ranges::sort(routes_,
                      [](const Route& a, const Route& b) { return std::tie(a.node, a.row) < std::tie(b.node, b.row); });
    return std::move(routes_);
  }

 private:
  [[nodiscard]] std::size_t bus_of(std::size_t node) const { return network_.nodes[node].bus; }
  [[nodiscard]] bool crosses(const Signal& signal) const {
    return std::ranges::any_of(signal.consumers,
                               [&](const Consumer& each) { return bus_of(each.node) != bus_of(signal.producer); });
  }
  [[nodiscard]] std::vector<Hop> way_to(const Signal& signal, std::size_t node) const {
    return *way(network_, bus_of(signal.producer), bus_of(node));
  }

  /// Takes the places that links name themselves, and the rows that a gateway's own configuration sets.
  void take_what_is_there(const Resolved& resolved) {
    for (const Signal& signal : resolved.signals) {
      places_[signal.producer].insert(signal.object);
      for (const Consumer& each : signal.consumers) places_[each.node].insert(each.object);
    }
    for (const Gateway& gateway : network_.gateways) {
      const Node& above = network_.nodes[gateway.above];
      if (!above.file || !gateway.beneath || above.linked_before) continue;
      for (const auto& each : above.file->parameters) {
        if (each.object.index != RoutingObjects::routes || each.object.sub == 0 || each.value.raw == 0) continue;
        rows_[gateway.above].insert(each.object.sub);
        const auto entry = RouteEntry::of(each.value.raw);
        for (const auto& [at, object] : {std::pair{entry.from, entry.source}, std::pair{entry.to, entry.target}}) {
          if (at == 0) places_[gateway.above].insert(object);
          if (at == gateway.port) places_[*gateway.beneath].insert(object);
        }
      }
    }
  }

  struct Found {
    std::uint8_t row = 0;
    ObjectRef source{};
    ObjectRef target{};
  };
  using Key = std::tuple<std::size_t, ObjectRef, TransmissionType, Hop>;  ///< producer, object, type and hop

  static Key key_of(const Signal& signal, Hop hop) {
    return {signal.producer, signal.object, signal.transmission, hop};
  }

  [[nodiscard]] std::set<Hop> hops_of(const Signal& signal) const {
    std::set<Hop> hops;
    for (const Consumer& each : signal.consumers) {
      for (const Hop hop : way_to(signal, each.node)) hops.insert(hop);
    }
    return hops;
  }

  // Reserves the signal's rows of the earlier plan if they are free.
  void reserve(const Signal& signal) {
    for (const Hop hop : hops_of(signal)) {
      const std::size_t above = network_.gateways[hop.gateway].above;
      const auto same = [&](const EarlierRoute& each) {
        return each.gateway == network_.nodes[above].name && each.from == side(network_, hop, true) &&
               each.to == side(network_, hop, false) && each.producer == network_.nodes[signal.producer].name &&
               each.object == signal.object;
      };
      const auto old = std::ranges::find_if(earlier_.routes, same);
      if (old == earlier_.routes.end()) continue;
      const bool fits = is_place(entry_of(network_, hop), old->source, signal.bits) &&
                        is_place(exit_of(network_, hop), old->target, signal.bits) && is_row(above, old->row);
      if (!fits) continue;
      rows_[above].insert(old->row);
      places_[entry_of(network_, hop)].insert(old->source);
      places_[exit_of(network_, hop)].insert(old->target);
      found_[key_of(signal, hop)] = {old->row, old->source, old->target};
    }
  }
  bool is_row(std::size_t node, std::uint8_t row) {
    return network_.nodes[node].file->description->find({RoutingObjects::routes, row}) != nullptr &&
           !rows_[node].contains(row);
  }
  bool is_place(std::size_t node, ObjectRef object, unsigned bits) {
    return multilevel::signal_places(bits / 8) == object.index && object.sub != 0 &&
           network_.nodes[node].file->description->find(object) != nullptr && !places_[node].contains(object);
  }

  std::optional<std::uint8_t> free_row(std::size_t node) {
    for (unsigned row = 1; row < 255; ++row) {
      if (is_row(node, static_cast<std::uint8_t>(row))) return static_cast<std::uint8_t>(row);
    }
    return std::nullopt;
  }
  std::optional<ObjectRef> free_place(std::size_t node, unsigned bits) {
    for (unsigned sub = 1; sub < 255; ++sub) {
      const ObjectRef object{*multilevel::signal_places(bits / 8), static_cast<std::uint8_t>(sub)};
      if (is_place(node, object, bits)) return object;
    }
    return std::nullopt;
  }

  /// The place of the signal in this gateway; none: there is no room, with a finding.
  const Found* through(const Signal& signal, Hop hop) {
    const auto known = found_.find(key_of(signal, hop));
    if (known != found_.end()) return &known->second;
    const std::size_t above = network_.gateways[hop.gateway].above;
    const std::size_t entry = entry_of(network_, hop), exit = exit_of(network_, hop);
    const auto row = free_row(above);
    const auto source = free_place(entry, signal.bits);
    const auto target = free_place(exit, signal.bits);
    if (!row || !source || !target) {
      const std::size_t full = !row ? above : !source ? entry : exit;
      for (const std::size_t link : signal.links) {
        findings_.push_back(
            refusal(network_, link,
                    fmt::format("{} has no {} left for another signal{}", network_.nodes[full].name,
                                row ? "place" : "row", row ? fmt::format(" of {} bits", signal.bits) : " (5F11h)"),
                    "link fewer objects across this gateway, or take routes out of its config"));
      }
      return nullptr;
    }
    rows_[above].insert(*row);
    places_[entry].insert(*source);
    places_[exit].insert(*target);
    return &(found_[key_of(signal, hop)] = {*row, *source, *target});
  }

  /// Each bus's part of the deadline: after subtracting the gateways' delays, in proportion to its bit time.
  [[nodiscard]] std::map<std::size_t, rt::Duration> shares(const Signal& signal) const {
    std::map<std::size_t, rt::Duration> all;
    for (const std::size_t link : signal.links) {
      const auto& deadline = network_.links[link].deadline;
      if (!deadline) continue;
      for (const End& end : network_.links[link].to) {
        const auto hops = way_to(signal, end.node);
        const auto buses = buses_of(network_, bus_of(signal.producer), hops);
        double sum = 0;
        for (const std::size_t bus : buses) sum += 1.0 / network_.buses[bus].others.bit_rate;
        const auto left = static_cast<double>((*deadline - delay_of(network_, hops)).count());
        for (const std::size_t bus : buses) {
          const rt::Duration share(static_cast<std::int64_t>(left / network_.buses[bus].others.bit_rate / sum));
          const auto [known, fresh] = all.try_emplace(bus, share);
          if (!fresh) known->second = std::min(known->second, share);
        }
      }
    }
    return all;
  }
  [[nodiscard]] std::vector<std::size_t> links_over(const Signal& signal, std::size_t bus) const {
    std::vector<std::size_t> links;
    for (const std::size_t link : signal.links) {
      const bool there = std::ranges::any_of(network_.links[link].to, [&](const End& end) {
        const auto buses = buses_of(network_, bus_of(signal.producer), way_to(signal, end.node));
        return std::ranges::find(buses, bus) != buses.end();
      });
      if (there) links.push_back(link);
    }
    return links;
  }

  void split(const Signal& signal, std::vector<Signal>& all) {
    const auto hops = hops_of(signal);
    for (const Hop hop : hops) {
      if (through(signal, hop) == nullptr) return;
    }
    const auto of_deadline = shares(signal);
    const auto put = [&](std::size_t producer, ObjectRef object) {
      Signal made = signal;
      const std::size_t bus = bus_of(producer);
      made.producer = producer;
      made.object = object;
      made.origin = signal.producer;
      made.crosses = true;
      made.links = links_over(signal, bus);
      const auto share = of_deadline.find(bus);
      made.deadline = share == of_deadline.end() ? std::nullopt : std::optional(share->second);
      std::erase_if(made.consumers, [&](const Consumer& each) { return bus_of(each.node) != bus; });
      for (const Hop hop : hops) {
        const std::size_t entry = entry_of(network_, hop);
        if (bus_of(entry) == bus) made.consumers.push_back({entry, through(signal, hop)->source});
      }
      std::ranges::sort(made.consumers);
      all.push_back(std::move(made));
    };
    put(signal.producer, signal.object);
    for (const Hop hop : hops) {
      const Found& found = *through(signal, hop);
      const std::size_t exit = exit_of(network_, hop);
      put(exit, found.target);
      Route route{.gateway = hop.gateway,
                  .node = network_.gateways[hop.gateway].above,
                  .row = found.row,
                  .from = side(network_, hop, true),
                  .to = side(network_, hop, false),
                  .source = found.source,
                  .target = found.target,
                  .producer = signal.producer,
                  .object = signal.object,
                  .links = links_over(signal, bus_of(exit))};
      const auto share = of_deadline.find(bus_of(exit));
      if (share != of_deadline.end()) route.budget = share->second + network_.gateways[hop.gateway].delay;
      routes_.push_back(std::move(route));
    }
  }

  const LinkNetwork& network_;
  const Earlier& earlier_;
  Findings& findings_;
  std::map<std::size_t, std::set<ObjectRef>> places_;   ///< taken, by node
  std::map<std::size_t, std::set<std::uint8_t>> rows_;  ///< taken, by the gateway's node above
  std::map<Key, Found> found_;
  std::vector<Signal> waiting_;
  std::vector<Route> routes_;
};

std::size_t entry_node(const LinkNetwork& network, const Route& route) {
  const Gateway& gateway = network.gateways[route.gateway];
  return route.from == 0 ? gateway.above : *gateway.beneath;
}
std::size_t exit_node(const LinkNetwork& network, const Route& route) {
  const Gateway& gateway = network.gateways[route.gateway];
  return route.to == 0 ? gateway.above : *gateway.beneath;
}

/// The PDO that brings this object to a node, and the receiver in it.
struct Brought {
  const Pdo* pdo = nullptr;
  const Receiver* receiver = nullptr;
  ObjectRef object{};  ///< of the producer
};
Brought brings(const Plan& plan, std::size_t node, ObjectRef object) {
  for (const Pdo& pdo : plan.pdos) {
    for (const Receiver& receiver : pdo.receivers) {
      if (receiver.node != node) continue;
      const auto got = std::ranges::find(receiver.received, object, &Received::object);
      if (got != receiver.received.end()) return {&pdo, &receiver, pdo.carried[got->carried].object};
    }
  }
  return {};
}

/// From a consumer back to the source of its value; none: it does not cross a gateway, or ends in one.
std::optional<CrossingLink> whole_way(const LinkNetwork& network, const Plan& plan, const Pdo& last,
                                      const Receiver& receiver, const Received& got) {
  const bool ends_in_gateway = std::ranges::any_of(plan.routes, [&](const Route& each) {
    return entry_node(network, each) == receiver.node && each.source == got.object;
  });
  if (ends_in_gateway) return std::nullopt;
  CrossingLink made{
      .from = last.producer, .source = last.carried[got.carried].object, .to = receiver.node, .target = got.object};
  made.pdos.push_back(static_cast<std::size_t>(&last - plan.pdos.data()));
  while (made.gateways.size() < network.gateways.size()) {
    const auto route = std::ranges::find_if(plan.routes, [&](const Route& each) {
      return exit_node(network, each) == made.from && each.target == made.source;
    });
    if (route == plan.routes.end()) break;
    const auto brought = brings(plan, entry_node(network, *route), route->source);
    made.from = brought.pdo->producer;
    made.source = brought.object;
    made.gateways.insert(made.gateways.begin(), route->gateway);
    made.pdos.insert(made.pdos.begin(), static_cast<std::size_t>(brought.pdo - plan.pdos.data()));
  }
  if (made.gateways.empty()) return std::nullopt;
  for (const std::size_t link : last.links) {
    const auto& written = network.links[link];
    const bool mine = written.from.node == made.from &&
                      std::ranges::any_of(written.to, [&](const End& end) { return end.node == made.to; });
    if (!mine || !written.deadline) continue;
    made.deadline = std::min(made.deadline.value_or(*written.deadline), *written.deadline);
  }
  return made;
}

}  // namespace

std::optional<std::vector<Hop>> way(const LinkNetwork& network, std::size_t from, std::size_t to) {
  auto up = up_from(network, from);
  auto down = up_from(network, to);
  while (!up.empty() && !down.empty() && up.back() == down.back()) {
    up.pop_back();
    down.pop_back();
  }
  const auto top_of = [&](const std::vector<std::size_t>& ups, std::size_t bus) {
    return ups.empty() ? bus : network.nodes[network.gateways[ups.back()].above].bus;
  };
  if (top_of(up, from) != top_of(down, to)) return std::nullopt;
  std::vector<Hop> hops;
  for (const std::size_t gateway : up) hops.push_back({gateway, false});
  std::ranges::reverse(down);
  for (const std::size_t gateway : down) hops.push_back({gateway, true});
  return hops;
}

std::size_t entry_of(const LinkNetwork& network, Hop hop) {
  const Gateway& gateway = network.gateways[hop.gateway];
  return hop.down ? gateway.above : *gateway.beneath;
}
std::size_t exit_of(const LinkNetwork& network, Hop hop) {
  const Gateway& gateway = network.gateways[hop.gateway];
  return hop.down ? *gateway.beneath : gateway.above;
}

std::optional<CannotCross> cannot_cross(const LinkNetwork& network, const Link& link, Consumer from, Consumer to,
                                        od::DataType type) {
  const Node& producer = network.nodes[from.node];
  const Node& consumer = network.nodes[to.node];
  const std::string& here = network.buses[producer.bus].name;
  const std::string& there = network.buses[consumer.bus].name;
  const auto hops = way(network, producer.bus, consumer.bus);
  if (!hops) {
    return CannotCross{fmt::format("{} is on {}, {} on {}, and no gateway leads from one to the other", producer.name,
                                   here, consumer.name, there),
                       "PDOs stay on one bus: name the gateway in [bus.NAME], or link both to a device on both buses"};
  }
  for (const auto& [node, object] : {std::pair{&producer, from.object}, std::pair{&consumer, to.object}}) {
    if (object == ObjectRef{} || !safety_relevant(*node, object)) continue;
    return CannotCross{fmt::format("{:04X}h:{:02X} of {} is safety-relevant (SRDO): it is never forwarded, as the "
                                   "gateway would have to be part of the safety function",
                                   object.index, object.sub, node->name),
                       "safety functions stay on one bus"};
  }
  if (link.transmission <= 240) {
    return CannotCross{
        fmt::format("SYNC of {} ends at its gateway, and this link waits for it as far as {}", here, there),
        "transmission = \"event\""};
  }
  const unsigned bits = od::bit_length(type);
  if (bits % 8 != 0 || !multilevel::signal_places(bits / 8)) {
    return CannotCross{fmt::format("it has {} bit, and gateways carry signals of 8, 16, 32 and 64 bits", bits),
                       "link the byte that it is part of, or an object of another size"};
  }
  for (const Hop hop : *hops) {
    if (auto wrong = cannot_carry(network, hop, bits / 8)) return wrong;
  }
  const auto delay = delay_of(network, *hops);
  if (!link.deadline || *link.deadline > delay) return std::nullopt;
  return CannotCross{
      fmt::format("its deadline is {:g} ms, and the {} on its way may take {:g} ms without any bus",
                  in_ms(*link.deadline), hops->size() == 1 ? "gateway" : fmt::format("{} gateways", hops->size()),
                  in_ms(delay)),
      "a longer deadline, or gateway = { delay = … } where a gateway is faster than that"};
}

std::vector<Route> cross(const LinkNetwork& network, Resolved& resolved, const Earlier& earlier, Findings& findings) {
  return Crossing(network, earlier, findings).run(resolved);
}

void finish_crossings(const LinkNetwork& network, Plan& plan) {
  // A link with a refused PDO has no complete way.
  std::erase_if(plan.routes, [&](const Route& route) {
    return brings(plan, entry_node(network, route), route.source).pdo == nullptr;
  });
  for (Route& route : plan.routes) {
    route.freshness_ms = brings(plan, entry_node(network, route), route.source).receiver->event_ms;
  }
  std::vector<std::optional<rt::Duration>> worst;
  for (const Pdo& pdo : plan.pdos) worst.push_back(pdo.worst);
  plan.crossings.clear();
  for (const Pdo& pdo : plan.pdos) {
    for (const Receiver& receiver : pdo.receivers) {
      for (const Received& got : receiver.received) {
        auto made = whole_way(network, plan, pdo, receiver, got);
        if (!made) continue;
        made->worst = worst_of(network, *made, worst);
        plan.crossings.push_back(std::move(*made));
      }
    }
  }
}

}  // namespace berth::linker
