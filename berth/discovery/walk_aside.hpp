/// A walk beside known devices that keep answering, because they got no node-ID or because they answer Fastscan even
/// with one. They are waiting, since no device stays in configuration during the search for others, so they answer
/// whatever they match. So the walk asks what they do not match: the places beside each part of their addresses.
/// Internal to `discovery`.
#pragma once

#include <array>
#include <vector>

#include "berth/discovery/walk_route.hpp"

namespace berth::discovery::walk {

class Aside {
 public:
  Aside(Questions& questions, Descent& descent, Devices& devices, Serials& serials, Route& route, Memory& memory,
        const Report& report) noexcept
      : q_(questions),
        descent_(descent),
        devices_(devices),
        serials_(serials),
        route_(route),
        memory_(memory),
        report_(report) {}

  /// Finds one device at most: a device that moved on is elsewhere afterwards, and the next round begins with 80h.
  rt::Task<void> round();
  /// No device is beside the known ones.
  [[nodiscard]] bool exhausted() const noexcept { return exhausted_; }

 private:
  enum class Stand : std::uint8_t { there, vacant, nobody };
  rt::Task<Stand> stand_at(Place place);
  [[nodiscard]] bool is_vacant(const Place& place) const;
  void forget_silence(rt::Time answered);
  rt::Task<bool> ask_beside(Place place);
  rt::Task<void> below(Prefix at);

  Questions& q_;
  Descent& descent_;
  Devices& devices_;
  Serials& serials_;
  Route& route_;
  Memory& memory_;
  const Report& report_;
  bool exhausted_ = false;
};

}  // namespace berth::discovery::walk
