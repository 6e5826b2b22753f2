/// What the tests of the plant's devices share: a device of a plant file, and a record of a bus.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "berth/plant/plant_file.hpp"
#include "berth/sim/world.hpp"

namespace berth::plant {

/// Every frame of a bus, in cansend's notation, and when it was on the wire.
class Record final : public can::Tap {
 public:
  explicit Record(sim::Bus& bus) : bus_(bus) { bus.add_tap(*this); }
  ~Record() { bus_.remove_tap(*this); }
  Record(const Record&) = delete;
  Record& operator=(const Record&) = delete;
  void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
    text.push_back(can::to_string(frame));
    times.push_back(at);
  }
  [[nodiscard]] long count(std::string_view frame) const { return std::count(text.begin(), text.end(), frame); }
  [[nodiscard]] bool has(std::string_view frame) const { return count(frame) > 0; }
  std::vector<std::string> text;
  std::vector<rt::Time> times;

 private:
  sim::Bus& bus_;
};

/// On bus "b"; without an `id` it is blank.
inline PlantDevice device(const std::string& name, std::uint32_t serial, std::uint8_t id = 0xFF) {
  PlantDevice d;
  d.name = name;
  d.bus = "b";
  d.address = {1, 2, 3, serial};
  d.source = id == 0xFF ? NodeIdSource::blank : NodeIdSource::nonvolatile;
  d.node_id = NodeId(id);
  d.boot = std::chrono::milliseconds(10);
  d.reset = std::chrono::milliseconds(5);
  return d;
}

}  // namespace berth::plant
