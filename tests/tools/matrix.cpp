// ./run matrix [--kind K] [--devices N] [--bitrate KBIT] [--latency L] [--limit SECONDS] [--show]: the main job at
// every size, with every kind of device and at every bit rate, from blank devices to operational. Prints the bus times
// as a table; exit 1 when a cell that docs/limits.md does not except is not operational within its bus time.
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "tests/harness/matrix.hpp"

using namespace berth;
using namespace berth::harness::matrix;

namespace {

struct Options {
  std::optional<Kind> kind;
  std::optional<unsigned> devices;
  std::optional<std::uint32_t> bit_rate;
  std::optional<Latency> latency;
  std::optional<rt::Duration> limit;
  unsigned workers = 2;
  bool show = false;
};

struct Done {
  std::size_t cell = 0;
  double wall = 0;
  Outcome outcome;
};

std::vector<Cell> cells_of(const Options& o) {
  std::vector<Cell> cells;
  for (int k = 0; k < static_cast<int>(Kind::count); ++k) {
    for (const auto n : sizes) {
      for (const auto rate : bit_rates) {
        for (int l = 0; l < static_cast<int>(Latency::count); ++l) {
          const Cell cell{static_cast<Kind>(k), n, rate, static_cast<Latency>(l)};
          const bool chosen = (!o.kind || *o.kind == cell.kind) && (!o.devices || *o.devices == n) &&
                              (!o.bit_rate || *o.bit_rate == rate) && (!o.latency || *o.latency == cell.latency);
          if (chosen) cells.push_back(cell);
        }
      }
    }
  }
  return cells;
}

rt::Duration limit_of(const Options& o, const Cell&) { return o.limit.value_or(rt::Duration(10min)); }

Done run_one(const Options& o, const std::vector<Cell>& cells, std::size_t i) {
  const auto began = std::chrono::steady_clock::now();
  Done done;
  done.cell = i;
  done.outcome = run(cells[i], limit_of(o, cells[i]), o.show);
  done.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return done;
}

// Each worker is a process and takes every n-th cell; what it found comes back through one pipe, a record at a time
// (smaller than PIPE_BUF, so that records of two do not mix).
std::vector<Done> run_all(const Options& o, const std::vector<Cell>& cells) {
  static_assert(sizeof(Done) <= 512);
  int ends[2];
  if (pipe(ends) != 0) std::abort();
  std::fflush(stdout);
  for (unsigned w = 0; w < o.workers; ++w) {
    if (fork() != 0) continue;
    close(ends[0]);
    bool written = true;
    for (std::size_t i = w; i < cells.size(); i += o.workers) {
      const Done done = run_one(o, cells, i);
      std::fflush(stdout);
      written = written && write(ends[1], &done, sizeof done) == static_cast<ssize_t>(sizeof done);
    }
    _exit(written ? 0 : 3);
  }
  close(ends[1]);
  std::vector<Done> all(cells.size());
  std::vector<bool> came(cells.size());
  Done done;
  while (read(ends[0], &done, sizeof done) == static_cast<ssize_t>(sizeof done)) {
    all[done.cell] = done;
    came[done.cell] = true;
    if (done.outcome.end == End::operational) continue;
    std::printf("%s: %s at %.1f s, %u operational (%.1f s of wall time): %s\n", describe(cells[done.cell]).c_str(),
                name(done.outcome.end), operate::seconds(rt::Time{} + done.outcome.bus_time), done.outcome.operational,
                done.wall, done.outcome.why.data());
    std::fflush(stdout);
  }
  while (wait(nullptr) > 0) {
  }
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (came[i]) continue;
    all[i].outcome.end = End::wrong;
    std::printf("%s: its worker died\n", describe(cells[i]).c_str());
  }
  return all;
}

std::string time_text(const Outcome& outcome) {
  if (outcome.end != End::operational) return "-";
  const double time = operate::seconds(rt::Time{} + outcome.bus_time);
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "%.*f", time < 100 ? 1 : 0, time);
  return text.data();
}

void print_table(const std::vector<Cell>& cells, const std::vector<Done>& all) {
  std::printf(
      "\nBus time in seconds from the first frame to operational; latencies equal / 0.2 to 4 ms / slow outliers\n");
  std::printf("%-12s%8s", "kind", "devices");
  for (const auto rate : bit_rates) std::printf("%26s", (std::to_string(rate / 1000) + " kbit/s").c_str());
  std::printf("\n");
  std::size_t i = 0;
  while (i < cells.size()) {
    const Cell row = cells[i];
    std::printf("%-12s%8u", name(row.kind), row.devices);
    for (const auto rate : bit_rates) {
      std::string entry;
      for (; i < cells.size() && cells[i].kind == row.kind && cells[i].devices == row.devices &&
             cells[i].bit_rate == rate;
           ++i) {
        if (!entry.empty()) entry += " / ";
        entry += time_text(all[i].outcome);
      }
      std::printf("%26s", entry.c_str());
    }
    std::printf("\n");
  }
}

template <class Names>
int place_of(const Names& names, const char* wanted) {
  const auto it = std::ranges::find(names, std::string_view(wanted));
  return it == names.end() ? -1 : static_cast<int>(it - names.begin());
}

bool read_options(Options& o, int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view option = argv[i];
    if (option == "--show") {
      o.show = true;
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
  Options o;
  const bool read = read_options(o, argc, argv);
  const auto cells = cells_of(o);
  if (!read || cells.empty()) {
    std::fprintf(
        stderr,
        "usage: matrix [--kind K] [--devices N] [--bitrate KBIT] [--latency L] [--limit SECONDS] [--workers N] "
        "[--show]\nkinds:");
    for (const auto* kind : kind_names) std::fprintf(stderr, " %s", kind);
    std::fprintf(stderr, "\nlatencies:");
    for (const auto* latency : latency_names) std::fprintf(stderr, " %s", latency);
    std::fprintf(stderr, "\ndevices: one of 1 2 5 30 60 120 126; kbit/s: one of 10 50 125 500 1000\n");
    return 2;
  }
  const auto all = run_all(o, cells);
  print_table(cells, all);
  const auto good = std::ranges::count_if(all, [](const Done& d) { return d.outcome.end == End::operational; });
  std::printf("%zu cells, %zu operational\n", cells.size(), static_cast<std::size_t>(good));
  return static_cast<std::size_t>(good) == cells.size() ? 0 : 1;
}
