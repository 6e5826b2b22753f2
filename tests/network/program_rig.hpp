// Devices that are programmed over the bus, and a manager that does it.
#pragma once

#include <gtest/gtest.h>
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "berth/base/crc.hpp"
#include "berth/device/device.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/manager/program_loader.hpp"
#include "berth/network/dictionary_manager.hpp"
#include "berth/sim/world.hpp"

namespace berth::network::test {

using namespace std::chrono_literals;
using Image = std::vector<std::uint8_t>;

inline constexpr std::uint32_t programmed_type = 0x0002'0195;
inline constexpr TypeCode programmed_product{0x11, 0x33};

inline Image program_content(std::size_t size, unsigned seed) {
  Image bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(seed * 31 + i * 7 + i / 11);
  return bytes;
}
inline Image program_image(std::size_t size, unsigned seed, device::ProgramHead head = {.type = programmed_product}) {
  return device::make_program_image(head, program_content(size, seed));
}

struct ProgrammedSpec {
  device::ProgramLayout layout{.count = 1, .images = 2, .longest = 8'192, .sector = 1'024};
  device::FlashTimes times{.byte = 2us, .sector = 5ms, .sector_size = 1'024};
  std::uint32_t bit_rate = 500'000;
  bool checked = true;
  rt::Duration boot = 20ms;
};

inline std::shared_ptr<const od::Description> programmed_description(std::uint8_t count) {
  od::DescriptionBuilder b;
  device::add_device(b, {.type = programmed_type, .name = "Controller", .heartbeat_ms = 100});
  device::add_storage(b);
  device::add_programs(b, count);
  return b.build();
}

// A programmable device on a controller of its own, whose power goes when its flash memory is cut.
struct Programmed final : device::SimFlash::Watcher, rt::Job {
  Programmed(sim::World& world, sim::Bus& bus, std::uint8_t id, const ProgrammedSpec& spec)
      : controller(bus.attach({.queue_depth = 16, .rx_depth = 64})),
        dispatcher(world.executor(), *controller),
        description(programmed_description(spec.layout.count)),
        memory(world.executor(), device::memory_size(*description), 1ms),
        flash(world.executor(), device::ProgramMemory::footprint(spec.layout), 0ns),
        device(dispatcher, description, &memory,
               {.address = {programmed_product.vendor, programmed_product.product, 1, id},
                .source = device::NodeIdSource::fixed,
                .node_id = NodeId(id)},
               nullptr, {.boot = spec.boot, .reset = spec.boot},
               {.memory = &flash, .layout = spec.layout, .checked = spec.checked}) {
    flash.set_times(spec.times);
    flash.watch(this);
  }
  void on() {
    controller->power(true);
    device.power_on();
  }
  void off() {
    device.power_off();
    controller->power(false);
  }
  void write_began() noexcept override {}
  void write_ended() noexcept override {}
  // Not inside the memory's call.
  void cut() noexcept override {
    ++cuts;
    dispatcher.executor().after(rt::Duration(0), *this);
  }
  void run() noexcept override { off(); }
  [[nodiscard]] Image held(std::uint8_t number = 1) const {
    const auto& memory_of = device.programs()->memory();
    const auto& program = memory_of.program(number);
    Image bytes(program.valid ? program.length : 0);
    if (program.valid) memory_of.read(number, 0, bytes);
    return bytes;
  }

  std::unique_ptr<sim::Controller> controller;
  can::Dispatcher dispatcher;
  std::shared_ptr<const od::Description> description;
  device::SimFlash memory;
  device::SimFlash flash;
  device::Device device;
  unsigned cuts = 0;
};

// Devices 1 to `count`, and the manager's side of the bus.
struct ProgramRig {
  explicit ProgramRig(std::uint8_t count = 1, ProgrammedSpec with = {})
      : spec(with), wire(world.add_bus("bus", spec.bit_rate)) {
    for (std::uint8_t id = 1; id <= count; ++id) {
      devices[id] = std::make_unique<Programmed>(world, wire, id, spec);
      devices[id]->on();
    }
    world.run_for(50ms);
  }
  template <class T>
  struct Done {
    std::optional<T> value;
  };
  static rt::Task<void> load(ProgramLoader& loader, ProgramReport& report, std::optional<Result<void>>& into) {
    auto done = co_await loader.run(report);
    into = done;
  }
  // Into device `id`; `while_running` once, in stage `act_in`, when so many bytes are down.
  Result<void> download(std::uint8_t id, std::span<const ProgramWish> wishes, std::size_t at = ~std::size_t{0},
                        const std::function<void()>& while_running = {}) {
    ProgramOptions options = given;
    options.transfers = &transfers;
    bool acted = false;
    options.progress = [&](const ProgramProgress& p) {
      progress.push_back(p);
      if (p.done >= at && p.stage == act_in && !acted) act = acted = true;
    };
    co::SdoOptions patience;
    patience.timeout = 200ms;
    co::NodeAccess access(managed.sdo(), NodeId(id), patience);
    ProgramLoader loader(access, wishes, options);
    report = {};
    std::optional<Result<void>> ended;
    rt::Scope scope(world.executor());
    scope.spawn(load(loader, report, ended));
    const bool over = world.run_until(
        [&] {
          if (std::exchange(act, false)) while_running();
          return ended.has_value();
        },
        300s);
    if (!over) return fail(Errc::timeout, "the loader never ended");
    return *ended;
  }
  Result<void> download(std::uint8_t id, const Image& image, std::uint32_t identification = 0) {
    const std::array wishes{ProgramWish{.number = 1, .image = image, .identification = identification}};
    return download(id, wishes);
  }
  template <class Op>
  auto get(Op&& op) {
    struct Told final : rt::Job {
      void run() noexcept override { done = true; }
      bool done = false;
    } told;
    if (!op.begin(world.executor(), told)) {
      EXPECT_TRUE(world.run_until([&] { return told.done; }, 10s));
    }
    return op.await_resume();
  }
  using Step = rt::Task<Result<void>> (*)(co::SdoAccess&, std::uint8_t, const ProgramOptions&);
  // One step by itself, at program 1 of a device.
  Result<void> get_task(Step step, std::uint8_t id) {
    co::SdoOptions patience;
    patience.timeout = 200ms;
    co::NodeAccess access(managed.sdo(), NodeId(id), patience);
    std::optional<Result<void>> ended;
    const auto run = [](Step what, co::SdoAccess& on, const ProgramOptions& how,
                        std::optional<Result<void>>& into) -> rt::Task<void> {
      auto done = co_await what(on, 1, how);
      into = done;
    };
    rt::Scope scope(world.executor());
    scope.spawn(run(step, access, given, ended));
    EXPECT_TRUE(world.run_until([&] { return ended.has_value(); }, 300s));
    return ended.value_or(fail(Errc::timeout, "it never ended"));
  }
  template <class T>
  od::Answer<T> read(std::uint8_t id, std::uint16_t index, std::uint8_t sub) {
    const auto value = get(managed.sdo().read<T>(NodeId(id), index, sub));
    if (value) return *value;
    return od::refuse(static_cast<od::AbortCode>(value.error().detail));
  }
  od::AbortCode control(std::uint8_t id, std::uint8_t value, std::uint8_t number = 1) {
    const auto done = get(managed.sdo().write<std::uint8_t>(NodeId(id), 0x1F51, number, value));
    world.run_for(100ms);
    return done ? od::AbortCode::none : static_cast<od::AbortCode>(done.error().detail);
  }

  ProgrammedSpec spec;
  sim::World world;
  sim::Bus& wire;
  std::unique_ptr<sim::Controller> controller = wire.attach({.queue_depth = 64, .rx_depth = 256});
  can::Dispatcher dispatcher{world.executor(), *controller};
  ManagedBus managed{dispatcher};
  ProgramTransfers transfers{dispatcher};
  std::map<std::uint8_t, std::unique_ptr<Programmed>> devices;
  ProgramOptions given;
  ProgramReport report;
  std::vector<ProgramProgress> progress;
  ProgramStage act_in = ProgramStage::downloading;
  bool act = false;
};

}  // namespace berth::network::test
