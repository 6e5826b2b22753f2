// SDO expedited round trips and long transfers, client and server in one process and no bus between them; memory of a
// simulated device.
#include <fmt/format.h>
#include <malloc.h>

#include <array>
#include <charconv>
#include <cstdio>
#include <cstdlib>
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

/// One end of a pair of ports: a frame is with the other end at once, each frame in a job of its own as a port
/// promises.
class Pair final : public can::Port, private rt::Job {
 public:
  explicit Pair(rt::Executor& executor) noexcept : executor_(&executor) {}
  void join(Pair& other) noexcept { other_ = &other; }

  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override {
    if (count_ == room) return can::Queued::full;
    Waiting& waiting = queue_[(first_ + count_++) % room];
    waiting.frame = frame;
    waiting.tag = tag;
    executor_->post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    for (unsigned i = 0; i < count_; ++i) {
      Waiting& waiting = queue_[(first_ + i) % room];
      if (waiting.tag == tag) waiting.tag = gone;
    }
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    accepts_ = accept.empty() ? can::IdRange{1, 0} : can::IdRange{accept.front().first, accept.back().last};
  }
  [[nodiscard]] can::Status status() const noexcept override { return {.up = true, .knows_sent = true}; }
  bool restart(std::uint32_t) noexcept override { return false; }

 private:
  static constexpr std::uint32_t gone = 0xFFFF'FFFFU;
  static constexpr unsigned room = 16;
  struct Waiting {
    can::Frame frame;
    std::uint32_t tag = 0;
  };
  void run() noexcept override {
    const Waiting& waiting = queue_[first_];  // stays in its place: it counts until it is dealt with
    const auto tag = waiting.tag;
    if (tag != gone && other_->listener_ != nullptr && other_->accepts_.contains(waiting.frame.key())) {
      other_->listener_->received(waiting.frame, executor_->now());
    }
    first_ = (first_ + 1) % room;
    if (--count_ > 0) executor_->post(*this);
    if (tag != 0 && tag != gone) listener_->sent(tag, executor_->now());
  }

  rt::Executor* executor_;
  Pair* other_ = nullptr;
  can::Listener* listener_ = nullptr;
  can::IdRange accepts_{1, 0};
  std::array<Waiting, room> queue_;
  unsigned first_ = 0;
  unsigned count_ = 0;
};

/// A DOMAIN that is made as it is read and forgotten as it is written.
class Tape final : public od::Stream {
 public:
  od::Answer<std::optional<std::size_t>> open_read(ObjectRef) noexcept override {
    left_ = length;
    return std::optional(length);
  }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    const auto count = std::min(into.size(), left_);
    std::memset(into.data(), static_cast<int>(left_), count);
    left_ -= count;
    return count;
  }
  od::AbortCode open_write(ObjectRef, std::optional<std::size_t>) noexcept override {
    length = 0;
    return od::AbortCode::none;
  }
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    length += bytes.size();
    return od::AbortCode::none;
  }
  std::size_t length = 0;

 private:
  std::size_t left_ = 0;
};

class Source final : public co::SdoSource {
 public:
  explicit Source(std::size_t length) : left_(length), length_(length) {}
  std::optional<std::size_t> size() const noexcept override { return length_; }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    const auto count = std::min(into.size(), left_);
    std::memset(into.data(), static_cast<int>(left_), count);
    left_ -= count;
    return count;
  }

 private:
  std::size_t left_;
  std::size_t length_;
};

class Sink final : public co::SdoSink {
 public:
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    length += bytes.size();
    return od::AbortCode::none;
  }
  std::size_t length = 0;
};

constexpr std::size_t mebi = std::size_t{1} << 20U;
constexpr std::uint16_t domain = 0x2000, tape = 0x2001;

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = od::Access::ro});
  b.variable(domain, {.name = "domain", .type = od::DataType::domain, .capacity = mebi});
  b.variable(tape, {.name = "tape", .type = od::DataType::domain, .capacity = 1});
  return b.build();
}

/// A client and a server of an object each way.
class Talk {
 public:
  Talk() {
    near_.join(far_);
    far_.join(near_);
    service_.start(node);
    values_.attach(tape_, {tape, 0});
    for (std::size_t i = 0; i < data_.size(); ++i) data_[i] = static_cast<std::uint8_t>(i * 37);
    values_.set_bytes({domain, 0}, data_);
  }
  bool run(std::uint64_t count) {
    good_ = 0;
    rt::Scope scope(executor_);
    scope.spawn(read(count));
    return finish(scope) && good_ == count;
  }
  bool download(co::SdoMode mode) {
    good_ = 0;
    rt::Scope scope(executor_);
    scope.spawn(down(mode));
    return finish(scope) && good_ == 1;
  }
  bool upload(co::SdoMode mode) {
    good_ = 0;
    rt::Scope scope(executor_);
    scope.spawn(up(mode));
    return finish(scope) && good_ == 1;
  }
  bool stream(co::SdoMode mode, bool upwards, std::size_t length) {
    good_ = 0;
    rt::Scope scope(executor_);
    scope.spawn(upwards ? stream_up(mode, length) : stream_down(mode, length));
    return finish(scope) && good_ == 1;
  }

 private:
  static constexpr NodeId node{5};
  bool finish(rt::Scope& scope) {
    while (scope.running() > 0 && executor_.next() == executor_.now()) executor_.advance(executor_.now());
    return scope.running() == 0;
  }
  static co::SdoOptions options(co::SdoMode mode) {
    co::SdoOptions options;
    options.mode = mode;
    return options;
  }
  rt::Task<void> read(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) {
      const auto value = co_await client_.read<std::uint32_t>(node, 0x1000, 0);
      if (value.has_value()) ++good_;
    }
  }
  rt::Task<void> down(co::SdoMode mode) {
    const auto how = options(mode);
    const std::span<const std::uint8_t> data(data_);
    const auto done = co_await client_.download(node, domain, 0, data, how);
    if (done.has_value()) ++good_;
  }
  rt::Task<void> up(co::SdoMode mode) {
    const auto how = options(mode);
    const auto value = co_await client_.upload(node, domain, 0, how);
    if (value.has_value() && value->size() == mebi) ++good_;
  }
  rt::Task<void> stream_down(co::SdoMode mode, std::size_t length) {
    const auto how = options(mode);
    Source source(length);
    const auto done = co_await client_.download(node, tape, 0, source, how);
    if (done.has_value() && tape_.length == length) ++good_;
  }
  rt::Task<void> stream_up(co::SdoMode mode, std::size_t length) {
    const auto how = options(mode);
    Sink sink;
    tape_.length = length;
    const auto done = co_await client_.upload(node, tape, 0, sink, how);
    if (done.has_value() && sink.length == length) ++good_;
  }

  rt::Executor executor_;
  Pair near_{executor_};
  Pair far_{executor_};
  can::Dispatcher client_side_{executor_, near_};
  can::Dispatcher server_side_{executor_, far_};
  od::Values values_{description()};
  Tape tape_;
  co::SdoServerService service_{server_side_, values_, mebi};
  co::SdoClient client_{client_side_};
  std::vector<std::uint8_t> data_ = std::vector<std::uint8_t>(mebi);
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

struct Way {
  const char* name;
  co::SdoMode mode;
  bool upwards;
  double aim;  // MiB/s, 0 = none
};
constexpr Way ways[] = {
    {"segmented download of 1 MiB", co::SdoMode::segmented, false, 150},
    {"segmented upload of 1 MiB", co::SdoMode::segmented, true, 0},
    {"block download of 1 MiB", co::SdoMode::block, false, 200},
    {"block upload of 1 MiB", co::SdoMode::block, true, 200},
};

void add_transfers(std::vector<bench::Figure>& figures) {
  constexpr int rounds = 15;
  constexpr std::size_t long_domain = 100'000'000;
  Talk talk;
  for (const Way& way : ways) {
    double best = 0;
    for (int round = 0; round < rounds; ++round) {
      const bench::Watch watch;
      if (!(way.upwards ? talk.upload(way.mode) : talk.download(way.mode))) std::exit(1);
      best = std::max(best, 1 / watch.seconds());
    }
    if (way.aim > 0) {
      figures.push_back(bench::at_least(way.name, best, way.aim, "MiB/s"));
    } else {
      figures.push_back({way.name, bench::grouped(best) + " MiB/s"});
    }
  }
  const double before = heap();
  for (const bool upwards : {false, true}) {
    const bench::Watch watch;
    if (!talk.stream(co::SdoMode::block, upwards, long_domain)) std::exit(1);
    figures.push_back({upwards ? "block upload of a DOMAIN of 100 MB, streamed" : "block download, the same",
                       bench::grouped(static_cast<double>(long_domain) / mebi / watch.seconds()) + " MiB/s"});
  }
  figures.push_back({"heap that stays behind", bench::grouped(heap() - before) + " bytes"});
}

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
  if (argc == 4 && std::strcmp(argv[1], "--transfers") == 0) {  // under callgrind: how many of which way
    const Way& way = ways[std::strtoul(argv[3], nullptr, 10) % std::size(ways)];
    Talk talk;
    for (auto left = std::strtoul(argv[2], nullptr, 10); left > 0; --left) {
      if (!(way.upwards ? talk.upload(way.mode) : talk.download(way.mode))) return 1;
    }
    return 0;
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
  add_transfers(figures);
  bench::print_figures(
      "SDO without a bus; memory of a simulated device (controller, host, dictionary, services, flash)", figures);
  return 0;
}
