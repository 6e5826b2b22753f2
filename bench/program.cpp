// 64 KiB of program to each of 44 devices on one bus: how much of the bus's time the block transfers have, beside what
// they could have at best with the devices' flash times; the same one device after the other, and without a pace.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/base/random.hpp"
#include "berth/can/length.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/manager/program_loader.hpp"
#include "berth/network/managed_bus.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

constexpr std::uint8_t devices = 44;
constexpr std::size_t program_bytes = 65'536;
constexpr device::ProgramLayout layout{.count = 1, .images = 2, .longest = program_bytes, .sector = 4'096};
// A microcontroller's flash memory: 25 ms to erase 4 KiB, 5 us for a byte.
constexpr device::FlashTimes flash_times{.byte = 5us, .sector = 25ms, .sector_size = 4'096};

struct Station {
  Station(sim::World& world, sim::Bus& bus, std::uint8_t id, const std::shared_ptr<const od::Description>& description)
      : controller(bus.attach({.queue_depth = 16, .rx_depth = 16})),
        port(world.executor(), *controller, timing, world.random().fork()),
        dispatcher(world.executor(), port),
        flash(world.executor(), device::ProgramMemory::footprint(layout), 0ns),
        device(dispatcher, description, nullptr,
               {.address = {1, 2, 3, id}, .source = device::NodeIdSource::fixed, .node_id = NodeId(id)}, &port, timing,
               {.memory = &flash, .layout = layout}) {
    flash.set_times(flash_times);
    controller->power(true);
    device.power_on();
  }
  device::Timing timing{.response_min = 200us, .response_max = 800us, .boot = 100ms, .reset = 100ms};
  std::unique_ptr<sim::Controller> controller;
  device::TimedPort port;
  can::Dispatcher dispatcher;
  device::SimFlash flash;
  device::Device device;
};

enum class Way { one_by_one, at_once_without_pace, at_once };

struct Outcome {
  double seconds = 0;      // bus time, from the first stop to the last start
  double sdo_seconds = 0;  // of it the frames of the transfers
  std::size_t good = 0;
  unsigned lost = 0;  // heartbeats
};

struct Plant final : can::Tap, co::HeartbeatConsumer::Observer {
  explicit Plant(std::uint32_t rate) : bit_rate(rate), wire(world.add_bus("bus", rate)) {
    od::DescriptionBuilder b;
    device::add_device(b, {.heartbeat_ms = 1'000});
    device::add_programs(b);
    const auto description = b.build();
    for (std::uint8_t id = 1; id <= devices; ++id) {
      stations.push_back(std::make_unique<Station>(world, wire, id, description));
    }
    Random random(7);
    std::vector<std::uint8_t> content(program_bytes);
    for (auto& byte : content) byte = static_cast<std::uint8_t>(random.next());
    image = device::make_program_image({}, content);
    for (std::uint8_t id = 1; id <= devices; ++id) consumer.supervise(NodeId(id), 2'500ms);
    world.run_for(2s);
  }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const bool sdo = frame.id >= 0x580 && frame.id < 0x680;
    if (sdo) bits += can::exact_bits(frame);
  }
  void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override {
    if (event.kind == co::HeartbeatEvent::Kind::lost) ++lost;
  }
  rt::Task<void> load(NodeId id, const manager::ProgramOptions& options, std::size_t& good) {
    co::NodeAccess access(managed.sdo(), id);
    const std::array wishes{manager::ProgramWish{.image = image}};
    manager::ProgramLoader loader(access, wishes, options);
    manager::ProgramReport report;
    const auto done = co_await loader.run(report);
    if (done) ++good;
    ++over;
  }
  Outcome run(Way way) {
    manager::ProgramOptions options;
    manager::ProgramTransfers transfers(dispatcher);
    if (way == Way::at_once) options.transfers = &transfers;
    Outcome outcome;
    wire.add_tap(*this);
    bits = 0;
    lost = 0;
    over = 0;
    const rt::Time began = world.now();
    rt::Scope scope(world.executor(), way == Way::one_by_one ? 1 : devices);
    for (std::uint8_t id = 1; id <= devices; ++id) scope.spawn(load(NodeId(id), options, outcome.good));
    world.run_until([&] { return over == devices; }, 3h);
    wire.remove_tap(*this);
    outcome.seconds = std::chrono::duration<double>(world.now() - began).count();
    outcome.sdo_seconds = bits / bit_rate;
    outcome.lost = lost;
    return outcome;
  }

  std::uint32_t bit_rate;
  sim::World world;
  sim::Bus& wire;
  std::unique_ptr<sim::Controller> controller = wire.attach({.queue_depth = 64, .rx_depth = 256});
  can::Dispatcher dispatcher{world.executor(), *controller};
  network::ManagedBus managed{dispatcher};
  co::HeartbeatConsumer consumer{dispatcher, *this};
  std::vector<std::unique_ptr<Station>> stations;
  std::vector<std::uint8_t> image;
  double bits = 0;
  unsigned lost = 0;
  std::size_t over = 0;
};

// At best the bus is never idle, or the slowest of what one device does by itself is what counts.
double at_best(const Outcome& all) {
  const double flash = std::chrono::duration<double>(flash_times.sector * (2 * (program_bytes / 4'096 + 1)) +
                                                     flash_times.byte * program_bytes)
                           .count();
  return std::max(all.sdo_seconds, flash + all.sdo_seconds / devices);
}

void row(std::vector<std::vector<std::string>>& rows, std::uint32_t rate, const char* way, const Outcome& o) {
  rows.push_back({fmt::format("{} kbit/s", rate / 1000), way, fmt::format("{:.1f} s", o.seconds),
                  fmt::format("{:.1f} %", 100 * o.sdo_seconds / o.seconds), fmt::format("{} of {}", o.good, devices),
                  fmt::format("{}", o.lost)});
}

}  // namespace

int main() {
  std::vector<std::vector<std::string>> rows;
  std::vector<bench::Figure> figures;
  bool good = true;
  for (const std::uint32_t rate : {500'000U, 125'000U}) {
    const Outcome all = Plant(rate).run(Way::at_once);
    row(rows, rate, "side by side", all);
    row(rows, rate, "one by one", Plant(rate).run(Way::one_by_one));
    row(rows, rate, "side by side, no pace", Plant(rate).run(Way::at_once_without_pace));
    const double best = at_best(all);
    figures.push_back(bench::at_least(
        fmt::format("64 KiB to {} devices at {} kbit/s: of what block transfer can carry", devices, rate / 1000),
        100 * best / all.seconds, 85, "%"));
    good = good && all.good == devices && all.lost == 0;
  }
  bench::print_columns("programs: 64 KiB to each of 44 devices, in bus time",
                       {"bus", "how", "time", "bus used by it", "done", "heartbeats lost"}, rows);
  bench::print_figures("programs", figures);
  const bool met = std::ranges::all_of(figures, [](const bench::Figure& f) { return f.met.value_or(true); });
  return good && met ? 0 : 1;
}
