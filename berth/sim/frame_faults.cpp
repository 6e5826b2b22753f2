#include "berth/sim/frame_faults.hpp"

#include "berth/can/length.hpp"
#include "berth/sim/segment_nodes.hpp"
#include "berth/sim/world.hpp"

namespace berth::sim {

rt::Duration offset_of_bit(const can::Frame& frame, int bit, rt::Duration bit_time, rt::Duration data_bit) noexcept {
  if (!frame.fd || !frame.brs) return bit * bit_time;
  const can::FdBits parts = can::exact_fd_bits(frame);
  const int fast = std::clamp(bit - static_cast<int>(parts.head), 0, static_cast<int>(parts.data));
  return (bit - fast) * bit_time + fast * data_bit;
}

void FrameFaults::draw(Bus& bus, const can::Frame& frame, rt::Time start, int sender, const SegmentNodes& nodes) {
  const int length = static_cast<int>(frame.fd ? can::exact_fd_bits(frame).all() : can::exact_bits(frame)) - 3;
  FaultPlan& plan = bus.faults();
  plan.strike({frame, plan.started(), start, sender}, [&](const Fault& fault) {
    const int first = fault.where.from_end ? length - 1 - fault.where.bit : fault.where.bit;
    if (fault.kind == Fault::Kind::overrun) {
      for (const Controller* victim : fault.victims) lose(*victim);
      for (const BusNode* node : nodes.slots()) {
        if (fault.victims.empty() && node != nullptr) lose(*node->controller);
      }
    } else if (fault.kind == Fault::Kind::act) {
      const auto data_bit = bus.fd() ? bus.data_bit_time() : rt::Duration{};
      bus.world().at(start + offset_of_bit(frame, first, nodes.bit(), data_bit), fault.act);
    } else if (frame.fd) {
      const auto here = [&](const Controller* victim) { return nodes.find(victim) != BusNode::no_slot; };
      if (fault.victims.empty() || std::ranges::any_of(fault.victims, here)) doom();
    } else {
      disturb({fault.kind, first, first + static_cast<int>(fault.bits) - 1, fault.victims, fault.spare_senders});
    }
  });
  std::vector<const Controller*> present;
  for (const BusNode* node : nodes.slots()) {
    if (node != nullptr && node->participates()) present.push_back(node->controller);
  }
  if (present.empty()) return;
  if (auto flip = plan.draw_flip(present, length)) {
    if (frame.fd) {
      doom();
    } else {
      disturb({Fault::Kind::flip, flip->bit, flip->bit, std::move(flip->victims), false});
    }
  }
  if (const Controller* const loser = plan.draw_overrun(present)) lose(*loser);
}

bool FrameFaults::victim(const Controller& node) const noexcept {
  return std::ranges::any_of(
      flaws_, [&](const Flaw& flaw) { return std::ranges::find(flaw.victims, &node) != flaw.victims.end(); });
}

bool FrameFaults::seen(const Controller& node, bool sends, std::int64_t bit, bool dominant) const noexcept {
  for (const auto& flaw : flaws_) {
    const bool struck = flaw.victims.empty() ? !(flaw.spare_senders && sends)
                                             : std::ranges::find(flaw.victims, &node) != flaw.victims.end();
    if (!struck || bit < flaw.first || bit > flaw.last) continue;
    dominant = flaw.kind == Fault::Kind::flip ? !dominant : flaw.kind == Fault::Kind::dominant;
  }
  return dominant;
}

}  // namespace berth::sim
