#include "berth/sim/world.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace berth::sim {

class World::Action final : public rt::Job {
 public:
  Action(World& world, std::function<void()> what) : world_(world), what_(std::move(what)), next_(world.actions_) {
    if (next_ != nullptr) next_->previous_ = this;
    world.actions_ = this;
  }
  ~Action() {
    if (next_ != nullptr) next_->previous_ = previous_;
    (previous_ != nullptr ? previous_->next_ : world_.actions_) = next_;
  }
  void run() noexcept override {
    const auto what = std::move(what_);
    delete this;
    what();
  }

 private:
  World& world_;
  std::function<void()> what_;
  Action* previous_ = nullptr;
  Action* next_;
};

World::World(std::uint64_t seed) : seed_(seed), random_(seed) {}

World::~World() {
  while (actions_ != nullptr) delete actions_;
}

Bus& World::add_bus(std::string name, std::uint32_t bit_rate, std::uint32_t data_bit_rate) {
  const auto number = static_cast<int>(buses_.size());
  buses_.push_back(
      std::unique_ptr<Bus>(new Bus(*this, number, std::move(name), can::BitRate{bit_rate, data_bit_rate})));
  return *buses_.back();
}

Bus* World::find_bus(std::string_view name) noexcept {
  const auto found = std::ranges::find(buses_, name, [](const auto& bus) -> std::string_view { return bus->name(); });
  return found == buses_.end() ? nullptr : found->get();
}

void World::at(rt::Time when, std::function<void()> action) {
  executor_.at(when, *new Action(*this, std::move(action)));
}

void World::mix_fd(const can::Frame& frame) noexcept {
  mix(frame.brs ? 3U : 1U);
  for (unsigned i = 8; i < frame.size; i += 4) {
    std::uint32_t word = 0;
    std::memcpy(&word, frame.data.data() + i, 4);
    mix(word);
  }
}

}  // namespace berth::sim
