/// `berth trace`: trace files and live buses in words, in numbers, and from one format into another.
///
/// `trace_options.cpp` is the command line, `trace_source.*` (and `trace_ring.*`) where entries come from,
/// `trace_outlet.*` where they go, `trace_known.*` what the machine file and the descriptions know, `trace_nodes.*`
/// which node a row is about, `trace.cpp` the command.
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

/// One end of a time range: as the log counts, or from its first frame.
struct TracePoint {
  std::chrono::nanoseconds at{};
  bool from_first = false;
};

struct TraceTime {
  std::optional<TracePoint> after, before;
  std::string shown;  ///< "relative", "absolute"; empty: relative on a terminal that shows a live source
};

/// Which SDO transfers: by index, and sub-index if one is given, or by the beginning of the object's name.
struct ObjectFilter {
  std::optional<od::ObjectWord> number;
  std::string name;
};

/// How a file is read.
struct TraceFrom {
  std::optional<trace::Format> format;  ///< empty: by its content
  trace::ReadOptions how;
  bool ring = false;   ///< of a running process with Studio: what its ring has
  std::string filter;  ///< of the ring: what Studio's trace finds by these words
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
  bool frames = false;  ///< every frame by itself
  std::optional<std::uint32_t> bit_rate;
  // Which of it.
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
