// The coal conveyor of examples/conveyor (paper 5, figure 1), from blank devices to operational: all side by side, and
// one after the other; what linking its 720 objects takes and saves; the analysis of 500 messages; the boot-up of 126
// devices.
#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/can/length.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/traffic/bus_messages.hpp"
#include "berth/traffic/link_network.hpp"
#include "tests/conveyor/conveyor.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr int rounds = 5;

/// What the bus is spent on, in seconds of its time.
struct Spent final : can::Tap {
  explicit Spent(test::Conveyor& observed) : plant(observed) { plant.bus().add_tap(*this); }
  ~Spent() { plant.bus().remove_tap(*this); }
  Spent(const Spent&) = delete;
  Spent& operator=(const Spent&) = delete;
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    constexpr std::uint32_t lss_answer = 0x7E4;
    constexpr std::uint32_t lss_request = 0x7E5;
    const double time = can::exact_bits(frame) / static_cast<double>(plant.machine().buses.front().bitrate);
    const bool asks = frame.id >= 0x600 && frame.id < 0x680;
    const bool is_sdo = frame.id >= 0x580 && frame.id < 0x680;
    const bool is_lss = frame.id == lss_answer || frame.id == lss_request;
    (is_sdo ? sdo : is_lss ? lss : rest) += time;
    transfers += asks ? 1U : 0U;
    // Writing the configuration date is the first thing that a configuration changes.
    const bool dates = asks && (frame.data[0] & 0xE0U) == 0x20 && frame.data[1] == 0x20 && frame.data[2] == 0x10;
    if (dates && !configures) configures = plant.seconds();
    if (configures) behind += time;
  }
  test::Conveyor& plant;
  double sdo = 0, lss = 0, rest = 0;
  unsigned transfers = 0;
  std::optional<double> configures;  ///< when the first configuration began
  double behind = 0;                 ///< of all frames from then on
};

/// From power-on to all operational.
struct Start {
  double bus = 0;   ///< seconds of the bus
  double wall = 0;  ///< seconds of this computer
  double sdo = 0, lss = 0, rest = 0;
  double searched = 0;  ///< until the first configuration begins
  double carried = 0;   ///< what the bus carries from then on
  unsigned transfers = 0;
};

std::optional<Start> conveyor(unsigned at_once) {
  const bench::Watch watch;
  test::Conveyor plant(
      [&](design::Machine& machine, plant::PlantFile&) { machine.buses.front().timing.at_once = at_once; });
  const bool begun = plant.begin();  // its bus is made; no time has gone by
  const auto spent = begun ? std::make_unique<Spent>(plant) : nullptr;
  if (!begun || !plant.run_until([&] { return plant.operational(); }, 1h)) {
    fmt::print(stderr, "the conveyor did not become operational: {}\n", plant.problem());
    return std::nullopt;
  }
  return Start{.bus = plant.seconds(),
               .wall = watch.seconds(),
               .sdo = spent->sdo,
               .lss = spent->lss,
               .rest = spent->rest,
               .searched = spent->configures.value_or(0),
               .carried = spent->behind,
               .transfers = spent->transfers};
}

/// 126 devices that have their node-IDs, on one bus of 500 kbit/s.
struct Full {
  explicit Full(unsigned at_once) {
    machine.name = "full";
    design::Bus bus;
    bus.name = "field";
    bus.bitrate = 500'000;
    bus.timing.at_once = at_once;
    machine.buses.push_back(bus);
    file.seed = 126;
    file.buses.push_back({"field", 0});
    for (std::uint8_t id = 1; id <= 126; ++id) {
      design::Slot slot;
      slot.spec.name = {"full", "field", fmt::format("s{}", id)};
      slot.spec.id = NodeId(id);
      slot.spec.type = {1, 2};
      machine.slots.push_back(slot);
      plant::PlantDevice device;
      device.name = fmt::format("d{}", id);
      device.bus = "field";
      device.address = {1, 2, 0, id};
      device.source = plant::NodeIdSource::nonvolatile;
      device.node_id = NodeId(id);
      file.devices.push_back(device);
    }
  }
  std::optional<double> start() {
    Findings findings;
    auto world = plant::World::make(file, std::vector<plant::BusRate>{{"field", 500'000}}, findings);
    if (!world) return std::nullopt;
    const auto port = world->attach_master("field");
    tree::Session session(world->executor(), machine, store);
    if (!session.connect("field", *port) || !session.open()) return std::nullopt;
    world->start();
    session.start();
    if (!world->sim().run_until([&] { return session.operational(); }, 1h)) return std::nullopt;
    const double at = std::chrono::duration<double>(world->executor().now().time_since_epoch()).count();
    session.stop();
    return at;
  }
  design::Machine machine;
  plant::PlantFile file;
  places::MemoryStore store;
};

/// The second start: every slot has its device already, which is where a boot-up is nothing but that.
std::optional<double> boot_full(unsigned at_once) {
  Full full(at_once);
  const auto first = full.start();
  return first ? full.start() : std::nullopt;
}

analysis::Line five_hundred(const design::Machine& machine, const traffic::LinkPlan& links) {
  auto line = traffic::messages_of(machine, machine.buses.front(), {.links = &links}).line;
  std::uint32_t key = 0x500;
  while (line.messages.size() < 500) {
    line.messages.push_back(
        {.name = "further", .sender = 0, .key = ++key, .data_bytes = 8, .period = 1s, .deadline = 1s});
  }
  line.messages.resize(500);
  return line;
}

bool start_up(std::vector<bench::Figure>& figures) {
  const auto together = conveyor(0);
  const auto single = conveyor(1);
  if (!together || !single) return false;
  const double factor = single->bus / together->bus;
  figures.push_back({"blank to operational, side by side, bus time", fmt::format("{:.1f} s", together->bus)});
  figures.push_back({"blank to operational, one after the other, bus time", fmt::format("{:.1f} s", single->bus)});
  figures.push_back({"times quicker", fmt::format("{:.1f}", factor), ">= 5", factor >= 5});
  figures.push_back({"blank to operational, side by side, wall time", fmt::format("{:.2f} s", together->wall)});
  figures.push_back({"blank to operational, one after the other, wall time", fmt::format("{:.2f} s", single->wall)});
  const auto seconds = [&](const char* what, double time) { figures.push_back({what, fmt::format("{:.1f} s", time)}); };
  seconds("side by side: SDO frames, bus time", together->sdo);
  figures.push_back({"side by side: SDO requests", bench::grouped(static_cast<double>(together->transfers))});
  seconds("side by side: LSS frames, bus time", together->lss);
  seconds("side by side: all other frames, bus time", together->rest);
  seconds("until the first configuration: search, then one binding after the other by LSS", together->searched);
  seconds("what the bus carries from then on", together->carried);
  figures.push_back({"times quicker, were the bus never idle from then on",
                     fmt::format("{:.1f}", single->bus / (together->searched + together->carried))});
  const auto full = boot_full(0);
  const auto slow = boot_full(1);
  if (!full || !slow) return false;
  figures.push_back({"boot-up of 126 known devices, side by side, bus time", fmt::format("{:.2f} s", *full)});
  figures.push_back({"boot-up of 126 known devices, one after the other", fmt::format("{:.2f} s", *slow)});
  return true;
}

bool link_and_analyze(std::vector<bench::Figure>& figures) {
  const test::Conveyor plant;
  if (!plant.problem().empty()) return false;
  const auto [network, wrong] = traffic::link_network(plant.machine());
  bench::Rounds plans;
  for (int i = 0; i < rounds; ++i) {
    const bench::Watch watch;
    const auto planned = linker::make_plan(network);
    if (!planned.good()) return false;
    plans.add(watch.seconds() * 1e3);
  }
  const auto links = traffic::plan_links(plant.machine());
  if (has_errors(links.findings)) return false;
  std::size_t records = links.plan.pdos.size();
  for (const auto& pdo : links.plan.pdos) records += pdo.receivers.size();
  const auto& load = links.plan.buses.front();
  figures.push_back({"links", bench::grouped(static_cast<double>(network.links.size()))});
  figures.push_back({"linker, ms", plans.text(), "<= 100", plans.median() <= 100});
  figures.push_back({"objects sent: CAN-IDs with one object each", bench::grouped(static_cast<double>(load.objects))});
  figures.push_back({"CAN-IDs as linked", bench::grouped(static_cast<double>(links.plan.pdos.size()))});
  figures.push_back(
      {"PDOs in the devices (TPDOs and RPDOs)", bench::grouped(static_cast<double>(records)), "> 500", records > 500});
  figures.push_back(
      {"bus load of PDOs with one object each, at most", fmt::format("{:.1f} %", 100 * load.one_object_each)});
  figures.push_back({"bus load of PDOs as linked, at most", fmt::format("{:.1f} %", 100 * load.pdos)});
  figures.push_back({"everything on the bus, at most", fmt::format("{:.1f} %", 100 * load.load)});
  const auto line = five_hundred(plant.machine(), links);
  bench::Rounds analyses;
  std::size_t bounded = 0;
  for (int i = 0; i < rounds; ++i) {
    const bench::Watch watch;
    const auto result = analysis::analyze(line);
    analyses.add(watch.seconds() * 1e3);
    bounded = 0;
    for (const auto& each : result.responses) bounded += each.worst ? 1U : 0U;
  }
  figures.push_back({"analysis of 500 messages, ms", analyses.text(), "<= 50", analyses.median() <= 50});
  figures.push_back({"of them with a bound", bench::grouped(static_cast<double>(bounded))});
  return true;
}

}  // namespace

int main() {
  std::vector<bench::Figure> figures;
  const bool good = start_up(figures) && link_and_analyze(figures);
  bench::print_figures("coal conveyor: 11 controllers, 44 modules, 500 kbit/s", figures);
  fmt::print("observed over bound by priority: ./run bench analysis; process image: ./run bench process\n");
  return good ? 0 : 1;
}
