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

#include "berth/harness/matrix.hpp"
#include "berth/operate/report.hpp"

namespace berth::harness::matrix {

// Which cells, and how.
struct Choice : Selection {
  std::optional<rt::Duration> limit;
  unsigned workers = 2;
  bool show = false;
  bool frames = false;
  bool ratio = false;  // also compares with the published methods
  bool quiet = false;  // cells that are not operational are not named
};

struct Done {
  std::size_t cell = 0;
  double wall = 0;
  Outcome outcome;
};

inline void print(const std::string& line) { std::printf("%s\n", line.c_str()); }

inline Done run_one(const Choice& o, const std::vector<Cell>& cells, std::size_t i) {
  const auto began = std::chrono::steady_clock::now();
  Done done;
  done.cell = i;
  done.outcome = run(cells[i], o.limit.value_or(budget(cells[i])), o.show ? Show(print) : Show(), o.frames);
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
    if (done.outcome.end == End::operational || o.quiet) continue;
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

// Prints one line for each kind and size, with one entry per bit rate: `text_of` its cells, one per latency.
template <class TextOf>
void print_rows(const std::vector<Cell>& cells, const char* title, const TextOf& text_of) {
  std::printf("\n%s; latencies equal / 0.2 to 4 ms / slow outliers\n", title);
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
        entry += text_of(i);
      }
      std::printf("%26s", entry.c_str());
    }
    std::printf("\n");
  }
}

inline void print_table(const std::vector<Cell>& cells, const std::vector<Done>& all) {
  print_rows(cells, "Bus time in seconds from the first frame to operational",
             [&](std::size_t i) { return time_text(all[i].outcome); });
}

inline void print_rest(const std::vector<Cell>& cells, const std::vector<Done>& all) {
  const auto text = [&](std::size_t i) {
    std::array<char, 24> words{};
    std::snprintf(words.data(), words.size(), "%.1f", all[i].outcome.at_rest);
    return std::string(words.data());
  };
  print_rows(cells, "Frames a second that Berth sends when all are operational and nothing happens", text);
}

// The default's bus time over that of the best published method.
struct Ratio {
  std::optional<double> value;  // none: no published method is operational in this cell
  std::string_view method;      // the best published one
};

inline constexpr double most_ratio = 1.1;

// The ratio of each cell, for which it runs the published methods. `all`: the default's outcomes.
inline std::vector<Ratio> ratios(const Choice& o, const std::vector<Cell>& cells, const std::vector<Done>& all) {
  std::vector<Cell> others;
  std::vector<std::size_t> of;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    for (const auto method : published(cells[i].kind)) {
      others.push_back(cells[i]);
      others.back().method = method;
      of.push_back(i);
    }
  }
  Choice quiet = o;
  quiet.quiet = true;
  const auto done = run_all(quiet, others);
  std::vector<Ratio> list(cells.size());
  for (std::size_t k = 0; k < others.size(); ++k) {
    const auto& mine = all[of[k]].outcome;
    const auto& theirs = done[k].outcome;
    if (mine.end != End::operational || theirs.end != End::operational) continue;
    const double ratio = static_cast<double>(mine.bus_time.count()) / static_cast<double>(theirs.bus_time.count());
    auto& best = list[of[k]];
    if (!best.value || ratio > *best.value) best = {ratio, others[k].method};
  }
  return list;
}

// Prints them, and the worst; false if the default is slower than `most_ratio` in one.
inline bool print_ratios(const std::vector<Cell>& cells, const std::vector<Ratio>& list) {
  print_rows(cells, "The default's bus time over that of the best published method; -: none is operational",
             [&](std::size_t i) {
               if (!list[i].value) return std::string("-");
               std::array<char, 24> text{};
               std::snprintf(text.data(), text.size(), "%.2f", *list[i].value);
               return std::string(text.data());
             });
  std::size_t compared = 0;
  std::size_t slower = 0;
  const Ratio* worst = nullptr;
  for (const auto& ratio : list) {
    if (!ratio.value) continue;
    ++compared;
    slower += *ratio.value > most_ratio ? 1U : 0U;
    if (worst == nullptr || *ratio.value > *worst->value) worst = &ratio;
  }
  std::printf("%zu cells compared, in %zu the default takes more than %.1f times the best published method\n", compared,
              slower, most_ratio);
  if (worst != nullptr) {
    std::printf("worst: %s: %.2f times %.*s\n", describe(cells[static_cast<std::size_t>(worst - list.data())]).c_str(),
                *worst->value, static_cast<int>(worst->method.size()), worst->method.data());
  }
  return slower == 0;
}

// Prints how many of them are as they must be; false if one is not.
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
