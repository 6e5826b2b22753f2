// `berth reproduce`: makes the papers' figures again, and their traces.
#include "berth/study/reproduce.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "berth/study/negotiation_load.hpp"
#include "berth/study/words.hpp"
#include "berth/trace/candump.hpp"
#include "output.hpp"
#include "outputs.hpp"
#include "study.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json json_of(const study::Row& row) {
  return {{"paper", row.paper},
          {"what", row.what},
          {"published_s", number(row.published)},
          {"formula_s", number(row.formula)},
          {"simulated_s", number(row.simulated)},
          {"berth_s", number(row.berth)},
          {"counted", number(row.counted)},
          {"note", row.note},
          {"unit", row.unit},
          {"trace", row.trace.empty() ? Json(nullptr) : Json(row.trace + ".log")},
          {"marks", row.marks.empty() ? Json(nullptr) : Json(row.marks)}};
}

std::string cell(const std::optional<double>& value, const study::Row& row) {
  if (!value) return "-";
  const std::string_view unit = row.unit;
  if (unit == "share") return fmt::format("{:.4g} %", *value * 100);
  if (unit != "s") return fmt::format("{:.0f}", *value);
  return *value < 1 ? fmt::format("{:.1f} ms", *value * 1000) : fmt::format("{:.3f} s", *value);
}

/// Wraps text into lines of up to `width` characters.
std::vector<std::string> wrapped(const std::string& text, std::size_t width) {
  std::vector<std::string> lines(1);
  std::size_t at = 0;
  while (at < text.size()) {
    const auto end = std::min(text.find(' ', at), text.size());
    const auto word = text.substr(at, end - at);
    at = end + 1;
    if (!lines.back().empty() && lines.back().size() + 1 + word.size() > width) lines.emplace_back();
    lines.back() += (lines.back().empty() ? "" : " ") + word;
  }
  return lines;
}

void print_rows(const study::Figures& figures) {
  std::size_t width = 0;
  for (const auto& row : figures.rows) width = std::max(width, row.what.size());
  const auto line = [&](const std::string& paper, const std::string& what, const auto&... cells) {
    std::string text = fmt::format("{:<6}{:<{}}", paper, what, width);
    ((text += fmt::format("  {:>13}", cells)), ...);
    print_line(text);
  };
  line("paper", "what", "published", "formula", "simulated", "Berth");
  for (const auto& row : figures.rows) {
    line(std::to_string(row.paper), row.what, cell(row.published, row), cell(row.formula, row),
         cell(row.counted ? row.counted : row.simulated, row), cell(row.berth, row));
    for (const auto& note : wrapped(row.note, 92)) print_line("      " + note);
    if (!row.trace.empty()) print_line(fmt::format("      trace {}.log; {}", row.trace, row.marks));
  }
}

std::optional<Failure> write_traces(const study::Figures& figures, const std::string& folder, bool force) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return failure(Exit::failed, folder + ": " + error.message());
  for (const auto& each : figures.traces) {
    const std::string path = folder + "/" + each.name + ".log";
    const std::string text = trace::write_candump(each.trace);
    if (auto bad = may_write(path, "--traces", force)) return bad;
    if (auto bad = write_output(path, text)) return bad;
  }
  return std::nullopt;
}

/// A run counts only if its devices end up as intended; else the differences are printed.
int verdict(const std::vector<std::string>& wrong) {
  for (const auto& line : wrong) fmt::print(stderr, "wrong: {}\n", line);
  return wrong.empty() ? Exit::done : Exit::failed;
}

int print_listing(const Options& options, const StudyOptions& study, const study::Conditions& conditions) {
  const auto found = study::listing(study.listing, conditions);
  if (!found) {
    std::string names;
    for (const auto& name : study::listings()) names += (names.empty() ? "" : ", ") + std::string(name);
    return tell(failure(Exit::usage, fmt::format("there is no trace \"{}\"; use {}", study.listing, names)),
                options.json);
  }
  if (!study.folder.empty()) {
    const study::Figures one{{}, {{found->name, 0, found->trace}}};
    if (const auto bad = write_traces(one, study.folder, options.files.force)) return tell(*bad, options.json);
  }
  using Form = study::Listing::Form;
  const auto lines = found->form == Form::messages ? study::message_table(found->trace)
                     : found->form == Form::times  ? study::time_table(found->trace)
                                                   : study::view_table(found->trace);
  if (!options.json) {
    print_line(found->title);
    print_lines(lines);
    return verdict(found->wrong);
  }
  Json json{{"trace", found->name}, {"title", found->title}, {"messages", Json::array()}};
  study::Interpreter interpreter;
  for (const auto& e : found->trace.entries) {
    json["messages"].push_back({{"msg", json["messages"].size() + 1},
                                {"at_s", std::chrono::duration<double>(e.at).count()},
                                {"id", study::id_text(e.frame)},
                                {"details", interpreter.words(e.frame)},
                                {"raw", study::raw(e.frame)}});
  }
  print_text(json.dump(2));
  return verdict(found->wrong);
}

double in_seconds(rt::Duration time) { return std::chrono::duration<double>(time).count(); }
double milliseconds_of(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

std::vector<std::string> incomplete(const std::vector<study::LoadRow>& rows) {
  std::vector<std::string> lines;
  for (const auto& r : rows) {
    if (!r.complete)
      lines.push_back(
          fmt::format("{} devices at {} bit/s: {} have a node-ID of their own", r.devices, r.bit_rate, r.with_id));
  }
  return lines;
}

int print_load(const Options& options) {
  const auto rows = study::negotiation_load(options.sim.seed.value_or(1));
  if (options.json) {
    Json json{{"rows", Json::array()}};
    for (const auto& r : rows) {
      json["rows"].push_back({{"devices", r.devices},
                              {"bitrate", r.bit_rate},
                              {"with_id", r.with_id},
                              {"complete", r.complete},
                              {"settled_s", in_seconds(r.settled)},
                              {"frames", r.frames},
                              {"bits", r.bits},
                              {"mean_load", r.mean_load},
                              {"peak_load", r.peak_load},
                              {"longest_blocking_s", in_seconds(r.longest_run)},
                              {"pdo_waited_s", in_seconds(r.pdo_waited)},
                              {"pdo_undisturbed_s", in_seconds(r.pdo_undisturbed)}});
    }
    print_text(json.dump(2));
    return verdict(incomplete(rows));
  }
  print_line("What the negotiation of node-IDs (paper 2) costs the rest of the bus; all devices get power at once");
  print_line(fmt::format("{:>7} {:>8} {:>7} {:>10} {:>8} {:>10} {:>10} {:>14} {:>10}", "devices", "kbit/s", "with ID",
                         "settled", "frames", "mean load", "peak load", "blocks a PDO", "PDO waited"));
  for (const auto& r : rows) {
    print_line(fmt::format("{:>7} {:>8} {:>7} {:>8.2f} s {:>8} {:>8.2f} % {:>8.2f} % {:>11.2f} ms {:>7.2f} ms",
                           r.devices, r.bit_rate / 1000, r.with_id, in_seconds(r.settled), r.frames, 100 * r.mean_load,
                           100 * r.peak_load, milliseconds_of(r.longest_run), milliseconds_of(r.pdo_waited)));
  }
  return verdict(incomplete(rows));
}

}  // namespace

int run_reproduce(const Options& options, const StudyOptions& study) {
  study::Conditions conditions;
  conditions.bit_rate = study.bit_rate;
  if (study.latency) conditions.latency = *study.latency;
  if (!study.listing.empty()) return print_listing(options, study, conditions);
  if (study.negotiation_load) return print_load(options);
  const auto figures = study::reproduce(conditions);
  if (!study.folder.empty()) {
    if (const auto bad = write_traces(figures, study.folder, options.files.force)) return tell(*bad, options.json);
  }
  if (!options.json) {
    print_rows(figures);
    return verdict(figures.wrong);
  }
  Json json{{"rows", Json::array()}};
  for (const auto& row : figures.rows) json["rows"].push_back(json_of(row));
  json["wrong"] = figures.wrong;
  print_text(json.dump(2));
  return verdict(figures.wrong);
}

}  // namespace berth::cli
