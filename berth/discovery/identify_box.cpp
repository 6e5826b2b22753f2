// Ranges of revisions and serial numbers.
#include <algorithm>

#include "berth/discovery/identify.hpp"

namespace berth::discovery {
namespace {

constexpr std::uint32_t middle(std::uint32_t low, std::uint32_t high) noexcept { return low + (high - low) / 2; }

// The ranges of one dimension between known values.
template <class Add>
void between(std::uint32_t low, std::uint32_t high, const std::vector<std::uint32_t>& known, const Add& add) {
  std::uint64_t from = low;
  for (const std::uint32_t k : known) {
    if (k > from) add(static_cast<std::uint32_t>(from), k - 1U);
    from = std::uint64_t{k} + 1;
  }
  if (from <= high) add(static_cast<std::uint32_t>(from), high);
}

}  // namespace

Box Box::lower() const noexcept {
  Box b = *this;
  if (serial_low != serial_high) {
    b.serial_high = middle(serial_low, serial_high);
  } else {
    b.revision_high = middle(revision_low, revision_high);
  }
  return b;
}

Box Box::upper() const noexcept {
  Box b = *this;
  if (serial_low != serial_high) {
    b.serial_low = middle(serial_low, serial_high) + 1;
  } else {
    b.revision_low = middle(revision_low, revision_high) + 1;
  }
  return b;
}

std::vector<Box> gaps(const Box& all, std::vector<R_SN> known) {
  std::erase_if(known, [&](const R_SN& n) { return !all.contains(n); });
  std::ranges::sort(known, {}, [](const R_SN& n) { return std::pair(n.serial, n.revision); });
  std::vector<Box> result;
  std::vector<std::uint32_t> serials;
  for (const R_SN& n : known) {
    if (serials.empty() || serials.back() != n.serial) serials.push_back(n.serial);
  }
  between(all.serial_low, all.serial_high, serials, [&](std::uint32_t low, std::uint32_t high) {
    result.push_back({all.revision_low, all.revision_high, low, high});
  });
  for (const std::uint32_t serial : serials) {
    std::vector<std::uint32_t> revisions;
    for (const R_SN& n : known) {
      const bool twice = !revisions.empty() && revisions.back() == n.revision;
      if (n.serial == serial && !twice) revisions.push_back(n.revision);
    }
    between(all.revision_low, all.revision_high, revisions, [&](std::uint32_t low, std::uint32_t high) {
      result.push_back({low, high, serial, serial});
    });
  }
  return result;
}

}  // namespace berth::discovery
