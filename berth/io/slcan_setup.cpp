#include "berth/io/slcan_setup.hpp"

#include <fmt/format.h>

namespace berth::io {

// The first C may only end a line that was broken off.
std::string_view SlcanSetup::begin(std::uint32_t bit_rate, const SlcanOptions& options) {
  bit_rate_ = bit_rate;
  data_bit_rate_ = options.data_bit_rate;
  listen_only_ = options.listen_only;
  opens_ = false;
  confirms_ = Confirms::nothing;
  answers_ = 0;
  return "C\rC\rV\r";
}

std::optional<SlcanSetup::Turn> SlcanSetup::hear(const SlcanLine& line) {
  using Kind = SlcanLine::Kind;
  const bool answer = line.kind == Kind::done || line.kind == Kind::refused;
  if (opens_) return answer ? std::optional(answered(line.kind == Kind::refused)) : std::nullopt;
  if (answer) ++answers_;
  const bool tells = line.kind == Kind::version || line.kind == Kind::text;
  if (tells) version_ = line.text;
  // Two answers to C, and one to V.
  return tells || answers_ == 3 ? std::optional(open()) : std::nullopt;
}

SlcanSetup::Turn SlcanSetup::silence() {
  if (opens_) return {.failure = "the adapter does not answer"};
  return open();
}

// By now it is known whether the adapter answers.
SlcanSetup::Turn SlcanSetup::open() {
  opens_ = true;
  steps_.clear();
  if (bit_rate_ != 0) steps_.push_back({slcan_rate(bit_rate_), fmt::format("it refuses {} bit/s", bit_rate_)});
  if (data_bit_rate_ != 0) {
    steps_.push_back({fmt::format("Y{}\r", data_bit_rate_ / 1'000'000),
                      fmt::format("it refuses {} bit/s in the data phase", data_bit_rate_)});
  }
  if (answers_ == 0) {
    steps_.push_back({listen_only_ ? "M1\r" : "M0\r", {}});
    steps_.push_back({"O\r", {}});
    Turn turn{.up = true};
    for (const auto& step : steps_) turn.say += step.command;
    return turn;
  }
  steps_.push_back({"z0003\r", {}});  // the adapter reports received frames and sent frames
  steps_.push_back(
      {listen_only_ ? "L\r" : "O\r", listen_only_ ? "it cannot listen only" : "it does not open its channel"});
  return {.say = steps_.front().command};
}

SlcanSetup::Turn SlcanSetup::answered(bool refused) {
  const Step step = steps_.front();
  steps_.pop_front();
  if (refused && !step.refusal.empty()) return {.failure = "the adapter: " + step.refusal};
  if (step.command[0] == 'z') confirms_ = refused ? Confirms::answers : Confirms::events;
  if (steps_.empty()) return {.up = true};
  return {.say = steps_.front().command};
}

}  // namespace berth::io
