#include "berth/studio/batch.hpp"

#include <algorithm>
#include <limits>

namespace berth::studio {
namespace {

void append(std::uint64_t value, unsigned bytes, std::string& out) {
  for (unsigned i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8U * i) & 0xFFU);
}

std::int64_t microseconds(const RingFrame& frame) noexcept { return frame.at.time_since_epoch().count() / 1000; }

}  // namespace

// Only overwritten frames can be missing, and the oldest are overwritten first: the rest has no gap.
std::uint64_t append_batch(const FrameRing& ring, std::uint64_t first, std::uint64_t end, std::string& out) {
  end = std::min(end, first + 65'535U);
  RingFrame frame;
  std::uint64_t missing = 0;
  while (first < end && !ring.read(first, frame)) ++first, ++missing;
  if (first == end) return missing;
  const std::size_t head = out.size();
  append(1, 1, out);  // kind
  append(1, 1, out);  // version
  append(0, 2, out);  // count, set below
  append(0, 4, out);
  append(first, 8, out);
  append(static_cast<std::uint64_t>(frame.at.time_since_epoch().count()), 8, out);
  std::uint64_t count = 0;
  std::int64_t before = microseconds(frame);
  for (auto n = first; n < end; ++n, ++count) {
    if (!ring.read(n, frame)) break;  // overwritten meanwhile: counted as missing
    // The times of two buses may be slightly out of order.
    const auto step =
        std::clamp<std::int64_t>(microseconds(frame) - before, 0, std::numeric_limits<std::uint32_t>::max());
    before += step;
    append(static_cast<std::uint64_t>(step), 4, out);
    append(frame.frame.id | (frame.frame.extended ? 1U << 31U : 0U) | (frame.frame.remote ? 1U << 30U : 0U) |
               (frame.error ? 1U << 29U : 0U),
           4, out);
    append(frame.bus, 1, out);
    const auto bytes = frame.frame.bytes();
    append(frame.frame.size | (frame.own ? 0x80U : 0U) | (frame.cut ? 0x10U : 0U), 1,
           out);  // for a remote frame, the requested length
    out.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  }
  out[head + 2] = static_cast<char>(count & 0xFFU);
  out[head + 3] = static_cast<char>(count >> 8U);
  return missing + (end - first - count);
}

}  // namespace berth::studio
