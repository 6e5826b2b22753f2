#include "berth/research/negotiation_sender.hpp"

#include <algorithm>
#include <utility>

#include "berth/can/length.hpp"

namespace berth::research {
namespace {

constexpr std::uint32_t usual_bit_rate = 125'000;  // if the port does not know it
constexpr unsigned shortest_frame = 67;            // bits of an extended frame without data and without stuff bits
constexpr unsigned longest_frame = 78;             // bits of an extended frame without data, reachable

// An FD frame's data phase may be faster, which a port does not report: this is an upper bound in nominal bit times.
unsigned load_bits(const can::Frame& frame) noexcept {
  return frame.fd ? longest_frame + 10U * frame.size : can::exact_bits(frame);
}

}  // namespace

void HeardLoad::roll(rt::Time now) noexcept {
  for (unsigned i = 0; i <= buckets && now >= bucket_ends_; ++i) {
    bucket_ = (bucket_ + 1) % buckets;
    bits_[bucket_] = 0;
    bucket_ends_ = i == buckets ? now + bucket : bucket_ends_ + bucket;
  }
}

void HeardLoad::count(unsigned bits, rt::Time now) noexcept {
  roll(now);
  bits_[bucket_] += bits;
}

double HeardLoad::share(std::uint32_t bit_rate, rt::Time now) noexcept {
  roll(now);
  std::uint64_t sum = 0;
  for (const auto bits : bits_) sum += bits;
  const double seconds =
      std::chrono::duration<double>((buckets - 1) * bucket + (bucket - (bucket_ends_ - now))).count();
  return static_cast<double>(sum) / (seconds * bit_rate);
}

bool NegotiationSender::put(const can::Frame& frame) noexcept {
  queued_ = owner_->send(frame);
  if (queued_) ++frames_;
  return queued_;
}

void NegotiationSender::drop() noexcept {
  if (std::exchange(queued_, false)) owner_->withdraw();
}

void NegotiationSender::heard(const can::Frame& frame) noexcept { load_.count(load_bits(frame), executor_->now()); }

double NegotiationSender::load() noexcept {
  const auto rate = owner_->bit_rate();
  return load_.share(rate != 0 ? rate : usual_bit_rate, executor_->now());
}

rt::Duration NegotiationSender::frame_time() const noexcept {
  const auto rate = owner_->bit_rate();
  return rt::Duration(longest_frame * std::int64_t{1'000'000'000} / (rate != 0 ? rate : usual_bit_rate));
}

// From start to start it is at least the spacing.
rt::Duration NegotiationSender::pace() noexcept {
  const auto frame = frame_time();
  auto spacing = std::max(options_->spacing, 2 * frame);
  if (!options_->literal && load() > options_->load_limit) spacing *= 2;
  return spacing - frame * shortest_frame / longest_frame;
}

rt::Duration NegotiationSender::random(rt::Duration most) noexcept {
  return options_->literal ? rt::Duration::zero() : rt::Duration(random_.between(0, most.count()));
}

}  // namespace berth::research
