#include "berth/doctor/diagnose.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "berth/can/frame.hpp"
#include "berth/doctor/findings.hpp"
#include "berth/doctor/silence.hpp"
#include "berth/places/plan.hpp"

namespace berth::doctor {

const char* name(Kind kind) noexcept {
  switch (kind) {
    case Kind::silent_bus: return "silent-bus";
    case Kind::duplicate_node_id: return "duplicate-node-id";
    case Kind::identifier_collision: return "identifier-collision";
    case Kind::blank_node: return "blank-node";
    case Kind::wrong_bit_rate: return "wrong-bit-rate";
    case Kind::missing_heartbeat: return "missing-heartbeat";
    case Kind::error_passive: return "error-passive";
    case Kind::overload: return "overload";
    case Kind::short_lss_answer: return "short-lss-answer";
    case Kind::disturbance: break;
  }
  return "disturbance";
}

const char* name(Certainty certainty) noexcept {
  switch (certainty) {
    case Certainty::possible: return "possible";
    case Certainty::likely: return "likely";
    case Certainty::certain: break;
  }
  return "certain";
}

const places::SlotSpec* Expected::slot(NodeId node) const noexcept {
  const auto it = std::ranges::find(slots, node, &places::SlotSpec::id);
  return it == slots.end() ? nullptr : &*it;
}

Rhythm rhythm(std::span<const rt::Time> times, rt::Duration period) {
  Rhythm r;
  r.beats = times.size();
  if (times.size() < 6) return r;
  std::vector<rt::Duration> intervals;
  for (std::size_t i = 1; i < times.size(); ++i) intervals.push_back(times[i] - times[i - 1]);
  auto sorted = intervals;
  std::ranges::sort(sorted);
  r.usual = sorted[sorted.size() * 9 / 10];
  const auto mean = (times.back() - times.front()) / static_cast<std::int64_t>(intervals.size());
  if (mean.count() <= 0 || r.usual.count() <= 0) return r;
  const auto base = period.count() > 0 ? period : r.usual;
  r.rate = static_cast<double>(base.count()) / static_cast<double>(mean.count());
  // One clock with a changed period goes from long to short once; two clocks alternate.
  unsigned turns = 0;
  for (std::size_t i = 1; i < intervals.size(); ++i) {
    const bool is_short = intervals[i] * 4 < r.usual * 3;
    const bool was_short = intervals[i - 1] * 4 < r.usual * 3;
    if (is_short != was_short) ++turns;
  }
  const double spread = static_cast<double>(r.usual.count()) / static_cast<double>(mean.count());
  r.interleaved = turns >= 4 && turns * 4 >= intervals.size() && spread >= 1.25;
  return r;
}

namespace {

using namespace std::chrono_literals;

/// Collects the findings about one bus.
class Consultation {
 public:
  Consultation(const Heard& heard, const Expected& expected, const Answers& answers)
      : heard_(heard), expected_(expected), answers_(answers), silence_(heard, expected, answers) {}

  std::vector<Diagnosis> findings() {
    if (auto cause = silence_.of_bus()) return {std::move(*cause)};
    find_strangers_rate();
    for (unsigned n = 1; n <= 127; ++n) duplicate(NodeId(static_cast<std::uint8_t>(n)));
    collisions();
    blanks();
    short_answers();
    for (unsigned n = 1; n <= 127; ++n) {
      const NodeId id(static_cast<std::uint8_t>(n));
      if (id == jammer_) continue;
      if (auto missing = silence_.of_heartbeat(id, jammed_)) found_.push_back(std::move(*missing));
    }
    passive();
    overload();
    disturbance();
    std::ranges::stable_sort(found_, {}, [](const Diagnosis& d) { return std::pair(d.kind, d.node.value()); });
    return std::move(found_);
  }

 private:
  Diagnosis& add(Kind kind, Certainty certainty, NodeId node = NodeId()) {
    return found_.emplace_back(finding(expected_, kind, certainty, node));
  }
  [[nodiscard]] bool has(Kind kind, NodeId node) const {
    return std::ranges::any_of(found_, [&](const auto& d) { return d.kind == kind && d.node == node; });
  }
  [[nodiscard]] std::string who(NodeId node) const { return doctor::who(expected_, node); }

  // ---- a node at another bit rate ----

  /// Nodes that reported error-passive or bus-off.
  [[nodiscard]] std::vector<NodeId> complaining() const {
    std::vector<NodeId> nodes;
    for (unsigned n = 1; n <= 127; ++n) {
      const NodeId id(static_cast<std::uint8_t>(n));
      if (heard_.node(id).error_passive.count + heard_.node(id).bus_off.count > 0) nodes.push_back(id);
    }
    return nodes;
  }

  /// Only this node reports errors, around every long run: its own wire is the cause, not another node.
  [[nodiscard]] bool explained_by(NodeId id) const {
    const auto& node = heard_.node(id);
    const auto near = [](const Count& c, const ErrorRun& run) {
      return c.count > 0 && c.first - 1s <= run.last && run.first <= c.last + 1s;
    };
    return std::ranges::all_of(heard_.runs, [&](const ErrorRun& run) {
      return run.count < Heard::long_run || near(node.error_passive, run) || near(node.bus_off, run);
    });
  }

  // A node at another bit rate destroys dozens of attempts in a row, again and again, or causes errors all the time
  // while several nodes report them. Its own frames are never heard (docs/protocols/can-frames.md §Fault confinement).
  void find_strangers_rate() {
    const auto runs = heard_.long_runs();
    const auto loud = complaining();
    const bool own_trouble = loud.size() == 1 && explained_by(loud.front());
    const bool in_a_row = runs >= 2 && heard_.collided.empty();
    const bool everywhere = loud.size() >= 2 && heard_.errors >= 50 && heard_.errors * 20ULL >= heard_.frames;
    if (own_trouble || (!in_a_row && !everywhere)) return;
    std::vector<NodeId> suspects;
    for (const auto& slot : expected_.slots) {
      if (silence_.unheard(slot)) suspects.push_back(slot.id);
    }
    jammed_ = true;
    const bool one = suspects.size() == 1;
    auto& d = add(Kind::wrong_bit_rate, one ? Certainty::likely : Certainty::possible, one ? suspects[0] : NodeId());
    const auto longest = std::ranges::max_element(heard_.runs, {}, &ErrorRun::count);
    d.count = heard_.errors;
    if (longest != heard_.runs.end()) {
      d.first = heard_.runs.front().first;
      d.last = heard_.runs.back().last;
      d.evidence.push_back(
          fmt::format("{} errors to {} good frames, from {:.3f} s to {:.3f} s; {} in a row at most, {} or "
                      "more {} times",
                      heard_.errors, heard_.frames, in_seconds(d.first), in_seconds(d.last), longest->count,
                      Heard::long_run, runs));
    }
    d.evidence.push_back(
        fmt::format("this port's counters went up to TEC {}, REC {}", heard_.worst.tec, heard_.worst.rec));
    if (!loud.empty()) d.evidence.push_back(fmt::format("node {} reported error-passive or bus-off", list(loud)));
    if (one) {
      jammer_ = suspects[0];
      d.what =
          fmt::format("a node destroys frames as a device at another bit rate does; probably {}", who(suspects[0]));
      d.evidence.push_back(fmt::format("{} is the only slot that was never heard", who(suspects[0])));
      d.advice = fmt::format("set {} to {} bit/s, or take it off the bus and look whether the errors end",
                             who(suspects[0]), expected_.bit_rate);
    } else if (suspects.empty()) {
      d.what = "a node destroys frames as a device at another bit rate does";
      d.evidence.push_back(expected_.slots.empty() ? "without a machine file no device is known to be missing"
                                                   : "every slot was heard well: it is a device of no slot");
      d.advice = "take devices off the bus one by one until the errors end; that one's bit rate is wrong";
    } else {
      d.what = "a node destroys frames as a device at another bit rate does";
      d.evidence.push_back(fmt::format("never heard: nodes {}", list(suspects)));
      d.advice = fmt::format("look at the bit rates of nodes {} first", list(suspects));
    }
  }

  // ---- two devices with one node-ID ----

  struct Signs {
    Certainty certainty = Certainty::possible;
    std::vector<std::string> evidence;
    void note(Certainty c, std::string text) {
      certainty = std::max(certainty, c);
      evidence.push_back(std::move(text));
    }
  };

  void duplicate(NodeId id) {
    const auto& node = heard_.node(id);
    Signs signs;
    const auto note = [&](Certainty c, std::string text) { signs.note(c, std::move(text)); };
    Count seen;
    if (node.flips.count >= 3) {
      // A missed command or boot-up would also explain it.
      note(node.flips.count >= 6 && heard_.complete() ? Certainty::certain : Certainty::likely,
           fmt::format("its heartbeats report two NMT states alternately, without a command between: {}",
                       times(node.flips)));
      seen = node.flips;
    }
    if (const auto boots = boots_beside(node, expected_.heartbeat_period); boots.count > 0) {
      // A device may keep its heartbeat's rhythm through a commanded reset.
      const bool by_itself = node.resets.count == 0 && heard_.complete();
      note(boots.count > 1 && by_itself ? Certainty::certain : Certainty::likely,
           fmt::format("a boot-up message while the heartbeat went on in its old rhythm: {}", times(boots)));
      seen = boots;
    }
    if (const auto text = rhythm_of(id, signs.certainty); !text.empty()) {
      signs.evidence.push_back(text);
      seen = node.beat;
    }
    // A node that sends heartbeats more often than it is asked does not guard.
    const bool guards = node.guard_requests >= 3 && node.beat.count <= 4 * node.guard_requests;
    if (guards && node.guard_answers * 2 >= node.guard_requests * 3) {
      note(Certainty::likely,
           fmt::format("{} answers to {} guarding requests", node.guard_answers, node.guard_requests));
    }
    if (!signs.evidence.empty() && node.collision.count > 0) {
      note(Certainty::likely,
           fmt::format("it sent EMCY 8150h, another sends with its identifiers: {}", times(node.collision)));
    }
    std::vector<LssAddress> devices = asked_twice(id, signs);
    if (signs.evidence.empty()) return;
    const Certainty certainty = signs.certainty;
    auto& d = add(Kind::duplicate_node_id, certainty, id);
    when(d, seen);
    d.what = fmt::format("two devices have node-ID {}", id.value());
    if (certainty == Certainty::possible) d.what = fmt::format("perhaps two devices have node-ID {}", id.value());
    d.evidence = std::move(signs.evidence);
    d.devices = std::move(devices);
    d.advice = certainty == Certainty::certain
                   ? fmt::format("take one of them off the bus and give it another node-ID, then connect it again")
                   : fmt::format(
                         "switch the device of node {} off: if the node is still heard, there is another one; `berth "
                         "doctor --active` asks by LSS",
                         id.value());
  }

  // Notes signs from the answers that several devices have this node-ID. Returns those that LSS identified.
  std::vector<LssAddress> asked_twice(NodeId id, Signs& signs) const {
    std::vector<LssAddress> devices;
    for (const auto& p : answers_.present) {
      if (p.told && p.active == id) devices.push_back(p.device);
    }
    if (devices.size() > 1) {
      std::string both;
      for (const auto& d : devices) both += (both.empty() ? "" : " and ") + to_string(d);
      signs.note(Certainty::certain, fmt::format("by LSS: {} have node-ID {}", both, id.value()));
    }
    for (const auto& a : answers_.serials) {
      if (a.node != id || a.answers < 2) continue;
      std::string values;
      for (const auto v : a.values) values += fmt::format("{}{:08X}h", values.empty() ? "" : ", ", v);
      signs.note(a.values.size() > 1 ? Certainty::certain : Certainty::likely,
                 fmt::format("{} answers to one SDO request, serial numbers {}", a.answers, values));
    }
    return devices;
  }

  [[nodiscard]] std::string rhythm_of(NodeId id, Certainty& certainty) const {
    std::vector<rt::Time> at;
    for (const auto& beat : heard_.node(id).beats) at.push_back(beat.at);
    const bool known = expected_.known(id) && expected_.heartbeat_period.count() > 0;
    const auto r = rhythm(at, known ? expected_.heartbeat_period : rt::Duration{0});
    // A full bus disturbs the rhythm.
    if (r.beats < 6 || (jammed_ && !known) || heard_.load(expected_.bit_rate) >= 0.8) return {};
    const bool twice = r.rate > 1.8 && r.rate < 2.2;
    if (known && r.rate < 1.4) return {};
    if (!r.interleaved && !(known && twice)) return {};
    if (r.interleaved && known) certainty = std::max(certainty, Certainty::likely);
    if (known) {
      return fmt::format("{} heartbeats, {:.1f} times as many as one device sends every {:g} ms{}", r.beats, r.rate,
                         in_ms(expected_.heartbeat_period),
                         r.interleaved ? ", in two alternating rhythms" : ", evenly spaced");
    }
    return fmt::format("{} heartbeats in two alternating rhythms", r.beats);
  }

  // ---- identifiers ----

  void collisions() {
    for (unsigned n = 1; n <= 127; ++n) {
      const NodeId id(static_cast<std::uint8_t>(n));
      const auto& node = heard_.node(id);
      if (node.collision.count == 0 || has(Kind::duplicate_node_id, id)) continue;
      auto& d = add(Kind::identifier_collision, Certainty::certain, id);
      when(d, node.collision);
      d.what = fmt::format("{} hears another node send with one of its identifiers", who(id));
      d.evidence.push_back(fmt::format("it sent EMCY 8150h: {}", times(node.collision)));
      d.advice = fmt::format(
          "is there a second device with node-ID {}? If not, look for a PDO or SYNC of another node that is mapped to "
          "an identifier of this one",
          id.value());
    }
    for (const auto& [key, count] : heard_.collided) {
      const NodeId id(static_cast<std::uint8_t>(key & 0x7FU));
      const bool of_node = (key & can::extended_flag) == 0 && (key & 0x780U) >= 0x080U && id.value() != 0;
      if (of_node && has(Kind::duplicate_node_id, id)) continue;
      auto& d = add(Kind::identifier_collision, Certainty::likely, of_node ? id : NodeId());
      d.cob_id = key;
      when(d, count);
      d.what = fmt::format("two nodes send with identifier {:03X}h", key & ~can::extended_flag);
      d.evidence.push_back(fmt::format(
          "after many destroyed attempts two frames of it that differ came back to back: {}", times(count)));
      d.advice = "give one of the two another identifier, or another node-ID";
    }
    if (const auto r = rhythm(heard_.syncs, rt::Duration{0}); r.interleaved && !jammed_) {
      auto& d = add(Kind::identifier_collision, Certainty::likely);
      d.cob_id = 0x080;
      d.count = heard_.syncs.size();
      d.first = heard_.syncs.front();
      d.last = heard_.syncs.back();
      d.what = "two nodes produce SYNC (identifier 080h)";
      d.evidence.push_back(fmt::format("{} SYNC messages in two alternating rhythms", r.beats));
      d.advice = "clear bit 30 of object 1005h in all devices but one";
    }
    claims();
  }

  void claims() {
    std::set<std::uint32_t> told;
    for (const auto& a : answers_.claims) {
      const NodeId owner(static_cast<std::uint8_t>(a.key & 0x7FU));
      const auto range = a.key & 0x780U;
      const bool tpdo_of_another = (a.key & can::extended_flag) == 0 && range >= 0x180 && range <= 0x480 &&
                                   (range & 0x80U) != 0 && owner.value() != 0 && owner != a.node;
      for (const auto& b : answers_.claims) {
        const bool both = b.key == a.key && a.node < b.node;
        if (!both || !told.insert(a.key).second) continue;
        auto& d = add(Kind::identifier_collision, Certainty::certain, tpdo_of_another ? a.node : b.node);
        d.cob_id = a.key;
        d.what = fmt::format("{} and {} send PDOs with one identifier, {:03X}h", who(a.node), who(b.node),
                             a.key & ~can::extended_flag);
        d.evidence.push_back(fmt::format("by SDO: node {} has it in {:04X}h, node {} in {:04X}h", a.node.value(),
                                         a.object, b.node.value(), b.object));
        d.advice = "give one of the two PDOs another COB-ID";
      }
    }
  }

  // ---- LSS ----

  void short_answers() {
    if (heard_.short_answers.all.count == 0) return;
    auto& d = add(Kind::short_lss_answer, Certainty::certain);
    when(d, heard_.short_answers.all);
    const auto& first = heard_.short_answers.first_frame;
    d.what = "a device sends LSS answers with fewer than 8 bytes";
    d.evidence.push_back(fmt::format("{:02X}h with {} of 8 bytes, and others: {}", first.data[0], first.size,
                                     times(heard_.short_answers.all)));
    d.advice =
        "Berth reads them; other LSS masters may not (CiA 305 has 8 bytes): ask the device's maker for new firmware";
  }

  // Another LSS master's questions showed the blank device; that master may have given it a node-ID since.
  [[nodiscard]] bool had_one() const { return heard_.given.count > 0 && heard_.given.last > heard_.blank.all.last; }
  [[nodiscard]] bool denied() const { return answers_.asked && !answers_.blank; }

  [[nodiscard]] bool tells_blank() const {
    return answers_.blank || (heard_.blank.all.count > 0 && !(had_one() && denied()));
  }

  // Devices that reported by LSS that they have no node-ID.
  [[nodiscard]] std::vector<LssAddress> told_blank() const {
    std::vector<LssAddress> all;
    for (const auto& p : answers_.present) {
      if (p.told && !p.active.configured()) all.push_back(p.device);
    }
    return all;
  }

  // All devices are known, and none fits one of these slots.
  [[nodiscard]] bool fit_nowhere(const std::vector<LssAddress>& devices, const std::vector<NodeId>& candidates) const {
    return !devices.empty() && !candidates.empty() && std::ranges::none_of(devices, [&](const LssAddress& device) {
      return std::ranges::any_of(candidates, [&](NodeId id) { return places::fits(*expected_.slot(id), device); });
    });
  }

  void blank(const std::vector<NodeId>& unheard) {
    const auto devices = told_blank();
    const bool foreign = fit_nowhere(devices, unheard);
    const std::vector<NodeId> candidates = foreign ? std::vector<NodeId>() : unheard;
    const bool one = candidates.size() == 1;
    const bool now = answers_.blank || (!had_one() && !denied());
    const bool scanned = !answers_.blank && heard_.blank.by_fastscan.count == heard_.blank.all.count;
    const auto sure = scanned ? Certainty::likely : Certainty::certain;
    auto& d = add(Kind::blank_node, now ? sure : Certainty::possible, one ? candidates[0] : NodeId());
    when(d, heard_.blank.all);
    d.what = now ? "at least one device has no node-ID" : "a device had no node-ID, and perhaps still has none";
    if (one) d.what += fmt::format("; probably that of {}", who(candidates[0]));
    if (heard_.blank.all.count > 0)
      d.evidence.push_back(
          fmt::format("a device without node-ID answered an LSS question: {}", times(heard_.blank.all)));
    if (scanned) d.evidence.emplace_back("it answered Fastscan alone, as devices of one stack do with a node-ID, too");
    if (!now && had_one())
      d.evidence.push_back(
          fmt::format("a device took a node-ID from another LSS master since: {}", times(heard_.given)));
    if (denied()) d.evidence.emplace_back("no device answered LSS identify non-configured remote slave at the end");
    if (answers_.blank && heard_.blank.all.count == 0)
      d.evidence.emplace_back("it answered LSS identify non-configured remote slave");
    if (one) d.evidence.push_back(fmt::format("{} is the only slot that was not heard", who(candidates[0])));
    if (candidates.size() > 1) d.evidence.push_back(fmt::format("not heard: nodes {}", list(candidates)));
    d.devices = devices;
    for (const auto& device : d.devices) d.evidence.push_back(to_string(device) + " has none, by LSS");
    if (foreign) d.evidence.emplace_back("it is of another type than the slots that were not heard");
    d.advice = foreign ? fmt::format(
                             "take it off the bus, or write into the slot that may have it: also = [{{ vendor = "
                             "0x{:X}, product = 0x{:X} }}]",
                             devices.front().vendor, devices.front().product)
                       : std::string("`berth bind` gives it the node-ID of its slot");
  }

  void blanks() {
    std::vector<NodeId> candidates;
    for (const auto& slot : expected_.slots) {
      const bool candidate = silence_.unheard(slot) && slot.assign == places::Assign::lss && slot.id != jammer_;
      if (candidate) candidates.push_back(slot.id);
    }
    if (tells_blank()) return blank(candidates);
    if (answers_.asked) return;
    for (const auto id : candidates) {
      if (expected_.slot(id)->optional) continue;
      auto& d = add(Kind::blank_node, Certainty::possible, id);
      d.what = fmt::format("the device of {} has no node-ID, or is not there", who(id));
      d.evidence.emplace_back("nothing that only this node sends was heard");
      d.advice = "`berth doctor --active` asks whether a device without node-ID is there; `berth bind` gives it one";
    }
  }

  // ---- error states, load ----

  void passive() {
    if (jammed_) return;  // already reported as evidence: the jamming node causes it
    for (const auto id : complaining()) {
      const auto& node = heard_.node(id);
      auto& d = add(Kind::error_passive, Certainty::certain, id);
      when(d, node.error_passive);
      when(d, node.bus_off);
      d.what = fmt::format("{} {}", who(id), node.bus_off.count > 0 ? "was bus-off" : "was error-passive");
      if (node.error_passive.count > 0)
        d.evidence.push_back(fmt::format("EMCY 8120h, error-passive: {}", times(node.error_passive)));
      if (node.bus_off.count > 0)
        d.evidence.push_back(fmt::format("EMCY 8140h, recovered from bus-off: {}", times(node.bus_off)));
      if (heard_.errors > 0) d.evidence.push_back(fmt::format("this port noticed {} errors", heard_.errors));
      d.advice = "look at its plug, stub and transceiver first, then for a second device with its identifiers";
    }
    if (!heard_.was_passive) return;
    auto& d = add(Kind::error_passive, Certainty::certain);
    d.what = heard_.worst.bus_off ? "this port was bus-off" : "this port was error-passive";
    d.evidence.push_back(fmt::format("its counters went up to TEC {}, REC {}; {} errors", heard_.worst.tec,
                                     heard_.worst.rec, heard_.errors));
    d.advice = "is the bit rate right, is there another node, are both ends terminated?";
  }

  void overload() {
    if (jammed_) return;  // EMCYs and repetitions cause the load
    const auto load = heard_.load(expected_.bit_rate);
    const auto worst = heard_.worst_load(expected_.bit_rate);
    const auto stretched = stretched_nodes();
    if (load >= 0.8 || worst >= 0.95 || (load >= 0.5 && !stretched.empty())) {
      auto& d = add(Kind::overload, load >= 0.8 && heard_.knows_bit_rate ? Certainty::certain : Certainty::likely);
      d.first = heard_.from;
      d.last = heard_.to;
      d.count = heard_.frames;
      d.what = fmt::format("the bus is full: {:.0f} % load at {} bit/s", load * 100, expected_.bit_rate);
      d.evidence.push_back(fmt::format("{} frames in {:.1f} s; {:.0f} % in the fullest second", heard_.frames,
                                       in_ms(heard_.to - heard_.from) / 1000, worst * 100));
      if (!heard_.knows_bit_rate)
        d.evidence.push_back(
            fmt::format("this port does not report its bit rate; {} bit/s is assumed", expected_.bit_rate));
      if (!stretched.empty()) d.evidence.push_back(fmt::format("heartbeats come late: nodes {}", list(stretched)));
      d.advice = "send less often (event and inhibit times, SYNC period, heartbeats), or raise the bit rate of all";
    }
    for (unsigned n = 1; n <= 127; ++n) {
      const NodeId id(static_cast<std::uint8_t>(n));
      const auto& node = heard_.node(id);
      if (node.overrun.count == 0) continue;
      auto& d = add(Kind::overload, Certainty::certain, id);
      when(d, node.overrun);
      d.what = fmt::format("{} loses frames", who(id));
      d.evidence.push_back(fmt::format("EMCY 8110h, CAN overrun: {}", times(node.overrun)));
      d.evidence.push_back(fmt::format("bus load {:.0f} %", load * 100));
      d.advice = "let the others send less often, or give the device a better acceptance filter";
    }
  }

  [[nodiscard]] std::vector<NodeId> stretched_nodes() const {
    std::vector<NodeId> nodes;
    for (const auto& slot : expected_.slots) {
      const auto& beats = heard_.node(slot.id).beats;
      if (beats.size() < 4 || expected_.heartbeat_period.count() == 0) continue;
      const auto mean = (beats.back().at - beats.front().at) / static_cast<std::int64_t>(beats.size() - 1);
      if (mean * 10 > expected_.heartbeat_period * 13) nodes.push_back(slot.id);
    }
    return nodes;
  }

  void disturbance() {
    if (jammed_ || heard_.errors < 5 || heard_.errors * 100ULL < heard_.frames || !complaining().empty() ||
        !heard_.collided.empty() || heard_.was_passive) {
      return;
    }
    auto& d = add(Kind::disturbance, Certainty::possible);
    d.count = heard_.errors;
    if (!heard_.runs.empty()) {
      d.first = heard_.runs.front().first;
      d.last = heard_.runs.back().last;
    }
    d.what = "frames are destroyed on the way";
    d.evidence.push_back(fmt::format("{} errors to {} good frames, {} at most in a row", heard_.errors, heard_.frames,
                                     std::ranges::max_element(heard_.runs, {}, &ErrorRun::count) != heard_.runs.end()
                                         ? std::ranges::max_element(heard_.runs, {}, &ErrorRun::count)->count
                                         : 0));
    d.advice = "look at termination, cable length, stubs and shield; a device at another bit rate is another cause";
  }

  const Heard& heard_;
  const Expected& expected_;
  const Answers& answers_;
  Silence silence_;
  std::vector<Diagnosis> found_;
  bool jammed_ = false;
  NodeId jammer_{};
};

}  // namespace

std::vector<Diagnosis> diagnose(const Heard& heard, const Expected& expected, const Answers& answers) {
  return Consultation(heard, expected, answers).findings();
}

}  // namespace berth::doctor
