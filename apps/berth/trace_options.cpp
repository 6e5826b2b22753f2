// The words and options of `berth trace`.
#include <fmt/format.h>

#include <charconv>
#include <memory>

#include "berth/text/quantity.hpp"
#include "trace.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

// In seconds: "1436509052.25" by the log's clock, "+2.5" from its first frame.
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

void point_word(const Verb& verb, const char* name, std::optional<TracePoint>& into, const char* help) {
  const auto read = [&into](const std::string& text) {
    into = parse_point(text);
    return into
               ? std::string()
               : fmt::format("\"{}\" is not a time; write seconds as the log does, or +2.5 from its first frame", text);
  };
  verb.read(name, "SECONDS", read, help);
}

void format_word(const Verb& verb, const char* name, const char* help, std::function<bool(const std::string&)> take,
                 const char* words) {
  const auto read = [take = std::move(take), words](const std::string& text) {
    return take(text) ? std::string() : fmt::format("there is no format \"{}\"; there are {}", text, words);
  };
  verb.read(name, "FORMAT", read, help);
}

void add_formats(const Verb& verb, TraceOptions& trace) {
  format_word(
      verb, "--from", "format of the file (default: by its content)",
      [&trace](const std::string& text) {
        trace.from.format = trace::parse_format(text);
        return trace.from.format.has_value();
      },
      "candump, pcapng, asc, trc and pcap");
  format_word(
      verb, "--to", "convert: candump, pcapng, asc, trc or trc1.1 (default: by the ending of -o)",
      [&trace](const std::string& text) {
        trace.trc_1_1 = text == "trc1.1";
        trace.to = trace::parse_format(trace.trc_1_1 ? "trc" : text);
        return trace.to && trace::is_written(*trace.to);
      },
      "candump, pcapng, asc, trc and trc1.1");
  verb.flag("--deltas", trace.from.how.deltas, "candump -td: each time counts from the line before");
  verb.word("--output,-o,--record", trace.output, "write the frames to this file (- for standard output)")
      .shown("FILE");
  verb.flag(
      "--no-directions", [&trace] { trace.directions = false; },
      "--to candump: without R and T after the frames, which some readers do not know");
}

void add_filters(const Verb& verb, TraceOptions& trace) {
  verb.word("--node", trace.nodes,
            "only these nodes' frames: a node-ID, with --machine a slot; 3/5: also what gateway 3 carries for it")
      .shown("NODE,...")
      .separated_by(',')
      .one_each();
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
  verb.read_each("--service", "SERVICE...", service, "only these: sdo, pdo, nmt, emcy, lss, heartbeat, ...")
      .separated_by(',')
      .one_each();
  const auto object = [&trace](const std::string& text) {
    const auto number = od::read_object(text);
    if (!number && number.error().kind != od::NoObject::Kind::other) return number.error().why;
    trace.objects.push_back({number ? std::optional(*number) : std::nullopt, text});
    return std::string();
  };
  verb.read_each("--object", "OBJECT...", object,
                 "only SDO transfers and PDOs of these: 1018h, 1018h:04, or the beginning of a name that the row shows")
      .one_each();
  verb.word("--text", trace.text, "only rows whose words have this, in either case").shown("WORD");
  verb.word("--bus", trace.buses, "only these buses: as the log names them, or the machine file")
      .shown("BUS...")
      .one_each();
  point_word(verb, "--after", trace.time.after,
             "only from this time on: as the log counts, or +2.5 from its first frame");
  point_word(verb, "--before", trace.time.before, "only up to this time");
}

void add_forms(const Verb& verb, TraceOptions& trace) {
  const Word stats = verb.flag("--stats", trace.stats, "frames, bits, periods, jitter and load, by identifier");
  verb.flag("--table", trace.table, "number, identifier, details, raw message, with tabs between").excludes(stats);
  verb.flag("--frames", trace.frames, "every frame by itself: SDO transfers are not folded into one row");
  verb.word("--times", trace.time.shown,
            "of rows in words: from the first frame, or as the log counts (default: relative where a live source is "
            "shown on a terminal)")
      .one_of(std::vector<std::string>{"relative", "absolute"});
  colour_word(verb);
}

}  // namespace

void add_trace(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<TraceOptions>();
  const Verb trace = berth.add("trace", "a trace file or a live bus: in words, in numbers, in another format",
                               [&options, wanted] { return run_trace(options, *wanted); });
  trace.footer(
      "Examples:\n  berth trace run.log\n  berth trace run.log --machine machine.toml --service sdo,emcy\n"
      "  berth trace run.log --eds 5=sensor.eds --node 5\n  berth trace run.log --machine machine.toml --node 3/5\n  "
      "berth trace run.pcapng --stats --bitrate 125000\n"
      "  berth trace run.asc -o run.pcapng\n  berth trace run.log --follow --text abort\n"
      "  berth trace --port socketcan:can0 -o run.log\n  berth trace machine.toml\n"
      "  berth trace machine.toml --ring --filter abort -o run.log\n"
      "The last two: the frames of the `berth up` that runs it, from now on, and those\nthat its Studio has kept.");
  trace.word("file", wanted->file, "candump, pcapng, Vector ASC or PEAK TRC; - for standard input").shown("FILE");
  add_formats(trace, *wanted);
  trace.word("--machine,-m", options.machine, "machine file: its slots' names, descriptions and configurations")
      .shown("MACHINE");
  reach_word(trace, options);
  force_word(trace, options);
  trace.word("--eds", wanted->eds, "description of a node: N=FILE, or FILE with one --node")
      .shown("[N=]FILE")
      .one_each();
  add_forms(trace, *wanted);
  trace.word("--bitrate", wanted->bit_rate, "of the bus, for its load; of --port, to open it")
      .from_to(10'000, 1'000'000)
      .shown("BIT/S");
  add_filters(trace, *wanted);
  trace.flag("--follow,-f", wanted->follow, "go on when the file's end is reached, until Ctrl-C or --timeout");
  trace.word("--port", wanted->port, "listen on a live bus and send nothing: socketcan:can0, plant:PATH, ...")
      .shown("PORT");
  trace.flag("--ring", wanted->from.ring,
             "the last 1,048,576 frames, kept by the process that runs the machine with --studio");
  trace
      .word("--filter", wanted->from.filter,
            "with --ring: only frames that the filter of Studio's trace finds by these words")
      .shown("WORDS");
  control_word(trace, options);
  trace.flag("--quiet,-q", wanted->quiet, "with -o and a live source: no words");
  trace.time("--timeout", options.timeout, "end a live source after this time");
  json_flag(trace, options, "one JSON object a row; with --stats or a conversion one in all");
}

}  // namespace berth::cli
