/// A walk beside devices that are known and answer on, because they got no node-ID, or because they answer Fastscan
/// whatever node-ID they have. They are waiting, as no device stays in configuration while others are searched for, so
/// they answer whatever they fit. What they do not fit is asked instead: at each part of their addresses the places
/// beside them. Internal to `discovery`.
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

  /// One device at most: one that moved on stands elsewhere afterwards, and the next round begins with 80h.
  rt::Task<void> round();
  /// No device is beside those.
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
