// Any frames and pauses at a flying master: it sends nothing but frames of this service, becomes master only when its
// own 071h is on the wire, and afterwards, when all is silent, it becomes the active one.
#include "berth/manager/flying_master.hpp"

#include "fuzz/bench_port.hpp"

namespace flying_master_target {

namespace {

using namespace berth;
using namespace berth::manager;
using fuzz::require;
using std::chrono::milliseconds;
using std::chrono::seconds;
using State = FlyingNegotiation::State;

constexpr NodeId own(5);

struct Node final : FlyingMaster::Owner {
  void role_changed() noexcept override {
    if (flying.is_master() && !was_master) require(claims > 0);
    if (flying.is_master()) require(flying.active()->node == own);
    was_master = flying.is_master();
  }
  void reset_all() noexcept override {
    require(!all_reset);  // once
    all_reset = true;
    flying.end();
    begin();
  }
  void overheard(const co::NmtRequest&) noexcept override { require(flying.is_master()); }
  void begin() {
    require(flying.begin({.own = {1, own}}, [](NodeId) { return milliseconds(200); }).has_value());
  }

  rt::Executor executor;
  fuzz::BenchPort port{executor};
  can::Dispatcher dispatcher{executor, port};
  FlyingMaster flying{dispatcher, *this};
  unsigned claims = 0;
  bool was_master = false;
  bool all_reset = false;
};

void act(Node& node, fuzz::Input& in) {
  const std::uint8_t kind = in.byte();
  switch (kind & 7U) {
    case 0: return node.port.hear(in.frame(0x070U + (kind >> 4)));
    case 1: return node.port.hear(can::Frame::base(0x71, {static_cast<std::uint8_t>((kind >> 4) % 4), in.byte()}));
    case 2: return node.port.hear(can::Frame::base(0x072U + (kind >> 4) % 5, {}));
    case 3: return node.port.hear(can::Frame::base(0x700U + (kind >> 4), {static_cast<std::uint8_t>(in.byte() % 8)}));
    case 4: return node.port.hear(can::Frame::base(0, {in.byte(), static_cast<std::uint8_t>(kind >> 4)}));
    case 5: return node.executor.advance(node.executor.now() + milliseconds(in.byte()));
    case 6: return node.executor.advance(node.executor.now() + milliseconds(20) * in.byte());
    default:
      node.port.refuses = (kind & 0x30U) == 0x10;
      if ((kind & 0x30U) != 0x20) return;
      node.flying.end();
      node.was_master = false;
      return node.begin();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::Input in(data, size);
  Node node;
  node.port.on_sent = [&node](const can::Frame& frame) {
    const auto message = parse_flying(frame);
    require(message.has_value());
    if (message->service != FlyingService::active_master) return;
    ++node.claims;
    require(message->sender == MasterRank{1, own});
  };
  node.begin();
  while (!in.empty()) act(node, in);
  // Whatever was heard: nobody speaks any more, so the active master is lost, or does not answer.
  node.port.refuses = false;
  node.executor.advance(node.executor.now() + seconds(40));
  require(node.flying.is_master());
  node.port.hear(can::Frame::base(0x73, {}));
  const unsigned before = node.claims;
  node.executor.advance(node.executor.now() + milliseconds(1));
  require(node.claims == before + 1);
  return 0;
}

}  // namespace flying_master_target
