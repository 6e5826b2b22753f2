/// Frames of the ring as a file of a trace format: the answer to `GET /api/v1/trace`. Works in steps, so that the
/// thread can do other work in between, and the amount of unsent data is limited. Internal to room `studio`.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>
#include <vector>

#include "berth/studio/frame_ring.hpp"
#include "berth/studio/search.hpp"
#include "berth/trace/stream.hpp"

namespace berth::studio {

/// The range and the format.
struct TraceQuery {
  trace::Format format = trace::Format::candump;
  bool trc_1_1 = false;
  std::uint64_t from = 0;             ///< number of the first frame
  std::optional<std::uint64_t> to{};  ///< and of the last; empty: the newest
  std::string filter{};               ///< as in "frames"
};

/// "format=pcapng&from=10&to=20&filter=sdo%20605%23": candump, pcapng, asc, trc or trc1.1. The reason as text for
/// anything else.
[[nodiscard]] tl::expected<TraceQuery, std::string> parse_trace_query(std::string_view query);

class Export {
 public:
  /// Ring and names must outlive this. Later frames are not included.
  Export(const FrameRing& ring, const std::vector<std::string>& buses, const TraceQuery& query);
  /// Processes this number of frames and appends them in the file's format; true: that was the end. Frames overwritten
  /// meanwhile are omitted, and FD frames of which the ring only has the first 8 bytes.
  bool step(std::size_t frames, std::string& out);

 private:
  const FrameRing* ring_;
  const std::vector<std::string>* buses_;
  Matcher matcher_;
  std::unique_ptr<trace::Writer> writer_;
  std::uint64_t at_;    // the next to be processed
  std::uint64_t from_;  // the first to be written
  std::uint64_t end_;   // after the last
};

/// The ending of such a file's name, e.g. "pcapng".
[[nodiscard]] std::string_view ending_of(trace::Format format) noexcept;

}  // namespace berth::studio
