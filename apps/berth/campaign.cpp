// `berth study KIND --seeds A..B`: runs the seeds of a campaign, and appends a line for each to its file.
#include "campaign.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <unordered_set>

#include "berth/base/shell_word.hpp"
#include "berth/campaign/crew.hpp"
#include "berth/campaign/line_file.hpp"
#include "berth/harness/example_files.hpp"
#include "interrupt.hpp"
#include "outputs.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using campaign::Kind;
using campaign::Line;
using campaign::Verdict;
using campaign::Work;

constexpr const char* version = BERTH_VERSION;

Failure failure_of(const std::string& what, const Error& error) {
  if (error.code == Errc::duplicate) return failure(Exit::usage, fmt::format("{}: {}", what, error.text));
  if (error.code == Errc::invalid) {
    const std::string line = error.detail == 0 ? std::string() : fmt::format(":{}", error.detail);
    return failure(Exit::usage, fmt::format("{}{}: {}", what, line, error.text));
  }
  const std::string why = error.detail == 0 ? std::string() : fmt::format(": {}", std::strerror(int(error.detail)));
  return failure(Exit::failed, fmt::format("{}: {}{}", what, error.text, why));
}

std::optional<Failure> read(const CampaignOptions& wanted, Work& work) {
  const auto kind = campaign::kind_of(wanted.kind);
  const auto variant = campaign::variant_of(wanted.variant);
  if (!kind || !variant) return failure(Exit::usage, "there is no such kind of worlds");  // the words are checked
  work = {.kind = *kind, .variant = *variant, .twice = wanted.twice};
  const auto has = campaign::variants_of(*kind);
  if (std::ranges::find(has, *variant) == has.end()) {
    return failure(Exit::usage, fmt::format("--variant {}: \"{}\" has none of that name", wanted.variant, wanted.kind));
  }
  if (!wanted.seeds) return failure(Exit::usage, "which seeds? write --seeds 1..1000");
  if (wanted.seeds->first < campaign::lowest_seed(*kind))
    return failure(Exit::usage, fmt::format("the seeds of \"{}\" are numbers of cells, and begin at 1", wanted.kind));
  if (wanted.show && !wanted.out.empty())
    return failure(Exit::usage, "--show prints what happens in each world, and --out keeps lines: use one of them");
  return std::nullopt;
}

std::string in_words(double seconds) {
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  if (seconds < 90 * 60) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.0f} h", seconds / 3600);
}

/// "230 of 1000 seeds, 2 not good, about 5 min left": one line of a terminal, on standard error, drawn over the last.
class Ticker {
 public:
  /// `known`: seeds that are not run again.
  void begin(std::uint64_t known, std::uint64_t all) {
    on_ = ::isatty(STDERR_FILENO) == 1;
    known_ = known;
    all_ = all;
  }
  void draw(std::uint64_t done, std::uint64_t not_good) {
    const auto now = Clock::now();
    if (!on_ || done == known_ || (drawn_ && now - *drawn_ < std::chrono::milliseconds(200))) return;
    drawn_ = now;
    const double each = std::chrono::duration<double>(now - begun_).count() / static_cast<double>(done - known_);
    const std::string bad = not_good == 0 ? std::string() : fmt::format(", {} not good", not_good);
    fmt::print(stderr, "\r{} of {} seeds{}, about {} left\x1b[K\r", done, all_, bad,
               in_words(each * static_cast<double>(all_ - done)));
  }
  /// Before something else is printed.
  void clear() {
    if (drawn_) fmt::print(stderr, "\r\x1b[K");
    drawn_.reset();
  }

 private:
  using Clock = std::chrono::steady_clock;
  bool on_ = false;
  std::uint64_t known_ = 0, all_ = 0;
  Clock::time_point begun_ = Clock::now();
  std::optional<Clock::time_point> drawn_;
};

/// The seeds of a campaign one after the other, and what came of them.
class Progress {
 public:
  Progress(const CampaignOptions& wanted, const Work& work, bool json)
      : wanted_(wanted), work_(work), next_(wanted.seeds->first), json_(json) {}

  /// What earlier runs found. A seed without a result is done again.
  void know(const campaign::Results& results) {
    for (const auto& [key, line] : results.lines()) {
      const bool counts = key == campaign::key_of(work_, version, key.seed) && wanted_.seeds->has(key.seed);
      if (!counts || !campaign::is_result(line.verdict)) continue;
      known_.insert(key.seed);
      ++count_[static_cast<std::size_t>(line.verdict)];
    }
  }
  void append_to(campaign::LineFile& file) noexcept { file_ = &file; }
  /// Call it before the first seed is run.
  void begin() {
    const bool lines_on_terminal = file_ == nullptr && on_terminal();
    if (!json_ && !lines_on_terminal) ticker_.begin(done(), wanted_.seeds->count());
  }
  void end() { ticker_.clear(); }

  std::optional<std::uint64_t> next() {
    while (!over_) {
      const std::uint64_t seed = next_;
      over_ = seed == wanted_.seeds->last;
      ++next_;
      if (!known_.contains(seed)) return seed;
    }
    return std::nullopt;
  }

  /// False: the line cannot be kept.
  bool take(const campaign::Ended& ended) {
    using How = campaign::Ended::How;
    switch (ended.how) {
      case How::done: break;
      case How::died: return keep_without(ended.seed, Verdict::crashed, ended.text);
      case How::killed:
        return keep_without(ended.seed, Verdict::killed, ended.text + ": by somebody, or because memory ran out");
      case How::too_long:
        return keep_without(ended.seed, Verdict::too_long, fmt::format("not over in {:g} s", seconds(wanted_.limit)));
    }
    return keep(ended.text);
  }

  [[nodiscard]] std::uint64_t of(Verdict verdict) const { return count_.at(static_cast<std::size_t>(verdict)); }
  [[nodiscard]] std::uint64_t done() const {
    std::uint64_t sum = 0;
    for (const auto each : count_) sum += each;
    return sum;
  }
  [[nodiscard]] bool is_good() const { return done() == of(Verdict::good); }
  [[nodiscard]] const std::optional<Error>& error() const noexcept { return error_; }

 private:
  static double seconds(std::chrono::nanoseconds time) { return std::chrono::duration<double>(time).count(); }

  bool keep_without(std::uint64_t seed, Verdict verdict, const std::string& why) {
    return keep(to_json(campaign::line_without_result(work_, version, seed, verdict, why)));
  }

  bool keep(const std::string& text) {
    const auto line = campaign::parse_line(text);
    if (!line) {
      error_ = line.error();
      return false;
    }
    if (file_ == nullptr) {
      print_text(text);
    } else if (const auto written = write(text); !written) {
      error_ = written.error();
      return false;
    }
    ++count_[static_cast<std::size_t>(line->verdict)];
    if (file_ != nullptr && line->verdict != Verdict::good && !json_) {
      ticker_.clear();
      print_lines(lines_of(*line));
    }
    ticker_.draw(done(), done() - of(Verdict::good));
    return true;
  }
  /// Once a second the lines are brought to the disk: a power cut loses those of the last second.
  Result<void> write(const std::string& text) {
    if (auto written = file_->append(text); !written) return written;
    const auto now = std::chrono::steady_clock::now();
    if (now - synced_ < std::chrono::seconds(1)) return {};
    synced_ = now;
    return file_->sync();
  }

  const CampaignOptions& wanted_;
  const Work& work_;
  std::uint64_t next_;
  bool json_;
  bool over_ = false;
  campaign::LineFile* file_ = nullptr;
  std::unordered_set<std::uint64_t> known_;
  std::array<std::uint64_t, campaign::verdicts> count_{};
  std::chrono::steady_clock::time_point synced_{};
  Ticker ticker_;
  std::optional<Error> error_;
};

/// In this process, so that a debugger sees it.
int show_seeds(const Work& work, const campaign::Seeds& seeds, const harness::Folders& folders) {
  const Interrupt interrupt;
  bool good = true;
  for (std::uint64_t seed = seeds.first;; ++seed) {
    const Line line = campaign::run_seed(work, version, seed, folders, [](const std::string& log) { print_text(log); });
    print_text(to_json(line));
    good = good && line.verdict == Verdict::good;
    if (is_ending()) return Exit::failed;
    if (seed == seeds.last) return good ? Exit::done : Exit::no;
  }
}

int report(const Progress& progress, const CampaignOptions& wanted, bool json) {
  const std::uint64_t all = wanted.seeds->count();
  const bool complete = progress.done() == all;
  if (json && !wanted.out.empty()) {
    nlohmann::ordered_json object{{"seeds", all}, {"done", progress.done()}};
    for (std::size_t i = 0; i < campaign::verdicts; ++i)
      object[name(static_cast<Verdict>(i))] = progress.of(static_cast<Verdict>(i));
    print_text(object.dump(2));
  } else if (!wanted.out.empty()) {
    std::string text =
        fmt::format("{} of {} seeds in {}: {} good", progress.done(), all, wanted.out, progress.of(Verdict::good));
    for (std::size_t i = 1; i < campaign::verdicts; ++i) {
      const auto verdict = static_cast<Verdict>(i);
      if (progress.of(verdict) > 0) text += fmt::format(", {} {}", progress.of(verdict), name(verdict));
    }
    print_line(text);
    if (!progress.is_good())
      print_line(fmt::format("what is not good: berth study --summary {}", shell_word(wanted.out)));
  }
  if (!complete && !json) print_error("ended before all seeds were done; the same command does the rest");
  if (!complete) return Exit::failed;
  return progress.is_good() ? Exit::done : Exit::no;
}

Result<bool> run_seeds(Progress& progress, const Work& work, const CampaignOptions& wanted,
                       const harness::Folders& folders, int line_file) {
  Interrupt interrupt;
  campaign::CrewOptions crew;
  crew.jobs = wanted.jobs > 0 ? wanted.jobs : std::max(1U, std::thread::hardware_concurrency());
  crew.limit = wanted.limit;
  crew.stop = interrupt.descriptor();
  crew.not_for_workers = {interrupt.descriptor()};
  if (line_file >= 0) crew.not_for_workers.push_back(line_file);
  crew.must_stop = [] { return run_must_end(); };
  return campaign::run_crew(
      crew, [&](std::uint64_t seed) { return to_json(campaign::run_seed(work, version, seed, folders)); },
      [&] { return progress.next(); }, [&](const campaign::Ended& ended) { return progress.take(ended); });
}

}  // namespace

std::vector<std::string> lines_of(const Line& line) {
  const auto end = line.reason.find('\n');
  const std::string options = line.key.options.empty() ? "" : " " + line.key.options;
  const std::string cell = line.cell.empty() ? "" : fmt::format(" ({})", line.cell);
  return {fmt::format("{}{} {}{} {}: {}", name(line.key.kind), options, line.key.seed, cell, name(line.verdict),
                      line.reason.substr(0, end)),
          "  " + line.replay};
}

int run_campaign(const Options& options, const CampaignOptions& wanted) {
  Work work;
  if (const auto bad = read(wanted, work)) return tell(*bad, options.json);
  const auto files = harness::ExampleFiles::make();
  if (!files) return tell(failure_of("the folder for temporary files", files.error()), options.json);
  if (wanted.show) return show_seeds(work, *wanted.seeds, files->folders());
  Progress progress(wanted, work, options.json);
  std::optional<campaign::LineFile> file;
  if (!wanted.out.empty()) {
    if (const auto bad = may_keep(wanted.out, "--out")) return tell(*bad, options.json);
    campaign::Results known;
    auto opened = campaign::LineFile::open(wanted.out, known);
    if (!opened) return tell(failure_of(wanted.out, opened.error()), options.json);
    file.emplace(std::move(*opened));
    progress.know(known);
    progress.append_to(*file);
    if (file->was().torn() && !options.json) print_error(wanted.out + ": its torn last line was taken off");
  }
  progress.begin();
  const auto ran = run_seeds(progress, work, wanted, files->folders(), file ? file->descriptor() : -1);
  progress.end();
  if (!ran) return tell(failure_of("berth study", ran.error()), options.json);
  if (progress.error()) return tell(failure_of(wanted.out, *progress.error()), options.json);
  if (file) {
    if (const auto synced = file->sync(); !synced) return tell(failure_of(wanted.out, synced.error()), options.json);
  }
  return report(progress, wanted, options.json);
}

void add_study(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<CampaignOptions>();
  const Verb study = berth.add("study", "many random worlds by their seeds, a line of JSON each", [&options, wanted] {
    if (!wanted->summary.empty()) return run_summary(options, *wanted);
    if (!wanted->merge.empty()) return run_merge(options, *wanted);
    return run_campaign(options, *wanted);
  });
  study.footer(
      "Examples:\n  berth study --seeds 1..1000 --out a.jsonl\n  berth study trees --seeds 1..200 --jobs 8 --out "
      "a.jsonl\n"
      "  berth study --merge a.jsonl b.jsonl --out all.jsonl\n  berth study --summary all.jsonl\n"
      "  berth study faults --seeds 17 --show");
  study
      .word("kind", wanted->kind,
            "faults (default): the main job among faults; trees: buses beneath gateways; matrix: every size and kind "
            "of devices; compare: every method")
      .one_of({"faults", "trees", "matrix", "compare"});
  const auto seeds = [wanted](const std::string& text) {
    wanted->seeds = campaign::parse_seeds(text);
    return wanted->seeds ? std::string() : fmt::format("\"{}\" is no range of seeds; write 1..1000 or 17", text);
  };
  const Word range = study.read("--seeds", "A..B", seeds, "such as 1..1000, both included; 17 is one seed");
  study.word("--jobs", wanted->jobs, "processes side by side (default: one a processor)").from_to(1, 1024).shown("N");
  study
      .word("--out", wanted->out,
            "append the lines to this file, and do only the seeds that it lacks: a run that ended goes on")
      .shown("FILE");
  study
      .word("--variant", wanted->variant,
            "of faults: usual, plain, twins, waits, as-sold; of trees: usual, plain, as-sold")
      .one_of({"usual", "plain", "twins", "waits", "as-sold"});
  study.flag("--twice", wanted->twice, "run each seed two times, and report where the two differ");
  study.time("--limit", wanted->limit, "longest real time of one seed (default 10 min)");
  study.flag("--show", wanted->show, "print what happens in each world, one after the other");
  Word merge = study.word("--merge", wanted->merge, "join these files, each seed once, and report contradictions");
  merge.shown("FILE").values(1, 1'000'000).excludes(range);
  Word summary =
      study.word("--summary", wanted->summary, "of these files: failures, seeds that are missing, a table of figures");
  summary.shown("FILE").values(1, 1'000'000).excludes(range).excludes(merge);
  json_flag(study, options, "one JSON object, where it is not lines of JSON");
  force_word(study, options);
}

}  // namespace berth::cli
