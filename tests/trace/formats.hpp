// What the tests of the formats share: whole files through the streaming readers and writers.
#pragma once

#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "berth/trace/stream.hpp"

namespace berth::trace::test {

class Kept final : public Sink {
 public:
  void entry(const Entry& entry) override { trace.entries.push_back(entry); }
  void finding(Finding finding) override { findings.push_back(std::move(finding)); }
  [[nodiscard]] std::size_t count(Finding::Severity severity) const {
    std::size_t n = 0;
    for (const auto& f : findings) n += f.severity == severity ? 1 : 0;
    return n;
  }
  [[nodiscard]] std::size_t errors() const { return count(Finding::Severity::error); }
  [[nodiscard]] std::string text() const {
    std::string all;
    for (const auto& f : findings) all += to_string(f) + "\n";
    return all;
  }
  Trace trace;
  Findings findings;
};

// In pieces of `piece` bytes.
inline Kept read(Format format, std::string_view bytes, std::size_t piece = 1U << 20U) {
  Kept kept;
  const auto reader = make_reader(format, "t");
  for (std::size_t at = 0; at < bytes.size(); at += piece) reader->feed(bytes.substr(at, piece), kept);
  reader->finish(kept);
  kept.trace.buses = reader->buses();
  return kept;
}

struct Written {
  std::string bytes;
  std::vector<std::string> lost;
};

inline Written write(Format format, const Trace& trace, const WriteOptions& options = {}) {
  Written written;
  const auto writer = make_writer(format, options);
  for (const auto& e : trace.entries) writer->write(e, trace.buses[e.bus], written.bytes);
  writer->finish(written.bytes);
  written.lost = writer->lost();
  return written;
}

}  // namespace berth::trace::test
