// `berth study --merge`, `berth study --summary`.
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>

#include "berth/campaign/summary.hpp"
#include "campaign.hpp"
#include "outputs.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
using campaign::Group;
using campaign::Spread;
using campaign::Verdict;

std::string where(const campaign::Line& line) {
  return fmt::format("{}{}{} {} of version {}", name(line.key.kind), line.key.options.empty() ? "" : " ",
                     line.key.options, line.key.seed, line.key.version);
}

std::string told(const campaign::Line& line) {
  return line.reason.empty()
             ? std::string(name(line.verdict))
             : fmt::format("{} ({})", name(line.verdict), line.reason.substr(0, line.reason.find('\n')));
}

Json json_of(const campaign::Results& results) {
  Json list = Json::array();
  for (const auto& c : results.contradictions()) {
    list.push_back({{"kind", name(c.first.key.kind)},
                    {"options", c.first.key.options},
                    {"version", c.first.key.version},
                    {"seed", c.first.key.seed},
                    {"first", {{"file", c.first_from}, {"line", Json::parse(to_json(c.first))}}},
                    {"other", {{"file", c.other_from}, {"line", Json::parse(to_json(c.other))}}}});
  }
  return list;
}

std::vector<std::string> contradictions_of(const campaign::Results& results) {
  std::vector<std::string> lines;
  for (const auto& c : results.contradictions()) {
    const bool same_words = told(c.first) == told(c.other);
    lines.push_back(fmt::format("{}: {} says {}, {} says {}{}", where(c.first), c.first_from, told(c.first),
                                c.other_from, told(c.other), same_words ? " with other figures" : ""));
  }
  return lines;
}

/// Files that were read, and what of them was passed over.
struct Read {
  campaign::Results results;
  Json passed_over = Json::array();
  bool damaged = false;  ///< a line is none of a campaign, and was not torn
};

/// `quiet`: what was passed over is in `Read::passed_over` alone.
std::optional<Failure> read_files(const std::vector<std::string>& files, Read& into, bool quiet) {
  for (const auto& path : files) {
    const auto file = into.results.read(path);
    if (!file) {
      const int error = static_cast<int>(file.error().detail);
      return failure(Exit::usage, fmt::format("{}: {}", path, std::strerror(error)));
    }
    const std::uint64_t first = std::max<std::uint64_t>(1, file->first_bad);
    if (file->foreign()) return failure(Exit::usage, fmt::format("{}:{}: it is no file of a campaign", path, first));
    into.damaged = into.damaged || file->bad_lines > 0;
    const std::uint64_t torn = file->pieces + (file->torn() ? 1 : 0);
    if (torn > 0) into.passed_over.push_back({{"file", path}, {"torn", torn}});
    if (file->bad_lines > 0)
      into.passed_over.push_back(
          {{"file", path}, {"lines", file->bad_lines}, {"first", first}, {"why", file->why_bad}});
    if (quiet) continue;
    if (torn > 0) print_error(fmt::format("{}: {} torn line{} passed over", path, torn, torn == 1 ? "" : "s"));
    if (file->bad_lines > 0) {
      print_error(fmt::format("{}:{}: {}; {} such line{} passed over", path, first, file->why_bad, file->bad_lines,
                              file->bad_lines == 1 ? "" : "s"));
    }
  }
  return std::nullopt;
}

std::string written(const campaign::Seeds& seeds) {
  return seeds.first == seeds.last ? fmt::format("{}", seeds.first) : fmt::format("{}..{}", seeds.first, seeds.last);
}

/// What is not there between the lowest and the highest seed; most campaigns lack nothing.
void print_missing(const std::vector<campaign::Range>& ranges) {
  constexpr std::size_t most = 5;
  for (const auto& range : ranges) {
    if (range.missing.empty()) continue;
    std::string text =
        fmt::format("{}{}{}: {} of the seeds {} without a line:", name(range.kind), range.options.empty() ? "" : " ",
                    range.options, range.seeds.count() - range.count, written(range.seeds));
    for (std::size_t i = 0; i < std::min(most, range.missing.size()); ++i)
      text += fmt::format("{} {}", i == 0 ? "" : ",", written(range.missing[i]));
    print_line(text + (range.missing.size() > most ? ", ..." : ""));
  }
}

Json json_of(const campaign::Range& range) {
  Json missing = Json::array();
  for (const auto& seeds : range.missing) missing.push_back(written(seeds));
  return {{"kind", name(range.kind)},      {"options", range.options}, {"version", range.version},
          {"seeds", written(range.seeds)}, {"lines", range.count},     {"missing", missing}};
}

std::string number(double value) { return value == 0 ? "0" : fmt::format("{:.4g}", value); }
std::string whole(double value) { return fmt::format("{:.0f}", value); }

Json json_of(const Spread& spread) {
  if (spread.count == 0) return nullptr;
  return {{"count", spread.count}, {"median", spread.median}, {"p95", spread.p95}, {"max", spread.most}};
}

Json json_of(const Group& group) {
  Json json{{"kind", name(group.kind)}, {"options", group.options}, {"version", group.version}, {"group", group.group},
            {"seeds", group.seeds()},   {"first", group.first},     {"last", group.last}};
  for (std::size_t i = 0; i < campaign::verdicts; ++i)
    json[name(static_cast<Verdict>(i))] = group.of(static_cast<Verdict>(i));
  json["operational_s"] = json_of(group.operational_s);
  json["bus_time_s"] = json_of(group.bus_time_s);
  json["frames"] = json_of(group.frames);
  json["lost"] = json_of(group.lost);
  return json;
}

std::string cells(const Spread& spread, std::string (*text)(double)) {
  if (spread.count == 0) return fmt::format("  {:>28}", "-");
  return fmt::format("  {:>8} {:>9} {:>9}", text(spread.median), text(spread.p95), text(spread.most));
}

void print_groups(const std::vector<Group>& groups) {
  std::size_t width = 4;
  const auto called = [](const Group& g) {
    std::string text = name(g.kind);
    for (const auto& more : {g.options, g.group}) {
      if (!more.empty()) text += " " + more;
    }
    return text;
  };
  for (const auto& g : groups) width = std::max(width, called(g).size());
  print_line(fmt::format("{:<{}}  {:<8}{:>9}{:>9}{:>7}  {:>28}  {:>28}  {:>28}", "kind", width, "version", "seeds",
                         "good", "not", "operational s: median p95 max", "frames: median p95 max",
                         "lost: median p95 max"));
  for (const auto& g : groups) {
    print_line(fmt::format("{:<{}}  {:<8}{:>9}{:>9}{:>7}{}{}{}", called(g), width, g.version, g.seeds(),
                           g.of(Verdict::good), g.seeds() - g.of(Verdict::good), cells(g.operational_s, number),
                           cells(g.frames, whole), cells(g.lost, whole)));
  }
}

}  // namespace

int run_merge(const Options& options, const CampaignOptions& wanted) {
  if (!wanted.out.empty()) {
    if (const auto bad = may_write(wanted.out, "--out", options.files.force)) return tell(*bad, options.json);
  }
  Read read;
  const bool as_object = options.json && !wanted.out.empty();
  if (const auto bad = read_files(wanted.merge, read, as_object)) return tell(*bad, options.json);
  const auto& results = read.results;
  std::string text;
  for (const auto& [key, line] : results.lines()) text += to_json(line) + "\n";
  if (wanted.out.empty()) {
    if (!text.empty()) print_text(text.substr(0, text.size() - 1));
  } else if (const auto bad = write_output(wanted.out, text)) {
    return tell(*bad, options.json);
  }
  if (!as_object) {
    for (const auto& line : contradictions_of(results)) print_error(line);
  }
  if (as_object) {
    print_text(Json{{"lines", results.lines().size()},
                    {"doubles", results.doubles()},
                    {"contradictions", json_of(results)},
                    {"passed_over", read.passed_over}}
                   .dump(2));
  } else if (!wanted.out.empty()) {
    print_line(fmt::format("{} lines in {}; {} doubles, {} contradictions", results.lines().size(), wanted.out,
                           results.doubles(), results.contradictions().size()));
  }
  return results.contradictions().empty() && !read.damaged ? Exit::done : Exit::no;
}

int run_summary(const Options& options, const CampaignOptions& wanted) {
  Read read;
  if (const auto bad = read_files(wanted.summary, read, options.json)) return tell(*bad, options.json);
  const auto& results = read.results;
  const auto summary = campaign::summarize(results);
  const bool good = summary.failures.empty() && results.contradictions().empty() && !read.damaged;
  if (options.json) {
    Json json{{"failures", Json::array()},
              {"groups", Json::array()},
              {"ranges", Json::array()},
              {"contradictions", json_of(results)}};
    for (const auto& line : summary.failures) json["failures"].push_back(Json::parse(to_json(line)));
    for (const auto& group : summary.groups) json["groups"].push_back(json_of(group));
    for (const auto& range : summary.ranges) json["ranges"].push_back(json_of(range));
    json["passed_over"] = read.passed_over;
    print_text(json.dump(2));
    return good ? Exit::done : Exit::no;
  }
  for (const auto& line : summary.failures) print_lines(lines_of(line));
  print_lines(contradictions_of(results));
  print_missing(summary.ranges);
  print_groups(summary.groups);
  return good ? Exit::done : Exit::no;
}

}  // namespace berth::cli
