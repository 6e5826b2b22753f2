// One TPDO of two UNSIGNED32: sent by one device, received and stored by another, in one process and no bus between.
#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <cstring>

#include "bench/tools/figures.hpp"
#include "bench/tools/pair.hpp"
#include "berth/co/pdo.hpp"

using namespace berth;

namespace {

struct Owner final : co::ServiceOwner {
  void raise_error(std::uint16_t, std::uint8_t, const std::array<std::uint8_t, 5>&) noexcept override { std::abort(); }
  void clear_error(std::uint16_t) noexcept override {}
};

constexpr std::uint32_t entry(std::uint8_t sub) { return co::PdoEntry{{0x2000, sub}, 32}.raw(); }

std::shared_ptr<const od::Description> description(std::uint16_t communication) {
  od::DescriptionBuilder b;
  b.object(0x2000, od::ObjectCode::array, "Application object");
  for (std::uint8_t sub = 1; sub <= 2; ++sub) b.sub(0x2000, {.sub = sub, .name = "x", .mappable = true});
  b.object(communication, od::ObjectCode::record, "PDO communication");
  b.sub(communication, {.sub = 1, .name = "COB-ID", .initial = od::Literal::number(0x40000185)});
  b.sub(communication,
        {.sub = 2, .name = "type", .type = od::DataType::unsigned8, .initial = od::Literal::number(0xFF)});
  const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
  b.object(mapping, od::ObjectCode::record, "PDO mapping");
  b.sub(mapping, {.sub = 0, .name = "count", .type = od::DataType::unsigned8, .initial = od::Literal::number(2)});
  for (std::uint8_t sub = 1; sub <= 2; ++sub) {
    b.sub(mapping, {.sub = sub, .name = "entry", .initial = od::Literal::number(entry(sub))});
  }
  return b.build();
}

struct Side {
  Side(rt::Executor& executor, std::uint16_t communication)
      : port(executor), dispatcher(executor, port), values(description(communication)) {}
  bench::Pair<> port;
  can::Dispatcher dispatcher;
  od::Values values;
  Owner owner;
  co::Pdos pdos{dispatcher, values, owner};
};

/// A producer and a consumer; `run` sends `count` PDOs.
class Line {
 public:
  Line() {
    near_.port.join(far_.port);
    far_.port.join(near_.port);
    near_.pdos.start(NodeId(5));
    far_.pdos.start(NodeId(6));
    executor_.advance(executor_.now());
    value_ = near_.values.scalar(*near_.values.description().find(ObjectRef{0x2000, 1}));
  }
  bool run(std::uint64_t count) {
    std::uint32_t i = 0;
    for (; i < count; ++i) {
      std::memcpy(value_, &i, sizeof i);
      if (!near_.pdos.event(1)) return false;
      executor_.advance(executor_.now());
    }
    return count == 0 || far_.values.get<std::uint32_t>({0x2000, 1}) == i - 1;
  }

 private:
  rt::Executor executor_;
  Side near_{executor_, 0x1800};
  Side far_{executor_, 0x1400};
  std::uint8_t* value_ = nullptr;
};

constexpr std::uint64_t timed = 1'000'000;
constexpr int rounds = 15;
constexpr double speed_aim = 25e6;
// 295 without the protections of cmake/Hardening.cmake.
constexpr bench::Counted instructions{"instructions each", "--pdos", 50'000, 310, 320};

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::strcmp(argv[1], "--ceiling") == 0) return bench::holds(instructions) ? 0 : 1;
  Line line;
  if (argc == 3 && std::strcmp(argv[1], "--pdos") == 0) {  // under callgrind
    std::uint64_t pdos = 0;
    std::from_chars(argv[2], argv[2] + std::strlen(argv[2]), pdos);
    return line.run(pdos) ? 0 : 1;
  }
  std::vector<bench::Figure> figures;
  bench::Rounds measured;
  for (int round = 0; round < rounds; ++round) {
    const bench::Watch watch;
    if (!line.run(timed)) return 1;
    measured.add(static_cast<double>(timed) / watch.seconds());
  }
  figures.push_back(bench::at_least("PDOs sent, received and stored", measured, speed_aim, "/s"));
  figures.push_back(bench::count(instructions));
  bench::print_figures(
      "PDO without a bus; one receive entry, one TPDO and one RPDO each, no time-outs; median (minimum to maximum) of "
      "15",
      figures);
  return 0;
}
