#include "berth/discovery/walk_way.hpp"

#include <algorithm>

namespace berth::discovery::walk {

void Way::note_asked(std::uint32_t value) noexcept {
  auto& before = asked_[sub];
  if (sub < varied_.size() && before && *before != value) varied_[sub] = true;
  before = value;
}

void Frontier::open(Prefix at, Open::Why why) {
  if (why == Open::Why::heard) {
    if (std::ranges::find(seen_, at) != seen_.end()) return;
    seen_.push_back(at);
  }
  open_.push_back({at, why});
}

Open Frontier::take() {
  const Open next = open_.back();
  open_.pop_back();
  return next;
}

bool Frontier::remove(Prefix at) {
  const auto it = std::ranges::find(open_, at, &Open::at);
  if (it == open_.end()) return false;
  open_.erase(it);
  return true;
}

void Frontier::clear() noexcept {
  open_.clear();
  seen_.clear();
}

KnownPaths::KnownPaths(const Known& known) {
  for (const LssAddress& a : known.expected) {
    paths_.push_back({.part = {a.vendor, a.product, a.revision, a.serial}, .parts = 4});
  }
  for (const Kind& k : known.kinds) {
    paths_.push_back(
        {.part = {k.type.vendor, k.type.product, k.revision.value_or(0), 0}, .parts = k.revision ? 3U : 2U});
  }
  for (const LssAddress& a : known.registered) {
    paths_.push_back({.part = {a.vendor, a.product, a.revision, 0}, .parts = 3});
  }
}

bool KnownPaths::is_absent(const Path& path, unsigned sub) const {
  return std::ranges::any_of(absent_, [&](const Path& a) {
    return a.parts == sub + 1 && std::equal(a.part.begin(), a.part.begin() + a.parts, path.part.begin());
  });
}

const Path* KnownPaths::choose(const Way& way, std::span<const Prefix> children, std::span<const Found> found) const {
  const auto is_found = [&](const LssAddress& device) {
    return std::ranges::find(found, device, &Found::address) != found.end();
  };
  for (const Path& path : paths_) {
    const bool fits = std::equal(way.part.begin(), way.part.begin() + way.sub, path.part.begin());
    if (path.parts <= way.sub || !fits || is_absent(path, way.sub)) continue;
    if (path.parts == 4 && is_found({path.part[0], path.part[1], path.part[2], path.part[3]})) continue;
    const auto holds = [&](Prefix p) { return p.contains(path.part[way.sub]); };
    if (children.empty() || std::ranges::any_of(children, holds)) return &path;
  }
  return nullptr;
}

void KnownPaths::put_first(const LssAddress& device) {
  paths_.insert(paths_.begin(), Path{.part = {device.vendor, device.product, device.revision, 0}, .parts = 3});
}

}  // namespace berth::discovery::walk
