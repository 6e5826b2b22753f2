#include "berth/sim/bus.hpp"

#include <algorithm>

#include "berth/sim/segment.hpp"
#include "berth/sim/world.hpp"

namespace berth::sim {

Bus::Bus(World& world, int number, std::string name, can::BitRate bit_rate)
    : world_(&world),
      executor_(&world.executor()),
      number_(number),
      bit_rate_(bit_rate.nominal),
      data_bit_rate_(bit_rate.data),
      name_(std::move(name)),
      faults_(world.random().fork()),
      statistics_since_(world.now()) {
  new_segment();
}

Bus::~Bus() = default;

rt::Duration Bus::bit_time() const noexcept { return bit_time_of(bit_rate_); }
rt::Duration Bus::data_bit_time() const noexcept { return bit_time_of(data_bit_rate_); }

Segment& Bus::new_segment() { return *segments_.emplace_back(std::make_unique<Segment>(*this)); }

std::unique_ptr<Controller> Bus::attach(const ControllerOptions& options) {
  if (fd() && !options.fd) return nullptr;
  std::unique_ptr<Controller> node(new Controller(*this, next_number_++, options));
  Segment& segment = *segments_.front();
  const bool idle = segment.idle();
  controllers_.push_back(node.get());
  segment.join(node->node_);
  if (!idle) segment.integrate(node->node_, node->powered() ? 1 : 0);
  return node;
}

void Bus::detach(Controller& controller) noexcept {
  controller.node_.segment->leave(controller.node_);
  std::erase(controllers_, &controller);
  faults_.forget(controller);
  drop_empty_segments();
}

void Bus::add_tap(can::Tap& tap) { taps_.push_back(&tap); }
void Bus::remove_tap(can::Tap& tap) noexcept { std::erase(taps_, &tap); }

void Bus::good_frame(const can::Frame& frame, rt::Time at, int sender) noexcept {
  ++statistics_.frames;
  std::uint64_t data = 0;
  std::memcpy(&data, frame.data.data(), 8);
  if (frame.remote) data = 0;
  if (frame.size < 8) data &= (1ULL << (8U * frame.size)) - 1;
  const std::uint64_t head = (static_cast<std::uint64_t>(frame.key()) << 32U) |
                             (static_cast<std::uint64_t>(frame.size) << 24U) | (frame.remote ? 1ULL << 23U : 0) |
                             (static_cast<std::uint64_t>(number_ & 0x7F) << 16U) | static_cast<std::uint16_t>(sender);
  world_->mix(head);
  world_->mix(data);
  if (frame.fd) world_->mix_fd(frame);
  world_->mix(static_cast<std::uint64_t>(at.time_since_epoch().count()));
  for (std::size_t i = 0; i < taps_.size(); ++i) taps_[i]->frame(frame, at, sender);
}

unsigned Bus::inject(Fault fault) { return faults_.add(std::move(fault)); }

double Bus::load() const noexcept {
  const auto elapsed = executor_->now() - statistics_since_;
  return elapsed.count() <= 0 ? 0.0
                              : static_cast<double>(statistics_.busy.count()) / static_cast<double>(elapsed.count());
}

void Bus::reset_statistics() noexcept {
  statistics_ = {};
  statistics_since_ = executor_->now();
}

// The first segment is the bus; the others are cut off from it.

void Bus::split(std::span<Controller* const> others) {
  Segment& segment = new_segment();
  for (Controller* node : others) {
    if (node->bus_ == this && node->cable_) node->node_.segment->hand_over(node->node_, segment);
  }
  drop_empty_segments();
}

void Bus::join() {
  for (Controller* node : controllers_) {
    if (node->cable_) node->node_.segment->hand_over(node->node_, *segments_.front());
  }
  drop_empty_segments();
}

std::vector<std::vector<const Controller*>> pieces(const Bus& bus) {
  std::vector<std::vector<const Controller*>> found;
  for (const auto& segment : bus.segments_) {
    std::vector<const Controller*> here;
    for (const Controller* node : bus.controllers_) {
      if (node->cable_in() && segment->medium().nodes.find(node) != BusNode::no_slot) here.push_back(node);
    }
    if (!here.empty()) found.push_back(std::move(here));
  }
  return found;
}

void Bus::move(Controller& controller, bool cable_in) noexcept {
  controller.node_.segment->hand_over(controller.node_, cable_in ? *segments_.front() : new_segment());
  drop_empty_segments();
}

void Bus::drop_empty_segments() noexcept {
  const auto first = segments_.begin() + 1;
  segments_.erase(
      std::remove_if(first, segments_.end(), [](const auto& segment) { return segment->medium().nodes.empty(); }),
      segments_.end());
}

}  // namespace berth::sim
