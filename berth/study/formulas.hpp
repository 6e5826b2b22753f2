/// The formulas of papers 2 and 4, with frame lengths, time-out and bit rate as parameters (S2.3, S2.7, S2.16, S4.7,
/// S4.16, S4.17); paper 1's formulas are in `berth/nodeid/paper1_times.hpp`. Nothing here uses a simulation.
#pragma once

#include <cstdint>

#include "berth/rt/executor.hpp"

namespace berth::study {

/// Time of so many bits; `bit_rate` in bit/s.
[[nodiscard]] constexpr rt::Duration time_of(unsigned bits, std::uint32_t bit_rate) noexcept {
  return rt::Duration(static_cast<rt::Duration::rep>(bits) * 1'000'000'000 / bit_rate);
}

/// The usual bounds, 55 + 10 bits per data byte (base) and 80 (extended, no data).
inline constexpr unsigned lss_bits = 135;      ///< any LSS frame
inline constexpr unsigned boot_up_bits = 65;   ///< one data byte
inline constexpr unsigned feedback_bits = 80;  ///< paper 4's 29-bit feedback; RAND's IUS
inline constexpr unsigned negotiation_bits = 80;

/// Paper 4: one device found and configured by Fastscan, until its boot-up message.
struct Fastscan {
  std::uint32_t bit_rate = 125'000;                        ///< not printed; the printed times match it
  rt::Duration timeout = std::chrono::milliseconds(20);    ///< of each request
  rt::Duration response = std::chrono::microseconds(500);  ///< the device's, to configure node-ID
  rt::Duration store = std::chrono::milliseconds(5);       ///< the device's, to store configuration
  rt::Duration boot = std::chrono::milliseconds(5);        ///< from switch state global to the boot-up message
};
/// Table 1: 80h, then for each of the four parts 32 bits and one more request if bit 0 is 1 (S4.14).
inline constexpr unsigned table_1_requests = 132;
/// Table 2: 80h, then two for each part (S4.17).
inline constexpr unsigned table_2_requests = 9;
/// "It takes about 128 requests" (S2.3, S4.7).
inline constexpr unsigned about_128 = 128;

/// `requests` requests with their whole windows, without frames, as in the papers.
[[nodiscard]] constexpr rt::Duration scan_windows(unsigned requests, rt::Duration timeout) noexcept {
  return requests * timeout;
}
/// The same with the frames: a window begins after its request was sent.
[[nodiscard]] constexpr rt::Duration scan(unsigned requests, const Fastscan& f) noexcept {
  return requests * (time_of(lss_bits, f.bit_rate) + f.timeout);
}
/// Configure node-ID, store configuration, switch state global, boot-up (S4.18).
[[nodiscard]] constexpr rt::Duration configure(const Fastscan& f) noexcept {
  const auto frame = time_of(lss_bits, f.bit_rate);
  return frame + f.response + frame + frame + f.store + frame + frame + f.boot + time_of(boot_up_bits, f.bit_rate);
}

/// Paper 2: one negotiation without disturbance.
struct Negotiation {
  std::uint32_t bit_rate = 125'000;
  rt::Duration silence = std::chrono::milliseconds(100);  ///< before and after
  rt::Duration spacing = std::chrono::milliseconds(5);
  unsigned messages = 16;
};
/// From the request to the announcement: silence, the messages, silence; 275 ms (S2.16).
[[nodiscard]] constexpr rt::Duration cycle(const Negotiation& n) noexcept {
  return n.silence + (n.messages - 1) * n.spacing + n.silence;
}

/// Share of the 29 bits of an extended identifier that negotiation uses, and of all identifiers (S2.7).
inline constexpr double negotiation_bit_share = 13.0 / 29.0;
inline constexpr double negotiation_id_share = 8192.0 / 536'870'912.0;

}  // namespace berth::study
