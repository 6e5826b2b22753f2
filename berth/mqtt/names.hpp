/// Looks hosts' names up without making anybody wait: each lookup has a thread of its own for as long as it takes,
/// which a dead name server can make half a minute. Internal to room `mqtt`.
#pragma once

#include <chrono>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/base/bell.hpp"

namespace berth::mqtt {

/// Addresses as text, in the system's order of preference (RFC 6724); at least one. The error is getaddrinfo's.
using Addresses = tl::expected<std::vector<std::string>, int>;

class Names {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds fresh{5};  ///< for how long an answer serves other clients too

  /// `bell` is rung, perhaps after this object's end, when a lookup is done.
  explicit Names(std::shared_ptr<Bell> bell) : bell_(std::move(bell)) {}

  /// Empty: not known yet; ask again when the bell was rung. An address is its own answer. An error is told to those
  /// that ask until the next call after it was told begins a new lookup.
  [[nodiscard]] std::optional<Addresses> ask(const std::string& host, Time now);

 private:
  struct Lookup;
  struct Known {
    std::shared_ptr<Lookup> lookup;
    std::optional<Time> told{};  // when its answer was first told
  };
  [[nodiscard]] std::shared_ptr<Lookup> begin(const std::string& host) const;

  std::shared_ptr<Bell> bell_;
  std::map<std::string, Known> known_;
};

}  // namespace berth::mqtt
