// What may be written behind `berth trace`.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <memory>

#include "berth/text/quantity.hpp"
#include "time_option.hpp"
#include "trace.hpp"

namespace berth::cli {
namespace {

// "1436509052.25": as the log counts; "+2.5": from its first frame. Seconds.
std::optional<TracePoint> parse_point(std::string text) {
  TracePoint point;
  point.from_first = text.starts_with('+');
  if (point.from_first) text.erase(0, 1);
  double seconds = 0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (bad != std::errc{} || end != text.data() + text.size() || !(seconds >= 0) || seconds > 9e9) return std::nullopt;
  point.at = std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e6 + 0.5) * 1000);
  return point;
}

void point_option(CLI::App& sub, const char* name, std::optional<TracePoint>& into, const char* help) {
  const auto read = [&into](const std::string& text) {
    into = parse_point(text);
    return into ? std::string()
                : fmt::format("\"{}\" is no time; write seconds as the log does, or +2.5 from its first frame", text);
  };
  sub.add_option_function<std::string>(
         name, [](const std::string&) {}, help)
      ->check(CLI::Validator(read, "SECONDS"));
}

void format_option(CLI::App& sub, const char* name, const char* help, std::function<bool(const std::string&)> take,
                   const char* words) {
  const auto read = [take = std::move(take), words](const std::string& text) {
    return take(text) ? std::string() : fmt::format("there is no format \"{}\"; there are {}", text, words);
  };
  sub.add_option_function<std::string>(
         name, [](const std::string&) {}, help)
      ->check(CLI::Validator(read, "FORMAT"));
}

void add_formats(CLI::App& sub, TraceOptions& trace) {
  format_option(
      sub, "--from", "format of the file (default: by its content)",
      [&trace](const std::string& text) {
        trace.from = trace::parse_format(text);
        return trace.from.has_value();
      },
      "candump, pcapng, asc and trc");
  format_option(
      sub, "--to", "convert: candump, pcapng, asc, trc or trc1.1 (default: by the ending of -o)",
      [&trace](const std::string& text) {
        trace.trc_1_1 = text == "trc1.1";
        trace.to = trace::parse_format(trace.trc_1_1 ? "trc" : text);
        return trace.to.has_value();
      },
      "candump, pcapng, asc, trc and trc1.1");
  sub.add_option("--output,-o,--record", trace.output, "write the frames to this file (- for standard output)")
      ->option_text("FILE");
  sub.add_flag_callback(
      "--no-directions", [&trace] { trace.directions = false; },
      "--to candump: without R and T behind the frames, which some readers do not know");
}

void add_filters(CLI::App& sub, TraceOptions& trace) {
  sub.add_option("--node", trace.nodes, "only these nodes' frames")
      ->check(CLI::Range(1, 127))
      ->option_text("N...")
      ->allow_extra_args(false);
  const auto service = [&trace](const std::string& text) {
    const auto found = decode::parse_service(text);
    if (found) {
      trace.services.push_back(*found);
      return std::string();
    }
    std::string names;
    for (std::size_t i = 0; i < decode::services; ++i)
      names += fmt::format("{}{}", i > 0 ? ", " : "", decode::name(static_cast<decode::Service>(i)));
    return fmt::format("there is no service \"{}\"; there are {}", text, names);
  };
  sub.add_option_function<std::vector<std::string>>(
         "--service", [](const std::vector<std::string>&) {}, "only these: sdo, pdo, nmt, emcy, lss, heartbeat, ...")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(CLI::Validator(service, "SERVICE..."));
  sub.add_option("--text", trace.text, "only rows whose words have this, in either case")->option_text("WORD");
  sub.add_option("--bus", trace.buses, "only these buses: as the log names them, or the machine file")
      ->option_text("BUS...")
      ->allow_extra_args(false);
  point_option(sub, "--after", trace.after, "only from this time on: as the log counts, or +2.5 from its first frame");
  point_option(sub, "--before", trace.before, "only up to this time");
}

}  // namespace

void add_trace(CLI::App& app, Options& options, std::function<int()>& action) {
  const auto trace = std::make_shared<TraceOptions>();
  auto* const sub = app.add_subcommand("trace", "a trace file or a live bus: in words, in numbers, in another format");
  sub->footer(
      "Examples:\n  berth trace run.log\n  berth trace run.log --machine machine.toml --service sdo,emcy\n"
      "  berth trace run.log --eds 5=sensor.eds --node 5\n  berth trace run.pcapng --stats --bitrate 125000\n"
      "  berth trace run.asc -o run.pcapng\n  berth trace run.log --follow --text abort\n"
      "  berth trace --port socketcan:can0 -o run.log");
  sub->add_option("file", trace->file, "candump, pcapng, Vector ASC or PEAK TRC; - for standard input")
      ->option_text("FILE");
  add_formats(*sub, *trace);
  sub->add_option("--machine", options.machine, "machine file: its slots' names, descriptions and configurations");
  sub->add_option("--eds", trace->eds, "description of a node: N=FILE, or FILE with one --node")
      ->option_text("[N=]FILE")
      ->allow_extra_args(false);
  auto* const stats = sub->add_flag("--stats", trace->stats, "frames, bits, periods, jitter and load, by identifier");
  auto* const table =
      sub->add_flag("--table", trace->table, "number, identifier, details, raw message, with tabs between");
  table->excludes(stats);
  sub->add_flag("--frames", trace->frames, "every frame by itself: SDO transfers are not folded into one row");
  sub->add_option("--bitrate", trace->bit_rate, "of the bus, for its load; of --port, to open it")
      ->check(CLI::Range(10'000, 1'000'000))
      ->option_text("BIT/S");
  add_filters(*sub, *trace);
  sub->add_flag("--follow,-f", trace->follow, "go on when the file's end is reached, until Ctrl-C or --timeout");
  sub->add_option("--port", trace->port, "listen on a live bus and send nothing: socketcan:can0, plant:PATH, ...")
      ->option_text("PORT");
  sub->add_flag("--quiet,-q", trace->quiet, "with -o and a live source: no words");
  time_option(
      *sub, "--timeout", [&options](std::chrono::nanoseconds time) { options.timeout = time; },
      "end a live source after this time");
  sub->add_flag("--json", options.json, "one JSON object a row; with --stats or a conversion one in all");
  sub->callback([&options, &action, trace] { action = [&options, trace] { return run_trace(options, *trace); }; });
}

}  // namespace berth::cli
