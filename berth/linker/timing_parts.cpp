#include "berth/linker/timing_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/linker/bounds.hpp"

namespace berth::linker {
namespace {

using namespace std::chrono_literals;
using rt::Duration;

constexpr unsigned most_ticks = 0xFFFF;
constexpr Duration assumed_period = 10ms;  // as `berth analyze` has it of PDOs that say nothing
// Of links without a deadline; the first with which the others are in time.
constexpr std::array<Duration, 5> idle_inhibits{10ms, 20ms, 50ms, 100ms, 200ms};
constexpr unsigned no_deadline_event_ms = 1000;
constexpr unsigned least_event_ms = 100;
constexpr unsigned event_in_deadlines = 10;
constexpr unsigned missing_in_events = 3;

/// What of a deadline the inhibit time takes; the rest is for the bus.
struct Share {
  unsigned parts = 1;
  unsigned of = 2;
};
constexpr std::array<Share, 4> shares{{{1, 2}, {2, 3}, {3, 4}, {7, 8}}};

double ms(Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

class Timing {
 public:
  Timing(const Network& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals,
         const std::vector<bool>& linked, Plan& plan)
      : network_(network), devices_(devices), signals_(signals), linked_(linked), plan_(plan) {}

  bool run(Findings& findings) {
    bool good = true;
    plan_.buses.assign(network_.buses.size(), {});
    for (std::size_t bus = 0; bus < network_.buses.size(); ++bus) {
      const bool kept = std::ranges::any_of(idle_inhibits, [&](Duration idle) {
        idle_ = idle;
        return std::ranges::any_of(shares, [&](Share share) { return try_share(bus, share); });
      });
      if (!kept) {
        (void)try_share(bus, shares.front());
        tell(bus, findings);
      }
      good = good && kept;
    }
    return good;
  }

 private:
  const DevicePdo& device_of(const Pdo& pdo) const { return *devices_[pdo.producer].find(co::PdoKind::tpdo, pdo.tpdo); }

  static std::uint16_t event_of(const std::optional<Duration>& deadline) {
    if (!deadline) return no_deadline_event_ms;
    const auto whole = std::chrono::ceil<std::chrono::milliseconds>(*deadline * event_in_deadlines).count();
    return static_cast<std::uint16_t>(std::clamp<std::int64_t>(whole, least_event_ms, most_ticks));
  }

  void set(Pdo& pdo, Share share) const {
    const DevicePdo& device = device_of(pdo);
    pdo.inhibit = 0;
    pdo.event_ms = 0;
    if (!synchronous(pdo.transmission)) {
      // An MPDO carries one object at a time: the last of them waits for all others.
      const auto objects = static_cast<std::int64_t>(pdo.mpdo ? pdo.carried.size() : 1);
      Duration inhibit = idle_;
      if (pdo.deadline) inhibit = *pdo.deadline * share.parts / share.of / objects;
      const auto ticks = std::clamp<std::int64_t>(inhibit / inhibit_unit, 1, most_ticks);
      if (device.has_inhibit) pdo.inhibit = static_cast<std::uint16_t>(ticks);
      if (device.has_event) pdo.event_ms = event_of(pdo.deadline);
    }
    for (Receiver& each : pdo.receivers) {
      const DevicePdo* const rpdo = devices_[each.node].find(co::PdoKind::rpdo, each.rpdo);
      const bool watched = pdo.deadline && pdo.event_ms != 0 && !pdo.mpdo && rpdo != nullptr && rpdo->has_event;
      each.event_ms = static_cast<std::uint16_t>(watched ? std::min(pdo.event_ms * missing_in_events, most_ticks) : 0);
    }
  }

  Duration period_of(const Pdo& pdo) const {
    if (synchronous(pdo.transmission)) return network_.buses[pdo.bus].sync * std::max<unsigned>(pdo.transmission, 1);
    return pdo.inhibit > 0 ? inhibit_unit * pdo.inhibit : assumed_period;
  }
  std::size_t sender(analysis::Line& line, std::size_t node) const {
    const std::string& name = network_.nodes[node].name;
    const auto found = std::ranges::find(line.senders, name, &analysis::Sender::name);
    if (found != line.senders.end()) return static_cast<std::size_t>(found - line.senders.begin());
    line.senders.push_back({name, false});
    return line.senders.size() - 1;
  }

  /// PDOs that no link made: of devices that no link knows, and those that were configured.
  void add_kept(analysis::Line& line, std::size_t bus) const {
    for (std::size_t node = 0; node < network_.nodes.size(); ++node) {
      if (network_.nodes[node].bus != bus || !network_.nodes[node].file) continue;
      for (const DevicePdo& pdo : devices_[node].tpdos) {
        const bool stays = !linked_[node] || pdo.kept;
        const bool sent = pdo.valid && !pdo.mapping.empty();  // without objects it is switched off
        if (!sent || !stays || pdo.can_id > 0x7FF || pdo.type == 252 || pdo.type == 253) continue;
        Duration period = assumed_period;
        if (synchronous(pdo.type)) period = network_.buses[bus].sync * std::max<unsigned>(pdo.type, 1);
        if (!synchronous(pdo.type) && pdo.inhibit > 0) period = inhibit_unit * pdo.inhibit;
        if (!synchronous(pdo.type) && pdo.inhibit == 0 && pdo.event_ms > 0) period = 1ms * pdo.event_ms;
        if (period == Duration(0)) continue;
        unsigned bits = 0;
        for (const auto& entry : pdo.mapping) bits += entry.bits;
        line.messages.push_back({.name = fmt::format("TPDO {}", pdo.number),
                                 .sender = sender(line, node),
                                 .key = pdo.can_id,
                                 .data_bytes = std::min((bits + 7) / 8, 8U),
                                 .period = period});
      }
    }
  }

  bool try_share(std::size_t bus, Share share) {
    analysis::Line line = network_.buses[bus].others;
    add_kept(line, bus);
    std::vector<Pdo*> ours;
    const std::size_t first = line.messages.size();
    bool in_time = true;
    for (Pdo& pdo : plan_.pdos) {
      if (pdo.bus != bus) continue;
      set(pdo, share);
      const auto left = pdo.deadline ? left_for_bus(sending_of(network_, pdo), *pdo.deadline) : Duration(0);
      line.messages.push_back({.name = fmt::format("TPDO {}", pdo.tpdo),
                               .sender = sender(line, pdo.producer),
                               .key = pdo.can_id,
                               .data_bytes = pdo.bytes(),
                               .period = period_of(pdo),
                               .deadline = left});
      ours.push_back(&pdo);
    }
    const auto result = analysis::analyze(line);
    for (const auto& response : result.responses) {
      if (response.message < first) continue;
      Pdo& pdo = *ours[response.message - first];
      pdo.worst.reset();
      if (!response.worst) in_time = false;
      if (response.worst) pdo.worst = worst_of(network_, pdo, *response.worst);
      if (!response.meets_deadline) in_time = false;
    }
    measure(bus, line, first, result);
    return in_time;
  }

  void measure(std::size_t bus, const analysis::Line& line, std::size_t first, const analysis::Result& result) {
    BusLoad& load = plan_.buses[bus];
    load = {.load = result.load};
    for (const auto& response : result.responses) {
      if (response.message >= first) load.pdos += response.load;
    }
    for (const Signal& signal : signals_) {
      if (network_.nodes[signal.producer].bus != bus) continue;
      ++load.objects;
      Duration period = network_.buses[bus].sync * std::max<unsigned>(signal.transmission, 1);
      if (!synchronous(signal.transmission)) {
        period = signal.deadline ? std::max<Duration>(*signal.deadline / 2, inhibit_unit) : idle_;
      }
      const auto frame = analysis::frame_time(line, false, (signal.bits + 7U) / 8U);
      load.one_object_each += static_cast<double>(frame.count()) / static_cast<double>(period.count());
    }
  }

  void tell(std::size_t bus, Findings& findings) {
    const BusLoad& load = plan_.buses[bus];
    bool told = false;
    for (const Pdo& pdo : plan_.pdos) {
      if (pdo.bus != bus) continue;
      for (const std::size_t link : pdo.links) told = tell_link(pdo, link, findings) || told;
    }
    if (told) return;
    findings.push_back({Finding::Severity::error, network_.file, 0, 0, fmt::format("bus.{}", network_.buses[bus].name),
                        fmt::format("the bus is too slow: everything on it would take {:.0f} % of it", 100 * load.load),
                        "raise the bit rate, give the links deadlines, or link fewer objects"});
  }

  /// What of the deadline of a link across gateways is for the bus of this PDO.
  std::optional<Duration> share_of(const Pdo& pdo, std::size_t link) const {
    std::optional<Duration> share;
    for (const Signal& signal : signals_) {
      const bool here = network_.nodes[signal.producer].bus == pdo.bus;
      if (!here || !signal.crosses || !signal.deadline || !network_.links[link].deadline) continue;
      if (std::ranges::find(signal.links, link) == signal.links.end()) continue;
      share = std::min(share.value_or(*signal.deadline), *signal.deadline);
    }
    return share;
  }

  bool tell_link(const Pdo& pdo, std::size_t link, Findings& findings) const {
    const auto share = share_of(pdo, link);
    const auto& deadline = share ? share : network_.links[link].deadline;
    const bool no_bound = !pdo.worst;
    if (!no_bound && (!deadline || *pdo.worst <= *deadline)) return false;
    const Bus& bus = network_.buses[pdo.bus];
    if (deadline && synchronous(pdo.transmission) && waiting(sending_of(network_, pdo)) > *deadline) {
      findings.push_back(
          refusal(network_, link,
                  fmt::format("SYNC on {} is every {:g} ms: this link takes {:g} ms, its deadline is {:g} ms", bus.name,
                              ms(bus.sync), ms(waiting(sending_of(network_, pdo))), ms(*deadline)),
                  "a shorter SYNC period, a longer deadline, or transmission = \"event\""));
      return true;
    }
    const std::string worst =
        no_bound ? "there is no bound on how long it takes" : fmt::format("it can take {:.3f} ms", ms(*pdo.worst));
    std::string wanted = deadline ? fmt::format(", its deadline is {:g} ms", ms(*deadline)) : "";
    if (share) {
      wanted = fmt::format(", its deadline is {:g} ms, of which {:g} ms are for this bus",
                           ms(*network_.links[link].deadline), ms(*share));
    }
    findings.push_back(
        refusal(network_, link,
                fmt::format("bus {} is too slow for this link: {}{}; TPDO {} of {}, CAN-ID {:03X}h", bus.name, worst,
                            wanted, pdo.tpdo, network_.nodes[pdo.producer].name, pdo.can_id),
                fmt::format("a longer deadline, a higher bit rate than {} kbit/s, or fewer objects; all of "
                            "the bus's messages take {:.0f} % of it at most",
                            bus.others.bit_rate / 1000, 100 * plan_.buses[pdo.bus].load)));
    return true;
  }

  const Network& network_;
  const std::vector<DevicePdos>& devices_;
  const std::vector<Signal>& signals_;
  const std::vector<bool>& linked_;
  Plan& plan_;
  Duration idle_ = idle_inhibits.front();
};

}  // namespace

bool set_times(const Network& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals,
               const std::vector<bool>& linked, Plan& plan, Findings& findings) {
  return Timing(network, devices, signals, linked, plan).run(findings);
}

}  // namespace berth::linker
