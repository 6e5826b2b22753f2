/// The data of a RAND walk while it runs. Internal to `nodeid`.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "berth/nodeid/rand_walk.hpp"

namespace berth::nodeid {

inline constexpr std::uint32_t join(std::uint16_t high, std::uint16_t low) noexcept {
  return static_cast<std::uint32_t>(high) << 16 | low;
}
inline constexpr LssAddress address_of(const std::array<std::uint16_t, 8>& c) noexcept {
  return {join(c[0], c[1]), join(c[2], c[3]), join(c[4], c[5]), join(c[6], c[7])};
}

// The known chunks under a prefix.
struct RandWalk::Node {
  enum class State : std::uint8_t { fresh, guessed, visited };
  State state = State::fresh;
  std::set<std::uint16_t> open{};  // chunks whose subtree is still to be walked
  std::set<std::uint16_t> all{};   // chunks heard here in this round
};

struct RandWalk::Run {
  struct Entry {
    Walked device;
    bool now = false;       // heard in this round and not silenced yet
    bool doubtful = false;  // may come from a stray answer: to be proven
    bool doubled = false;   // answered twice: one device or two?
    bool told = false;      // reported to the observer
  };
  std::span<const WalkKind> kinds;
  const WalkOptions& options;
  WalkObserver* observer;
  WalkReport report{};
  std::vector<Entry> entries{};
  std::map<Prefix, Node> tree{};  // of this round
  rt::Time last_sent{};
  unsigned streak = 0;  // rounds without a new device
  unsigned silent = 0;  // ways that ended in silence, minus those that ended with a device
  bool guess = true;    // the first round: `kinds` are assumed to be there
  bool hurry = true;    // known ways are walked without waiting for their answers
  bool steps = true;    // a serial number may be guessed from the two before it
  bool resume = false;  // resuming slaves are asked for
  bool stopped = false;
  unsigned too_fast_ = 0;
  unsigned wrong_steps_ = 0;
  std::size_t known_before = 0;  // entries when the round began

  bool stops() noexcept {
    stopped = stopped || (observer != nullptr && !observer->goes_on());
    return stopped;
  }
  // A stray answer also makes a way that ends in silence: such ways double the factor twice at most.
  [[nodiscard]] unsigned factor() const noexcept { return 1U << std::max(std::min(streak, 4U), std::min(silent, 2U)); }
  [[nodiscard]] rt::Duration longest() const noexcept { return factor() * options.longest; }

  /// The serial number expected alone under this prefix of seven chunks, if the serial numbers below it continue: two
  /// differences agree, and are too large for two under one prefix.
  [[nodiscard]] std::optional<std::uint16_t> guessed(const Prefix& prefix) const {
    if (!steps || options.prove_all || prefix.depth != 7) return std::nullopt;
    const LssAddress here = address_of(prefix.chunks);
    std::vector<std::uint32_t> serials;
    for (const Entry& e : entries) {
      const LssAddress& a = e.device.address;
      if (a.type() == here.type() && a.revision == here.revision && a.serial < here.serial) serials.push_back(a.serial);
    }
    if (serials.size() < 3) return std::nullopt;
    std::ranges::partial_sort(serials, serials.begin() + 3, std::ranges::greater());
    const std::uint32_t step = serials[0] - serials[1];
    const std::uint32_t next = serials[0] + step;
    const bool fits = step > 0xFFFF && serials[1] - serials[2] == step && next >> 16U == prefix.chunks[6];
    if (!fits) return std::nullopt;
    return static_cast<std::uint16_t>(next & 0xFFFFU);
  }
  static LssAddress address_under(const Prefix& prefix, std::uint16_t chunk) noexcept {
    auto chunks = prefix.chunks;
    chunks[7] = chunk;
    return address_of(chunks);
  }
  Entry& enter(const Prefix& prefix, std::uint16_t chunk, rt::Time at, bool resumes) {
    const auto address = address_under(prefix, chunk);
    auto known = std::ranges::find(entries, address, [](const Entry& e) { return e.device.address; });
    if (known == entries.end()) {
      entries.push_back({.device = {.address = address, .at = at, .times_found = 0}});
      known = entries.end() - 1;
    }
    if (!known->now) ++known->device.times_found;
    known->now = true;
    known->device.resumes |= resumes;
    silent -= std::min(silent, 1U);
    return *known;
  }
  /// A chunk that also occurs on the way to this prefix may be a late answer.
  [[nodiscard]] bool may_be_stray(const Prefix& prefix, std::uint16_t chunk) {
    Prefix node;
    bool heard = tree[node].all.contains(chunk);
    while (!heard && node.depth + 1 < prefix.depth) {
      node.chunks[node.depth] = prefix.chunks[node.depth];
      ++node.depth;
      heard = tree[node].all.contains(chunk);
    }
    return heard;
  }
  /// Adds the chunks heard under the prefix. After requests in quick succession there are many stray answers, each of
  /// which would be a way of its own: they are left out. A device that is thereby left out answers the closing phase 0.
  void add(const Prefix& prefix, const std::vector<std::uint16_t>& chunks, bool hurried) {
    auto& open = tree[prefix].open;
    const auto stray = [&](std::uint16_t chunk) { return hurried && may_be_stray(prefix, chunk); };
    const bool none_else = open.empty() && std::ranges::all_of(chunks, stray);
    for (const auto chunk : chunks) {
      if (none_else || !stray(chunk)) open.insert(chunk);
    }
  }
  [[nodiscard]] Entry* find(const LssAddress& address) noexcept {
    const auto it = std::ranges::find(entries, address, [](const Entry& e) { return e.device.address; });
    return it == entries.end() ? nullptr : &*it;
  }
  /// A branch is dead. True: the requests may have come too fast for its devices, so it is tried again.
  bool too_fast(bool hurried) noexcept {
    ++report.dead_branches;
    ++silent;
    if (!hurried) return false;
    hurry = ++too_fast_ < 2;
    return true;
  }
  /// A guessed serial number does not exist.
  void wrong_step() noexcept {
    ++silent;
    steps = ++wrong_steps_ < 2;
  }
  /// The prefix is done.
  void prune(Prefix prefix) {
    if (prefix.depth == 0) return;
    --prefix.depth;
    const auto chunk = std::exchange(prefix.chunks[prefix.depth], std::uint16_t{0});
    prune(prefix, chunk);
  }
  /// The chunk's subtree is done: removes it, and all parents without other chunks, from the tree.
  void prune(Prefix prefix, std::uint16_t chunk) {
    for (;;) {
      auto& open = tree[prefix].open;
      open.erase(chunk);
      if (!open.empty() || prefix.depth == 0) return;
      --prefix.depth;
      chunk = std::exchange(prefix.chunks[prefix.depth], std::uint16_t{0});
    }
  }
};

}  // namespace berth::nodeid
