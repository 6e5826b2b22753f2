#include "berth/study/negotiation_load.hpp"

#include <algorithm>
#include <array>
#include <deque>
#include <set>
#include <utility>

#include "berth/can/length.hpp"
#include "berth/plant/world.hpp"
#include "berth/research/negotiation_frames.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;

constexpr rt::Duration quiet = 200ms;  // the devices boot: only the PDO is sent
constexpr rt::Duration pdo_period = 10ms;
constexpr rt::Duration window = 100ms;  // for the peak load
constexpr std::uint32_t pdo_id = 0x1FF;

rt::Duration length(const can::Frame& frame, std::uint32_t bit_rate, unsigned without = 0) {
  return rt::Duration((can::exact_bits(frame) - without) * std::int64_t{1'000'000'000} / bit_rate);
}

/// Adds up the negotiation's frames on the bus.
class Meter final : public can::Tap {
 public:
  Meter(LoadRow& row, std::uint32_t bit_rate) : row_(&row), bit_rate_(bit_rate) {}
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    const auto message = research::decode_negotiation(frame);
    if (!message) {
      run_began_ = rt::never;
      return;
    }
    const auto begin = at - length(frame, bit_rate_, 3);  // a tap sees the frame before its intermission
    const auto free = begin + length(frame, bit_rate_);
    const auto bit = rt::Duration(1'000'000'000 / bit_rate_);
    if (run_began_ == rt::never || begin - free_at_ > bit) run_began_ = begin;
    free_at_ = free;
    row_->longest_run = std::max(row_->longest_run, free - run_began_);
    ++row_->frames;
    row_->bits += can::exact_bits(frame);
    if (first_ == rt::never) first_ = begin;
    if (message->kind == research::NegotiationMessage::Kind::used) row_->settled = at - first_;
    recent_.emplace_back(at, can::exact_bits(frame));
    sum_ += recent_.back().second;
    while (recent_.front().first + window <= at) {
      sum_ -= recent_.front().second;
      recent_.pop_front();
    }
    row_->peak_load = std::max(row_->peak_load, static_cast<double>(sum_) * 10.0 / bit_rate_);
  }

 private:
  LoadRow* row_;
  std::uint32_t bit_rate_;
  std::deque<std::pair<rt::Time, unsigned>> recent_;
  unsigned sum_ = 0;
  rt::Time first_ = rt::never;
  rt::Time free_at_{};
  rt::Time run_began_ = rt::never;
};

/// A node with a PDO.
class Sender final : private rt::Job, private can::Confirmation {
 public:
  Sender(can::Port& port, rt::Executor& executor, std::uint32_t bit_rate)
      : executor_(&executor), dispatcher_(executor, port), bit_rate_(bit_rate) {
    executor.after(1ms, *this);
  }
  rt::Duration waited{0};

 private:
  void run() noexcept override {
    executor_->after(pdo_period, *this);
    if (pending()) return;
    queued_at_ = executor_->now();
    dispatcher_.send(frame_, *this);
  }
  void sent(rt::Time at) noexcept override {
    waited = std::max(waited, at - queued_at_ - length(frame_, bit_rate_, 3));
  }
  rt::Executor* executor_;
  can::Dispatcher dispatcher_;
  can::Frame frame_ = can::Frame::base(pdo_id, {0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC, 0xDE, 0xF0});
  std::uint32_t bit_rate_;
  rt::Time queued_at_{};
};

plant::PlantFile blank_devices(unsigned devices, std::uint32_t bit_rate, std::uint64_t seed) {
  plant::PlantFile file;
  file.seed = seed;
  file.buses.push_back({"bus", bit_rate});
  for (unsigned i = 0; i < devices; ++i) {
    plant::PlantDevice d;
    d.name = "device " + std::to_string(i + 1);
    d.bus = "bus";
    d.address = {0x319, 0x0B01, 0x0002'0000, 0x4000 + i};
    d.speaks = {plant::Speaks::negotiation};
    d.boot = quiet;
    d.response = {.min = 200us, .max = 700us};
    file.devices.push_back(d);
  }
  return file;
}

unsigned with_own_id(const plant::World& world) {
  std::set<NodeId> ids;
  for (const auto& device : world.devices()) {
    if (device->device().node_id().configured()) ids.insert(device->device().node_id());
  }
  return static_cast<unsigned>(ids.size());
}

}  // namespace

LoadRow negotiation_load(unsigned devices, std::uint32_t bit_rate, std::uint64_t seed) {
  LoadRow row{.devices = devices, .bit_rate = bit_rate};
  Findings findings;
  const auto world = plant::World::make(blank_devices(devices, bit_rate, seed), {}, findings);
  if (!world) return row;
  auto port = world->attach_master("bus");
  Meter meter(row, bit_rate);
  auto& bus = *world->sim().find_bus("bus");
  bus.add_tap(meter);
  {
    Sender sender(*port, world->executor(), bit_rate);
    world->start();
    world->sim().run_for(quiet);
    row.pdo_undisturbed = std::exchange(sender.waited, rt::Duration::zero());
    const auto limit = world->sim().now() + devices * 1s + 10s;
    while (row.with_id < devices && world->sim().now() < limit) {
      world->sim().run_for(20ms);
      row.with_id = with_own_id(*world);
    }
    row.pdo_waited = sender.waited;
  }
  bus.remove_tap(meter);
  row.complete = row.with_id == devices;
  const double seconds = std::chrono::duration<double>(row.settled).count();
  if (seconds > 0) row.mean_load = static_cast<double>(row.bits) / (seconds * bit_rate);
  return row;
}

std::vector<LoadRow> negotiation_load(std::uint64_t seed) {
  std::vector<LoadRow> rows;
  for (const unsigned devices : {2U, 10U, 30U, 127U}) {
    for (const std::uint32_t bit_rate : {50'000U, 125'000U, 500'000U}) {
      rows.push_back(negotiation_load(devices, bit_rate, seed));
    }
  }
  return rows;
}

}  // namespace berth::study
