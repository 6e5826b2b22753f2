// `berth compare`: runs every discovery method on the same devices and the same bus.
#include <fmt/format.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "berth/study/contest.hpp"
#include "output.hpp"
#include "outputs.hpp"
#include "study.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
using study::Cell;
using study::Contest;

double seconds(rt::Duration time) { return std::chrono::duration<double>(time).count(); }

std::vector<std::string> split(const std::string& list) {
  std::vector<std::string> parts(1);
  for (const char c : list) {
    if (c == ',') {
      parts.emplace_back();
    } else if (c != ' ') {
      parts.back() += c;
    }
  }
  return parts;
}

std::optional<unsigned> number(const std::string& text, unsigned least, unsigned most) {
  unsigned value = 0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (bad != std::errc{} || end != text.data() + text.size() || value < least || value > most) return std::nullopt;
  return value;
}

/// Reads a list word by word with `read`; a failure names the wrong word.
template <class T, class Read>
std::optional<Failure> read_list(const std::string& list, std::vector<T>& into, const char* option,
                                 const std::string& use, const Read& read) {
  if (list.empty()) return std::nullopt;
  into.clear();
  for (const auto& word : split(list)) {
    const auto value = read(word);
    if (!value) return failure(Exit::usage, fmt::format("{}: there is no \"{}\"; use {}", option, word, use));
    into.push_back(*value);
  }
  return std::nullopt;
}

std::optional<study::Serials> serials_of(const std::string& word) {
  using enum study::Serials;
  for (const auto each : {consecutive, random, mixed}) {
    if (word == study::name(each)) return each;
  }
  return std::nullopt;
}

std::optional<Failure> read(const StudyOptions& study, Contest& contest) {
  std::string names;
  for (const auto& each : study::contestants()) names += (names.empty() ? "" : ", ") + std::string(study::name(each));
  if (auto bad = read_list(study.methods, contest.methods, "--methods", names,
                           [](const std::string& word) { return study::contestant(word); }))
    return bad;
  if (auto bad = read_list(study.devices, contest.devices, "--devices", "1 to 126",
                           [](const std::string& word) { return number(word, 1, 126); }))
    return bad;
  if (auto bad = read_list(study.bit_rates, contest.bit_rates, "--bitrates", "10 to 1000 (kbit/s)",
                           [](const std::string& word) -> std::optional<std::uint32_t> {
                             const auto kbit = number(word, 10, 1000);
                             if (!kbit) return std::nullopt;
                             return *kbit * 1000;
                           }))
    return bad;
  if (auto bad = read_list(study.serials, contest.serials, "--serials", "consecutive, random or mixed", serials_of))
    return bad;
  if (study.seeds > 0) contest.seeds = study.seeds;
  return std::nullopt;
}

std::string csv(const std::vector<Cell>& cells) {
  std::string text = "method,devices,bitrate,serials,bus_time_s,worst_s,frames,bits,found,bound\n";
  for (const auto& c : cells) {
    text +=
        fmt::format("{},{},{},{},{:.6f},{:.6f},{},{},{},{}\n", study::name(c.method), c.devices, c.bit_rate,
                    study::name(c.serials), seconds(c.bus_time), seconds(c.worst), c.frames, c.bits, c.found, c.bound);
  }
  return text;
}

std::string remark(const Cell& c) {
  std::string text;
  if (c.found < c.devices) text = fmt::format("{} of {} found", c.found, c.devices);
  if (c.bound < c.devices && c.bound != c.found)
    text += fmt::format("{}{} of {} bound", text.empty() ? "" : ", ", c.bound, c.devices);
  if (!c.trouble.empty()) text += (text.empty() ? "" : "; ") + c.trouble;
  if (!c.wrong.empty()) text += (text.empty() ? "WRONG: " : "; WRONG: ") + c.wrong.front();
  return text;
}

void print_table(const std::vector<Cell>& cells, const Contest& contest) {
  print_line(
      fmt::format("Blank devices found and given a node-ID, until their boot-up; answers after {:.1f} to {:.1f} ms; {} "
                  "seed{} a cell",
                  seconds(contest.response.min) * 1000, seconds(contest.response.max) * 1000, contest.seeds,
                  contest.seeds == 1 ? "" : "s"));
  print_line("Published methods with the windows of their papers; mean bus time, worst bus time, mean frames and bits");
  print_line(fmt::format("{:<21}{:>8}{:>8}  {:<12}{:>12}{:>12}{:>9}{:>11}{:>7}{:>7}", "method", "devices", "kbit/s",
                         "serials", "bus time s", "worst s", "frames", "bits", "found", "bound"));
  for (const auto& c : cells) {
    const auto note = remark(c);
    print_line(fmt::format("{:<21}{:>8}{:>8}  {:<12}{:>12.3f}{:>12.3f}{:>9}{:>11}{:>7}{:>7}{}{}", study::name(c.method),
                           c.devices, c.bit_rate / 1000, study::name(c.serials), seconds(c.bus_time), seconds(c.worst),
                           c.frames, c.bits, c.found, c.bound, note.empty() ? "" : "  ", note));
  }
}

std::optional<Failure> may_write_all(const StudyOptions& study, bool force) {
  if (!study.csv.empty()) {
    if (auto bad = may_write(study.csv, "--csv", force)) return bad;
  }
  return study.plot.empty() ? std::nullopt : may_write(study.plot, "--plot", force);
}

}  // namespace

int run_compare(const Options& options, const StudyOptions& study) {
  Contest contest;
  if (const auto bad = read(study, contest)) return tell(*bad, options.json);
  if (const auto bad = may_write_all(study, options.files.force)) return tell(*bad, options.json);
  const unsigned threads = study.threads > 0 ? study.threads : std::max(1U, std::thread::hardware_concurrency());
  const bool live = on_terminal() && !options.json;
  const auto cells = study::compare(contest, threads, [live](std::size_t done, std::size_t all) {
    if (live) fmt::print(stderr, "\r{} of {} cells{}", done, all, done == all ? "\r\x1b[K" : "");
  });
  if (!study.csv.empty()) {
    const std::string table = csv(cells);
    if (const auto bad = write_output(study.csv, table)) return tell(*bad, options.json);
  }
  if (!study.plot.empty()) {
    const std::string plot = study::plot(cells);
    if (const auto bad = write_output(study.plot, plot)) return tell(*bad, options.json);
  }
  const bool wrong = std::ranges::any_of(cells, [](const Cell& c) { return !c.wrong.empty(); });
  const int status = wrong ? Exit::failed : Exit::done;
  if (!options.json) {
    print_table(cells, contest);
    return status;
  }
  Json json{{"rows", Json::array()}};
  for (const auto& c : cells) {
    json["rows"].push_back({{"method", study::name(c.method)},
                            {"devices", c.devices},
                            {"bitrate", c.bit_rate},
                            {"serials", study::name(c.serials)},
                            {"bus_time_s", seconds(c.bus_time)},
                            {"worst_s", seconds(c.worst)},
                            {"frames", c.frames},
                            {"bits", c.bits},
                            {"found", c.found},
                            {"bound", c.bound},
                            {"note", remark(c)}});
  }
  json["seeds"] = contest.seeds;
  print_text(json.dump(2));
  return status;
}

}  // namespace berth::cli
