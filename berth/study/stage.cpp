#include "berth/study/stage.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <set>

namespace berth::study {
namespace {

using namespace std::chrono_literals;

std::unique_ptr<plant::World> make(const plant::PlantFile& plant, std::uint32_t bit_rate) {
  Findings findings;
  const plant::BusRate rate{std::string(bus_name), bit_rate};
  auto world = plant::World::make(plant, {&rate, 1}, findings);
  if (world) return world;
  for (const auto& finding : findings) std::fprintf(stderr, "%s\n", to_string(finding).c_str());
  std::abort();
}

LssAddress address_of(Serials serials, unsigned i, Random& random) {
  const auto any = static_cast<std::uint32_t>(random.next());
  switch (serials) {
    case Serials::consecutive:
      return {.vendor = 0x0135'5341, .product = 0x0447'0003, .revision = 0x2'0006, .serial = i + 1};
    case Serials::random: return {.vendor = 0x0135'5341, .product = 0x0447'0003, .revision = 0x2'0006, .serial = any};
    case Serials::mixed: break;
  }
  constexpr TypeCode types[]{{0x0135'5341, 0x0447'0003},
                             {0x0135'5341, 0x0447'0104},
                             {0x0000'0319, 0xAA55'0001},
                             {0x0000'0319, 0xAA55'0002},
                             {0x0000'0017, 0x0000'0600}};
  const auto& type = types[i % std::size(types)];
  return {.vendor = type.vendor,
          .product = type.product,
          .revision = i / 5 % 2 == 0 ? 0x1'0003U : 0x2'0006U,
          .serial = any};
}

}  // namespace

const char* name(Serials serials) noexcept {
  switch (serials) {
    case Serials::consecutive: return "consecutive";
    case Serials::random: return "random";
    case Serials::mixed: return "mixed";
  }
  return "?";
}

plant::PlantFile plant_of(const Cast& cast) {
  plant::PlantFile plant;
  plant.seed = cast.seed;
  plant.buses.push_back({std::string(bus_name), 0});
  Random random(cast.seed);
  std::set<LssAddress> taken;
  while (plant.devices.size() < cast.devices) {
    const auto i = static_cast<unsigned>(plant.devices.size());
    plant::PlantDevice device;
    device.name = "d" + std::to_string(i + 1);
    device.bus = bus_name;
    device.address = address_of(cast.serials, i, random);
    if (!taken.insert(device.address).second) continue;
    device.speaks = cast.speaks;
    device.response = cast.response;
    device.reset = device.storing.time = 5ms;
    if (cast.configured) {
      device.source = plant::NodeIdSource::hard_coded;
      device.node_id = NodeId(static_cast<std::uint8_t>(i + 1));
    }
    plant.devices.push_back(std::move(device));
  }
  return plant;
}

Stage::Stage(const plant::PlantFile& plant, std::uint32_t bit_rate)
    : world_(make(plant, bit_rate)),
      bus_(world_->bus(bus_name)),
      port_(world_->attach_master(bus_name)),
      dispatcher_(world_->executor(), *port_) {
  (void)trace_.bus(bus_name);
  bus_->add_tap(*this);
  world_->start();
}

Stage::~Stage() { bus_->remove_tap(*this); }

void Stage::frame(const can::Frame& frame, rt::Time at, int) noexcept {
  last_ = at;
  if (recording_) trace_.entries.push_back({at.time_since_epoch(), 0, frame});
}

void Stage::mark() {
  class Sent final : public can::Confirmation {
   public:
    void sent(rt::Time) noexcept override { done = true; }
    bool done = false;
  } sent;
  dispatcher_.send(can::Frame::base(0x77F, {0x05}), sent);
  world_->sim().run_until([&] { return sent.done; }, 1s);
}

bool Stage::run(rt::Task<void> task, rt::Duration limit) {
  rt::Scope scope(world_->executor());
  scope.spawn(std::move(task));
  return world_->sim().run_until([&] { return scope.running() == 0; }, limit);
}

void Stage::run_until_quiet(rt::Duration quiet, rt::Duration limit) {
  const rt::Time end = now() + limit;
  rt::Time from = now();
  while (now() < end) {
    world_->sim().run_until(std::min(end, from + quiet));
    if (now() - std::max(last_, from) >= quiet) return;
    from = std::max(last_, from);
  }
}

void Stage::crop_after_boot_up() {
  const auto boot_up = [](const trace::Entry& e) {
    const auto& f = e.frame;
    return !f.extended && !f.remote && f.id > 0x700 && f.id < 0x780 && f.size == 1 && f.data[0] == 0;
  };
  auto& all = trace_.entries;
  while (!all.empty() && !boot_up(all.back())) all.pop_back();
}

rt::Duration Stage::span() const noexcept {
  return trace_.entries.empty() ? rt::Duration{} : trace_.entries.back().at - trace_.entries.front().at;
}

unsigned Stage::bound() const {
  unsigned count = 0;
  std::set<NodeId> twice;
  for (const auto& [a, b] : world_->duplicates()) twice.insert(a->truth().active);
  for (const auto& truth : world_->truth()) {
    if (truth.active.configured() && !twice.contains(truth.active)) ++count;
  }
  return count;
}

}  // namespace berth::study
