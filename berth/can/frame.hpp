/// One CAN frame: classic or FD, base (11 bit) or extended (29 bit), data or remote.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace berth::can {

/// Marks an extended identifier where an identifier is one number (`Frame::key`, `IdRange`); SocketCAN uses the same
/// bit.
inline constexpr std::uint32_t extended_flag = 0x8000'0000U;
inline constexpr std::uint32_t base_mask = 0x7FFU;
inline constexpr std::uint32_t extended_mask = 0x1FFF'FFFFU;

/// All of a frame except its data, in one word that is written and copied in one piece. A processor that loads eight
/// bytes just after they were stored one by one waits until all are in its cache.
struct FrameHead {
  std::uint32_t id = 0;   ///< 0..7FFh or, when `extended`, 0..1FFF FFFFh
  std::uint8_t size = 0;  ///< bytes: 0..8, FD also 12, 16, 20, 24, 32, 48, 64
  bool extended = false;  ///< 29-bit format (IDE)
  bool remote = false;    ///< remote frame (RTR): `size` is the DLC asked for, no data on the wire
  bool fd : 1 = false;    ///< FD format (FDF); never remote
  bool brs : 1 = false;   ///< FD: data phase at the second bit rate
  bool esi : 1 = false;   ///< FD: sender is error passive

  friend bool operator==(const FrameHead&, const FrameHead&) noexcept = default;
};
static_assert(sizeof(FrameHead) == 8 && std::is_trivially_copyable_v<FrameHead>);

/// Copying copies only the bytes in use: a classic frame costs 16 bytes, not 72.
struct Frame : FrameHead {
  std::array<std::uint8_t, 64> data;  ///< only the first `size` bytes are valid

  Frame() noexcept { std::memset(data.data(), 0, 8); }
  Frame(const Frame& other) noexcept { *this = other; }
  Frame& operator=(const Frame& other) noexcept {
    static_cast<FrameHead&>(*this) = other;
    std::memcpy(data.data(), other.data.data(), 8);
    if (other.size > 8 && this != &other) [[unlikely]] {
      std::memcpy(data.data() + 8, other.data.data() + 8, other.size - 8U);
    }
    return *this;
  }
  ~Frame() = default;

  /// Makes it a classic data frame of so many bytes, in one store.
  void set_head(std::uint32_t key, std::uint8_t bytes) noexcept {
    if constexpr (std::endian::native == std::endian::little) {
      const std::uint64_t word =
          (key & ~extended_flag) | std::uint64_t{bytes} << 32U | std::uint64_t{key >> 31U} << 40U;
      static_cast<FrameHead&>(*this) = std::bit_cast<FrameHead>(word);
    } else {
      static_cast<FrameHead&>(*this) = {.id = key & ~extended_flag, .size = bytes, .extended = key >> 31U != 0};
    }
  }
  /// A data frame in base format. At most 8 bytes are taken.
  [[nodiscard]] static Frame base(std::uint32_t id, std::span<const std::uint8_t> bytes) noexcept {
    Frame f;
    f.set_head(id & base_mask, static_cast<std::uint8_t>(bytes.size() < 8 ? bytes.size() : 8));
    if (f.size > 0) std::memcpy(f.data.data(), bytes.data(), f.size);
    return f;
  }
  [[nodiscard]] static Frame base(std::uint32_t id, std::initializer_list<std::uint8_t> bytes) noexcept {
    return base(id, std::span(bytes.begin(), bytes.size()));
  }
  /// A data frame in extended format.
  [[nodiscard]] static Frame ext(std::uint32_t id, std::span<const std::uint8_t> bytes) noexcept {
    Frame f = base(0, bytes);
    f.set_head((id & extended_mask) | extended_flag, f.size);
    return f;
  }
  [[nodiscard]] static Frame ext(std::uint32_t id, std::initializer_list<std::uint8_t> bytes) noexcept {
    return ext(id, std::span(bytes.begin(), bytes.size()));
  }
  /// A remote frame in base format that asks for `dlc` bytes.
  [[nodiscard]] static Frame request(std::uint32_t id, std::uint8_t dlc) noexcept {
    Frame f;
    f.id = id & base_mask;
    f.remote = true;
    f.size = dlc < 8 ? dlc : std::uint8_t{8};
    return f;
  }

  /// The bytes on the wire: none for a remote frame.
  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept {
    return {data.data(), remote ? std::size_t{0} : size};
  }
  /// Identifier and format as one number, for acceptance filters and dispatch.
  [[nodiscard]] std::uint32_t key() const noexcept { return extended ? id | extended_flag : id; }

  friend bool operator==(const Frame& a, const Frame& b) noexcept {
    return a.key() == b.key() && a.remote == b.remote && a.fd == b.fd && a.brs == b.brs && a.size == b.size &&
           (a.remote || std::memcmp(a.data.data(), b.data.data(), a.size) == 0);
  }
};

/// candump's short form: `7E5#0401000000000000`, `1F940000#80000000`, `701#R1`. FD: `123##1AABB`.
[[nodiscard]] std::string to_string(const Frame& frame);
/// Parses the output of `to_string`; an identifier of more than three digits is extended.
[[nodiscard]] std::optional<Frame> parse_frame(std::string_view text);

/// Inclusive range of keys (`Frame::key`) that an acceptance filter passes.
struct IdRange {
  std::uint32_t first = 0;
  std::uint32_t last = 0;
  [[nodiscard]] constexpr bool contains(std::uint32_t key) const noexcept { return key >= first && key <= last; }
  friend constexpr bool operator==(IdRange, IdRange) noexcept = default;
};
[[nodiscard]] constexpr IdRange only(std::uint32_t key) noexcept { return {key, key}; }
inline constexpr IdRange all_base{0, base_mask};
inline constexpr IdRange all_extended{extended_flag, extended_flag | extended_mask};

/// Bit rates in bit/s. CANopen's: 10, 20, 50, 125, 250, 500, 800 and 1000 kbit/s (CiA 301 §4.5).
struct BitRate {
  std::uint32_t nominal = 125'000;
  std::uint32_t data = 0;  ///< FD data phase, 0 = none
  friend constexpr bool operator==(BitRate, BitRate) noexcept = default;
};

}  // namespace berth::can
