#include "berth/trace/pcap.hpp"

#include <fmt/format.h>

#include <chrono>

#include "berth/trace/lines.hpp"

namespace berth::trace {
namespace {

constexpr std::uint32_t magic_micros = 0xA1B2'C3D4;
constexpr std::uint32_t magic_nanos = 0xA1B2'3C4D;
constexpr std::size_t head_bytes = 24;
constexpr std::size_t packet_head = 16;

bool is_magic(std::uint32_t value) noexcept { return value == magic_micros || value == magic_nanos; }

}  // namespace

bool is_pcap(std::string_view head) noexcept {
  return head.size() >= 4 && (is_magic(u32_at(head, 0, false)) || is_magic(u32_at(head, 0, true)));
}

std::uint32_t PcapReader::u32(std::string_view bytes, std::size_t at) const noexcept {
  return u32_at(bytes, at, big_endian_);
}

void PcapReader::tell(Finding::Severity severity, std::string message) {
  sink_->finding({severity, file_, 0, 0, fmt::format("byte {}", offset_), std::move(message), {}});
}

void PcapReader::feed(std::string_view bytes, Sink& sink) {
  sink_ = &sink;
  if (over_) return;
  rest_ += bytes;
  std::size_t done = 0;
  while (!over_) {
    const std::size_t count = step(std::string_view(rest_).substr(done));
    if (count == 0) break;
    done += count;
    offset_ += count;
  }
  rest_.erase(0, over_ ? rest_.size() : done);
}

// How many bytes were used; 0: more are needed.
std::size_t PcapReader::step(std::string_view bytes) {
  if (!begun_) {
    if (bytes.size() < head_bytes) return 0;
    head(bytes);
    return head_bytes;
  }
  if (bytes.size() < packet_head) return 0;
  const std::uint32_t captured = u32(bytes, 8);
  if (captured > longest_packet) {
    tell(Finding::Severity::error,
         fmt::format("a packet of {} bytes is none of CAN: nothing after it is read", captured));
    over_ = true;
    return 0;
  }
  if (bytes.size() < packet_head + captured) return 0;
  packet(bytes.substr(0, packet_head + captured));
  return packet_head + captured;
}

void PcapReader::head(std::string_view bytes) {
  begun_ = true;
  big_endian_ = is_magic(u32_at(bytes, 0, true));
  if (!is_pcap(bytes)) {
    tell(Finding::Severity::error, "a pcap file begins with A1 B2 C3 D4, or that backwards");
    over_ = true;
    return;
  }
  nanoseconds_ = u32(bytes, 0) == magic_nanos;
  const std::uint32_t number = u32(bytes, 20) & 0xFFFFU;  // the upper bits are about checksums
  link_ = link_type_of(number);
  if (link_ == LinkType::other) {
    tell(Finding::Severity::error, fmt::format("link type {} is none of CAN's (227, 113): nothing is read", number));
    over_ = true;
    return;
  }
  buses_.emplace_back("can0");
}

void PcapReader::packet(std::string_view bytes) {
  const std::uint32_t fraction = u32(bytes, 4);
  entry_.at = std::chrono::seconds(u32(bytes, 0)) +
              (nanoseconds_ ? rt::Duration(fraction) : rt::Duration(std::chrono::microseconds(fraction)));
  entry_.direction = Direction::unknown;
  const auto taken = take_packet(link_, big_endian_, bytes.substr(packet_head), entry_);
  if (taken.frame) sink_->entry(entry_);
  if (!taken.wrong.empty()) tell(Finding::Severity::error, taken.wrong);
}

void PcapReader::finish(Sink& sink) {
  sink_ = &sink;
  if (rest_.empty()) return;
  tell(Finding::Severity::error, fmt::format("the file is cut short: {} bytes of a packet are there", rest_.size()));
  rest_.clear();
}

}  // namespace berth::trace
