// What must hold for any bytes that are given to a reader of traces: it ends, its entries can be written in every
// format, pieces of any size give the same, and what its own writer wrote is read again as it was.
#pragma once

#include <string_view>

#include "berth/trace/stream.hpp"
#include "fuzz/require.hpp"

namespace berth::fuzz {

class Counting final : public trace::Sink {
 public:
  void entry(const trace::Entry& entry) override { trace.entries.push_back(entry); }
  void finding(Finding finding) override {
    require(!to_string(finding).empty() && finding.line >= 0 && finding.column >= 0);
    if (finding.severity == Finding::Severity::error) ++errors;
    ++findings;
  }
  trace::Trace trace;
  std::size_t errors = 0;
  std::size_t findings = 0;
};

inline Counting read(trace::Format format, std::string_view bytes, std::size_t piece) {
  Counting counting;
  const auto reader = trace::make_reader(format, "fuzz");
  for (std::size_t at = 0; at < bytes.size(); at += piece) reader->feed(bytes.substr(at, piece), counting);
  reader->finish(counting);
  counting.trace.buses = reader->buses();
  return counting;
}

inline std::string write(trace::Format format, const trace::Trace& trace) {
  std::string bytes;
  const auto writer = trace::make_writer(format);
  for (const auto& e : trace.entries) writer->write(e, trace.buses[e.bus], bytes);
  writer->finish(bytes);
  return bytes;
}

inline void check(trace::Format format, std::string_view bytes) {
  const auto whole = read(format, bytes, bytes.size() + 1);
  const auto pieces = read(format, bytes, 1 + bytes.size() % 13);
  require(whole.trace == pieces.trace && whole.errors == pieces.errors && whole.findings == pieces.findings);
  for (const auto& e : whole.trace.entries) require(e.bus < whole.trace.buses.size() && e.frame.size <= 64);
  for (const trace::Format other : trace::all_formats) {
    const auto again = read(other, write(other, whole.trace), 4096);
    require(again.errors == 0 && again.trace.entries.size() == whole.trace.entries.size());
    if (other == trace::Format::pcapng)
      require(again.trace.entries == whole.trace.entries || whole.trace.buses.size() > 1);
  }
}

}  // namespace berth::fuzz
