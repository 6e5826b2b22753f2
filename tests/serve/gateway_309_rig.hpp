/// A machine with two simulated buses, a session without a main job on it, devices, and a conversation of CiA 309-3
/// that is played from a transcript, in virtual time.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "berth/device/device.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/plant/world.hpp"
#include "berth/serve/cia309_client.hpp"
#include "berth/tree/session.hpp"

namespace berth::serve {

using namespace std::chrono_literals;

inline constexpr can::IdRange all_frames[] = {can::all_base, can::all_extended};

class FrameEar final : public can::Listener {
 public:
  void received(const can::Frame& f, rt::Time) noexcept override { frames.push_back(can::to_string(f)); }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
  [[nodiscard]] long count(const std::string& frame) const { return std::ranges::count(frames, frame); }
  std::vector<std::string> frames;
};

/// Node 5 of net 1 with an object of every type at 2000h, and room for 4 kB at 2100h.
inline std::shared_ptr<const od::Description> bench_device() {
  using od::DataType;
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = od::Access::ro, .initial = od::Literal::number(0x12345)});
  b.variable(0x1001, {.name = "Error register", .type = DataType::unsigned8, .access = od::Access::ro});
  b.variable(0x100C, {.name = "Guard time", .type = DataType::unsigned16});
  b.variable(0x100D, {.name = "Life time factor", .type = DataType::unsigned8});
  b.variable(0x1010, {.name = "Store", .access = od::Access::rw});
  b.variable(0x1014, {.name = "COB-ID EMCY", .initial = od::Literal::node_id_plus(0x80)});
  b.variable(0x1017, {.name = "Heartbeat", .type = DataType::unsigned16});
  std::uint8_t sub = 1;
  b.object(0x2000, od::ObjectCode::record, "Every type");
  for (const auto type : od::all_data_types()) {
    if (od::known(type)) b.sub(0x2000, {.sub = sub++, .name = od::name(type), .type = type});
  }
  b.variable(0x2100, {.name = "Long", .type = DataType::domain, .capacity = 4096});
  b.variable(0x2101, {.name = "Secret", .access = od::Access::wo});
  return b.build();
}
/// The sub-index of a type in 2000h.
inline unsigned sub_of(od::DataType wanted) {
  unsigned sub = 1;
  for (const auto type : od::all_data_types()) {
    if (!od::known(type)) continue;
    if (type == wanted) return sub;
    ++sub;
  }
  return 0;
}

struct Rig309Options {
  design::Role role = design::Role::master;
  bool bench = true;   ///< node 5 on net 1
  unsigned blank = 0;  ///< LSS devices without a node-ID on net 1, serial numbers 0x101, 0x102, ...
  bool clone = false;  ///< another one of blank0's LSS address
  std::uint32_t bit_rate = 500'000;
  bool one_net = false;
};

class Rig309 {
 public:
  explicit Rig309(Rig309Options options = {}) {
    machine_.name = "rig";
    for (const std::string name : {"backbone", "drives"}) {
      if (options.one_net && name == "drives") continue;
      design::Bus bus;
      bus.name = name;
      bus.bitrate = options.bit_rate;
      bus.role = options.role;
      machine_.buses.push_back(bus);
      file_.buses.push_back({name, 0});
      rates_.push_back({name, bus.bitrate});
    }
    const unsigned devices = options.blank + (options.clone ? 1U : 0U);
    for (unsigned i = 0; i < devices; ++i) {
      plant::PlantDevice d;
      d.name = i < options.blank ? "blank" + std::to_string(i) : "clone";
      d.bus = "backbone";
      d.address = {0x11, 0x22, 0x33, 0x101 + i % options.blank};
      if (i >= options.blank) d.response = {.min = 2ms, .max = 3ms};
      d.speaks = {plant::Speaks::fastscan};
      file_.devices.push_back(d);
    }
    Findings findings;
    world_ = plant::World::make(file_, rates_, findings);
    for (const auto& f : findings) ADD_FAILURE() << to_string(f);
    for (const auto& bus : machine_.buses) {
      ports_.push_back(world_->attach_master(bus.name));
      sniffers_.push_back(world_->attach_master(bus.name, {.name = "sniffer", .queue_depth = 64}));
      sniffers_.back()->listen(&ears_.emplace_back(std::make_unique<FrameEar>()).operator*(), all_frames);
    }
    session_ = std::make_unique<tree::Session>(world_->executor(), machine_, store_);
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      EXPECT_TRUE(session_->connect(machine_.buses[i].name, *ports_[i]));
    }
    EXPECT_TRUE(session_->open());
    world_->start();
    if (options.bench) add_bench();
    house_.session = session_.get();
    house_.tell = [this](const std::string& text) { told.push_back(text); };
    run_for(100ms);
    for (auto& ear : ears_) ear->frames.clear();
    begin();
  }
  ~Rig309() {
    talk.reset();
    session_.reset();
    bench.reset();
    dispatcher_.reset();
    bench_port_.reset();
    sniffers_.clear();
    ports_.clear();
  }

  void begin() {
    talk = std::make_unique<cia309::Conversation>(
        house_, [this](std::string_view text) { said += text; }, [this] { ++mores; });
  }

  /// Lines with "> " are said; lines with "< " are all that is answered up to the next "> ", and must come within a
  /// minute of bus time.
  void play(const std::string& transcript) {
    std::istringstream lines(transcript);
    std::string expected;
    std::string line;
    const auto check = [&] {
      world_->sim().run_until([&] { return said.size() >= expected.size() && talk->idle(); }, 60s);
      EXPECT_EQ(said, expected);
      said.clear();
      expected.clear();
    };
    while (std::getline(lines, line)) {
      if (line.starts_with("> ")) {
        if (!expected.empty()) check();
        talk->take(std::string_view(line).substr(2));
      } else if (line.starts_with("< ")) {
        expected += line.substr(2) + "\r\n";
      }
    }
    check();
  }
  void run_for(rt::Duration time) { world_->sim().run_for(time); }
  bool run_until(const std::function<bool()>& done, rt::Duration limit = 60s) {
    return world_->sim().run_until(done, limit);
  }
  [[nodiscard]] FrameEar& heard(std::size_t net = 1) { return *ears_.at(net - 1); }
  sim::Controller& peer(std::size_t net = 1) { return *sniffers_.at(net - 1); }
  [[nodiscard]] tree::Session& session() { return *session_; }
  [[nodiscard]] cia309::House& house() { return house_; }
  [[nodiscard]] plant::World& world() { return *world_; }
  void unplug_bench() {
    bench.reset();
    dispatcher_.reset();
    bench_port_.reset();
  }
  void add_bench() {
    bench_port_ = world_->attach_master("backbone", {.name = "bench", .queue_depth = 64});
    dispatcher_ = std::make_unique<can::Dispatcher>(world_->executor(), *bench_port_);
    device::Options options;
    options.address = {0xAA, 0xBB, 0xCC, 0xDD};
    options.source = device::NodeIdSource::fixed;
    options.node_id = NodeId(5);
    options.rand = device::RandMode::off;
    bench = std::make_unique<device::Device>(*dispatcher_, description_, nullptr, options);
    bench->power_on();
  }

  std::unique_ptr<device::Device> bench;
  std::unique_ptr<cia309::Conversation> talk;
  std::string said;
  std::vector<std::string> told;
  unsigned mores = 0;

 private:
  std::shared_ptr<const od::Description> description_ = bench_device();
  design::Machine machine_;
  plant::PlantFile file_;
  std::vector<plant::BusRate> rates_;
  places::MemoryStore store_;
  std::unique_ptr<plant::World> world_;
  std::vector<std::unique_ptr<sim::Controller>> ports_;
  std::vector<std::unique_ptr<FrameEar>> ears_;
  std::vector<std::unique_ptr<sim::Controller>> sniffers_;
  std::unique_ptr<sim::Controller> bench_port_;
  std::unique_ptr<can::Dispatcher> dispatcher_;
  std::unique_ptr<tree::Session> session_;
  cia309::House house_;
};

}  // namespace berth::serve
