/// Frames of the ring as a file of a trace format: the answer to `GET /api/v1/trace`. Works in steps, so that the
/// thread does other things between them, and what waits to be sent has a bound. Inside of room `studio`.
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

/// What of the ring, and how.
struct TraceQuery {
  trace::Format format = trace::Format::candump;
  bool trc_1_1 = false;
  std::uint64_t from = 0;             ///< number of the first frame
  std::optional<std::uint64_t> to{};  ///< and of the last; empty: the newest
  std::string filter{};               ///< as of "frames"
};

/// "format=pcapng&from=10&to=20&filter=sdo%20605%23": candump, pcapng, asc, trc or trc1.1. A reason in words for
/// anything else.
[[nodiscard]] tl::expected<TraceQuery, std::string> parse_trace_query(std::string_view query);

class Export {
 public:
  /// Ring and names must stay. What comes after this moment is not looked at.
  Export(const FrameRing& ring, const std::vector<std::string>& buses, const TraceQuery& query);
  /// Looks at so many frames and appends what they are in the file; true: that was its end. What was overwritten
  /// meanwhile is left out, and so are FD frames of which the ring has only the first 8 bytes any more.
  bool step(std::size_t frames, std::string& out);

 private:
  const FrameRing* ring_;
  const std::vector<std::string>* buses_;
  Matcher matcher_;
  std::unique_ptr<trace::Writer> writer_;
  std::uint64_t at_;    // the next that is looked at
  std::uint64_t from_;  // the first that is written
  std::uint64_t end_;   // after the last
};

/// "pcapng" and the like: how such a file's name ends.
[[nodiscard]] std::string_view ending_of(trace::Format format) noexcept;

}  // namespace berth::studio
