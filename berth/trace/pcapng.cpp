#include "berth/trace/pcapng.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "berth/base/bytes.hpp"
#include "berth/trace/captured.hpp"
#include "berth/trace/lines.hpp"

namespace berth::trace {
namespace {

constexpr std::uint32_t section_header = 0x0A0D'0D0A;
constexpr std::uint32_t interface_description = 1;
constexpr std::uint32_t obsolete_packet = 2;
constexpr std::uint32_t simple_packet = 3;
constexpr std::uint32_t enhanced_packet = 6;
constexpr std::uint32_t byte_order_magic = 0x1A2B'3C4D;
constexpr std::size_t most_interfaces = 65'536;  // of which few are CAN

constexpr std::size_t padded(std::size_t size) noexcept { return (size + 3) & ~std::size_t{3}; }
std::uint8_t byte_at(std::string_view bytes, std::size_t at) noexcept { return static_cast<std::uint8_t>(bytes[at]); }
std::uint32_t big_u32(std::string_view bytes, std::size_t at) noexcept {
  return static_cast<std::uint32_t>(byte_at(bytes, at)) << 24 |
         static_cast<std::uint32_t>(byte_at(bytes, at + 1)) << 16 |
         static_cast<std::uint32_t>(byte_at(bytes, at + 2)) << 8 | byte_at(bytes, at + 3);
}
std::uint32_t little_u32(std::string_view bytes, std::size_t at) noexcept {
  return static_cast<std::uint32_t>(byte_at(bytes, at + 3)) << 24 |
         static_cast<std::uint32_t>(byte_at(bytes, at + 2)) << 16 |
         static_cast<std::uint32_t>(byte_at(bytes, at + 1)) << 8 | byte_at(bytes, at);
}
bool looked_into(std::uint32_t type) noexcept {
  return type == section_header || type == interface_description || type == obsolete_packet || type == simple_packet ||
         type == enhanced_packet;
}

}  // namespace

std::uint16_t PcapngReader::u16(std::string_view bytes, std::size_t at) const noexcept {
  const unsigned a = byte_at(bytes, at);
  const unsigned b = byte_at(bytes, at + 1);
  return static_cast<std::uint16_t>(big_endian_ ? a << 8 | b : b << 8 | a);
}
std::uint32_t PcapngReader::u32(std::string_view bytes, std::size_t at) const noexcept {
  return big_endian_ ? big_u32(bytes, at) : little_u32(bytes, at);
}
std::uint64_t PcapngReader::u64(std::string_view bytes, std::size_t at) const noexcept {
  const std::uint64_t a = u32(bytes, at);
  const std::uint64_t b = u32(bytes, at + 4);
  return big_endian_ ? a << 32 | b : b << 32 | a;
}

void PcapngReader::tell(Finding::Severity severity, std::string message, std::string fix) {
  sink_->finding({severity, file_, 0, 0, fmt::format("byte {}", offset_), std::move(message), std::move(fix)});
}

void PcapngReader::feed(std::string_view bytes, Sink& sink) {
  sink_ = &sink;
  while (!bytes.empty()) {
    if (rest_.empty()) {
      bytes.remove_prefix(consume(bytes));
      rest_ = bytes;
      return;
    }
    const std::size_t more = std::min(needed_ - rest_.size(), bytes.size());
    rest_ += bytes.substr(0, more);
    bytes.remove_prefix(more);
    if (rest_.size() >= needed_) rest_.erase(0, consume(rest_));
  }
}

// Reads whole blocks from the front; the rest is shorter than `needed_`.
std::size_t PcapngReader::consume(std::string_view bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    std::size_t count = static_cast<std::size_t>(std::min<std::uint64_t>(passing_, bytes.size() - done));
    if (count > 0) {
      passing_ -= count;
    } else {
      count = step(bytes.substr(done));
      if (count == 0) break;
    }
    done += count;
    offset_ += count;
  }
  return done;
}

// Reads the first block of `bytes` and returns how many bytes were used; 0: `needed_` bytes are needed.
std::size_t PcapngReader::step(std::string_view bytes) {
  needed_ = 12;
  if (bytes.size() < needed_) return 0;
  if (lost_) {
    if (!plausible(bytes)) return 1;
    lost_ = false;
  }
  const bool begins = little_u32(bytes, 0) == section_header;
  if (begins) {
    if (little_u32(bytes, 8) != byte_order_magic && big_u32(bytes, 8) != byte_order_magic)
      return lose("a section's header without the byte order magic");
    big_endian_ = big_u32(bytes, 8) == byte_order_magic;
  } else if (!in_section_) {
    return lose("a pcapng file begins with a section header, 0A 0D 0D 0A");
  }
  const std::uint32_t type = u32(bytes, 0);
  const std::uint32_t length = u32(bytes, 4);
  if (length < 12 || length % 4 != 0) return lose(fmt::format("a block cannot have {} bytes", length));
  if (!looked_into(type)) {
    passing_ = length - 12;
    return 12;
  }
  if (length > longest_block) return lose(fmt::format("a block of {} bytes is more than packets of CAN need", length));
  needed_ = length;
  if (bytes.size() < length) return 0;
  const auto whole = bytes.substr(0, length);
  if (u32(whole, length - 4) != length)
    return lose(fmt::format("a block of {} bytes says at its end that it has {}", length, u32(whole, length - 4)));
  unsure_ = false;
  block(type, whole);
  return length;
}

std::size_t PcapngReader::lose(std::string message) {
  // On the way to the next block, something that only looked like a block is not reported.
  if (!unsure_)
    tell(Finding::Severity::error, std::move(message), "the reader goes on where the next block seems to begin");
  lost_ = unsure_ = true;
  return 1;
}

bool PcapngReader::plausible(std::string_view bytes) const noexcept {
  if (little_u32(bytes, 0) == section_header)
    return little_u32(bytes, 8) == byte_order_magic || big_u32(bytes, 8) == byte_order_magic;
  if (!in_section_) return false;
  const std::uint32_t type = u32(bytes, 0);
  const std::uint32_t length = u32(bytes, 4);
  return type != section_header && looked_into(type) && length >= 16 && length % 4 == 0 && length <= 4096;
}

void PcapngReader::block(std::uint32_t type, std::string_view block) {
  switch (type) {
    case section_header: return section(block);
    case interface_description: return interface(block);
    case enhanced_packet: return enhanced(block);
    case simple_packet: return simple(block);
    default: return obsolete(block);
  }
}

void PcapngReader::section(std::string_view block) {
  in_section_ = true;
  interfaces_.clear();
  if (block.size() < 28) return tell(Finding::Severity::error, "a section's header is too short");
  if (u16(block, 12) != 1)
    tell(Finding::Severity::warning,
         fmt::format("version {}.{} of pcapng, read as 1.0", u16(block, 12), u16(block, 14)));
}

// Calls `each(code, value)` for every option; `bytes` begins with them.
template <class F>
void PcapngReader::options(std::string_view bytes, F each) {
  while (bytes.size() >= 4) {
    const std::uint16_t code = u16(bytes, 0);
    const std::uint16_t length = u16(bytes, 2);
    if (code == 0) return;
    if (4 + padded(length) > bytes.size())
      return tell(Finding::Severity::warning, fmt::format("option {} is longer than its block", code));
    each(code, bytes.substr(4, length));
    bytes.remove_prefix(4 + padded(length));
  }
}

void PcapngReader::interface(std::string_view block) {
  if (block.size() < 20) {
    interfaces_.emplace_back();
    return tell(Finding::Severity::error, "an interface's description is too short");
  }
  if (interfaces_.size() >= most_interfaces)
    return tell(Finding::Severity::error, fmt::format("a section has at most {} interfaces", most_interfaces));
  Interface it;
  const std::uint16_t link_type = u16(block, 8);
  it.link = link_type_of(link_type);
  it.can = it.link != LinkType::other;
  it.snap_length = u32(block, 12);
  std::string name = fmt::format("can{}", interfaces_.size());
  options(block.substr(16, block.size() - 20), [&](std::uint16_t code, std::string_view value) {
    if (code == 2 && !value.empty()) name = value.substr(0, value.find('\0'));
    if (code == 9 && value.size() == 1) it.resolution = byte_at(value, 0);
    if (code == 14 && value.size() == 8) it.offset = static_cast<std::int64_t>(u64(value, 0));
  });
  if (!it.can) {
    tell(Finding::Severity::note,
         fmt::format("interface {} has link type {}, which is none of CAN's: its packets are left out", name,
                     link_type));
  } else {
    const auto known = std::find(buses_.begin(), buses_.end(), name);
    if (known == buses_.end() && buses_.size() >= LineReader::most_buses) {
      it.can = false;
      tell(Finding::Severity::error, fmt::format("a trace has at most {} buses", LineReader::most_buses));
    } else {
      it.bus = static_cast<std::uint16_t>(known - buses_.begin());
      if (known == buses_.end()) buses_.push_back(name);
    }
  }
  interfaces_.push_back(it);
}

void PcapngReader::enhanced(std::string_view block) {
  if (block.size() < 32) return tell(Finding::Severity::error, "an enhanced packet block is too short");
  const Packet found{.interface = u32(block, 8),
                     .time = static_cast<std::uint64_t>(u32(block, 12)) << 32 | u32(block, 16),
                     .captured = u32(block, 20),
                     .data = 28};
  entry_.direction = Direction::unknown;
  if (const std::size_t behind = 28 + padded(found.captured); behind + 8 <= block.size()) {
    options(block.substr(behind, block.size() - 4 - behind), [&](std::uint16_t code, std::string_view value) {
      if (code != 2 || value.size() != 4) return;
      const unsigned way = u32(value, 0) & 3U;
      entry_.direction = way == 1 ? Direction::received : way == 2 ? Direction::sent : Direction::unknown;
    });
  }
  packet(found, block);
}

void PcapngReader::simple(std::string_view block) {
  if (interfaces_.empty() || block.size() < 16)
    return tell(Finding::Severity::error, "a simple packet block without its interface");
  const std::uint32_t most = static_cast<std::uint32_t>(block.size() - 16);
  std::uint32_t captured = std::min(u32(block, 8), most);
  if (interfaces_[0].snap_length > 0) captured = std::min(captured, interfaces_[0].snap_length);
  entry_.direction = Direction::unknown;
  packet({.timed = false, .captured = captured, .data = 12}, block);
}

void PcapngReader::obsolete(std::string_view block) {
  if (block.size() < 32) return tell(Finding::Severity::error, "a packet block is too short");
  entry_.direction = Direction::unknown;
  packet({.interface = u16(block, 8),
          .time = static_cast<std::uint64_t>(u32(block, 12)) << 32 | u32(block, 16),
          .captured = u32(block, 20),
          .data = 28},
         block);
}

void PcapngReader::packet(const Packet& packet, std::string_view block) {
  if (packet.interface >= interfaces_.size())
    return tell(Finding::Severity::error,
                fmt::format("a packet of interface {}, which is not described", packet.interface));
  const Interface& it = interfaces_[packet.interface];
  if (!it.can) return;
  if (packet.captured > block.size() - 4 - packet.data)
    return tell(Finding::Severity::error, "a packet is longer than its block");
  if (packet.timed) {
    const auto at = time(it, packet.time);
    if (!at) return tell(Finding::Severity::error, "a packet's time does not fit into nanoseconds of 64 bits");
    entry_.at = *at;
  }
  entry_.bus = it.bus;
  const auto taken = take_packet(it.link, big_endian_, block.substr(packet.data, packet.captured), entry_);
  if (taken.frame) sink_->entry(entry_);
  if (!taken.wrong.empty()) tell(Finding::Severity::error, taken.wrong);
}

std::optional<rt::Duration> PcapngReader::time(const Interface& it, std::uint64_t count) const noexcept {
  std::uint64_t seconds = 0;
  std::uint64_t nanos = 0;
  if ((it.resolution & 0x80U) != 0) {
    unsigned bits = it.resolution & 0x7FU;
    if (bits > 63) return std::nullopt;
    seconds = count >> bits;
    std::uint64_t fraction = count & ((std::uint64_t{1} << bits) - 1);
    if (bits > 32) {
      fraction >>= bits - 32;
      bits = 32;
    }
    nanos = (fraction * 1'000'000'000) >> bits;
  } else {
    if (it.resolution > 19) return std::nullopt;
    std::uint64_t unit = 1;  // counts per second
    for (unsigned i = 0; i < it.resolution; ++i) unit *= 10;
    seconds = count / unit;
    const std::uint64_t fraction = count % unit;
    nanos = unit >= 1'000'000'000 ? fraction / (unit / 1'000'000'000) : fraction * (1'000'000'000 / unit);
  }
  if (seconds > static_cast<std::uint64_t>(most_seconds) || it.offset > most_seconds || it.offset < -most_seconds)
    return std::nullopt;
  const std::int64_t all = static_cast<std::int64_t>(seconds) + it.offset;
  if (all < 0 || all > most_seconds) return std::nullopt;
  return std::chrono::seconds(all) + std::chrono::nanoseconds(nanos);
}

void PcapngReader::finish(Sink& sink) {
  sink_ = &sink;
  if ((!rest_.empty() && !unsure_) || passing_ > 0) {
    tell(Finding::Severity::error,
         passing_ > 0 ? fmt::format("the file is cut short: {} bytes of a block are missing", passing_)
                      : fmt::format("the file is cut short: {} bytes of a block are there", rest_.size()));
  }
  rest_.clear();
  passing_ = 0;
}

namespace {

void put_u16(std::string& out, std::uint16_t value) {
  const char bytes[] = {static_cast<char>(value), static_cast<char>(value >> 8)};
  out.append(bytes, 2);
}
void put_u32(std::string& out, std::uint32_t value) {
  char bytes[4];
  std::memcpy(bytes, &value, 4);
  out.append(bytes, 4);
}
void put_option(std::string& out, std::uint16_t code, std::string_view value) {
  put_u16(out, code);
  put_u16(out, static_cast<std::uint16_t>(value.size()));
  out += value;
  out.append(padded(value.size()) - value.size(), '\0');
}
void put_block(std::string& out, std::uint32_t type, std::string_view body) {
  const auto length = static_cast<std::uint32_t>(12 + body.size());
  put_u32(out, type);
  put_u32(out, length);
  out += body;
  put_u32(out, length);
}

}  // namespace

void PcapngWriter::begin(std::string& out) {
  if (begun_) return;
  begun_ = true;
  std::string body;
  put_u32(body, byte_order_magic);
  put_u16(body, 1);
  put_u16(body, 0);
  body.append(8, '\xFF');  // the section's length is unknown
  put_option(body, 4, "berth");
  put_u32(body, 0);
  put_block(out, section_header, body);
}

std::uint32_t PcapngWriter::interface(std::uint16_t bus, std::string_view name, std::string& out) {
  if (bus < numbers_.size() && numbers_[bus] > 0) [[likely]]
    return numbers_[bus] - 1;
  if (bus >= numbers_.size()) numbers_.resize(bus + std::size_t{1});
  numbers_[bus] = ++interfaces_;
  std::string body;
  put_u16(body, link_type_can_socketcan);
  put_u16(body, 0);
  put_u32(body, 0);
  put_option(body, 2, name.substr(0, 60'000));
  put_option(body, 9, "\x09");
  put_u32(body, 0);
  put_block(out, interface_description, body);
  return interfaces_ - 1;
}

void PcapngWriter::write(const Entry& entry, std::string_view bus, std::string& out) {
  begin(out);
  const std::uint32_t number = interface(entry.bus, bus, out);
  const can::Frame& frame = entry.frame;
  const std::uint32_t bytes = frame.remote ? 0U : frame.size;
  const std::uint32_t captured = 8 + bytes;
  const bool directed = entry.direction != Direction::unknown;
  const std::uint32_t length = static_cast<std::uint32_t>(32 + padded(captured) + (directed ? 12U : 0U));
  if (entry.at.count() < 0) lose(Loss::time_before_zero);
  const auto nanos = static_cast<std::uint64_t>(std::max<std::int64_t>(entry.at.count(), 0));
  std::array<std::uint8_t, 128> block{};
  std::uint8_t* to = block.data();
  const auto put = [&](std::uint32_t value) {
    store_le(to, value);
    to += 4;
  };
  put(enhanced_packet);
  put(length);
  put(number);
  put(static_cast<std::uint32_t>(nanos >> 32));
  put(static_cast<std::uint32_t>(nanos));
  put(captured);
  put(captured);
  const std::uint32_t id = frame.id | (entry.error ? flag_error : 0U) | (frame.extended ? can::extended_flag : 0U) |
                           (frame.remote ? flag_remote : 0U);
  for (int shift = 24; shift >= 0; shift -= 8) *to++ = static_cast<std::uint8_t>(id >> shift);
  *to++ = frame.size;
  *to++ =
      static_cast<std::uint8_t>((frame.fd ? fd_format : 0U) | (frame.brs ? fd_brs : 0U) | (frame.esi ? fd_esi : 0U));
  to += 2;
  std::memcpy(to, frame.data.data(), bytes);
  to += padded(bytes);
  if (directed) {
    put(4U << 16 | 2U);
    put(entry.direction == Direction::received ? 1 : 2);
    put(0);
  }
  put(length);
  out.append(reinterpret_cast<const char*>(block.data()), length);
}

void PcapngWriter::finish(std::string& out) { begin(out); }

}  // namespace berth::trace
