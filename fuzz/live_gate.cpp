// Any frames from the bus and from the code above, any time between them: an observer and a reader keep to their roles,
// a commissioner sends no NMT start, reset or SYNC, a master sends nothing before it listened and nothing after a sign,
// and what is told about the other master is told of frames that were there.
#include "berth/live/gate.hpp"

#include "fuzz/bench_port.hpp"

namespace live_gate_target {

namespace {

using namespace berth;
using fuzz::require;

std::uint32_t key_of(fuzz::Input& in) {
  constexpr std::array<std::uint32_t, 8> telling{0x000, 0x071, 0x080, 0x601, 0x701, 0x77F, 0x7E5, 0x7C2};
  const std::uint8_t kind = in.byte();
  if (kind < 0xC0) return telling[kind % telling.size()];
  return kind < 0xE0 ? in.half() & can::base_mask : in.word();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input in(data, size);
  rt::Executor executor;
  fuzz::BenchPort port(executor);
  live::GateOptions options;
  options.role = static_cast<live::Role>(in.byte() % 4);
  options.listen = std::chrono::milliseconds(10);
  options.watch.own = NodeId(127);
  options.watch.tolerated = in.byte();
  live::Gate gate(executor, port, options);
  bool shut = false;
  bool ran = false;  // it has listened: an SDO request is a client's from then on, and no master's
  bool foreign = false;
  std::uint32_t signs = 0;
  port.on_sent = [&](const can::Frame& frame) {
    require(live::allowed(options.role, frame));
    require(executor.now() >= rt::Time{} + options.listen);
  };
  while (!in.empty()) {
    const std::uint8_t step = in.byte();
    if (step < 0x60) {
      const auto key = key_of(in);
      const can::Frame frame = in.frame(key);
      const auto sign = gate.watch().sign_of(frame);
      const bool counts = sign && !options.watch.tolerated[static_cast<std::size_t>(*sign)];
      ran = ran || gate.state() == live::GateState::open;
      port.hear(frame);
      if (counts) ++signs;
      const bool masters = counts && !(ran && *sign == live::Sign::sdo);
      foreign = foreign || masters;
      shut = shut || (masters && options.role == live::Role::master);
      require(gate.watch().foreign() == foreign);
    } else if (step < 0xC0) {
      const auto key = key_of(in);
      const can::Frame frame = in.frame(key);
      const auto queued = gate.send(frame, step);
      require(queued != can::Queued::yes || (!shut && live::allowed(options.role, frame)));
      if ((step & 3U) == 3U) gate.withdraw(step);
    } else {
      executor.advance(executor.now() + std::chrono::microseconds(in.half()));
    }
  }
  std::uint32_t told = 0;
  for (const auto& evidence : gate.watch().evidence()) {
    told += evidence.count;
    require(evidence.first <= evidence.last);
  }
  require(told == signs);
  const auto probably = gate.watch().probably();
  require(!probably.configured() || (probably.value() >= 1 && probably.value() <= 127));
  require(gate.report().empty() == !foreign);
  return 0;
}

}  // namespace live_gate_target
