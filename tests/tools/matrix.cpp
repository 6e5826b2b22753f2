// ./run matrix [--kind K] [--devices N] [--bitrate KBIT] [--latency L] [--limit SECONDS] [--rx-depth N] [--show]
// [--frames] [--ratio]: the main job at every size, with every kind of device and at every bit rate, from blank devices
// to operational. Prints the bus times as a table, and how many frames Berth sends at rest; exit 1 when a cell that
// docs/limits.md does not except is not operational within its bus time, or Berth sends more than 5 frames a second.
// --ratio: and the default's time over that of the best published method; exit 1 when it is more than 1.1 anywhere.
#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "tests/harness/matrix_run.hpp"

using namespace berth;
using namespace berth::harness::matrix;

namespace {

template <class Names>
int place_of(const Names& names, const char* wanted) {
  const auto it = std::ranges::find(names, std::string_view(wanted));
  return it == names.end() ? -1 : static_cast<int>(it - names.begin());
}

bool read_options(Choice& o, int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view option = argv[i];
    if (option == "--ratio") {
      o.ratio = true;
      continue;
    }
    if (option == "--show" || option == "--frames") {
      o.show = true;
      o.frames = o.frames || option == "--frames";
      continue;
    }
    if (i + 1 == argc) return false;
    const char* const value = argv[++i];
    const auto number = std::strtoul(value, nullptr, 0);
    if (option == "--kind") {
      const int kind = place_of(kind_names, value);
      if (kind < 0) return false;
      o.kind = static_cast<Kind>(kind);
    } else if (option == "--latency") {
      const int latency = place_of(latency_names, value);
      if (latency < 0) return false;
      o.latency = static_cast<Latency>(latency);
    } else if (option == "--devices") {
      o.devices = static_cast<unsigned>(number);
    } else if (option == "--bitrate") {
      o.bit_rate = static_cast<std::uint32_t>(number < 10'000 ? number * 1000 : number);
    } else if (option == "--limit") {
      o.limit = std::chrono::seconds(number);
    } else if (option == "--rx-depth") {
      o.rx_depth = std::max(1U, static_cast<unsigned>(number));
    } else if (option == "--workers") {
      o.workers = std::max(1U, static_cast<unsigned>(number));
    } else {
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  Choice o;
  const bool read = read_options(o, argc, argv);
  const auto cells = cells_of(o);
  if (!read || cells.empty()) {
    std::fprintf(
        stderr,
        "usage: matrix [--kind K] [--devices N] [--bitrate KBIT] [--latency L] [--limit SECONDS] [--rx-depth N] "
        "[--workers N] [--show] [--frames] [--ratio]\nkinds:");
    for (const auto* kind : kind_names) std::fprintf(stderr, " %s", kind);
    std::fprintf(stderr, "\nlatencies:");
    for (const auto* latency : latency_names) std::fprintf(stderr, " %s", latency);
    std::fprintf(stderr, "\ndevices: one of 1 2 5 30 60 120 126; kbit/s: one of 10 50 125 500 1000\n");
    return 2;
  }
  const auto all = run_all(o, cells);
  print_table(cells, all);
  print_rest(cells, all);
  bool good = print_sum(cells, all);
  if (o.ratio) good = print_ratios(cells, ratios(o, cells, all)) && good;
  return good ? 0 : 1;
}
