// Any frames at any times at an LSS slave: it answers only what CiA 305 lets it answer, and its values stay legal.
#include <cstdint>

#include "berth/lss/slave.hpp"
#include "fuzz/require.hpp"

namespace lss_slave_target {

namespace {

using namespace berth;
using fuzz::require;

struct Owner final : lss::SlaveOwner {
  std::optional<lss::StoreResult> store(const lss::Settings&) noexcept override { return result; }
  void wants_reset_communication() noexcept override { reset = true; }
  void switch_bit_rate(lss::BitRateIndex index) noexcept override { require(lss::bit_rate(index).has_value()); }
  void silence_over() noexcept override {}
  std::optional<lss::StoreResult> result = lss::StoreResult{};
  bool reset = false;
};

// HC3.1: only the whole serial number, in a request that nothing comes after.
void check_complete(const lss::Slave& slave, const can::Frame& request) {
  require(lss::value32(request) == slave.address().serial);
  require(request.data[5] == 0 && request.data[6] == 3 && (request.data[7] == 0 || request.data[7] > 3));
}

void check(const lss::Slave& slave, const can::Frame& request, lss::State before, const lss::Answers& answers) {
  const auto& answer = *answers;
  require(lss::is_lss(answer, lss::slave_cob_id));
  require(lss::is_lss(request, lss::master_cob_id));
  const auto cs = request.data[0];
  const auto expected = cs == 0x43 ? 0x44 : cs == 0x4B || cs == 0x51 ? 0x4F : cs == 0x4C ? 0x50 : cs;
  require(answer.data[0] == expected);
  if (cs == 0x4C) require(slave.unconfigured());
  if (cs != 0x43 && cs != 0x4B && cs != 0x4C && cs != 0x51) require(before == lss::State::configuration);
  if (cs == 0x51) require(slave.unconfigured() && before == lss::State::waiting);
  if (cs == 0x51 && slave.state() == lss::State::configuration) check_complete(slave, request);
  if (!answers.feedback()) return;
  require(cs == 0x51 && slave.state() == lss::State::waiting);
  const auto feedback = lss::decode_feedback(*answers.feedback(), lss::default_feedback_base);
  require(feedback && lss::feedback_frame(*feedback) == *answers.feedback());
}

}  // namespace

// Records of 10 bytes: what happens, its size, then 8 bytes of frame.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  rt::Executor executor;
  Owner owner;
  const lss::Feedback feedback = size == 0 ? lss::Feedback::none : static_cast<lss::Feedback>(data[0] % 3);
  lss::Slave slave(executor, owner, {.address = {1, 1, 0, 5}, .feedback = feedback}, {});
  slave.reset_communication();
  for (; size >= 10; data += 10, size -= 10) {
    const auto what = data[0];
    can::Frame frame = can::Frame::base((what & 0x80U) != 0 ? 0x123 : lss::master_cob_id, {data + 2, 8});
    if ((what & 0x40U) != 0) frame.size = data[1] % 9;
    frame.remote = (what & 0x30U) == 0x30;
    owner.result = (what & 1U) != 0 ? std::nullopt : std::optional(lss::StoreResult{data[1], data[1]});
    const auto before = slave.state();
    const bool silent = slave.silent();
    if (const auto answer = slave.handle(frame)) {
      require(!silent);
      check(slave, frame, before, answer);
    }
    if (owner.reset) {
      require(slave.initialising() && slave.pending().node_id.configured());
      slave.reset_communication();
      owner.reset = false;
    }
    switch ((what >> 1) & 7U) {
      case 0: executor.advance(executor.now() + std::chrono::milliseconds(data[1])); break;
      case 1: slave.reset_communication(); break;
      case 2: slave.power_on(slave.persistent()); break;
      case 3: static_cast<void>(slave.stored({data[1], 0})); break;
      default: break;
    }
    require(NodeId::make(slave.pending().node_id.value()).has_value());
    require(NodeId::make(slave.active().node_id.value()).has_value());
    require(lss::contains(lss::all_fixed_bit_rates, static_cast<unsigned>(slave.pending().bit_rate)));
  }
  return 0;
}

}  // namespace lss_slave_target
