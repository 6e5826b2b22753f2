/// What a walk knows of devices that are known and keep answering. A walk in slices (`Options::slice`) continues with
/// it. Internal to `discovery`.
#pragma once

#include <array>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/discovery/prefix.hpp"
#include "berth/rt/executor.hpp"

namespace berth::discovery::walk {

/// Whether a kind of question has paid.
struct Worth {
  unsigned tries = 0;
  unsigned hits = 0;
  [[nodiscard]] bool ask() const noexcept { return tries < 3 + 12 * hits; }
  void note(bool hit) noexcept {
    ++tries;
    if (hit) ++hits;
  }
};

/// Known devices that keep answering, because they got no node-ID or although they have one.
class PutAside {
 public:
  void put(const LssAddress& device, bool has_node_id);
  [[nodiscard]] bool has(const LssAddress& device) const;
  [[nodiscard]] const std::vector<LssAddress>& all() const noexcept { return devices_; }
  /// One of them has no node-ID.
  [[nodiscard]] bool nameless() const noexcept { return nameless_; }
  /// One was put aside since `begin_round`: this round can find nothing more.
  [[nodiscard]] bool in_this_round() const noexcept { return now_; }
  void begin_round() noexcept { now_ = false; }

 private:
  std::vector<LssAddress> devices_;
  bool nameless_ = false;
  bool now_ = false;
};

/// The first parts of an address that was put aside.
struct Place {
  std::array<std::uint32_t, 3> part{};
  unsigned parts = 0;
  friend bool operator==(const Place&, const Place&) = default;
};

/// A part of the numbers at a place that was asked, and silent.
struct Silent {
  Place place;
  Prefix at;
  rt::Time asked{};
};

struct Memory {
  /// A search in slices starts with the devices that answered with their node-IDs in the slice before (`last`): finding
  /// one that lost its node-ID is not urgent.
  [[nodiscard]] static Memory for_a_search(bool in_slices, const Memory& last);

  PutAside aside{};
  Worth stayers{};                // registered devices asked for by name: they answer although they have a node-ID
  bool some_stay = false;         // although they have a node-ID
  std::vector<Place> vacant{};    // lead to no device
  std::vector<Silent> silent{};   // asked beside the known ones, and silent
  std::vector<Silent> doubted{};  // silent in haste
};

}  // namespace berth::discovery::walk
