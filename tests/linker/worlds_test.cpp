// Random linked machines on the exact simulated bus: devices with what `berth link` gives them, whose inputs change as
// quickly as they can. No change arrives, and no other frame ends, later than its bound. `./run worlds` has more.
#include "tests/worlds/seeds.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <map>

#include "berth/eds/eds.hpp"
#include "berth/linker/bounds.hpp"
#include "berth/linker/files.hpp"
#include "tests/device/rig.hpp"
#include "tests/linker/devices.hpp"

using namespace berth;
using namespace berth::test;
using namespace std::chrono_literals;

namespace {

constexpr rt::Duration heartbeat = 100ms;
constexpr rt::Duration emcy = 250ms;
constexpr rt::Duration sdo = 10ms;
constexpr rt::Duration nmt = 100ms;
constexpr std::uint32_t first_request = 0x601;
constexpr const char* master = "master";

double in_ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

struct Machine {
  linker::LinkNetwork network;
  std::vector<sim::TxOrder> queues;  // as they are, also where that is not said
};

void add_other(linker::Bus& bus, const std::string& name, std::size_t sender, std::uint32_t key, unsigned bytes,
               rt::Duration period) {
  bus.others.messages.push_back(
      {.name = name, .sender = sender, .key = key, .data_bytes = bytes, .period = period, .deadline = 0ms});
}

/// What is on the bus beside the PDOs: all that the run below sends.
void add_others(linker::LinkNetwork& network) {
  auto& bus = network.buses[0];
  bus.others.messages.clear();
  bus.others.background_bytes.reset();
  for (std::size_t i = 0; i < network.nodes.size(); ++i) {
    add_other(bus, "heartbeat", i, 0x700U + network.nodes[i].id.value(), 1, heartbeat);
    add_other(bus, "EMCY", i, 0x80U + network.nodes[i].id.value(), 8, emcy);
  }
  const std::size_t own = bus.others.senders.size();
  bus.others.senders.push_back({master, analysis::Queue::in_order});
  add_other(bus, "NMT", own, 0, 2, nmt);
  add_other(bus, "heartbeat", own, 0x77F, 1, heartbeat);
  add_other(bus, "SDO request", own, first_request, 8, sdo);
  add_other(bus, "SDO response", 0, 0x581, 8, sdo);
  bus.others.messages.back().jitter = sdo;
  if (bus.sync > 0ms) add_other(bus, "SYNC", own, 0x80, 0, bus.sync);
}

Machine random_machine(Random& random) {
  static const auto plc = [] {
    auto spec = controller();
    spec.tpdos = spec.rpdos = 12;
    spec.entries = 8;
    return file_of(spec);
  }();
  constexpr std::uint32_t rates[] = {83'333, 125'000, 250'000, 500'000, 1'000'000};
  Machine made;
  std::vector<std::pair<std::string, std::shared_ptr<const eds::File>>> nodes;
  const auto count = random.between(2, 7);
  for (unsigned i = 1; i <= count; ++i) nodes.emplace_back("d" + std::to_string(i), plc);
  made.network = network_of(std::move(nodes));
  auto& bus = made.network.buses[0];
  bus.others.bit_rate = rates[random.below(std::size(rates))];
  if (random.chance(400'000)) bus.sync = 10ms * static_cast<std::int64_t>(random.between(1, 5));
  for (auto& sender : bus.others.senders) {
    made.queues.push_back(random.chance(500'000) ? sim::TxOrder::in_order : sim::TxOrder::priority);
    sender.queue = made.queues.back() == sim::TxOrder::priority ? analysis::Queue::priority : analysis::Queue::in_order;
    if (random.chance(300'000)) sender.queue = analysis::Queue::unknown;
  }
  add_others(made.network);
  constexpr od::DataType types[] = {od::DataType::unsigned16, od::DataType::unsigned32, od::DataType::unsigned64};
  const auto links = random.between(1, 14);
  for (unsigned i = 0; i < links; ++i) {
    const auto from = random.between(1, count);
    const auto to = (from + random.below(count - 1)) % count + 1;
    const bool at_sync = bus.sync > 0ms && random.chance(400'000);
    std::optional<rt::Duration> deadline = 1ms * static_cast<std::int64_t>(random.between(15, 150));
    if (at_sync) deadline = *deadline + 5 * bus.sync;
    if (random.chance(200'000)) deadline.reset();
    const auto type = static_cast<linker::TransmissionType>(at_sync ? random.between(0, 3) : linker::at_change);
    add_link(made.network, "d" + std::to_string(from) + "/v" + std::to_string(i),
             {"d" + std::to_string(to) + "/w" + std::to_string(i)}, deadline, type, types[random.below(3)]);
  }
  return made;
}

/// A variable that a program writes: when each of its values was there first. It counts up.
struct Input {
  std::size_t node = 0;
  ObjectRef object{};
  unsigned bits = 0;
  std::vector<rt::Time> since = {};  // by value, from 1
};

/// The devices of a plan, running, and what each message took at most.
class World final : private can::Tap {
 public:
  World(const Machine& machine, const linker::Plan& plan, Random& random)
      : machine_(machine),
        network_(machine.network),
        plan_(plan),
        random_(random),
        rig_(network_.buses[0].others.bit_rate),
        arrival_(plan.pdos.size()),
        seen_(plan.pdos.size()),
        waits_(plan.pdos.size()) {
    for (const auto& variable : plan.variables) {
      if (variable.input) inputs_.push_back({variable.node, variable.object, od::bit_length(variable.type), {}});
    }
    rig_.bus.add_tap(*this);
    add_devices();
  }
  ~World() { rig_.bus.remove_tap(*this); }
  World(const World&) = delete;
  World& operator=(const World&) = delete;

  void run(rt::Duration time) {
    rig_.run(2ms);
    rig_.ask("000#0100", 20ms);
    end_ = rig_.world.now() + time;
    for (const auto& message : network_.buses[0].others.messages) {
      if (message.name == "SDO response") continue;
      const auto first = random_.chance(500'000) ? rt::Duration(0) : part_of(message.period);
      rig_.world.after(first, [this, &message] { send_other(message); });
    }
    for (Input& input : inputs_) rig_.world.after(part_of(1ms), [this, &input] { change(input); });
    rig_.run(time + 1s);
  }

  /// By PDO: from a change to its arrival, at most. By key of another frame: from its event to its end.
  [[nodiscard]] const std::vector<rt::Duration>& arrival() const { return arrival_; }
  [[nodiscard]] const std::map<std::uint32_t, rt::Duration>& others() const { return latest_; }
  [[nodiscard]] std::size_t frames() const { return frames_; }

 private:
  void add_devices() {
    const auto files = linker::make_files(network_, plan_);
    ASSERT_TRUE(files);
    for (std::size_t i = 0; i < network_.nodes.size(); ++i) {
      const auto file = std::ranges::find(*files, linker::file_stem(network_, i) + ".dcf", &linker::MadeFile::name);
      auto description = network_.nodes[i].file->description;
      if (file != files->end()) {
        auto reading = eds::read(file->bytes, file->name);
        ASSERT_TRUE(reading.usable()) << file->name;
        description = reading.file.description;
      }
      device::Options options{.address = device::test::address_of(static_cast<std::uint32_t>(i + 1)),
                              .node_id = network_.nodes[i].id,
                              .bit_rate = network_.buses[0].others.bit_rate};
      nodes_.push_back(std::make_unique<device::test::Node>(rig_.world, rig_.bus, std::move(options), device::Timing{},
                                                            rt::Duration(0), description, machine_.queues[i]));
      nodes_.back()->on();
    }
  }

  rt::Duration part_of(rt::Duration whole) {
    return rt::Duration(static_cast<std::int64_t>(random_.below(static_cast<std::uint64_t>(whole.count()))));
  }

  /// As often as it may be.
  void send_other(const analysis::Message& message) {
    if (rig_.world.now() >= end_) return;
    can::Frame frame;
    frame.id = message.key;
    frame.size = static_cast<std::uint8_t>(message.data_bytes);
    if (message.name == "SDO request") {
      frame = *can::parse_frame("601#4000100000000000");
      frame.id = first_request + static_cast<std::uint32_t>(random_.below(nodes_.size()));  // which device answers
    } else if (message.name == "NMT") {
      frame = *can::parse_frame("000#017E");  // to a node that is not there
    } else if (message.name != "SYNC" && random_.chance(500'000)) {
      for (unsigned i = 0; i < frame.size; ++i) frame.data[i] = 0x3C;
    }
    events_[message.key].push_back(rig_.world.now());
    const bool own = network_.buses[0].others.senders[message.sender].name == master;
    const auto queued = own ? rig_.me->send(frame, 0) : nodes_[message.sender]->dispatcher.send(frame);
    EXPECT_EQ(queued, can::Queued::yes) << message.name;
    rig_.world.after(message.period, [this, &message] { send_other(message); });
  }

  void change(Input& input) {
    const rt::Time now = rig_.world.now();
    if (now >= end_) return;
    input.since.push_back(now);
    auto& device = nodes_[input.node]->device;
    const auto value = input.since.size();
    switch (input.bits) {
      case 16: device.variable<std::uint16_t>(input.object).set(static_cast<std::uint16_t>(value)); break;
      case 32: device.variable<std::uint32_t>(input.object).set(static_cast<std::uint32_t>(value)); break;
      default: device.variable<std::uint64_t>(input.object).set(value); break;
    }
    rig_.world.after(150us + part_of(100us), [this, &input] { change(input); });
  }

  void frame(const can::Frame& frame, rt::Time at, int /*sender*/) noexcept override {
    ++frames_;
    for (std::size_t i = 0; i < plan_.pdos.size(); ++i) {
      if (plan_.pdos[i].can_id == frame.id) take(i, frame, at);
    }
    const bool request = frame.id >= first_request && frame.id < first_request + nodes_.size();
    const std::uint32_t id = request ? first_request : frame.id;
    if (frame.id == 0x80) {
      for (std::size_t i = 0; i < waits_.size(); ++i) {
        if (waits_[i]) arrival_[i] = std::max(arrival_[i], at - *waits_[i]);
        waits_[i].reset();
      }
    }
    auto& events = events_[id];
    if (events.empty()) return;
    latest_[id] = std::max(latest_[id], at - events.front());
    events.erase(events.begin());
  }

  /// The oldest change that this frame is the first to have.
  void take(std::size_t at_pdo, const can::Frame& frame, rt::Time at) {
    const auto& pdo = plan_.pdos[at_pdo];
    auto& seen = seen_[at_pdo];
    seen.resize(pdo.carried.size());
    for (std::size_t i = 0; i < pdo.carried.size(); ++i) {
      const auto& carried = pdo.carried[i];
      const auto input = std::ranges::find_if(
          inputs_, [&](const Input& each) { return each.node == pdo.producer && each.object == carried.object; });
      if (input == inputs_.end()) continue;
      std::uint64_t value = 0;
      for (unsigned bit = 0; bit < carried.bits; ++bit) {
        const unsigned place = carried.at + bit;
        value |= std::uint64_t{frame.data[place / 8] >> (place % 8) & 1U} << bit;
      }
      if (value <= seen[i]) continue;
      const rt::Time cause = input->since.at(seen[i]);  // of the value behind the last that was seen
      seen[i] = value;
      if (linker::synchronous(pdo.transmission)) {
        waits_[at_pdo] = std::min(waits_[at_pdo].value_or(cause), cause);
      } else {
        arrival_[at_pdo] = std::max(arrival_[at_pdo], at - cause);
      }
    }
  }

  const Machine& machine_;
  const linker::LinkNetwork& network_;
  const linker::Plan& plan_;
  Random& random_;
  device::test::Rig rig_;
  std::vector<std::unique_ptr<device::test::Node>> nodes_;
  std::vector<Input> inputs_;
  std::vector<rt::Duration> arrival_;
  std::vector<std::vector<std::uint64_t>> seen_;
  std::vector<std::optional<rt::Time>> waits_;  // synchronous: a change that counts at the next SYNC
  std::map<std::uint32_t, std::vector<rt::Time>> events_;
  std::map<std::uint32_t, rt::Duration> latest_;
  std::size_t frames_ = 0;
  rt::Time end_{};
};

/// All messages of the bus, as the plan has them: the PDOs behind the others.
analysis::Line line_of(const linker::LinkNetwork& network, const linker::Plan& plan) {
  analysis::Line line = network.buses[0].others;
  for (const auto& pdo : plan.pdos) {
    const auto sending = linker::sending_of(network, pdo);
    line.messages.push_back(
        {.name = "TPDO",
         .sender = pdo.producer,
         .key = pdo.can_id,
         .data_bytes = pdo.bytes(),
         .period = linker::least_interval(pdo.transmission, linker::inhibit_unit * pdo.inhibit, sending.sync, {})});
    linker::set_sending(line.messages.back(), sending, true, pdo.deadline);
  }
  return line;
}

}  // namespace

TEST(LinkWorlds, NothingIsLaterThanItsBound) {
  const auto seeds = worlds::seeds(25);
  std::vector<double> share;
  std::size_t frames = 0, machines = 0, refused = 0;
  for (auto seed = seeds.from; machines < seeds.count; ++seed) {
    Random random(seed);
    const auto machine = random_machine(random);
    const auto made = linker::make_plan(machine.network);
    if (!made.good()) {
      ASSERT_LT(++refused, 20 + 3 * seeds.count) << "too few are planned";
      continue;
    }
    ++machines;
    const auto line = line_of(machine.network, made.plan);
    const auto result = analysis::analyze(line);
    World world(machine, made.plan, random);
    world.run(2s);
    frames += world.frames();
    const std::size_t first = line.messages.size() - made.plan.pdos.size();
    for (std::size_t i = 0; i < made.plan.pdos.size(); ++i) {
      const auto& pdo = made.plan.pdos[i];
      ASSERT_TRUE(pdo.worst);
      EXPECT_EQ(pdo.worst, result.responses[first + i].arrival) << "one analysis for both";
      EXPECT_LE(world.arrival()[i].count(), pdo.worst->count())
          << "seed " << seed << ", " << line.bit_rate << " bit/s, " << analysis::key_text(pdo.can_id) << " of "
          << machine.network.nodes[pdo.producer].name << ", type " << int{pdo.transmission};
      share.push_back(in_ms(world.arrival()[i]) / in_ms(*pdo.worst));
    }
    for (std::size_t i = 0; i < first; ++i) {
      const auto seen = world.others().find(line.messages[i].key);
      if (seen == world.others().end() || !result.responses[i].worst) continue;
      EXPECT_LE(seen->second.count(), result.responses[i].worst->count())
          << "seed " << seed << ", " << line.messages[i].name << " " << analysis::key_text(line.messages[i].key);
    }
  }
  std::ranges::sort(share);
  std::printf("%zu machines (%zu refused), %zu frames, %zu PDOs: observed over bound: %.2f median, %.2f most\n",
              machines, refused, frames, share.size(), share[share.size() / 2], share.back());
  EXPECT_GT(share.back(), 0.8) << "a bound that no machine comes near says little";
}
