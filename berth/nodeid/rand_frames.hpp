/// The frames of RAND, the revision of the automatic node discovery protocol (paper 1 §II; S1.11 to S1.16, S1.23).
/// docs/rand.md has the whole wire format and the reasons for filling its gaps.
///
/// All are extended data frames. Masks and values are big-endian, as the paper prints them (`80 08 00 05`).
///
///     IURS  0x1F940000       80 phase mask_hi mask_lo      phase 0: mask 0; phase p: chunk(p-1)
///     DIRS  0x1F940000       80 08 mask_hi mask_lo         chunk(7)
///     IUS   0x1F500000 | chunk(p) << 2                     no data
///     DIS   0x1F900000 | chunk(7) << 2                     no data
///     switch identification state, ours:
///     global     0x1F940000  81 state 00 00                state 0 unknown, 1 identified
///     selective  0x1F940000  82..85 target 00 00 p3 p2 p1 p0   vendor, product, revision, serial, in this order
///     resume     0x1F940000  86 phase mask_hi mask_lo c3 c2 c1 c0   our extension: IURS and DIRS with the whole prefix
#pragma once

#include <cstdint>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"

namespace berth::nodeid {

inline constexpr std::uint32_t rand_request_id = 0x1F94'0000;  ///< 2021 (11 bit) || 0 (16 bit) || 0 (2 bit)
inline constexpr std::uint32_t ius_id = 0x1F50'0000;           ///< 2004 || chunk || 0
inline constexpr std::uint32_t dis_id = 0x1F90'0000;           ///< 2020 || chunk || 0
inline constexpr unsigned direct_phase = 8;                    ///< DIRS counts as phase 8 of IURS

/// The identifiers that a slave receives, and a master.
inline constexpr can::IdRange rand_requests = can::only(can::extended_flag | rand_request_id);
inline constexpr can::IdRange ius_answers{can::extended_flag | ius_id, can::extended_flag | ius_id | 0x3'FFFFU};
inline constexpr can::IdRange dis_answers{can::extended_flag | dis_id, can::extended_flag | dis_id | 0x3'FFFFU};

/// Whether the master knows a slave (S1.17). `selected`: matched every phase so far. The first two values are those in
/// the switch identification state frames.
enum class Identification : std::uint8_t { unknown = 0, identified = 1, selected = 2 };
[[nodiscard]] const char* name(Identification state) noexcept;

/// Phase 0..7; for phase 0 the mask is 0.
[[nodiscard]] can::Frame iurs(unsigned phase, std::uint16_t mask) noexcept;
[[nodiscard]] can::Frame dirs(std::uint16_t mask) noexcept;
[[nodiscard]] can::Frame ius(std::uint16_t chunk) noexcept;
[[nodiscard]] can::Frame dis(std::uint16_t chunk) noexcept;
/// `state`: unknown or identified.
[[nodiscard]] can::Frame switch_identification_global(Identification state) noexcept;
/// Frame 0..3 of 4. `target`: identified (the paper's service) or unknown (ours: search for this device again).
[[nodiscard]] can::Frame switch_identification_selective(const LssAddress& address, unsigned part,
                                                         Identification target = Identification::identified) noexcept;

/// Extension: asks devices whose chunks 0..phase-1 equal the address's, regardless of earlier requests. Phase 0..7 is
/// answered like IURS, 8 like DIRS. The last chunk is sent as it is, the earlier ones as their CRC-32.
[[nodiscard]] can::Frame resume_request(unsigned phase, const LssAddress& address) noexcept;
/// CRC-32 (IEEE 802.3) of the first `chunks` chunks, big-endian; 0 chunks: 0.
[[nodiscard]] std::uint32_t prefix_check(const LssAddress& address, unsigned chunks) noexcept;

/// A decoded request, for the slave.
struct RandRequest {
  enum class Kind : std::uint8_t { identify, direct, switch_global, switch_selective, resume };
  Kind kind = Kind::identify;
  std::uint8_t phase = 0;                           ///< identify: 0..7; resume: 0..8
  std::uint16_t mask = 0;                           ///< identify, direct, resume
  Identification target = Identification::unknown;  ///< switch_global, switch_selective
  std::uint8_t part = 0;                            ///< switch_selective: 0..3
  std::uint32_t value = 0;                          ///< switch_selective; resume: the prefix's check
};
/// Accepted: IURS, DIRS and switch global with DLC 4, or DLC 8 with reserved bytes of 0 (the paper says both; S1.13);
/// selective and resume with DLC 8. Else empty.
[[nodiscard]] std::optional<RandRequest> decode_rand_request(const can::Frame& frame) noexcept;

/// A decoded answer, for the master.
struct RandAnswer {
  bool direct = false;  ///< DIS
  std::uint16_t chunk = 0;
};
/// IUS or DIS: extended data frame with the two low bits 0. Data bytes are ignored (the paper's §IV counts four in
/// DIS; S1.16).
[[nodiscard]] std::optional<RandAnswer> decode_rand_answer(const can::Frame& frame) noexcept;

}  // namespace berth::nodeid
