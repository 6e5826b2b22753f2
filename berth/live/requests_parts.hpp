/// Identifiers of requests that only a master sends (docs/protocols). `live` does not link the rooms of these
/// protocols.
#pragma once

#include "berth/can/frame.hpp"

namespace berth::live {

inline constexpr std::uint32_t lss_requests = 0x7E5;
inline constexpr std::uint32_t rand_requests = can::extended_flag | 0x1F94'0000U;
inline constexpr std::uint32_t and_requests = 0x7C2;

}  // namespace berth::live
