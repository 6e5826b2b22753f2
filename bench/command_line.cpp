// What a person at a terminal waits for and is shown: the first line of --help, and what the start of 120 slots prints
// in a pipe and on a terminal of 80x24. The start's bytes on a terminal depend on how often the table is drawn, so on
// this host's time too.
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "bench/tools/figures.hpp"
#include "tests/cli/process.hpp"

using namespace berth;

namespace {

test::Words start() {
  return {"up",      test::example("hundred-twenty.toml"),
          "--sim",   test::example("hundred-twenty.plant.toml"),
          "--until", "operational"};
}

double kilobytes(const std::string& text) { return static_cast<double>(text.size()) / 1e3; }
double lines(const std::string& text) { return static_cast<double>(std::ranges::count(text, '\n')); }

bench::Figure help() {
  constexpr int starts = 21;
  bench::Rounds rounds;
  for (int i = 0; i < starts; ++i) {
    const bench::Watch watch;
    test::Background help({"--help"});
    const bool told = help.says("\n");
    if (told) rounds.add(watch.seconds() * 1e3);
    (void)help.end();
  }
  return {"--help: first line, ms", rounds.text()};
}

}  // namespace

int main() {
  std::vector<bench::Figure> figures{help()};
  const test::Outcome piped = test::berth(start());
  test::Background seen(start(), test::OnTerminal{.columns = 80, .rows = 24});
  const test::Outcome shown = seen.end();
  if (piped.status != 0 || shown.status != 0) {
    fmt::print(stderr, "the start of 120 slots failed: {}{}\n", piped.err, shown.err);
    return 1;
  }
  figures.push_back({"start of 120 slots in a pipe: lines", bench::grouped(lines(piped.out))});
  figures.push_back({"start of 120 slots in a pipe: kB", fmt::format("{:.1f}", kilobytes(piped.out))});
  figures.push_back({"start of 120 slots, terminal 80x24: kB", fmt::format("{:.1f}", kilobytes(shown.out))});
  bench::print_figures(
      "The command line (2 MB a start on a terminal before; docs/coming-from.md's commands are "
      "counted by test_cli)",
      figures);
}
