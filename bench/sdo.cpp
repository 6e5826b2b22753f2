// SDO expedited round trips and long transfers, client and server in one process and no bus between them.
#include <fmt/format.h>
#include <malloc.h>

#include <array>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "bench/tools/figures.hpp"
#include "bench/tools/pair.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/co/sdo_server.hpp"
#include "berth/rt/scope.hpp"

using namespace berth;
using namespace std::chrono_literals;

namespace {

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
template <unsigned room>
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
  bench::Pair<room> near_{executor_};
  bench::Pair<room> far_{executor_};
  can::Dispatcher client_side_{executor_, near_};
  can::Dispatcher server_side_{executor_, far_};
  od::Values values_{description()};
  Tape tape_;
  co::SdoServerService service_{server_side_, values_, mebi};
  co::SdoClient client_{client_side_};
  std::vector<std::uint8_t> data_ = std::vector<std::uint8_t>(mebi);
  std::uint64_t good_ = 0;
};

constexpr double trips_aim = 12e6;
constexpr std::uint64_t timed_trips = 1'000'000;
constexpr int rounds = 15;
// 837 without the protections of cmake/Hardening.cmake.
constexpr bench::Counted instructions{"instructions a round trip", "--trips", 20'000, 850, 900};

void add_sdo(std::vector<bench::Figure>& figures) {
  Talk<1> talk;
  bench::Rounds measured;
  for (int round = 0; round < rounds; ++round) {
    const bench::Watch watch;
    if (!talk.run(timed_trips)) std::exit(1);
    measured.add(static_cast<double>(timed_trips) / watch.seconds());
  }
  figures.push_back(bench::at_least("SDO expedited uploads/s", measured, trips_aim, "/s"));
  figures.push_back(bench::count(instructions));
}

double heap() { return static_cast<double>(::mallinfo2().uordblks); }

struct Way {
  const char* name;
  co::SdoMode mode;
  bool upwards;
  double aim;  // MiB/s, 0 = none
  template <unsigned room>
  bool run(Talk<room>& talk) const {
    return upwards ? talk.upload(mode) : talk.download(mode);
  }
};
constexpr Way ways[] = {
    {"segmented download of 1 MiB", co::SdoMode::segmented, false, 150},
    {"segmented upload of 1 MiB", co::SdoMode::segmented, true, 0},
    {"block download of 1 MiB", co::SdoMode::block, false, 200},
    {"block upload of 1 MiB", co::SdoMode::block, true, 200},
};

void add_transfers(std::vector<bench::Figure>& figures) {
  constexpr std::size_t long_domain = 100'000'000;
  Talk<1> talk;
  Talk<16> wide;  // a sub-block wants a queue
  for (const Way& way : ways) {
    bench::Rounds measured;
    for (int round = 0; round < rounds; ++round) {
      const bench::Watch watch;
      const bool block = way.mode == co::SdoMode::block;
      if (!(block ? way.run(wide) : way.run(talk))) std::exit(1);
      measured.add(1 / watch.seconds());
    }
    if (way.aim > 0) {
      figures.push_back(bench::at_least(way.name, measured, way.aim, "MiB/s"));
    } else {
      figures.push_back({way.name, measured.text() + " MiB/s"});
    }
  }
  double behind = 0;
  for (const bool upwards : {false, true}) {
    const double before = heap();
    const bench::Watch watch;
    if (!wide.stream(co::SdoMode::block, upwards, long_domain)) std::exit(1);
    behind += heap() - before;
    figures.push_back({upwards ? "block upload of a DOMAIN of 100 MB, streamed" : "block download, the same",
                       bench::grouped(static_cast<double>(long_domain) / mebi / watch.seconds()) + " MiB/s"});
  }
  figures.push_back({"heap that stays behind", bench::grouped(behind) + " bytes"});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--ceiling") == 0) return bench::holds(instructions) ? 0 : 1;
  if (argc == 3 && std::strcmp(argv[1], "--trips") == 0) {  // under callgrind
    std::uint64_t trips = 0;
    std::from_chars(argv[2], argv[2] + std::strlen(argv[2]), trips);
    Talk<1> talk;
    return talk.run(trips) ? 0 : 1;
  }
  if (argc == 4 && std::strcmp(argv[1], "--transfers") == 0) {  // under callgrind: how many of which way
    const Way& way = ways[std::strtoul(argv[3], nullptr, 10) % std::size(ways)];
    Talk<16> talk;
    for (auto left = std::strtoul(argv[2], nullptr, 10); left > 0; --left) {
      if (!way.run(talk)) return 1;
    }
    return 0;
  }
  std::vector<bench::Figure> figures;
  add_sdo(figures);
  add_transfers(figures);
  bench::print_figures(
      "SDO without a bus; one receive entry each, a dictionary of 3 objects, the client's time-out (a timer); median "
      "(minimum to maximum) of 15",
      figures);
  return 0;
}
