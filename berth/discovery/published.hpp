/// The published procedures behind `Discovery`. Internal to `discovery`: `make` gives them.
#pragma once

#include "berth/discovery/auto.hpp"

namespace berth::discovery {

/// Paper 1's RAND, nine requests a device, with the paper's fixed window of 40 ms (30 ms after an answer it needs)
/// unless `Options::window` says another.
[[nodiscard]] std::unique_ptr<Discovery> make_rand(const Services& services);
/// AND. Devices whose whole LSS address was not told are not reported.
[[nodiscard]] std::unique_ptr<Discovery> make_and(const Services& services);
/// CiA 305 Fastscan, plain or with one form of feedback, paper 4's 10 ms after each request. Without an assigner it
/// ends `held` at the first device.
[[nodiscard]] std::unique_ptr<Discovery> make_fastscan(const Services& services, lss::Feedback feedback);

}  // namespace berth::discovery
