// The matrix: the main job at every size, with every kind of device, at every bit rate. One cell is one machine and one
// plant from a seed of its own, from all devices present to operational. Needs no test library: tests, ./run matrix and
// bench/matrix.cpp use it.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/design/machine.hpp"
#include "berth/lss/interpret.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::harness::matrix {

using namespace std::chrono_literals;

// What all devices of a cell speak, or have.
enum class Kind : std::uint8_t {
  rand,         // and LSS without Fastscan
  lss,          // without Fastscan, and nothing else
  fastscan,     // and nothing else
  feedback_29,  // and nothing else
  feedback_11,
  fixed,         // its slot's node-ID by switches, and its slot says so; every second one speaks LSS
  fixed_unsaid,  // the same, but its slot does not say so
  stored,        // a node-ID in its memory: its slot's, or that of another slot
  canopennode,   // Fastscan as CANopenNode does it
  lely,          // Fastscan as Lely core does it
  mixed,         // each device one of the above
  // Devices that lack parts of LSS; all sizes and bit rates only if the kind is chosen by name.
  no_identity,     // LSS without Fastscan and without 5Ah to 5Dh
  no_node_id,      // LSS without Fastscan and without 5Eh
  no_inquiries,    // LSS without Fastscan and without 5Ah to 5Eh
  bare,            // Fastscan, 40h to 43h, 11h, 17h, and nothing else
  fastscan_alone,  // Fastscan, 11h, 17h, and nothing else
  refuses_store,   // 17h is answered with error code 1
  short_answers,   // Fastscan, and answers without the zeros at their end
  stored_bare,     // LSS without Fastscan and inquiries, in its memory a node-ID that no slot has
  partial,         // each device one of these, or a complete one
  count
};
inline constexpr std::array<const char*, static_cast<std::size_t>(Kind::count)> kind_names{
    "rand",           "lss",           "fastscan",      "feedback-29",  "feedback-11",
    "fixed",          "fixed-unsaid",  "stored",        "canopennode",  "lely",
    "mixed",          "no-identity",   "no-node-id",    "no-inquiries", "bare",
    "fastscan-alone", "refuses-store", "short-answers", "stored-bare",  "partial"};
[[nodiscard]] inline const char* name(Kind kind) { return kind_names.at(static_cast<std::size_t>(kind)); }

enum class Latency : std::uint8_t {
  equal,     // 1 ms
  random,    // 0.2 to 4 ms
  outliers,  // 0.2 to 2 ms, and 30 ms once in a hundred
  count,
  wide = count  // 0.1 to 9 ms, just within `rand_response`; not part of the matrix
};
inline constexpr std::array<const char*, static_cast<std::size_t>(Latency::count) + 1> latency_names{
    "equal", "random", "outliers", "wide"};
[[nodiscard]] inline const char* name(Latency latency) { return latency_names.at(static_cast<std::size_t>(latency)); }

inline constexpr std::array<unsigned, 7> sizes{1, 2, 5, 30, 60, 120, 126};
inline constexpr std::array<std::uint32_t, 5> bit_rates{10'000, 50'000, 125'000, 500'000, 1'000'000};

struct Cell {
  Kind kind = Kind::rand;
  unsigned devices = 1;
  std::uint32_t bit_rate = 125'000;
  Latency latency = Latency::equal;
  unsigned rx_depth = 16;            // frames that a device's receive buffer holds; not part of the matrix
  std::string_view method = "auto";  // `[bus] discovery`; not part of the matrix
};

// The published methods that find all devices of this kind; none if only Berth's default does.
[[nodiscard]] inline std::span<const std::string_view> published(Kind kind) {
  static constexpr std::array<std::string_view, 4> words{"rand", "fastscan", "fastscan-feedback-29",
                                                         "fastscan-feedback-11"};
  const std::span all(words);
  switch (kind) {
    case Kind::rand: return all.subspan(0, 1);
    case Kind::fastscan:
    case Kind::canopennode:
    case Kind::lely: return all.subspan(1, 1);
    case Kind::feedback_29: return all.subspan(2, 1);
    case Kind::feedback_11: return all.subspan(3, 1);
    default: return {};
  }
}

[[nodiscard]] inline std::string describe(const Cell& c) {
  return std::string(name(c.kind)) + ", " + std::to_string(c.devices) + " devices, " +
         std::to_string(c.bit_rate / 1000) + " kbit/s, " + name(c.latency);
}

// A cell of the default run. Devices that lack parts of LSS are tried only in small numbers there.
[[nodiscard]] inline bool is_usual(const Cell& c) {
  return c.kind <= Kind::mixed || (c.devices <= 5 && c.bit_rate == 125'000);
}

// Why docs/limits.md excepts this cell; empty for the others.
[[nodiscard]] inline std::optional<std::string_view> limit_of(const Cell&) { return std::nullopt; }

// Bus time within which a cell must be operational: twice what its frames take if each device needs as many questions
// as one whose serial number tells nothing about the others', and twice that if answers come late (docs/limits.md).
[[nodiscard]] inline rt::Duration budget(const Cell& c) {
  const auto frame = rt::Duration(128LL * 1'000'000'000 / c.bit_rate);
  // Plain LSS asks in six frames, the others in one; 32 questions at most. Node-ID, check and start take forty more.
  const bool by_ranges = c.kind == Kind::lss || c.kind == Kind::stored || c.kind >= Kind::mixed;
  const std::int64_t frames = by_ranges ? 32 * 7 : 32 * 3;
  const rt::Duration one = (frames + 40) * frame + 300ms;
  // CANopenNode's slaves delay one answer in fifty tenfold; Lely core's need a workaround.
  const bool known = c.kind == Kind::canopennode || c.kind == Kind::lely || c.kind == Kind::mixed;
  return (c.latency == Latency::outliers ? 2 : 1) * (known ? 4 : 2) * (15s + c.devices * one);
}

// Every cell has its own seed, the same in every run.
[[nodiscard]] inline std::uint64_t seed_of(const Cell& c) {
  std::uint64_t seed = static_cast<std::uint64_t>(c.kind) + 1;
  for (const std::uint64_t part :
       {std::uint64_t{c.devices}, std::uint64_t{c.bit_rate}, static_cast<std::uint64_t>(c.latency)}) {
    seed = (seed ^ part) * 0x9E37'79B9'7F4A'7C15ULL;
    seed ^= seed >> 29U;
  }
  return seed;
}

// Consecutive, stepped or random.
[[nodiscard]] inline std::vector<std::uint32_t> serials(Random& random, unsigned count) {
  std::vector<std::uint32_t> list;
  constexpr std::array<std::uint32_t, 4> steps{1, 16, 1000, 0x1'0000};
  const auto form = random.below(5);
  const auto base = static_cast<std::uint32_t>(1 + random.below(0x1000'0000));
  while (list.size() < count) {
    const auto serial = form < steps.size() ? base + static_cast<std::uint32_t>(list.size()) * steps.at(form)
                                            : static_cast<std::uint32_t>(random.next());
    if (std::ranges::find(list, serial) == list.end()) list.push_back(serial);
  }
  return list;
}

[[nodiscard]] inline plant::Latency response_of(Latency latency) {
  if (latency == Latency::equal) return {1ms, 1ms, 0, 0ms};
  if (latency == Latency::random) return {200us, 4ms, 0, 0ms};
  if (latency == Latency::wide) return {100us, 9ms, 0, 0ms};
  return {200us, 2ms, 10'000, 30ms};
}

// `number`: of its slot.
inline void make_partial(plant::PlantDevice& d, Kind kind, unsigned number) {
  using enum lss::Lackable;
  using plant::Speaks;
  const lss::LackSet inquiries{inquire_identity, inquire_node_id};
  const bool scanned = kind == Kind::bare || kind == Kind::fastscan_alone || kind == Kind::short_answers;
  d.speaks = {scanned ? Speaks::fastscan : Speaks::lss};
  d.lss.short_answers = kind == Kind::short_answers;
  d.lss.refuses_store = kind == Kind::refuses_store;
  if (kind == Kind::no_identity) d.lss.without = {inquire_identity};
  if (kind == Kind::no_node_id) d.lss.without = {inquire_node_id};
  if (kind == Kind::no_inquiries || kind == Kind::stored_bare) d.lss.without = inquiries;
  if (kind == Kind::bare || kind == Kind::fastscan_alone)
    d.lss.without = {inquire_identity, inquire_node_id, identify, bit_timing, activate};
  if (kind == Kind::fastscan_alone) d.lss.without.add(select);
  if (kind != Kind::stored_bare) return;
  d.source = plant::NodeIdSource::nonvolatile;
  d.node_id = NodeId(static_cast<std::uint8_t>(126 - number));
}

inline void make_kind(plant::PlantDevice& d, Kind kind, unsigned number, NodeId kept) {
  using plant::Speaks;
  switch (kind) {
    case Kind::rand: d.speaks = {Speaks::lss, Speaks::rand}; break;
    case Kind::lss: d.speaks = {Speaks::lss}; break;
    case Kind::fastscan: d.speaks = {Speaks::fastscan}; break;
    case Kind::feedback_29: d.speaks = {Speaks::feedback_29}; break;
    case Kind::feedback_11: d.speaks = {Speaks::feedback_11}; break;
    case Kind::fixed:
    case Kind::fixed_unsaid:
      d.source = plant::NodeIdSource::switches;
      d.node_id = NodeId(static_cast<std::uint8_t>(number));
      d.speaks = {};
      if (number % 2 == 0) d.speaks = {Speaks::lss};
      break;
    case Kind::stored:
      d.source = plant::NodeIdSource::nonvolatile;
      d.node_id = kept;
      d.speaks = {Speaks::fastscan};
      if (number % 3 == 0) d.speaks = {Speaks::lss};
      if (number % 3 == 1) d.speaks = {Speaks::lss, Speaks::rand};
      break;
    case Kind::canopennode:
    case Kind::lely:
      d.speaks = {Speaks::fastscan};
      d.lss.habit = kind == Kind::lely ? plant::Habit::lely : plant::Habit::canopennode;
      break;
    case Kind::mixed:
    case Kind::count: break;
    default: make_partial(d, kind, number); break;
  }
}

struct Made {
  design::Machine machine;
  plant::PlantFile plant;
};

[[nodiscard]] inline Made make(const Cell& cell) {
  Random random(seed_of(cell));
  Made made;
  made.machine.name = "matrix";
  design::Bus bus;
  bus.name = "field";
  bus.bitrate = cell.bit_rate;
  bus.discovery = cell.method;
  made.machine.buses.push_back(bus);
  made.plant.seed = random.next();
  made.plant.buses.push_back({bus.name, 0});

  const auto types = static_cast<unsigned>(1 + random.below(std::min(6U, cell.devices)));
  const auto serial = serials(random, cell.devices);
  // Stored node-IDs: each that of its own slot, or all shifted by a few, so that some belong to a slot of another type.
  const auto moved = random.below(2) == 0 ? 0U : static_cast<unsigned>(random.below(cell.devices));
  for (unsigned i = 0; i < cell.devices; ++i) {
    const unsigned number = i + 1;
    design::Slot slot;
    slot.spec.name = {made.machine.name, bus.name, "s" + std::to_string(number)};
    slot.spec.id = NodeId(static_cast<std::uint8_t>(number));
    slot.spec.type = {0x0000'0301, 0x0001'0000 + i % types};

    plant::PlantDevice d;
    d.name = "d" + std::to_string(number);
    d.bus = bus.name;
    d.address = {slot.spec.type.vendor, slot.spec.type.product, 0x0001'0002, serial[i]};
    d.response = response_of(cell.latency);
    d.controller.rx_depth = cell.rx_depth;
    auto kind = cell.kind;
    if (kind == Kind::mixed) kind = static_cast<Kind>(random.below(static_cast<std::uint64_t>(Kind::mixed)));
    if (kind == Kind::partial) {
      const auto lacking = static_cast<std::uint64_t>(Kind::partial) - static_cast<std::uint64_t>(Kind::mixed);
      const auto which = random.below(lacking);
      kind = which == 0 ? Kind::rand : static_cast<Kind>(static_cast<std::uint64_t>(Kind::mixed) + which);
    }
    if (kind == Kind::fixed) slot.spec.assign = places::Assign::fixed;
    made.machine.slots.push_back(slot);
    // A mixed plant's switches and memories must leave its slots' node-IDs to one device each.
    const unsigned place = cell.kind == Kind::mixed ? i : (i + moved) % cell.devices;
    make_kind(d, kind, number, NodeId(static_cast<std::uint8_t>(place + 1)));
    made.plant.devices.push_back(d);
  }
  design::fit_heartbeats(made.machine);  // as the reader of a machine file does
  return made;
}

enum class End : std::uint8_t {
  operational,
  gave_up,  // nothing more happens, as `berth up` judges it
  late,     // not within its bus time
  lost,     // operational, but no longer ten seconds later
  wrong,    // reported operational, but the devices are not
  busy,     // operational, and Berth sends more than `most_at_rest`
};
[[nodiscard]] inline const char* name(End end) {
  constexpr std::array<const char*, 6> names{"operational", "gave up", "too late", "lost", "wrong", "busy at rest"};
  return names.at(static_cast<std::size_t>(end));
}

// Plain bytes: it goes through a pipe.
struct Outcome {
  End end = End::late;
  rt::Duration bus_time{0};  // from Berth's first instant to operational, or to the end
  std::uint64_t frames = 0;
  double at_rest = 0;        // Berth's frames per second, with its heartbeat
  unsigned operational = 0;  // slots
  std::array<char, 400> why{};

  void say(std::string_view words) {
    const auto size = std::min(words.size(), why.size() - 1);
    std::ranges::copy(words.substr(0, size), why.begin());
    why.at(size) = '\0';
  }
};

// Frames per second that Berth may send on a bus on which nothing happens.
inline constexpr double most_at_rest = 5;

class Sent final : private can::Tap {
 public:
  Sent(sim::Bus& bus, int sender) : bus_(bus), sender_(sender) { bus_.add_tap(*this); }
  ~Sent() { bus_.remove_tap(*this); }
  unsigned frames = 0;

 private:
  void frame(const can::Frame&, rt::Time, int sender) noexcept override { frames += sender == sender_ ? 1U : 0U; }
  sim::Bus& bus_;
  int sender_;
};

class Run final : private can::Tap {
 public:
  static constexpr std::size_t longest_reason = 110;
  static constexpr rt::Duration there = 1s;     // every device boots before Berth begins, unheard by it
  static constexpr rt::Duration holds = 10s;    // how long an operational machine is watched
  static constexpr rt::Duration settles = 60s;  // one search among operational devices that answer Fastscan
  static constexpr rt::Duration rests = 30s;    // then Berth's frames are counted for so long

  explicit Run(const Cell& cell) : made_(make(cell)) {
    Findings findings;
    const auto& bus = made_.machine.buses.front();
    const plant::BusRate rate{bus.name, bus.bitrate};
    world_ = plant::World::make(made_.plant, {&rate, 1}, findings);
  }

  /// Also prints every frame, LSS decoded.
  void show_frames() {
    if (world_) world_->bus("field")->add_tap(*this);
  }

  Outcome go(rt::Duration limit, bool show) {
    if (!world_) return failed("no world");
    world_->start();
    world_->sim().run_for(there);
    const auto port = world_->attach_master("field");
    tree::Session session(world_->executor(), made_.machine, store_);
    if (!session.connect("field", *port) || !session.open()) return failed("no session");
    bool reached = false;
    session.on_milestone([&](operate::Milestone m) { reached = reached || m == operate::Milestone::operational; });
    session.on_event([&](const operate::Event& e) {
      last_ = e.text;
      if (show) std::printf("%s\n", operate::to_line(e).c_str());
    });
    begun_ = changed_ = world_->sim().now();
    session.start();
    while (!reached && world_->sim().now() < begun_ + limit && !settled(session)) {
      world_->sim().run_until([&] { return reached; }, 100ms);
    }
    outcome_.bus_time = world_->sim().now() - begun_;
    outcome_.frames = world_->bus("field")->statistics().frames;
    if (!reached) {
      outcome_.end = settled(session) ? End::gave_up : End::late;
    } else {
      world_->sim().run_for(holds + settles);
      const Sent sent(*world_->bus("field"), port->number());
      world_->sim().run_for(rests);
      outcome_.at_rest = sent.frames / std::chrono::duration<double>(rests).count();
      outcome_.end = session.operational() ? End::operational : End::lost;
      if (outcome_.at_rest > most_at_rest) outcome_.end = End::busy;
      if (!truly_operational()) outcome_.end = End::wrong;
    }
    count(session);
    session.stop();
    return outcome_;
  }

 private:
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    std::printf("%11.6f s  %3d  %s  %s\n", operate::seconds(at), sender, can::to_string(frame).c_str(),
                lss::interpret(frame).c_str());
  }

  Outcome failed(std::string_view why) {
    outcome_.end = End::wrong;
    outcome_.say(why);
    return outcome_;
  }

  // As apps/berth's `Ending::settled`: the table has not changed for so long, and no work is under way.
  bool settled(tree::Session& session) {
    std::vector<std::pair<places::SlotState, bool>> table;
    bool busy = !session.idle();
    for (const auto& s : session.slots()) {
      table.emplace_back(s.state, s.device.has_value());
      busy = busy || s.state == places::SlotState::binding || s.state == places::SlotState::configuring ||
             s.state == places::SlotState::unknown;
    }
    if (table != table_) {
      table_ = std::move(table);
      changed_ = world_->sim().now();
    }
    const auto& timing = made_.machine.buses.front().timing;
    const auto patience = timing.heartbeat_timeout + 12 * timing.probe_period + made_.plant.devices.front().boot;
    return !busy && world_->sim().now() - changed_ >= patience;
  }

  // By the devices' own memory: each slot's node-ID is held by one device, of its type, operational.
  bool truly_operational() {
    std::array<unsigned, 128> holders{};
    for (const auto& t : world_->truth()) {
      if (!t.active.configured()) return false;
      ++holders.at(t.active.value());
      const auto* const slot = made_.machine.slot("field", t.active);
      if (slot == nullptr || t.state != NmtState::operational || t.address.type() != slot->spec.type) return false;
    }
    return std::ranges::all_of(holders, [](unsigned n) { return n <= 1; });
  }

  // How many slots are in which state, with the first one's reason.
  void count(tree::Session& session) {
    std::array<unsigned, 16> states{};
    std::array<std::string, 16> reasons{};
    for (const auto& s : session.slots()) {
      const auto state = static_cast<std::size_t>(s.state);
      if (states.at(state)++ == 0) reasons.at(state) = s.reason.substr(0, longest_reason);
    }
    outcome_.operational = states.at(static_cast<std::size_t>(places::SlotState::operational));
    if (outcome_.end == End::operational) return;
    std::string words;
    for (std::size_t i = 0; i < states.size(); ++i) {
      if (states.at(i) == 0) continue;
      words += std::to_string(states.at(i)) + " " + places::name(static_cast<places::SlotState>(i));
      words += reasons.at(i).empty() ? "; " : " (" + reasons.at(i) + "); ";
    }
    outcome_.say(words + "last told: " + last_);
  }

  Made made_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::vector<std::pair<places::SlotState, bool>> table_;
  rt::Time begun_{}, changed_{};
  std::string last_;
  Outcome outcome_;
};

[[nodiscard]] inline Outcome run(const Cell& cell, rt::Duration limit, bool show = false, bool frames = false) {
  Run one(cell);
  if (frames) one.show_frames();
  return one.go(limit, show);
}

}  // namespace berth::harness::matrix
