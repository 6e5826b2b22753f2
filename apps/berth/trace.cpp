// `berth trace`: a recorded trace in words or in numbers.
#include "berth/study/words.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/text/file.hpp"
#include "berth/trace/candump.hpp"
#include "output.hpp"
#include "study.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

double seconds(rt::Duration time) { return std::chrono::duration<double>(time).count(); }

std::string key_text(std::uint32_t key) {
  const auto id = key & ~can::extended_flag;
  return key == id ? fmt::format("{:03X}", id) : fmt::format("{:08X}", id);
}

Json json_of(const Findings& findings) {
  Json all = Json::array();
  for (const auto& f : findings) {
    const char* const kinds[]{"note", "warning", "error"};
    all.push_back({{"severity", kinds[static_cast<int>(f.severity)]},
                   {"line", f.line},
                   {"column", f.column},
                   {"message", f.message}});
  }
  return all;
}

Json json_of(const trace::Trace& trace, std::uint16_t bus, const StudyOptions& study) {
  const auto all = trace::statistics(trace, bus);
  Json json{{"bus", trace.buses[bus]},
            {"frames", all.frames},
            {"bits", all.bits},
            {"fd_frames", all.fd_frames},
            {"first_s", seconds(all.first)},
            {"last_s", seconds(all.last)},
            {"span_s", seconds(all.span())},
            {"longest_gap_s", seconds(all.longest_gap)},
            {"bitrate", nullptr},
            {"load", nullptr},
            {"ids", Json::array()}};
  if (study.bit_rate) {
    json["bitrate"] = *study.bit_rate;
    json["load"] = all.load(*study.bit_rate);
  }
  for (const auto& id : all.ids)
    json["ids"].push_back({{"id", key_text(id.key)}, {"frames", id.frames}, {"bits", id.bits}});
  return json;
}

Json stats_json(const trace::Trace& trace, const StudyOptions& study) {
  Json buses = Json::array();
  for (std::uint16_t bus = 0; bus < trace.buses.size(); ++bus) buses.push_back(json_of(trace, bus, study));
  return buses;
}

void print_stats(const trace::Trace& trace, const StudyOptions& study) {
  if (trace.buses.empty()) print_line("no frames");
  for (std::uint16_t bus = 0; bus < trace.buses.size(); ++bus) {
    const auto all = trace::statistics(trace, bus);
    print_line(fmt::format("bus {}", trace.buses[bus]));
    print_line(fmt::format("  frames       {}", all.frames));
    print_line(fmt::format("  bits         {}{}", all.bits,
                           all.fd_frames > 0 ? fmt::format(" (without {} FD frames)", all.fd_frames) : ""));
    print_line(fmt::format("  first        {:.6f} s (end of the frame)", seconds(all.first)));
    print_line(fmt::format("  last         {:.6f} s", seconds(all.last)));
    print_line(fmt::format("  span         {:.6f} s", seconds(all.span())));
    print_line(fmt::format("  longest gap  {:.6f} s", seconds(all.longest_gap)));
    if (study.bit_rate)
      print_line(fmt::format("  load         {:.2f} % at {} bit/s", 100 * all.load(*study.bit_rate), *study.bit_rate));
    print_line(fmt::format("  {:<10}{:>10}{:>12}", "identifier", "frames", "bits"));
    for (const auto& id : all.ids)
      print_line(fmt::format("  {:<10}{:>10}{:>12}", key_text(id.key), id.frames, id.bits));
  }
}

Json frames_json(const trace::Trace& trace) {
  Json frames = Json::array();
  std::vector<study::Interpreter> interpreters(trace.buses.size());
  for (const auto& e : trace.entries) {
    frames.push_back({{"at_s", seconds(e.at)},
                      {"bus", trace.buses[e.bus]},
                      {"frame", can::to_string(e.frame)},
                      {"words", interpreters[e.bus].words(e.frame)}});
  }
  return frames;
}

void print_frames(const trace::Trace& trace) {
  std::vector<study::Interpreter> interpreters(trace.buses.size());
  for (const auto& e : trace.entries) {
    print_line(fmt::format("{:<58}  {}", trace::candump_line(e.at, trace.buses[e.bus], e.frame),
                           interpreters[e.bus].words(e.frame)));
  }
}

}  // namespace

int run_trace(const Options& options, const StudyOptions& study) {
  Findings unreadable;
  const auto text = text::read_file(study.file, unreadable);
  if (!text) return tell(failure(unreadable), options.json);
  const auto reading = trace::read_candump(*text, study.file);
  const int status = has_errors(reading.findings) ? Exit::usage : Exit::done;
  if (options.json) {
    Json json{{"file", study.file}, {"findings", json_of(reading.findings)}};
    if (study.stats) {
      auto buses = stats_json(reading.trace, study);
      if (buses.size() == 1) json.update(buses.front());
      json["buses"] = std::move(buses);
    } else {
      json["frames"] = frames_json(reading.trace);
    }
    print_line(json.dump(2, ' ', false, Json::error_handler_t::replace));
    return status;
  }
  for (const auto& finding : reading.findings) print_error(to_string(finding));
  if (study.stats) {
    print_stats(reading.trace, study);
  } else if (study.table) {
    print_lines(study::message_table(reading.trace));
  } else {
    print_frames(reading.trace);
  }
  return status;
}

}  // namespace berth::cli
