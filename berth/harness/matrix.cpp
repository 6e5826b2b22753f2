#include "berth/harness/matrix.hpp"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "berth/base/random.hpp"
#include "berth/design/machine.hpp"
#include "berth/lss/interpret.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/tree/session.hpp"

namespace berth::harness::matrix {
namespace {

// Every cell has its own seed, the same in every run; so has each of its rounds.
std::uint64_t seed_of(const Cell& cell) {
  std::uint64_t seed = static_cast<std::uint64_t>(cell.kind) + 1;
  for (const std::uint64_t part :
       {std::uint64_t{cell.devices}, std::uint64_t{cell.bit_rate}, static_cast<std::uint64_t>(cell.latency)}) {
    seed = (seed ^ part) * 0x9E37'79B9'7F4A'7C15ULL;
    seed ^= seed >> 29U;
  }
  if (cell.round != 0) seed ^= cell.round * 0xD1B5'4A32'D192'ED03ULL;
  return seed;
}

// Consecutive, stepped or random.
std::vector<std::uint32_t> serials(Random& random, unsigned count) {
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

plant::Latency response_of(Latency latency) {
  if (latency == Latency::equal) return {1ms, 1ms, 0, 0ms};
  if (latency == Latency::random) return {200us, 4ms, 0, 0ms};
  if (latency == Latency::wide) return {100us, 9ms, 0, 0ms};
  return {200us, 2ms, 10'000, 30ms};
}

// `number`: of its slot.
void make_partial(plant::PlantDevice& d, Kind kind, unsigned number) {
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

void make_kind(plant::PlantDevice& d, Kind kind, unsigned number, NodeId kept) {
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

Made make(const Cell& cell) {
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

  Run(const Cell& cell, Show show) : made_(make(cell)), show_(std::move(show)) {
    Findings findings;
    const auto& bus = made_.machine.buses.front();
    const plant::BusRate rate{bus.name, bus.bitrate};
    world_ = plant::World::make(made_.plant, {&rate, 1}, findings);
  }

  /// Also prints every frame, LSS decoded.
  void show_frames() {
    if (world_) world_->bus("field")->add_tap(*this);
  }

  Outcome go(rt::Duration limit) {
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
      if (show_) show_(operate::to_line(e));
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
    for (const auto& d : world_->devices()) outcome_.lost += d->controller().statistics().overruns;
    outcome_.hash = world_->sim().trace_hash();
    session.stop();
    return outcome_;
  }

 private:
  void frame(const can::Frame& frame, rt::Time at, int sender) noexcept override {
    show_(fmt::format("{:11.6f} s  {:3}  {}  {}", operate::seconds(at), sender, can::to_string(frame),
                      lss::interpret(frame)));
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
  Show show_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::vector<std::pair<places::SlotState, bool>> table_;
  rt::Time begun_{}, changed_{};
  std::string last_;
  Outcome outcome_;
};

}  // namespace

Outcome run(const Cell& cell, rt::Duration limit, const Show& show, bool frames) {
  Run one(cell, show);
  if (frames && show) one.show_frames();
  return one.go(limit);
}

std::vector<Cell> cells_of(const Selection& o) {
  std::vector<Cell> cells;
  for (int k = 0; k < static_cast<int>(Kind::count); ++k) {
    for (const auto n : sizes) {
      for (const auto rate : bit_rates) {
        for (int l = 0; l <= static_cast<int>(Latency::wide); ++l) {
          const Cell cell{static_cast<Kind>(k), n, rate, static_cast<Latency>(l), o.rx_depth};
          if (cell.latency == Latency::wide && o.latency != Latency::wide) continue;
          const bool chosen = (!o.kind || *o.kind == cell.kind) && (!o.devices || *o.devices == n) &&
                              (!o.bit_rate || *o.bit_rate == rate) && (!o.latency || *o.latency == cell.latency);
          if (chosen && (o.kind || is_usual(cell))) cells.push_back(cell);
        }
      }
    }
  }
  return cells;
}

}  // namespace berth::harness::matrix
