// The process image: 280 variables from the frames of 35 RPDOs through a device's dictionary into the image, and a
// consistent snapshot of them by another thread. Then the way from an RPDO to the TPDO of what a program in another
// process made of it, in real time.
#include <fmt/format.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstring>
#include <optional>
#include <thread>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/pair.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/io/loop.hpp"
#include "berth/process/device_image.hpp"
#include "berth/process/process.h"
#include "berth/process/shared_image.hpp"

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
    link.emplace(*device, executor, image->network(), bound, process::DeviceImage::Options{});
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

/// A program with a cycle of 5 ms in a process of its own: what comes in goes out.
[[noreturn]] void run_program(const std::string& name) {
  auto* const image = berth_process_open(name.c_str(), nullptr, 0);
  berth_variable in{};
  berth_variable out{};
  if (image == nullptr || !berth_process_find(image, "in", &in) || !berth_process_find(image, "out", &out)) ::_exit(1);
  constexpr long cycle_ns = 5'000'000;
  timespec at{};
  ::clock_gettime(CLOCK_MONOTONIC, &at);
  for (;;) {
    at.tv_nsec += cycle_ns;
    if (at.tv_nsec >= 1'000'000'000) at = {at.tv_sec + 1, at.tv_nsec - 1'000'000'000};
    ::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
    berth_process_refresh(image);
    berth_process_set_integer(image, &in, berth_process_integer(image, &out));
    berth_process_commit(image);
  }
}

/// Hears the TPDO.
struct Heard final : can::Listener {
  void received(const can::Frame& frame, rt::Time) noexcept override { value = frame.data[0]; }
  void sent(std::uint32_t, rt::Time) noexcept override {}
  void changed(const can::Status&, rt::Time) noexcept override {}
  int value = -1;
};

/// Milliseconds from the RPDO to the TPDO, each of 300 times; empty: it did not work, and was told.
std::vector<double> frame_to_frame() {
  using namespace std::chrono_literals;
  process::Layout layout;
  static_cast<void>(layout.input<std::uint8_t>("in"));
  static_cast<void>(layout.output<std::uint8_t>("out"));
  const auto name = fmt::format("bench-{}", ::getpid());
  auto image = process::SharedImage::create(name, layout);
  if (!image) {
    fmt::print(stderr, "bench_process: {}\n", image.error());
    return {};
  }
  const pid_t program = ::fork();
  if (program == 0) run_program(name);
  od::DescriptionBuilder b;
  device::add_device(b);
  b.object(0xA040, od::ObjectCode::array, "Input variables");
  b.sub(0xA040, {.sub = 1, .name = "v", .type = od::DataType::unsigned8, .access = od::Access::ro, .mappable = true});
  b.object(0xA4C0, od::ObjectCode::array, "Output variables");
  b.sub(0xA4C0, {.sub = 1, .name = "v", .type = od::DataType::unsigned8, .access = od::Access::rww, .mappable = true});
  device::add_rpdo(b, 1, {.map = {{{0xA4C0, 1}, 8}}});
  device::add_tpdo(b, 1, {.map = {{{0xA040, 1}, 8}}});
  rt::Executor executor;
  io::Loop loop(executor);
  bench::Pair<4> near{executor};
  bench::Pair<4> far{executor};
  near.join(far);
  far.join(near);
  Heard heard;
  const can::IdRange tpdo{0x185, 0x185};
  far.listen(&heard, std::span(&tpdo, 1));
  can::Dispatcher dispatcher(executor, near);
  device::Device device(dispatcher, b.build(), nullptr, {.source = device::NodeIdSource::fixed, .node_id = NodeId(5)});
  const std::vector<process::Bound> bound{{"in", {0xA040, 1}}, {"out", {0xA4C0, 1}}};
  process::DeviceImage link(device, executor, (*image)->network(), bound, {.cycle = 1ms});
  device.power_on();
  loop.turn(1ms);
  device.apply(co::NmtCommand::start);
  std::vector<double> took;
  constexpr int times = 300;
  for (int i = 1; i <= times; ++i) {
    // At any phase of the program's cycle.
    const auto until = executor.now() + std::chrono::microseconds(7'000 + 617 * (i % 9));
    while (executor.now() < until) loop.turn(1ms);
    const std::array<std::uint8_t, 1> data{static_cast<std::uint8_t>(i % 251 + 1)};
    const bench::Watch watch;
    far.send(can::Frame::base(0x205, data), 0);
    while (heard.value != data[0] && watch.seconds() < 1) loop.turn(1ms);
    if (heard.value == data[0]) took.push_back(watch.seconds() * 1e3);
  }
  ::kill(program, SIGKILL);
  ::waitpid(program, nullptr, 0);
  if (took.size() == times) return took;
  fmt::print(stderr, "bench_process: {} of {} RPDOs had no TPDO within 1 s\n", times - took.size(), times);
  return {};
}

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
  auto took = frame_to_frame();
  if (took.empty()) return 1;
  std::ranges::sort(took);
  const double median = took[took.size() / 2];
  figures.push_back({"RPDO to TPDO by a program of another process, cycle 5 ms (without the bus; of 300)",
                     fmt::format("{:.2f} ms ({:.2f} to {:.2f})", median, took.front(), took.back()), "<= 6 ms",
                     median <= 6});
  bench::print_figures("process image; median (minimum to maximum) of 15", figures);
  return torn == 0 ? 0 : 1;
}
