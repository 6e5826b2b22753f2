// The object linker on a machine of the coal conveyor's size (paper 5, fig. 1): 11 controllers, 44 modules, 280 network
// variables, 533 links. How long a plan and its files take, and what packing saves against one PDO for each object.
#include <fmt/format.h>

#include <vector>

#include "bench/tools/figures.hpp"
#include "berth/linker/files.hpp"
#include "tests/linker/devices.hpp"

using namespace berth;

int main() {
  const auto network = test::conveyor();
  constexpr int rounds = 11;
  bench::Rounds plans;
  bench::Rounds changes;
  bench::Rounds files;
  linker::Planned planned;
  std::size_t bytes = 0;
  for (int i = 0; i < rounds; ++i) {
    const bench::Watch plan;
    planned = linker::make_plan(network);
    plans.add(plan.seconds() * 1e3);
    const auto earlier = linker::earlier_of(network, planned.plan);
    const bench::Watch change;
    const auto again = linker::make_plan(network, earlier);
    changes.add(change.seconds() * 1e3);
    const bench::Watch write;
    const auto made = linker::make_files(network, planned.plan);
    files.add(write.seconds() * 1e3);
    if (!planned.good() || !made || !(again.plan == planned.plan)) {
      fmt::print(stderr, "the conveyor could not be linked\n");
      return 1;
    }
    bytes = 0;
    for (const auto& each : *made) bytes += each.bytes.size();
  }
  const auto& load = planned.plan.buses.front();
  const std::vector<bench::Figure> figures{
      {"links", bench::grouped(static_cast<double>(network.links.size()))},
      {"network variables", bench::grouped(static_cast<double>(planned.plan.variables.size()))},
      {"plan, ms", plans.text(), "100", plans.median() <= 100},
      {"plan that goes on from an earlier one, ms", changes.text()},
      {"all files, ms", files.text()},
      {"all files, kB", bench::grouped(static_cast<double>(bytes) / 1e3)},
      {"objects sent (PDOs, were each its own)", bench::grouped(static_cast<double>(load.objects))},
      {"PDOs", bench::grouped(static_cast<double>(planned.plan.pdos.size()))},
      {"bus load by these PDOs at most, %", fmt::format("{:.1f}", 100 * load.pdos)},
      {"with one PDO for each object, %", fmt::format("{:.1f}", 100 * load.one_object_each)},
      {"everything on the bus at most, %", fmt::format("{:.1f}", 100 * load.load)}};
  bench::print_figures("Object linker: 11 controllers, 44 modules, 500 kbit/s", figures);
}
