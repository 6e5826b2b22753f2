// Any frames and pauses at the NMT slave, both sides of guarding, heartbeat producer and consumer: the slave's state is
// what the commands for it make of it, supervision reports what can be, and afterwards the node boots and starts.
#include "berth/co/nmt_slave.hpp"

#include "berth/co/cob_id.hpp"
#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "fuzz/bench_port.hpp"

namespace nmt_target {

namespace {

using namespace berth;
using fuzz::require;
using std::chrono::microseconds;
using std::chrono::milliseconds;

constexpr NodeId own(5);

struct Node final : co::NmtSlave::Owner,
                    co::GuardingSlave::Observer,
                    co::GuardingMaster::Observer,
                    co::HeartbeatConsumer::Observer {
  Node() { slave.power_on(); }
  void reset(co::NmtReset, rt::Time) noexcept override {
    producer.stop();
    guarded.stop();
    slave.initialised(own);
  }
  void state_changed(NmtState from, NmtState to, rt::Time) noexcept override {
    require(from != to);
    if (from == NmtState::initialising) {
      producer.start(own, to);
      guarded.start(own, to);
    }
    producer.set_state(to);
    guarded.set_state(to);
  }
  void life_guarding(bool lost, rt::Time) noexcept override {
    require(lost == guarded.lost());
    if (lost) slave.apply_error_behaviour(0);
  }
  void guarding(const co::GuardingEvent& event, rt::Time) noexcept override { require(event.node.configured()); }
  void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override {
    using Kind = co::HeartbeatEvent::Kind;
    require(event.node.configured());
    require(event.supervised || event.kind == Kind::boot_up);
    if (event.kind == Kind::lost) require(consumer.lost(event.node));
    if (event.kind == Kind::recovered || event.kind == Kind::started) require(!consumer.lost(event.node));
  }

  rt::Executor executor;
  fuzz::BenchPort port{executor};
  can::Dispatcher dispatcher{executor, port};
  co::HeartbeatProducer producer{dispatcher};
  co::GuardingSlave guarded{dispatcher, *this};
  co::GuardingMaster master{dispatcher, *this};
  co::HeartbeatConsumer consumer{dispatcher, *this, 8};
  co::NmtSlave slave{dispatcher, *this};
};

// What CiA 301 §7.2.8.2.1 makes of a command; resets lead back to pre-operational once the boot-up message is queued.
void command(Node& node, const can::Frame& frame) {
  const NmtState before = node.slave.state();
  node.port.hear(frame);
  const bool heard = frame.key() == 0 && !frame.remote && !frame.fd && frame.size == 2 &&
                     (frame.data[1] == 0 || frame.data[1] == own.value()) && before != NmtState::initialising;
  NmtState after = before;
  if (heard) {
    switch (frame.data[0]) {
      case 0x01: after = NmtState::operational; break;
      case 0x02: after = NmtState::stopped; break;
      case 0x80: after = NmtState::pre_operational; break;
      case 0x81:
      case 0x82:
        return require(node.slave.state() == NmtState::pre_operational || node.port.refuses || node.port.capacity < 32);
      default: break;
    }
  }
  require(node.slave.state() == after);
}

void act(Node& node, fuzz::Input& in) {
  const std::uint8_t kind = in.byte();
  switch (kind & 15U) {
    case 0: return command(node, in.frame(0));
    case 1: return command(node, can::Frame::base(0, {in.byte(), static_cast<std::uint8_t>(kind >> 4)}));
    case 2:
    case 3: return node.port.hear(in.frame(0x700U + (kind >> 4)));
    case 4: return node.port.hear(in.frame(in.word() & (can::extended_flag | can::extended_mask)));
    case 5: return (void)node.consumer.set_entry(kind >> 4, in.word() & 0x010F'03FFU);
    case 6: return node.consumer.supervise(NodeId(static_cast<std::uint8_t>(1 + (kind >> 4))), milliseconds(in.byte()));
    case 7: return node.producer.set_period(milliseconds(in.byte()));
    case 8: return node.guarded.set_life_time(milliseconds(in.byte()), kind >> 4);
    case 9:
      return node.master.guard(NodeId(static_cast<std::uint8_t>(1 + (kind >> 4))), milliseconds(1 + in.byte()),
                               static_cast<std::uint8_t>(1 + in.byte() % 4));
    case 10: return node.master.end(NodeId(static_cast<std::uint8_t>(1 + (kind >> 4))));
    case 11: return node.consumer.set_never_seen_time(milliseconds(in.byte()));
    case 12: return node.executor.advance(node.executor.now() + microseconds(in.half()));
    case 13: return node.executor.advance(node.executor.now() + milliseconds(in.byte()));
    case 14:
      node.port.refuses = (kind & 0x30U) == 0x10;
      node.port.capacity = (kind & 0xC0U) == 0x40 ? 1 : 32;
      if ((kind & 0x30U) == 0x20) node.consumer.clear();
      if ((kind & 0x30U) == 0x30) node.consumer.hear_all_boot_ups((kind & 0x40U) != 0);
      return;
    default: return node.slave.apply_error_behaviour(in.byte() % 4);
  }
}

void check(Node& node) {
  node.port.refuses = false;
  node.port.capacity = 32;
  node.producer.set_period({});
  for (std::uint8_t n = 1; n <= 16; ++n) node.master.end(NodeId(n));
  node.executor.advance(node.executor.now() + milliseconds(200));  // a boot-up message may still have to go
  std::vector<can::Frame> log;
  node.port.on_sent = [&log](const can::Frame& frame) { log.push_back(frame); };
  node.port.hear(can::Frame::base(0, {0x81, own.value()}));
  node.executor.advance(node.executor.now() + milliseconds(10));
  require(log.size() == 1 && log[0] == can::Frame::base(0x705, {0}));
  require(node.slave.state() == NmtState::pre_operational);
  node.port.hear(can::Frame::base(0, {0x01, 0}));
  require(node.slave.state() == NmtState::operational);
  node.guarded.set_heartbeat_active(false);
  node.port.hear(can::Frame::request(0x705, 1));
  node.executor.advance(node.executor.now() + milliseconds(1));
  require(log.size() == 2 && log[1] == can::Frame::base(0x705, {0x05}));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input in(data, size);
  Node node;
  node.executor.advance(node.executor.now() + milliseconds(1));
  require(node.slave.state() == NmtState::pre_operational);
  while (!in.empty()) act(node, in);
  check(node);
  return 0;
}

}  // namespace nmt_target
