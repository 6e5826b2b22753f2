// What may be written behind `berth reproduce` and `berth compare`.
#include "study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "trace.hpp"

namespace berth::cli {
namespace {

using Shared = std::shared_ptr<StudyOptions>;

void json_flag(CLI::App& sub, Options& options) { sub.add_flag("--json", options.json, "one JSON object"); }

void bit_rate_flag(CLI::App& sub, StudyOptions& study, const char* help) {
  sub.add_option("--bitrate", study.bit_rate, help)->check(CLI::Range(10'000, 1'000'000))->option_text("BIT/S");
}

void add_reproduce(CLI::App& sub, Options& options, StudyOptions& study) {
  sub.footer(
      "Examples:\n  berth reproduce --record traces\n  berth reproduce --bitrate 250000 --latency \"1 ms\"\n"
      "  berth reproduce --trace paper4-table1\n  berth reproduce --negotiation-load");
  bit_rate_flag(sub, study, "instead of the papers'");
  const auto read = [&study](const std::string& text) {
    study.latency = text::parse_duration(text);
    if (study.latency && study.latency->count() >= 0 && *study.latency <= std::chrono::seconds(1)) return std::string();
    return fmt::format("\"{}\" is no time up to 1 s; write \"4 ms\" or \"500 us\"", text);
  };
  sub.add_option_function<std::string>(
         "--latency", [](const std::string&) {}, "of the devices' answers, instead of the papers'")
      ->check(CLI::Validator(read, "TIME"));
  sub.add_option("--record", study.folder, "write every trace into this folder")->option_text("FOLDER");
  auto* const trace = sub.add_option("--trace", study.listing,
                                     "print one of the papers' traces, made again: paper1-figure9, paper2-figure2, "
                                     "paper2-table4, paper4-table1, paper4-table2")
                          ->option_text("NAME");
  sub.add_flag("--negotiation-load", study.negotiation_load, "what negotiation costs the rest of the bus")
      ->excludes(trace);
  sub.add_option("--seed", options.seed, "with --negotiation-load: seed of the worlds");
  json_flag(sub, options);
}

void add_compare(CLI::App& sub, Options& options, StudyOptions& study) {
  sub.footer("Example:\n  berth compare --methods rand,planner-rand --devices 30 --bitrates 50,125 --plot plot.svg");
  const auto list = [&](const char* option, std::string& into, const char* help) {
    sub.add_option(option, into, help)->option_text("LIST");
  };
  list("--methods", study.methods, "of rand, and, fastscan, fastscan-feedback-29, … (default: all)");
  list("--devices", study.devices, "how many (default 1,5,30,120)");
  list("--bitrates", study.bit_rates, "kbit/s (default 50,125,1000)");
  list("--serials", study.serials, "of consecutive, random, mixed (default: all)");
  sub.add_option("--seeds", study.seeds, "trials a cell (default 3)")->check(CLI::Range(1, 100'000));
  sub.add_option("--threads", study.threads, "default: one a processor")->check(CLI::Range(1, 256));
  sub.add_option("--csv", study.csv, "write the table to this file")->option_text("FILE");
  sub.add_option("--plot", study.plot, "write a plot to this file")->option_text("FILE.svg");
  json_flag(sub, options);
}

}  // namespace

void add_study(CLI::App& app, Options& options, std::function<int()>& action) {
  const auto study = std::make_shared<StudyOptions>();
  using Run = int (*)(const Options&, const StudyOptions&);
  const auto command = [&](const char* name, const char* help, Run run) -> CLI::App& {
    auto* const sub = app.add_subcommand(name, help);
    // The callback owns the options: they live as long as the command line.
    sub->callback(
        [&options, &action, study, run] { action = [&options, study, run] { return run(options, *study); }; });
    return *sub;
  };
  add_trace(app, options, action);
  add_reproduce(command("reproduce", "the papers' figures: published, formula, simulated, Berth", run_reproduce),
                options, *study);
  add_compare(command("compare", "every way to find devices and give them node-IDs, side by side", run_compare),
              options, *study);
}

}  // namespace berth::cli
