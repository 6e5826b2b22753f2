/// The position of a walk in the tree of LSS addresses, and where it may continue. Internal to `discovery`.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "berth/discovery/discovery.hpp"
#include "berth/discovery/prefix.hpp"

namespace berth::discovery::walk {

/// The parts of the address confirmed since the last 80h, and what was asked of each in this search.
class Way {
 public:
  std::array<std::uint32_t, 4> part{};
  unsigned sub = 0;  ///< the current part

  [[nodiscard]] LssAddress address(std::uint32_t serial) const { return {part[0], part[1], part[2], serial}; }
  /// This whole value of the current part is asked for.
  void note_asked(std::uint32_t value) noexcept;
  /// Several values of this part were asked in this search.
  [[nodiscard]] bool varied(unsigned which) const noexcept { return varied_[which]; }

 private:
  std::array<bool, 3> varied_{};
  std::array<std::optional<std::uint32_t>, 4> asked_{};
};

/// A place to continue at.
struct Open {
  enum class Why : std::uint8_t {
    maybe,    ///< a device may be there
    heard,    ///< reported by feedback; still to be asked for what is below
    answered  ///< a device answered for it
  };
  Prefix at;
  Why why = Why::maybe;
};

/// The places of one part that are still to be visited, last one opened first.
class Frontier {
 public:
  /// A place that was `heard` before in this part is not opened again.
  void open(Prefix at, Open::Why why);
  [[nodiscard]] bool empty() const noexcept { return open_.empty(); }
  [[nodiscard]] Open take();
  /// False: it was not open.
  bool remove(Prefix at);
  void clear() noexcept;
  /// Places heard before may be opened again.
  void forget_heard() noexcept { seen_.clear(); }

 private:
  std::vector<Open> open_;
  std::vector<Prefix> seen_;
};

/// A vendor, product and perhaps revision that may be on the bus.
struct Path {
  std::array<std::uint32_t, 4> part{};
  unsigned parts = 2;  ///< known: 2, 3, or 4 for a whole address
};

/// The parts of addresses that devices may have, from what is known and what was found.
class KnownPaths {
 public:
  explicit KnownPaths(const Known& known);

  /// The first path that continues `way`, is not absent, and is not a whole address among `found`. With feedback
  /// (`children` not empty) only heard ones: devices without feedback wait until those with it have been found. Null:
  /// none.
  [[nodiscard]] const Path* choose(const Way& way, std::span<const Prefix> children,
                                   std::span<const Found> found) const;
  /// A device of this type and revision was found: the others are probably the same.
  void put_first(const LssAddress& device);
  /// No device matched it in this search.
  void note_absent(const Path& path) { absent_.push_back(path); }
  [[nodiscard]] std::size_t absent() const noexcept { return absent_.size(); }

 private:
  [[nodiscard]] bool is_absent(const Path& path, unsigned sub) const;

  std::vector<Path> paths_;
  std::vector<Path> absent_;
};

}  // namespace berth::discovery::walk
