// Any frames at a device that claims a node-ID: it holds a valid one or none, never yields to a higher NAME, and sends
// its own NAME only.
#include <cstdint>

#include "berth/research/claim_slave.hpp"
#include "fuzz/require.hpp"

namespace claim_slave_target {

namespace {
using namespace berth;
using fuzz::require;
using research::Claiming;

constexpr LssAddress address{1, 2, 3, 4};

struct Owner final : research::ClaimOwner {
  void send(const can::Frame& frame) noexcept override {
    const auto said = research::decode_claim(frame);
    require(said && said->name == research::claim_name(address));
  }
  void claimed(NodeId id) noexcept override { require(id.configured()); }
  void claim_lost(NodeId id) noexcept override { require(id.configured() && !firm); }
  bool firm = false;
};
}  // namespace

// Records of 11 bytes: what to do, the identifier's last byte, the size, then 8 bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  rt::Executor executor;
  Owner owner;
  research::ClaimSlave slave(executor, owner, {.address = address});
  for (; size >= 11; data += 11, size -= 11) {
    const auto what = data[0];
    switch (what & 0x07U) {
      case 0:
        slave.start();
        owner.firm = false;
        break;
      case 1: slave.stop(); break;
      case 2:
        owner.firm = (what & 8U) != 0;
        slave.settle(NodeId(static_cast<std::uint8_t>(1 + data[1] % 127)), owner.firm);
        break;
      case 3: executor.advance(executor.now() + std::chrono::milliseconds(data[1])); break;
      default: {
        const auto id = (what & 0x80U) != 0 ? research::claim_request_id | data[1] << 8 : research::claim_id | data[1];
        auto frame = can::Frame::ext(id, {data + 3, 8});
        frame.size = (what & 0x40U) != 0 ? data[2] % 9 : (what & 0x80U) != 0 ? 3 : 8;
        const auto before = slave.id();
        const auto state = slave.state();
        slave.received(frame);
        const auto heard = research::decode_claim(frame);
        const bool lower = heard && heard->name < slave.name() && heard->id == before.value();
        if (state == Claiming::settled && slave.state() != Claiming::settled) require(lower && !owner.firm);
      }
    }
    const bool has = slave.state() == Claiming::claiming || slave.state() == Claiming::settled;
    require(has == slave.id().configured());
  }
  return 0;
}

}  // namespace claim_slave_target
