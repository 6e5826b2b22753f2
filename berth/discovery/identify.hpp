/// LSS identify remote slave (46h to 4Bh; CiA 305) as a search: devices of known kinds, with or without a node-ID, with
/// or without Fastscan.
///
/// The six frames ask for one vendor and product and a range of revisions and of serial numbers; every LSS slave that
/// fits answers 4Fh, whatever its node-ID. So a range that is answered is halved until one address is left, which then
/// has to answer for itself (40h to 43h, 44h) and tells its node-ID (5Eh). Devices that are known, because they are
/// registered or were found, answer too: the search asks for what lies between them, and is over when no such gap is
/// answered within the longest window. That takes one question more than there are known devices, for each kind; when a
/// kind's revision is open, up to two more for each.
#pragma once

#include "berth/discovery/auto.hpp"
#include "berth/discovery/latency.hpp"

namespace berth::discovery {

/// Revisions and serial numbers, both ends included.
struct Box {
  std::uint32_t revision_low = 0;
  std::uint32_t revision_high = 0xFFFF'FFFF;
  std::uint32_t serial_low = 0;
  std::uint32_t serial_high = 0xFFFF'FFFF;
  [[nodiscard]] constexpr bool single() const noexcept {
    return revision_low == revision_high && serial_low == serial_high;
  }
  [[nodiscard]] constexpr bool contains(const R_SN& n) const noexcept {
    return n.revision >= revision_low && n.revision <= revision_high && n.serial >= serial_low &&
           n.serial <= serial_high;
  }
  /// Halves; `single` must be false. Revisions first.
  [[nodiscard]] Box lower() const noexcept;
  [[nodiscard]] Box upper() const noexcept;
  friend constexpr bool operator==(const Box&, const Box&) noexcept = default;
};
/// What of `all` holds none of `known`: disjoint boxes that, with the known, make up `all`.
[[nodiscard]] std::vector<Box> gaps(const Box& all, std::vector<R_SN> known);

class Identify final : public Discovery {
 public:
  explicit Identify(const Services& services) : services_(services) {}
  [[nodiscard]] Method method() const noexcept override { return Method::identify; }
  /// Looks for `Known::kinds` and for the types of `Known::expected`. The assigner is asked for those that have no
  /// node-ID.
  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override;
  /// LSS identify non-configured (4Ch): only those without a node-ID.
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override;

 private:
  struct Run;
  [[nodiscard]] rt::Task<Result<bool>> ask(Run& run, const Kind& kind, const Box& box, bool patient);
  [[nodiscard]] rt::Task<Result<void>> search(Run& run, const Kind& kind, const Box& box);
  [[nodiscard]] rt::Task<Result<bool>> proven(Run& run, const LssAddress& device);
  Services services_;
  Latency latency_;
  bool busy_ = false;
};

}  // namespace berth::discovery
