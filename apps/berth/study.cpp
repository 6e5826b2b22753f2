// The words and options of `berth reproduce` and `berth compare`.
#include "study.hpp"

#include <fmt/format.h>

#include <memory>

#include "verbs.hpp"

namespace berth::cli {

void add_reproduce(Verb& berth, Options& options) {
  const auto study = std::make_shared<StudyOptions>();
  const Verb reproduce = berth.add("reproduce", "the papers' figures: published, formula, simulated, Berth",
                                   [&options, study] { return run_reproduce(options, *study); });
  reproduce.footer(
      "Examples:\n  berth reproduce --record traces\n  berth reproduce --bitrate 250000 --latency \"1 ms\"\n"
      "  berth reproduce --trace paper4-table1\n  berth reproduce --negotiation-load");
  reproduce.word("--bitrate", study->bit_rate, "instead of the papers'").from_to(10'000, 1'000'000).shown("BIT/S");
  const auto latency = [study](const std::string& text) {
    study->latency = text::parse_duration(text);
    if (study->latency && study->latency->count() >= 0 && *study->latency <= std::chrono::seconds(1)) {
      return std::string();
    }
    return fmt::format("\"{}\" is not a time up to 1 s; write \"4 ms\" or \"500 us\"", text);
  };
  reproduce.read("--latency", "TIME", latency, "of the devices' answers, instead of the papers'");
  reproduce.word("--record", study->folder, "write every trace into this folder").shown("FOLDER");
  const Word trace = reproduce
                         .word("--trace", study->listing,
                               "print one of the papers' traces, made again: paper1-figure9, paper2-figure2, "
                               "paper2-table4, paper4-table1, paper4-table2")
                         .shown("NAME");
  reproduce.flag("--negotiation-load", study->negotiation_load, "what negotiation costs the rest of the bus")
      .excludes(trace);
  reproduce.seed("--seed", options.sim.seed, "with --negotiation-load: seed of the worlds");
  json_flag(reproduce, options);
  force_word(reproduce, options);
}

void add_compare(Verb& berth, Options& options) {
  const auto study = std::make_shared<StudyOptions>();
  const Verb compare = berth.add("compare", "every way to find devices and give them node-IDs, side by side",
                                 [&options, study] { return run_compare(options, *study); });
  compare.footer("Example:\n  berth compare --methods rand,planner-rand --devices 30 --plot plot.svg");
  const auto list = [&compare](const char* option, std::string& into, const char* help) {
    compare.word(option, into, help).shown("LIST");
  };
  list("--methods", study->methods, "of rand, and, fastscan, fastscan-feedback-29, … (default: all)");
  list("--devices", study->devices, "how many (default 1,5,30,120)");
  list("--bitrates", study->bit_rates, "kbit/s (default 50,125,1000)");
  list("--serials", study->serials, "of consecutive, random, mixed (default: all)");
  compare.word("--seeds", study->seeds, "trials a cell (default 3)").from_to(1, 100'000);
  compare.word("--threads", study->threads, "default: one a processor").from_to(1, 256);
  compare.word("--csv", study->csv, "write the table to this file").shown("FILE");
  compare.word("--plot", study->plot, "write a plot to this file").shown("FILE.svg");
  json_flag(compare, options);
  force_word(compare, options);
}

}  // namespace berth::cli
