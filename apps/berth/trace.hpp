/// `berth trace`: shows trace files and live buses as words or numbers, and converts formats.
///
/// - `trace_options.cpp`: the command line
/// - `trace_source.*`, `trace_ring.*`: where entries come from
/// - `trace_outlet.*`: where they go
/// - `trace_known.*`: what the machine file and the descriptions say
/// - `trace_nodes.*`: which node a row is about
/// - `trace.cpp`: the command
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "berth/decode/words.hpp"
#include "berth/od/notation.hpp"
#include "berth/trace/stream.hpp"
#include "options.hpp"

namespace berth::cli {

/// One end of a time range: as the log counts, or relative to its first frame.
struct TracePoint {
  std::chrono::nanoseconds at{};
  bool from_first = false;
};

struct TraceTime {
  std::optional<TracePoint> after, before;
  std::string shown;  ///< "relative", "absolute"; empty: relative on a terminal that shows a live source
};

/// Selects SDO transfers: by index, with or without sub-index, or by the first part of the object's name.
struct ObjectFilter {
  std::optional<od::ObjectWord> number;
  std::string name;
};

/// How a file is read.
struct TraceFrom {
  std::optional<trace::Format> format;  ///< empty: detect it from the content
  trace::ReadOptions how;
  bool ring = false;   ///< the ring of a running process with Studio
  std::string filter;  ///< of the ring: words as for Studio's trace filter
};

struct TraceOptions {
  std::string file;  ///< "-": standard input; empty: a live port
  TraceFrom from;
  // Where it goes; neither: words to standard output.
  std::optional<trace::Format> to;
  bool trc_1_1 = false;
  bool directions = true;
  std::string output;  ///< file; "-": standard output
  // What it is.
  std::vector<std::string> eds;  ///< FILE, or N=FILE
  bool stats = false;
  bool table = false;
  bool frames = false;  ///< every frame separately
  std::optional<std::uint32_t> bit_rate;
  // Which part of it.
  std::vector<std::string> nodes;  ///< node-IDs, paths, slots' names
  std::vector<decode::Service> services;
  std::vector<std::string> buses;
  std::string text;
  std::vector<ObjectFilter> objects;
  TraceTime time;
  // Live.
  bool follow = false;
  std::string port;
  bool quiet = false;  ///< no words while it records

  [[nodiscard]] bool filters_rows() const noexcept {
    return !nodes.empty() || !services.empty() || !text.empty() || !objects.empty();
  }
};

int run_trace(const Options& options, const TraceOptions& trace);

}  // namespace berth::cli
