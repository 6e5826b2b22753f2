// Worst-case response times: how close what the simulated bus shows comes to the bound, by priority, on 300 random
// machines; beside it what one has without an analysis: a message is there within its period and jitter, if it is ever.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "bench/tools/figures.hpp"
#include "tests/analysis/observed.hpp"

using namespace berth;
using namespace berth::analysis;

namespace {

constexpr int machines = 300;
constexpr std::size_t bands = 4;

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[values.size() / 2];
}

double by_period(const Message& message, rt::Duration latest) {
  return static_cast<double>(latest.count()) / static_cast<double>((message.period + message.jitter).count());
}

}  // namespace

int main() {
  Random random(20261123);
  std::array<std::vector<double>, bands> of_bound;
  std::array<std::vector<double>, bands> of_period;
  std::size_t messages = 0;
  std::size_t late = 0;
  for (int n = 0; n < machines; ++n) {
    const auto machine = observed::random_machine(random);
    const auto seen = observed::by_priority(machine, random);
    std::vector<Message> sorted = machine.line.messages;
    std::ranges::sort(sorted, [](const Message& a, const Message& b) { return precedes(a.key, b.key); });
    for (std::size_t rank = 0; rank < seen.size(); ++rank) {
      const std::size_t band = rank * bands / seen.size();
      if (!seen[rank].bound) continue;
      ++messages;
      late += seen[rank].latest > *seen[rank].bound ? 1U : 0U;
      of_bound[band].push_back(static_cast<double>(seen[rank].latest.count()) /
                               static_cast<double>(seen[rank].bound->count()));
      of_period[band].push_back(by_period(sorted[rank], seen[rank].latest));
    }
  }
  std::vector<std::vector<std::string>> rows;
  constexpr std::array<const char*, bands> names{"highest quarter", "second", "third", "lowest quarter"};
  for (std::size_t band = 0; band < bands; ++band) {
    rows.push_back({names[band], fmt::format("{:.2f}", median(of_bound[band])),
                    fmt::format("{:.2f}", *std::ranges::max_element(of_bound[band])),
                    fmt::format("{:.2f}", median(of_period[band]))});
  }
  bench::print_columns("observed maximum over bound, by priority, on random machines",
                       {"priority", "median", "most", "median of period and jitter"}, rows);
  const std::vector<bench::Figure> figures{
      {"machines", bench::grouped(machines)},
      {"messages with a bound", bench::grouped(static_cast<double>(messages))},
      {"later than their bound", bench::grouped(static_cast<double>(late)), "0", late == 0}};
  bench::print_figures("analysis", figures);
  return late == 0 ? 0 : 1;
}
