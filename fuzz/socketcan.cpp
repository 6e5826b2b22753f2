// What comes out of a SocketCAN socket, and filters for any ranges. Input: a byte that says how the rest is taken.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "berth/can/ranges.hpp"
#include "berth/io/socketcan_codec.hpp"
#include "fuzz/require.hpp"

namespace socketcan_target {

namespace {

using namespace berth;
using fuzz::require;

void frame(std::span<const std::uint8_t> bytes) {
  const auto f = io::decode_frame(bytes);
  const auto e = io::decode_error(bytes);
  require(!(f && e));
  if (f) {
    io::KernelFrame again;
    const auto size = io::encode_frame(*f, again);
    require(size == bytes.size());
    const auto back = io::decode_frame({again.data(), size});
    require(back && *back == *f);
  }
  if (e && e->level == io::BusReport::Level::passive) require(e->tec > 127 || e->rec > 127);
}

void filters(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return;
  const std::size_t most = 4 + bytes[0];
  bytes = bytes.subspan(1);
  std::vector<can::IdRange> ranges(std::min<std::size_t>(bytes.size() / sizeof(can::IdRange), 64));
  if (!ranges.empty()) std::memcpy(ranges.data(), bytes.data(), ranges.size() * sizeof(can::IdRange));
  const auto made = io::kernel_filters(ranges, most);
  const auto wanted = can::normalised(ranges);
  require(made.size() <= most);
  const auto passes = [&made](std::uint32_t id) {
    return std::ranges::any_of(made, [id](const io::KernelFilter& f) { return (id & f.mask) == (f.id & f.mask); });
  };
  for (const auto& r : wanted) {
    require(r.first <= r.last && can::contains(wanted, r.first) && can::contains(wanted, r.last));
    require(passes(r.first) && passes(r.last) && passes(r.first + (r.last - r.first) / 2));
    require(passes(r.last | 0x4000'0000U));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const std::uint8_t> rest(data + 1, size - 1);
  if (data[0] % 2 == 0) {
    frame(rest);
  } else {
    filters(rest);
  }
  return 0;
}

}  // namespace socketcan_target
