#include "berth/linker/timing_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <tuple>

#include "berth/linker/bounds.hpp"

namespace berth::linker {
namespace {

using namespace std::chrono_literals;
using analysis::Queue;
using rt::Duration;

constexpr unsigned most_ticks = 0xFFFF;
// For links without a deadline: the first with which the others are in time is used.
constexpr std::array<Duration, 9> idle_inhibits{10ms, 20ms, 50ms, 100ms, 200ms, 500ms, 1s, 2s, 5s};
constexpr unsigned no_deadline_event_ms = 1000;
constexpr unsigned least_event_ms = 100;
constexpr unsigned event_in_deadlines = 10;
constexpr unsigned missing_in_events = 3;

/// The largest part of a deadline for the inhibit time; the rest is for the bus.
struct Share {
  unsigned parts = 1;
  unsigned of = 2;
};
// A short inhibit time lets changes follow each other soon, a long one leaves the bus to others.
constexpr std::array<Share, 5> shares{{{1, 2}, {2, 3}, {3, 4}, {7, 8}, {1, 1}}};

double ms(Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

class Timing {
 public:
  Timing(const LinkNetwork& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals,
         const std::vector<bool>& linked, Plan& plan)
      : network_(network), devices_(devices), signals_(signals), linked_(linked), plan_(plan) {}

  bool run(Findings& findings) {
    bool good = true;
    plan_.buses.assign(network_.buses.size(), {});
    for (std::size_t bus = 0; bus < network_.buses.size(); ++bus) {
      // Brings everything on the bus in time; if that is impossible, at least the links.
      all_ = true;
      bool kept = find_times(bus);
      all_ = false;
      kept = kept || find_times(bus);
      if (!kept) {
        tell_queue(bus, findings);
        idle_ = idle_inhibits.front();
        (void)try_share(bus, shares.front(), false);
        tell(bus, findings);
      }
      good = good && kept;
    }
    return good;
  }

 private:
  /// Anything that fits with short times also fits with the longest: if these do not fit, nothing does.
  bool find_times(std::size_t bus) {
    idle_ = idle_inhibits.front();
    if (try_share(bus, shares.front())) return true;
    idle_ = idle_inhibits.back();
    if (!try_share(bus, shares.back())) return false;
    return std::ranges::any_of(idle_inhibits, [&](Duration idle) {
      idle_ = idle;
      return std::ranges::any_of(shares, [&](Share share) { return try_share(bus, share); });
    });
  }

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
      Duration inhibit = idle_;
      if (pdo.deadline) inhibit = *pdo.deadline * share.parts / share.of / objects_of(pdo);
      if (const auto said = inhibit_of_links(pdo)) inhibit = *said;
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

  /// An MPDO carries one object at a time: the last one waits for all others.
  static std::int64_t objects_of(const Pdo& pdo) noexcept {
    return static_cast<std::int64_t>(pdo.mpdo ? pdo.carried.size() : 1);
  }

  /// The longest inhibit time that the PDO's links give.
  [[nodiscard]] std::optional<Duration> inhibit_of_links(const Pdo& pdo) const {
    std::optional<Duration> longest;
    for (const std::size_t link : pdo.links) {
      if (const auto& said = network_.links[link].inhibit) longest = std::max(longest.value_or(*said), *said);
    }
    return longest;
  }

  [[nodiscard]] Duration period_of(const Pdo& pdo) const {
    const auto said = inhibit_of_links(pdo).value_or(network_.nodes[pdo.producer].interval);
    return least_interval(pdo.transmission, inhibit_unit * pdo.inhibit, network_.buses[pdo.bus].sync, said);
  }
  std::size_t sender(analysis::Line& line, std::size_t node) const {
    const std::string& name = network_.nodes[node].name;
    const auto found = std::ranges::find(line.senders, name, &analysis::Sender::name);
    if (found != line.senders.end()) return static_cast<std::size_t>(found - line.senders.begin());
    line.senders.push_back({name, analysis::Queue::unknown});
    return line.senders.size() - 1;
  }

  /// Adds the PDOs that no link made: those of devices without links, and configured ones.
  void add_kept(analysis::Line& line, std::size_t bus) const {
    for (std::size_t node = 0; node < network_.nodes.size(); ++node) {
      if (network_.nodes[node].bus != bus || !network_.nodes[node].file) continue;
      for (const DevicePdo& pdo : devices_[node].tpdos) {
        const bool stays = !linked_[node] || pdo.kept;
        const bool sent = pdo.valid && !pdo.mapping.empty();  // without objects it is switched off
        const Duration sync = network_.buses[bus].sync;
        if (!sent || !stays || pdo.can_id > 0x7FF || unsent(pdo.type, sync) != Unsent::no) continue;
        const auto period = least_interval(pdo.type, inhibit_unit * pdo.inhibit, sync, network_.nodes[node].interval);
        unsigned bits = 0;
        for (const auto& entry : pdo.mapping) bits += entry.bits;
        line.messages.push_back({.name = fmt::format("TPDO {}", pdo.number),
                                 .sender = sender(line, node),
                                 .key = pdo.can_id,
                                 .data_bytes = std::min((bits + 7) / 8, 8U),
                                 .period = period});
        set_sending(line.messages.back(),
                    {.transmission = pdo.type, .sync = sync, .sync_key = network_.buses[bus].sync_key}, false, {});
      }
    }
  }

  /// One trial on a bus: its PDOs, and their messages after the others.
  struct Tried {
    analysis::Line line;
    std::size_t first = 0;
    std::vector<Pdo*> pdos = {};
  };

  Tried begin(std::size_t bus, Share share) {
    Tried tried{network_.buses[bus].others};
    add_kept(tried.line, bus);
    tried.first = tried.line.messages.size();
    for (Pdo& pdo : plan_.pdos) {
      if (pdo.bus != bus) continue;
      set(pdo, share);
      tried.line.messages.push_back({.name = fmt::format("TPDO {}", pdo.tpdo),
                                     .sender = sender(tried.line, pdo.producer),
                                     .key = pdo.can_id,
                                     .data_bytes = pdo.bytes()});
      tried.pdos.push_back(&pdo);
    }
    for (auto& sender : tried.line.senders) {
      const bool slot = std::ranges::find(network_.nodes, sender.name, &Node::name) != network_.nodes.end();
      if (meant_ && slot && sender.queue == Queue::unknown) sender.queue = *meant_;
    }
    return tried;
  }

  void take_times(Tried& tried) const {
    for (std::size_t i = 0; i < tried.pdos.size(); ++i) {
      const Pdo& pdo = *tried.pdos[i];
      auto& message = tried.line.messages[tried.first + i];
      message.period = period_of(pdo);
      set_sending(message, sending_of(network_, pdo), true, pdo.deadline);
    }
  }

  /// Shortens the inhibit time of a late PDO to what its deadline leaves after the bus's time. False: none was
  /// shortened, or one cannot be short enough.
  bool shorten(Tried& tried, const analysis::Result& result) const {
    if (result.load > 1) return false;  // a shorter inhibit time would raise the load
    bool shortened = false;
    for (const auto& response : result.responses) {
      if (response.message < tried.first) continue;
      Pdo& pdo = *tried.pdos[response.message - tried.first];
      if (!response.worst) return false;
      if (response.meets_deadline || !pdo.deadline) continue;
      if (*response.worst >= *pdo.deadline) return false;
      if (synchronous(pdo.transmission) || pdo.inhibit <= 1 || inhibit_of_links(pdo)) return false;
      const auto most = (*pdo.deadline - *response.worst) / objects_of(pdo) / inhibit_unit;
      // The time of the frames before it also decreases with a shorter inhibit time, so go only half of the way.
      const auto waits = tried.line.messages[response.message].before;
      const auto now = (*pdo.deadline - *response.arrival + waits) / objects_of(pdo) / inhibit_unit;
      const auto ticks = pdo.inhibit > most ? most : (std::max<std::int64_t>(now, 0) + pdo.inhibit) / 2;
      pdo.inhibit = static_cast<std::uint16_t>(std::clamp<std::int64_t>(ticks, 1, pdo.inhibit - 1));
      shortened = true;
    }
    return shortened;
  }

  /// Makes inhibit times as long as possible, because a longer one leaves the bus to the others. Begins with the
  /// longest, and shortens until all fit or one cannot be shorter.
  bool try_share(std::size_t bus, Share share, bool shortens = true) {
    Tried tried = begin(bus, share);
    take_times(tried);
    auto result = analysis::analyze(tried.line);
    while (shortens && shorten(tried, result)) {
      take_times(tried);
      result = analysis::analyze(tried.line);
    }
    bool in_time = result.load <= 1;
    for (const auto& response : result.responses) {
      const bool own = response.message >= tried.first;
      in_time = in_time && (response.meets_deadline || !(own || all_));
      if (own) tried.pdos[response.message - tried.first]->worst = response.arrival;
    }
    measure(bus, tried.line, tried.first, result);
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

  /// A message that may come at any time leaves no bound for lower priorities.
  bool tell_endless(std::size_t bus, Findings& findings) {
    Tried tried = begin(bus, shares.front());
    take_times(tried);
    bool told = false;
    for (const auto& message : tried.line.messages) {
      if (message.period > Duration(0)) continue;
      const auto& name = tried.line.senders[message.sender].name;
      findings.push_back({Finding::Severity::error, network_.file, 0, 0, fmt::format("{}/{}", name, message.name),
                          fmt::format("{:03X}h is sent at each change, and its shortest interval is not known: neither "
                                      "it nor frames of lower priority have a bound",
                                      message.key),
                          "write the interval that it keeps into its link or its slot, such as inhibit = \"10 ms\""});
      told = true;
    }
    return told;
  }

  void error(std::size_t bus, Findings& findings, std::string message, std::string fix) const {
    findings.push_back({Finding::Severity::error, network_.file, 0, 0, fmt::format("bus.{}", network_.buses[bus].name),
                        std::move(message), std::move(fix)});
  }

  /// Reports whether the unknown queues are the only reason.
  void tell_queue(std::size_t bus, Findings& findings) {
    std::vector<std::string> unknown;
    for (const auto& node : network_.nodes) {
      const auto& senders = network_.buses[bus].others.senders;
      const auto sender = std::ranges::find(senders, node.name, &analysis::Sender::name);
      if (sender != senders.end() && sender->queue == Queue::unknown) unknown.push_back(node.name);
    }
    if (unknown.empty()) return;
    for (const auto& [queue, word, how] : {std::tuple(Queue::priority, "priority", "by identifier"),
                                           std::tuple(Queue::in_order, "in-order", "as they came")}) {
      meant_ = queue;
      const bool fits = find_times(bus);
      meant_.reset();
      if (!fits) continue;
      const std::string who =
          unknown.size() == 1 ? unknown.front() : fmt::format("{} and {} more", unknown.front(), unknown.size() - 1);
      return error(bus, findings,
                   fmt::format("it is not known in which order {} {} frames that wait, so the worse order is assumed: "
                               "if they leave {}, all are in time",
                               who, unknown.size() == 1 ? "sends" : "send", how),
                   fmt::format("write queue = \"{}\" into the slots whose devices do that", word));
    }
  }

  /// The messages that take most of a bus.
  static std::string most_of(const analysis::Line& line, const analysis::Result& result) {
    constexpr std::size_t most = 3;
    auto all = result.responses;
    std::ranges::stable_sort(all, std::ranges::greater{}, &analysis::Response::load);
    std::string text;
    for (std::size_t i = 0; i < std::min(most, all.size()); ++i) {
      const auto& message = line.messages[all[i].message];
      text += fmt::format("{}{} of {} {:.0f} %", i == 0 ? "" : ", ", message.name, line.senders[message.sender].name,
                          100 * all[i].load);
    }
    return text;
  }

  /// More than the whole bus.
  bool tell_load(std::size_t bus, Findings& findings) {
    Tried tried = begin(bus, shares.front());
    take_times(tried);
    const auto result = analysis::analyze(tried.line);
    if (result.load <= 1) return false;
    error(bus, findings,
          fmt::format("the bus is too slow: everything on it would take {:.0f} % of it; most by {}", 100 * result.load,
                      most_of(tried.line, result)),
          "raise the bit rate, give the links deadlines or inhibit times that are longer, or link fewer objects");
    return true;
  }

  void tell(std::size_t bus, Findings& findings) {
    if (tell_endless(bus, findings)) return;
    bool told = tell_load(bus, findings);
    for (const Pdo& pdo : plan_.pdos) {
      if (pdo.bus != bus) continue;
      for (const std::size_t link : pdo.links) told = tell_link(pdo, link, findings) || told;
    }
    if (told) return;
    error(bus, findings, "no times were found with which all links are in time",
          "raise the bit rate, give the links longer deadlines, or link fewer objects");
  }

  /// The part of the deadline of a link across gateways that this PDO's bus may use.
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

  const LinkNetwork& network_;
  const std::vector<DevicePdos>& devices_;
  const std::vector<Signal>& signals_;
  const std::vector<bool>& linked_;
  Plan& plan_;
  Duration idle_ = idle_inhibits.front();
  std::optional<Queue> meant_{};  // for queues that are not known
  bool all_ = false;              // all messages have to be in time, not only the links'
};

}  // namespace

bool set_times(const LinkNetwork& network, const std::vector<DevicePdos>& devices, const std::vector<Signal>& signals,
               const std::vector<bool>& linked, Plan& plan, Findings& findings) {
  return Timing(network, devices, signals, linked, plan).run(findings);
}

}  // namespace berth::linker
