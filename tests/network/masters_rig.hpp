// Several flying masters with the same network list, their slaves, and a watcher of what must never be.
#pragma once

#include <bitset>
#include <optional>

#include "berth/eds/concise_dcf.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "tests/network/network_rig.hpp"

namespace berth::network::test {

inline constexpr std::uint32_t booted_slave = 0x05;    // assigned, booted on error
inline constexpr std::uint32_t flying_startup = 0x21;  // master, flying
inline constexpr std::uint16_t big_table = 0x2001;

inline const std::shared_ptr<const od::Description>& big_slave_description() {
  static const auto made = [] {
    od::DescriptionBuilder b;
    device::add_device(b, {.type = slave_type, .name = "Slave", .heartbeat_ms = 100});
    device::add_storage(b);
    b.variable(0x2000, {.name = "Limit"});
    b.variable(big_table, {.name = "Table", .type = od::DataType::octet_string, .capacity = 8000});
    return b.build();
  }();
  return made;
}

inline const std::shared_ptr<const od::Description>& flying_description() {
  static const auto made = [] {
    od::DescriptionBuilder b;
    device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
    add_manager_objects(b, {.most = 8, .startup = flying_startup, .longest_concise = 9000, .flying = true});
    return b.build();
  }();
  return made;
}

struct FlyingStation {
  FlyingStation(sim::World& world, sim::Bus& bus, std::uint8_t id, std::vector<device::Preset> presets)
      : world_(&world), station(world, bus, id, flying_description(), std::move(presets)) {
    make();
    station.device.on().state = [this, id](NmtState state) { manager->own_state(state, NodeId(id)); };
    station.device.on().parameters = [this] {
      for (const auto& [slave, stream] : configurations) {
        EXPECT_EQ(station.device.values().write({0x1F22, slave}, stream), od::AbortCode::none);
      }
    };
  }
  ~FlyingStation() { manager.reset(); }
  void make() {
    manager = std::make_unique<DictionaryManager>(station.dispatcher, station.device.values(),
                                                  [this](co::NmtCommand command) { station.device.apply(command); });
    manager->on_role([this] {
      told.push_back(std::to_string(world_->now().time_since_epoch() / 1ms) +
                     " ms: " + name(manager->flying().state()));
    });
    manager->network().observe([this](const NetworkEvent& event) {
      told.push_back(std::to_string(world_->now().time_since_epoch() / 1ms) + " ms: " + text(event));
    });
  }
  void on() {
    if (powered) return;
    powered = true;
    station.on();
  }
  void off() {
    if (!powered) return;
    powered = false;
    manager->power_off();
    station.off();
  }
  [[nodiscard]] bool leads() const { return powered && manager->flying().is_master(); }
  [[nodiscard]] NodeId knows() const {
    const auto active = manager->flying().active();
    return powered && active ? active->node : NodeId();
  }
  sim::World* world_;
  Station station;
  std::unique_ptr<DictionaryManager> manager;
  std::map<std::uint8_t, std::vector<std::uint8_t>> configurations;  // 1F22h after each reset
  std::vector<std::string> told;
  bool powered = false;
};

// Masters have node-IDs from 10 on, slaves from 1 on.
struct MastersRig : can::Tap, device::Device::Observer {
  explicit MastersRig(std::vector<std::uint8_t> priorities, std::uint8_t slaves = 2,
                      std::uint32_t startup = flying_startup, std::uint32_t assignment = booted_slave,
                      std::uint64_t seed = 1)
      : world(seed) {
    wire.add_tap(*this);
    for (std::uint8_t id = 1; id <= slaves; ++id) {
      stations[id] = std::make_unique<Station>(world, wire, id, big_slave_description());
      stations[id]->device.observe(this);
    }
    for (std::size_t i = 0; i < priorities.size(); ++i) {
      const auto id = static_cast<std::uint8_t>(10 + i);
      std::vector<device::Preset> presets{{{0x1F80, 0}, startup}, {{0x1F90, 3}, priorities[i]}};
      for (std::uint8_t slave = 1; slave <= slaves; ++slave) {
        presets.push_back({{0x1F81, slave}, assignment});
        presets.push_back({{0x1F84, slave}, slave_type});
        presets.push_back({{0x1016, slave}, std::uint32_t{slave} << 16U | 300U});
      }
      masters.push_back(std::make_unique<FlyingStation>(world, wire, id, std::move(presets)));
    }
  }
  ~MastersRig() { wire.remove_tap(*this); }

  // The same table and limit for a slave, in every master.
  void configure(std::uint8_t slave, std::uint32_t limit, std::size_t table) {
    eds::ConciseDcf dcf;
    std::vector<std::uint8_t> bytes(4);
    store_le(bytes.data(), limit);
    dcf.entries.push_back({{0x2000, 0}, bytes});
    if (table > 0) dcf.entries.push_back({{big_table, 0}, std::vector<std::uint8_t>(table, slave)});
    const auto stream = eds::encode(dcf);
    for (auto& master : masters) master->configurations[slave] = stream;
  }
  void all_on() {
    for (auto& [id, station] : stations) station->on();
    for (auto& master : masters) master->on();
  }
  // The one that leads; null: none or several.
  [[nodiscard]] FlyingStation* leader() const {
    FlyingStation* found = nullptr;
    for (const auto& master : masters) {
      if (!master->leads()) continue;
      if (found != nullptr) return nullptr;
      found = master.get();
    }
    return found;
  }
  bool run_until_led_by(std::size_t index, rt::Duration limit = 30s) {
    return world.run_until([&] { return leader() == masters[index].get(); }, limit);
  }
  bool slaves_operational() const {
    return std::ranges::all_of(stations, [](auto& s) { return s.second->state() == NmtState::operational; });
  }
  bool run_until_operational(rt::Duration limit = 30s) {
    return world.run_until([&] { return slaves_operational(); }, limit);
  }

  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    frames.push_back(can::to_string(frame));
    const bool start = frame.key() == 0 && frame.size == 2 && frame.data[0] == 1;
    if (!start) return;
    for (const auto& [id, station] : stations) {
      const bool meant = frame.data[1] == 0 || frame.data[1] == id;
      const bool ran = runs_since[id] && *runs_since[id] < at;
      if (meant) ++starts[id];
      if (!meant || !ran) continue;
      ++second_starts;
      const auto from = frames.size() > 40 ? frames.end() - 40 : frames.begin();
      second_start += std::to_string(at.time_since_epoch() / 1ms) + " ms, of a device that runs since " +
                      std::to_string(runs_since[id]->time_since_epoch() / 1ms) + " ms:";
      for (auto f = from; f != frames.end(); ++f) second_start += "\n" + *f;
    }
  }
  void device_changed(const device::Device& device) noexcept override {
    const auto id = device.lss().address().serial;
    auto& since = runs_since.at(id);
    if (device.state() != NmtState::operational || !device.powered()) {
      if (since) ++left_operational.at(id);
      since.reset();
    } else if (!since) {
      since = world.now();
    }
  }
  // NMT commands and the frames of flying masters, in their order.
  [[nodiscard]] std::vector<std::string> commands() const {
    std::vector<std::string> found;
    std::ranges::copy_if(frames, std::back_inserter(found),
                         [](auto& f) { return f.starts_with("000#") || f.starts_with("07"); });
    return found;
  }
  [[nodiscard]] std::size_t count(std::string_view prefix) const {
    return static_cast<std::size_t>(std::ranges::count_if(frames, [&](auto& f) { return f.starts_with(prefix); }));
  }

  sim::World world;
  sim::Bus& wire = world.add_bus("bus", 500'000);
  std::map<std::uint8_t, std::unique_ptr<Station>> stations;
  std::vector<std::unique_ptr<FlyingStation>> masters;
  std::vector<std::string> frames;
  std::array<std::optional<rt::Time>, 128> runs_since{};
  std::array<unsigned, 128> left_operational{};
  std::array<unsigned, 128> starts{};
  unsigned second_starts = 0;
  std::string second_start;  // what was on the bus before
};

}  // namespace berth::network::test
