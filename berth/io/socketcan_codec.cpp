#include "berth/io/socketcan_codec.hpp"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "berth/can/length.hpp"
#include "berth/can/ranges.hpp"

namespace berth::io {

static_assert(classic_size == CAN_MTU && fd_size == CANFD_MTU && most_filters == CAN_RAW_FILTER_MAX);
static_assert(can::extended_flag == CAN_EFF_FLAG);

namespace {

std::uint32_t id_of(std::span<const std::uint8_t> bytes) noexcept {
  std::uint32_t id = 0;
  std::memcpy(&id, bytes.data(), sizeof id);
  return id;
}

bool exists(const can::Frame& f) noexcept {
  if (f.id > (f.extended ? can::extended_mask : can::base_mask)) return false;
  return f.fd ? !f.remote && can::fd_dlc(f.size).has_value() : f.size <= CAN_MAX_DLEN;
}

}  // namespace

std::size_t encode_frame(const can::Frame& frame, KernelFrame& bytes) noexcept {
  if (!exists(frame)) return 0;
  const std::uint32_t id = frame.key() | (frame.remote ? CAN_RTR_FLAG : 0);
  std::memset(bytes.data(), 0, classic_size);
  std::memcpy(bytes.data(), &id, sizeof id);
  bytes[offsetof(canfd_frame, len)] = frame.size;
  const auto data = frame.bytes();
  if (!data.empty()) std::memcpy(bytes.data() + offsetof(canfd_frame, data), data.data(), data.size());
  if (!frame.fd) return classic_size;
  if (frame.size < CANFD_MAX_DLEN)
    std::memset(bytes.data() + offsetof(canfd_frame, data) + frame.size, 0, CANFD_MAX_DLEN - frame.size);
  bytes[offsetof(canfd_frame, flags)] =
      static_cast<std::uint8_t>(CANFD_FDF | (frame.brs ? CANFD_BRS : 0) | (frame.esi ? CANFD_ESI : 0));
  return fd_size;
}

std::optional<can::Frame> decode_frame(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != classic_size && bytes.size() != fd_size) return std::nullopt;
  const std::uint32_t id = id_of(bytes);
  if ((id & CAN_ERR_FLAG) != 0) return std::nullopt;
  can::Frame f;
  f.fd = bytes.size() == fd_size;
  f.extended = (id & CAN_EFF_FLAG) != 0;
  f.remote = (id & CAN_RTR_FLAG) != 0;
  f.id = id & CAN_EFF_MASK;
  f.size = bytes[offsetof(canfd_frame, len)];
  if (!exists(f)) return std::nullopt;
  if (f.fd) {
    const auto flags = bytes[offsetof(canfd_frame, flags)];
    f.brs = (flags & CANFD_BRS) != 0;
    f.esi = (flags & CANFD_ESI) != 0;
  }
  if (!f.remote) std::memcpy(f.data.data(), bytes.data() + offsetof(canfd_frame, data), f.size);
  return f;
}

std::optional<BusReport> decode_error(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() != classic_size) return std::nullopt;
  const std::uint32_t id = id_of(bytes);
  if ((id & CAN_ERR_FLAG) == 0) return std::nullopt;
  const auto data = bytes.subspan<offsetof(can_frame, data), CAN_MAX_DLEN>();
  BusReport r;
  // An overload frame is no error, although its class is that of the errors.
  const bool overload = (id & CAN_ERR_PROT) != 0 && data[2] == CAN_ERR_PROT_OVERLOAD;
  r.error = (id & (CAN_ERR_BUSERROR | CAN_ERR_ACK)) != 0 || ((id & CAN_ERR_PROT) != 0 && !overload);
  r.bus_off = (id & CAN_ERR_BUSOFF) != 0;
  r.restarted = (id & CAN_ERR_RESTARTED) != 0;
  const unsigned controller = (id & CAN_ERR_CRTL) != 0 ? data[1] : 0U;
  r.overflow = (controller & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
  // Before CAN_ERR_CNT (Linux 6.0), drivers wrote the counters without a flag that says so.
  r.counts = (id & CAN_ERR_CNT) != 0 || (controller != 0 && (data[6] != 0 || data[7] != 0));
  if (r.counts) {
    r.tec = data[6];
    r.rec = data[7];
  }
  if ((controller & (CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_PASSIVE)) != 0) {
    r.level = BusReport::Level::passive;
    const bool shows = r.tec >= CAN_ERROR_PASSIVE_THRESHOLD || r.rec >= CAN_ERROR_PASSIVE_THRESHOLD;
    if (!shows && (controller & CAN_ERR_CRTL_TX_PASSIVE) != 0) r.tec = CAN_ERROR_PASSIVE_THRESHOLD;
    if (!shows && (controller & CAN_ERR_CRTL_RX_PASSIVE) != 0) r.rec = CAN_ERROR_PASSIVE_THRESHOLD;
  } else if ((controller & (CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_RX_WARNING)) != 0) {
    r.level = BusReport::Level::warning;
    if (!r.counts && (controller & CAN_ERR_CRTL_TX_WARNING) != 0) r.tec = CAN_ERROR_WARNING_THRESHOLD;
    if (!r.counts && (controller & CAN_ERR_CRTL_RX_WARNING) != 0) r.rec = CAN_ERROR_WARNING_THRESHOLD;
  } else if ((controller & CAN_ERR_CRTL_ACTIVE) != 0) {
    r.level = BusReport::Level::active;
  }
  return r;
}

can::Frame error_frame(std::span<const std::uint8_t> bytes) noexcept {
  can::Frame report;
  report.id = id_of(bytes) & CAN_ERR_MASK;
  report.size = CAN_MAX_DLEN;
  std::memcpy(report.data.data(), bytes.data() + offsetof(can_frame, data), CAN_MAX_DLEN);
  return report;
}

// ---- filters ----

namespace {

constexpr std::uint32_t few = 8;  // blocks of up to this many identifiers are listed singly

struct Filters {
  std::vector<KernelFilter> singles;
  std::vector<KernelFilter> blocks;
  [[nodiscard]] std::size_t size() const noexcept {
    return singles.size() + blocks.size() + (singles.empty() ? 0 : 1);  // one more, for remote frames
  }
};

// Splits a range of one format into aligned blocks of powers of two.
void add_blocks(can::IdRange range, Filters& to) {
  const bool extended = (range.first & CAN_EFF_FLAG) != 0;
  const std::uint32_t id_mask = extended ? CAN_EFF_MASK : CAN_SFF_MASK;
  std::uint64_t first = range.first;
  const std::uint64_t end = std::uint64_t{range.last} + 1;
  while (first < end) {
    std::uint64_t size = std::bit_floor(end - first);
    const std::uint64_t id = first & id_mask;
    if (id != 0) size = std::min(size, id & (~id + 1));
    if (size <= few) {
      for (std::uint64_t i = 0; i < size; ++i)
        to.singles.push_back({static_cast<std::uint32_t>(first + i), id_mask | CAN_EFF_FLAG | CAN_RTR_FLAG});
    } else {
      const auto open = static_cast<std::uint32_t>(size - 1);
      to.blocks.push_back({static_cast<std::uint32_t>(first), (id_mask & ~open) | CAN_EFF_FLAG});
    }
    first += size;
  }
}

// False: it would take more than `most`.
bool add_all(std::span<const can::IdRange> ranges, bool extended, std::size_t most, Filters& to) {
  Filters these;
  for (const auto& r : ranges) {
    if (((r.first & CAN_EFF_FLAG) != 0) != extended) continue;
    add_blocks(r, these);
    if (these.size() > most) return false;
  }
  to.singles.insert(to.singles.end(), these.singles.begin(), these.singles.end());
  to.blocks.insert(to.blocks.end(), these.blocks.begin(), these.blocks.end());
  return true;
}

}  // namespace

std::vector<KernelFilter> kernel_filters(std::span<const can::IdRange> ranges, std::size_t most) {
  const auto wanted = can::normalised(ranges);
  Filters filters;
  if (!add_all(wanted, false, most - 2, filters)) filters.blocks.push_back({0, CAN_EFF_FLAG});
  // One filter may be needed for all extended frames, and one for remote frames.
  const std::size_t used = filters.size() + 1;
  if (!add_all(wanted, true, most > used ? most - used : 0, filters))
    filters.blocks.push_back({CAN_EFF_FLAG, CAN_EFF_FLAG});
  auto all = std::move(filters.singles);
  if (!all.empty()) all.push_back({CAN_RTR_FLAG, CAN_RTR_FLAG});
  all.insert(all.end(), filters.blocks.begin(), filters.blocks.end());
  return all;
}

// ---- times ----

namespace {
// Two clocks that are read one after the other differ little, unless one was set between this batch and the last. A
// smaller step shifts the times by as much.
constexpr std::int64_t step = 20'000'000;  // ns
constexpr rt::Duration offset_holds = std::chrono::milliseconds(100);
}  // namespace

void StampMap::begin(rt::Time loop, std::int64_t wall) noexcept {
  const std::int64_t offset = wall - loop.time_since_epoch().count();
  steady_ = !offset_ || std::abs(offset - *offset_) < step;
  offset_ = offset;
  learnt_ = loop_ = loop;
  wall_ = wall;
}

bool StampMap::begin_as_before(rt::Time loop, std::optional<std::int64_t> stamp) noexcept {
  if (!offset_ || !steady_ || !stamp || loop - learnt_ >= offset_holds) return false;
  const std::int64_t wall = *offset_ + loop.time_since_epoch().count();
  const rt::Duration age(wall - *stamp);
  if (age < rt::Duration{0} || age >= rt::Duration(step)) return false;
  loop_ = loop;
  wall_ = wall;
  return true;
}

rt::Time StampMap::at(std::optional<std::int64_t> stamp, rt::Time latest) noexcept {
  rt::Time at = loop_;
  if (stamp && steady_ && *stamp < wall_) at -= rt::Duration(wall_ - *stamp);
  return not_before(std::min(at, latest));
}

rt::Time StampMap::not_before(rt::Time time) noexcept {
  last_ = std::max(last_, time);
  return last_;
}

}  // namespace berth::io
