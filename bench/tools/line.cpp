#include "bench/tools/line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <cstring>

namespace berth::bench {
namespace {

using namespace std::chrono_literals;

std::string machine_text(unsigned slots) {
  return fmt::format(
      "[machine]\nname = \"line-3\"\n[bus.field]\nport = \"sim\"\nbitrate = 500_000\n[[slot]]\nbus = \"field\"\n"
      "ids = \"1..{}\"\nname = \"sensor {{id}}\"\neds = \"eds/sensor.eds\"\npublish = [\"Position value\"]\n",
      slots);
}

std::string plant_text(unsigned slots) {
  std::string serials;
  for (unsigned i = 1; i <= slots; ++i) serials += fmt::format("{}{}", i == 1 ? "" : ", ", i);
  return fmt::format(
      "[plant]\nseed = 3\n[bus.field]\n[[device]]\nbus = \"field\"\nname = \"s{{n}}\"\neds = \"eds/sensor.eds\"\n"
      "serials = [{}]\n",
      serials);
}

}  // namespace

sparkplug::Now WorldClock::now() const noexcept {
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(executor_->now().time_since_epoch());
  return {.utc = {1'767'225'600'000 + static_cast<std::uint64_t>(ms.count())}, .steady = ms};
}

Line::Line(unsigned slots) : slots_(slots) {
  const std::string folder = std::string(BERTH_SOURCE_DIR) + "/examples/";
  auto machine = design::read_machine(machine_text(slots), folder + "fleet.toml", design::eds_loader());
  auto plant = plant::read_plant(plant_text(slots), folder + "fleet.plant.toml");
  if (!machine.machine || !plant.plant) std::abort();
  machine_ = std::move(*machine.machine);
  Findings findings;
  const std::vector<plant::BusRate> rates{{"field", 500'000}};
  world_ = plant::World::make(*plant.plant, rates, findings);
  port_ = world_->attach_master("field");
  world_->start();
  session_ = std::make_unique<tree::Session>(world_->executor(), machine_, store_);
  if (!session_->connect("field", *port_) || !session_->open()) std::abort();
  clock_ = std::make_unique<WorldClock>(world_->executor());
  signals_ = fleet::plan_signals(machine_, nullptr).signals;
  table_ = std::make_unique<fleet::SignalTable>(signals_, 1);
  reporter_ = std::make_unique<fleet::Reporter>(*session_, signals_, *table_, link_, *clock_,
                                                fleet::Reporter::Options{.version = "bench"}, [] {});
  session_->on_event([this](const operate::Event&) { reporter_->event(); });
  world_->bus("field")->add_tap(*this);
  session_->start();
}

Line::~Line() {
  world_->bus("field")->remove_tap(*this);
  session_->on_event({});
  reporter_.reset();
  session_.reset();
}

void Line::set_positions(std::uint32_t value) {
  for (unsigned i = 1; i <= slots_; ++i) {
    auto& firmware = world_->find(fmt::format("s{}", i))->device();
    std::array<std::uint8_t, 4> bytes{};
    std::memcpy(bytes.data(), &value, sizeof value);
    static_cast<void>(firmware.values().set_bytes({0x6004, 0}, bytes));
    firmware.services().changed(ObjectRef{0x6004, 0});
  }
}

FirstWords first_words(unsigned slots) {
  std::vector<fleet::News> words;
  Line line(slots);
  const auto take = [&] {
    while (auto news = line.take()) {
      using Kind = fleet::News::Kind;
      const auto told = std::ranges::find(words, news->device, &fleet::News::device);
      if (news->kind == Kind::node || news->kind == Kind::born) {
        if (told != words.end()) words.erase(told);
        words.push_back(std::move(*news));
        continue;
      }
      // What has changed since is in the births of a machine that begins now.
      if (told == words.end()) continue;
      if (news->kind == Kind::died) {
        words.erase(told);
        continue;
      }
      const auto metric = std::ranges::find(told->metrics, news->metric, &sparkplug::OwnMetric::name);
      if (metric == told->metrics.end()) continue;
      metric->value = news->value;
      metric->at = news->at;
      metric->quality = news->quality;
    }
  };
  for (int i = 0; i < 300; ++i) {
    line.run(100ms);
    take();
  }
  line.set_positions(1);
  for (int i = 0; i < 20; ++i) {
    line.run(100ms);
    take();
  }
  if (!line.operational() || words.size() != slots + 1) std::abort();
  return {line.machine(), std::move(words)};
}

}  // namespace berth::bench
