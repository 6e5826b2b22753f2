// Runs cells of the matrix in several processes and prints their table: for ./run matrix and bench/matrix.cpp.
#pragma once

#include <sys/wait.h>
#include <unistd.h>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "tests/harness/matrix.hpp"

namespace berth::harness::matrix {

// Which cells, and how.
struct Choice {
  std::optional<Kind> kind;
  std::optional<unsigned> devices;
  std::optional<std::uint32_t> bit_rate;
  std::optional<Latency> latency;
  std::optional<rt::Duration> limit;
  unsigned rx_depth = 16;
  unsigned workers = 2;
  bool show = false;
  bool frames = false;
};

struct Done {
  std::size_t cell = 0;
  double wall = 0;
  Outcome outcome;
};

inline std::vector<Cell> cells_of(const Choice& o) {
  std::vector<Cell> cells;
  for (int k = 0; k < static_cast<int>(Kind::count); ++k) {
    for (const auto n : sizes) {
      for (const auto rate : bit_rates) {
        for (int l = 0; l < static_cast<int>(Latency::count); ++l) {
          const Cell cell{static_cast<Kind>(k), n, rate, static_cast<Latency>(l), o.rx_depth};
          const bool chosen = (!o.kind || *o.kind == cell.kind) && (!o.devices || *o.devices == n) &&
                              (!o.bit_rate || *o.bit_rate == rate) && (!o.latency || *o.latency == cell.latency);
          if (chosen) cells.push_back(cell);
        }
      }
    }
  }
  return cells;
}

inline Done run_one(const Choice& o, const std::vector<Cell>& cells, std::size_t i) {
  const auto began = std::chrono::steady_clock::now();
  Done done;
  done.cell = i;
  done.outcome = run(cells[i], o.limit.value_or(budget(cells[i])), o.show, o.frames);
  done.wall = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return done;
}

// Each worker is a process and takes every n-th cell; what it found comes back through one pipe, a record at a time
// (smaller than PIPE_BUF, so that records of two do not mix).
inline std::vector<Done> run_all(const Choice& o, const std::vector<Cell>& cells) {
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
  for (std::size_t i = 0; i < cells.size(); ++i) all[i].cell = i;
  std::vector<bool> came(cells.size());
  Done done;
  while (read(ends[0], &done, sizeof done) == static_cast<ssize_t>(sizeof done)) {
    all[done.cell] = done;
    came[done.cell] = true;
    if (done.outcome.end == End::operational) continue;
    if (const auto why = limit_of(cells[done.cell])) {
      std::printf("%s: a limit: %.*s\n", describe(cells[done.cell]).c_str(), static_cast<int>(why->size()),
                  why->data());
      continue;
    }
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

inline std::string time_text(const Outcome& outcome) {
  if (outcome.end != End::operational) return "-";
  const double time = operate::seconds(rt::Time{} + outcome.bus_time);
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "%.*f", time < 100 ? 1 : 0, time);
  return text.data();
}

inline void print_table(const std::vector<Cell>& cells, const std::vector<Done>& all) {
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

// Prints how many of them are as they must be; false when one is not.
inline bool print_sum(const std::vector<Cell>& cells, const std::vector<Done>& all) {
  std::size_t good = 0;
  std::size_t limits = 0;
  for (const auto& done : all) {
    const bool operational = done.outcome.end == End::operational;
    good += operational ? 1U : 0U;
    limits += !operational && limit_of(cells[done.cell]) ? 1U : 0U;
  }
  std::printf("%zu cells, %zu operational, %zu documented limits\n", cells.size(), good, limits);
  return good + limits == cells.size();
}

}  // namespace berth::harness::matrix
