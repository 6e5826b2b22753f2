/// The published procedures as `Discovery`. Internal to `discovery`: `make` returns them.
#pragma once

#include "berth/discovery/auto.hpp"

namespace berth::discovery {

/// Paper 1's RAND, nine requests per device, with the paper's fixed window of 40 ms (30 ms after an answer it needs)
/// unless `Options::window` is set.
[[nodiscard]] std::unique_ptr<Discovery> make_rand(const Services& services);
/// AND. Reports no device whose LSS address is incomplete.
[[nodiscard]] std::unique_ptr<Discovery> make_and(const Services& services);
/// CiA 305 Fastscan, plain or with one form of feedback, with paper 4's 10 ms after each request. Without an assigner
/// it ends `held` at the first device.
[[nodiscard]] std::unique_ptr<Discovery> make_fastscan(const Services& services, lss::Feedback feedback);

}  // namespace berth::discovery
