// Any frames at a negotiator, at any time: it sends only what its state allows, and keeps to its promises.
#include <cstdint>

#include "berth/research/negotiation_frames.hpp"
#include "berth/research/negotiator.hpp"
#include "fuzz/require.hpp"

namespace negotiator_target {

namespace {
using namespace berth;
using fuzz::require;
using research::Negotiating;
using namespace std::chrono_literals;

constexpr LssAddress address{0x319, 0xAA55'EEFF, 0xDEAD'BEEF, 0x1234'5678};

struct Device final : research::NegotiatorOwner {
  bool send(const can::Frame& frame) noexcept override {
    const auto message = research::decode_negotiation(frame);
    require(message.has_value());
    if (message->kind == research::NegotiationMessage::Kind::identity) {
      require(!id.configured() && frame == research::identity(address, message->byte));
    }
    if (refuses) return false;
    queued = true;
    return true;
  }
  void withdraw() noexcept override { queued = false; }
  [[nodiscard]] bool nothing_queued() const noexcept override { return !queued; }
  [[nodiscard]] std::uint32_t bit_rate() const noexcept override { return 125'000; }
  void node_id_taken(NodeId taken) noexcept override {
    require(!id.configured() && taken.value() >= 1 && taken.value() <= 127);
    id = taken;
  }
  void node_id_lost(NodeId lost, research::IdLoss) noexcept override {
    require(lost == id && !firm);
    id = NodeId();
  }
  void all_taken() noexcept override {}
  void node_id_kept(NodeId kept) noexcept override { require(kept == id); }
  NodeId id;
  bool queued = false;
  bool refuses = false;
  bool firm = false;
};
}  // namespace

// One byte: options. Then records of four: what, two bytes of an identifier, a time.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  rt::Executor executor;
  Device device;
  research::Negotiator negotiator(executor, device,
                                {.address = address, .literal = (data[0] & 1U) != 0, .seed = data[0]});
  if ((data[0] & 2U) != 0) {
    device.firm = true;
    device.id = NodeId(5);
    negotiator.settle(device.id, true);
  } else {
    negotiator.start();
  }
  for (++data, --size; size >= 4; data += 4, size -= 4) {
    const std::uint32_t id = (data[1] | data[2] << 8U) & 0x1FFFU;
    auto frame = can::Frame::ext(id, {});
    switch (data[0] & 0xFU) {
      case 0:
        if (device.queued) {
          device.queued = false;
          negotiator.sent();
        }
        break;
      case 1: negotiator.doubled(); break;
      case 2: negotiator.suspend(2s); break;
      case 3: device.refuses = !device.refuses; break;
      case 4:
        frame.fd = true;
        negotiator.received(frame);
        break;
      case 5: negotiator.received(can::Frame::base(id & 0x7FFU, {1, 2, 3})); break;
      case 6: negotiator.begin_anew(); break;
      default: negotiator.received(frame); break;
    }
    executor.advance(executor.now() + data[3] * 1ms);
    require(negotiator.node_id() == device.id);
    require((negotiator.state() == Negotiating::settled) == device.id.configured());
    require(negotiator.load() >= 0);
  }
  return 0;
}

}  // namespace negotiator_target
