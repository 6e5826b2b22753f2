// Rebuilds a machine's table from the frames on its bus alone, as a person with a bus analyser would: LSS selects a
// device and gives it a node-ID, a boot-up message shows that it took it, NMT start and a heartbeat 05h that it runs.
// Knows no room of Berth but the frame.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>

#include "berth/can/port.hpp"

namespace berth::golden {

using Address = std::array<std::uint32_t, 4>;  // vendor, product, revision, serial

class TraceReader final : public can::Tap {
 public:
  struct Place {
    std::optional<Address> device;
    bool booted = false;
    bool started = false;
    bool operational = false;
  };

  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    if (frame.extended || frame.remote) return;
    const auto cs = frame.data[0];
    if (frame.id == 0x7E5 && frame.size == 8) return request(cs, frame);
    if (frame.id == 0x7E4 && frame.size == 8) return answer(cs, frame.data[1]);
    if (frame.id == 0x000 && frame.size == 2) return command(cs, frame.data[1]);
    if (frame.id > 0x700 && frame.id <= 0x77F && frame.size == 1) error_control(frame.id - 0x700, cs);
  }

  /// By node-ID: those for which a device was given the ID, or that said anything.
  [[nodiscard]] const std::map<unsigned, Place>& table() const noexcept { return places_; }

 private:
  void request(std::uint8_t cs, const can::Frame& frame) {
    if (cs == 0x04) selected_.reset();
    if (cs >= 0x40 && cs <= 0x43) {
      const auto byte = [&](unsigned i) { return static_cast<std::uint32_t>(frame.data[i]) << (8 * (i - 1)); };
      asked_[cs - 0x40U] = byte(1) | byte(2) | byte(3) | byte(4);
    }
    if (cs == 0x11) id_ = frame.data[1];
  }
  void answer(std::uint8_t cs, std::uint8_t error) {
    if (cs == 0x44) selected_ = asked_;
    if (cs != 0x11 || error != 0 || !selected_) return;
    std::erase_if(given_, [&](const auto& g) { return g.second == id_; });  // whoever had it before has left
    given_[*selected_] = id_;
  }
  void command(std::uint8_t cs, unsigned id) {
    for (auto& [number, place] : places_) {
      if (id != 0 && number != id) continue;
      if (cs == 0x01) place.started = true;
      if (cs != 0x01) place.started = place.operational = false;
    }
  }
  void error_control(unsigned id, std::uint8_t state) {
    auto& place = places_[id];
    if (state != 0) {
      place.operational = state == 0x05 && place.booted && place.started;
      return;
    }
    place = {};
    place.booted = true;
    for (const auto& [device, number] : given_) {
      if (number == id) place.device = device;
    }
  }

  Address asked_{};
  std::optional<Address> selected_;
  unsigned id_ = 0;
  std::map<Address, unsigned> given_;
  std::map<unsigned, Place> places_;
};

}  // namespace berth::golden
