// SDO expedited round trips, client and server in one process and no bus between them; memory of a simulated device.
#include <fmt/format.h>
#include <malloc.h>

#include <array>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/world.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/co/sdo_server.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

/// One end of a pair of ports: a frame is with the other end at once, each call in a job of its own as a port promises.
class Pair final : public can::Port, private rt::Job {
 public:
  explicit Pair(rt::Executor& executor) noexcept : executor_(&executor) {}
  void join(Pair& other) noexcept { other_ = &other; }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (waits_) return can::Queued::full;
    frame_ = frame;
    tag_ = tag;
    waits_ = true;
    executor_->post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    if (waits_ && tag == tag_) waits_ = false;
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accepts_ = accept.empty() ? can::IdRange{1, 0} : can::IdRange{accept.front().first, accept.back().last};
  }
  [[nodiscard]] can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
  bool restart(std::uint32_t) noexcept override { return false; }

 private:
  void run() noexcept override {
    if (!waits_) return;
    waits_ = false;
    const can::Frame frame = frame_;  // an answer may be queued here before this returns
    const auto tag = tag_;
    if (other_->listener_ != nullptr && other_->accepts_.contains(frame.key())) {
      other_->listener_->received(frame, executor_->now());
    }
    if (tag != 0) listener_->sent(tag, executor_->now());
  }

  rt::Executor* executor_;
  Pair* other_ = nullptr;
  can::Listener* listener_ = nullptr;
  can::IdRange accepts_{1, 0};
  can::Frame frame_;
  std::uint32_t tag_ = 0;
  bool waits_ = false;
};

/// A client that reads one object of a server `count` times.
class Talk {
 public:
  Talk() {
    near_.join(far_);
    far_.join(near_);
    service_.start(node);
  }
  bool run(std::uint64_t count) {
    good_ = 0;
    rt::Scope scope(executor_);
    scope.spawn(read(count));
    while (scope.running() > 0 && executor_.next() == executor_.now()) executor_.advance(executor_.now());
    return good_ == count;
  }

 private:
  static constexpr NodeId node{5};
  rt::Task<void> read(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) {
      const auto value = co_await client_.read<std::uint32_t>(node, 0x1000, 0);
      if (value.has_value()) ++good_;
    }
  }

  rt::Executor executor_;
  Pair near_{executor_};
  Pair far_{executor_};
  can::Dispatcher client_side_{executor_, near_};
  can::Dispatcher server_side_{executor_, far_};
  od::Values values_{device::minimal_description()};
  co::SdoServerService service_{server_side_, values_};
  co::SdoClient client_{client_side_};
  std::uint64_t good_ = 0;
};

constexpr std::uint64_t timed_trips = 1'000'000;
constexpr unsigned counted_trips = 20'000;
constexpr double instructions_aim = 900;
constexpr double memory_aim = 6000;  // bytes, each further device
constexpr unsigned further = 100;

void add_sdo(std::vector<bench::Figure>& figures) {
  Talk talk;
  double best = 0;
  for (int round = 0; round < 3; ++round) {
    const bench::Watch watch;
    if (!talk.run(timed_trips)) std::exit(1);
    best = std::max(best, static_cast<double>(timed_trips) / watch.seconds());
  }
  figures.push_back({"SDO expedited uploads/s", bench::grouped(best) + " /s"});
  const auto none = bench::instructions({"--trips", "0"});
  const auto all = bench::instructions({"--trips", std::to_string(counted_trips)});
  const char* name = "instructions a round trip";
  if (!none || !all) {
    figures.push_back({name, bench::no_valgrind});
  } else {
    figures.push_back(bench::at_most(name, static_cast<double>(*all - *none) / counted_trips, instructions_aim, ""));
  }
}

double heap() { return static_cast<double>(::mallinfo2().uordblks); }

/// A running world of `count` devices and what it takes; the rest of the plant is forgotten.
double memory_of(unsigned count, const std::string& eds, std::unique_ptr<plant::World>& world) {
  const double before = heap();
  {
    auto plant = bench::plant_of(count, false, 500us);
    unsigned id = 1;
    for (auto& device : plant.devices) {
      device.eds = eds;
      device.eds_path = eds;
      device.source = plant::NodeIdSource::hard_coded;
      device.node_id = NodeId(static_cast<std::uint8_t>(id++));
    }
    world = bench::start(plant, 1'000'000);
  }
  world->sim().run_for(200ms);
  return heap() - before;
}

void add_memory(std::vector<bench::Figure>& figures, const std::string& name, const std::string& eds, bool has_aim) {
  std::array<std::unique_ptr<plant::World>, 3> worlds;
  const double none = memory_of(0, {}, worlds[0]);
  const double first = memory_of(1, eds, worlds[1]) - none;
  // The built-in description is made once in a process, one from a file once in a world.
  const double more = (memory_of(1 + further, eds, worlds[2]) - none - (eds.empty() ? 0 : first)) /
                      (eds.empty() ? 1 + further : further);
  figures.push_back({name + ", first device", bench::grouped(first) + " bytes"});
  if (has_aim) {
    figures.push_back(bench::at_most(name + ", each further", more, memory_aim, "bytes"));
  } else {
    figures.push_back({name + ", each further", bench::grouped(more) + " bytes"});
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 3 && std::strcmp(argv[1], "--trips") == 0) {  // under callgrind
    std::uint64_t trips = 0;
    std::from_chars(argv[2], argv[2] + std::strlen(argv[2]), trips);
    Talk talk;
    return talk.run(trips) ? 0 : 1;
  }
  std::vector<bench::Figure> figures;
  add_memory(figures, "memory, built-in description", {}, true);
  const auto folder = bench::eds_folder();
  std::string profile;
  if (!folder.empty()) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
      if (entry.path().filename() == "DS301_profile.eds") profile = entry.path().string();
    }
  }
  if (profile.empty()) {
    figures.push_back({"memory, DS301_profile.eds", "no such file; see BERTH_EDS_DIR"});
  } else {
    add_memory(figures, "memory, DS301_profile.eds", profile, false);
  }
  add_sdo(figures);
  bench::print_figures(
      "SDO without a bus; memory of a simulated device (controller, host, dictionary, services, flash)", figures);
  return 0;
}
