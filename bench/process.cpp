// The process image: 280 variables from the frames of 35 RPDOs through a device's dictionary into the image, and a
// consistent snapshot of them by another thread.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <optional>
#include <thread>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/pair.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/process/device_image.hpp"

using namespace berth;

namespace {

constexpr unsigned rpdos = 35;
constexpr unsigned variables = rpdos * 8;
constexpr int updates = 20'000;
constexpr int rounds = 15;

struct Plc {
  Plc() {
    od::DescriptionBuilder b;
    device::add_device(b);
    for (unsigned i = 0; i < rpdos; ++i) {
      const auto index = static_cast<std::uint16_t>(0xA4C0 + i);
      b.object(index, od::ObjectCode::array, "Output variables");
      device::PdoObjects pdo;
      for (std::uint8_t sub = 1; sub <= 8; ++sub) {
        b.sub(index,
              {.sub = sub, .name = "v", .type = od::DataType::unsigned8, .access = od::Access::rww, .mappable = true});
        pdo.map.push_back({{index, sub}, 8});
        const auto name = fmt::format("v{}", bound.size());
        handles.push_back(layout.output<std::uint8_t>(name));
        bound.push_back({name, {index, sub}});
      }
      device::add_rpdo(b, i + 1, pdo);
    }
    near.join(far);
    far.join(near);
    dispatcher.emplace(executor, near);
    device.emplace(*dispatcher, b.build(), nullptr,
                   device::Options{.source = device::NodeIdSource::fixed, .node_id = NodeId(5)});
    image.emplace(layout);
    link.emplace(*device, executor, *image, bound, rt::Duration(0));
    device->power_on();
    executor.advance(executor.now());  // it boots: what is written before is the life before
    for (unsigned i = 0; i < rpdos; ++i) {
      static_cast<void>(device->values().write({static_cast<std::uint16_t>(0x1400 + i), 1}, le(0x80000000U)));
      static_cast<void>(device->values().write({static_cast<std::uint16_t>(0x1400 + i), 1}, le(0x300U + i)));
    }
    executor.advance(executor.now());
    device->apply(co::NmtCommand::start);
    executor.advance(executor.now());
  }
  std::span<const std::uint8_t> le(std::uint32_t value) {
    std::memcpy(word, &value, 4);
    return word;
  }
  /// 35 frames, as one instant hears them, and the publication behind them.
  void update(std::uint8_t n) {
    can::Frame frame;
    for (unsigned i = 0; i < rpdos; ++i) {
      const std::array<std::uint8_t, 8> data{n, n, n, n, n, n, n, n};
      frame = can::Frame::base(0x300 + i, data);
      far.send(frame, 0);
    }
    executor.advance(executor.now());
  }

  std::uint8_t word[4]{};
  rt::Executor executor;
  bench::Pair<rpdos> near{executor};
  bench::Pair<rpdos> far{executor};
  process::Layout layout;
  std::vector<process::Bound> bound;
  std::vector<process::Output<std::uint8_t>> handles;
  std::optional<can::Dispatcher> dispatcher;
  std::optional<device::Device> device;
  std::optional<process::Image> image;
  std::optional<process::DeviceImage> link;
};

}  // namespace

int main() {
  Plc plc;
  plc.update(1);
  auto& mine = plc.image->application();
  if (!mine.refresh()) {
    fmt::print(stderr, "bench_process: 35 frames were sent and the image published nothing\n");
    return 1;
  }
  for (const auto& handle : plc.handles) {
    if (mine.get(handle) == 1) continue;
    fmt::print(stderr, "bench_process: the variable at byte {} did not come\n", handle.offset());
    return 1;
  }
  bench::Rounds update;
  bench::Rounds snapshot;
  for (int round = 0; round < rounds; ++round) {
    const bench::Watch watch;
    for (int i = 0; i < updates; ++i) plc.update(static_cast<std::uint8_t>(i));
    update.add(watch.seconds() / updates * 1e6);
  }
  // The other thread takes snapshots and reads all of each, while this one publishes.
  std::atomic<bool> end = false;
  std::uint64_t torn = 0;
  for (int round = 0; round < rounds; ++round) {
    end = false;
    double spent = 0;
    std::uint64_t taken = 0;
    std::thread application([&] {
      std::array<std::uint8_t, variables> seen{};
      while (!end.load(std::memory_order_relaxed)) {
        const bench::Watch watch;
        const bool fresh = mine.refresh();
        for (unsigned i = 0; i < variables; ++i) seen[i] = mine.get(plc.handles[i]);
        spent += watch.seconds();
        ++taken;
        if (fresh && std::ranges::any_of(seen, [&](std::uint8_t v) { return v != seen[0]; })) ++torn;
      }
    });
    for (int i = 0; i < updates; ++i) plc.update(static_cast<std::uint8_t>(i));
    end = true;
    application.join();
    snapshot.add(spent / static_cast<double>(std::max<std::uint64_t>(taken, 1)) * 1e6);
  }
  std::vector<bench::Figure> figures;
  const auto at_most = [&](const char* name, const bench::Rounds& r, double aim) {
    figures.push_back({name, r.text() + " us", fmt::format("<= {:.0f} us", aim), r.median() <= aim});
  };
  at_most("280 variables from 35 RPDOs to the image, published", update, 10);
  at_most("a snapshot and all 280 of it, by another thread", snapshot, 2);
  figures.push_back({"snapshots that were torn", fmt::format("{}", torn), "0", torn == 0});
  bench::print_figures("process image; median (minimum to maximum) of 15", figures);
  return torn == 0 ? 0 : 1;
}
