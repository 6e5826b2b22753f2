/// A search by LSS identify remote slave (46h to 4Bh; CiA 305): devices of known kinds, with or without a node-ID, with
/// or without Fastscan.
///
/// The six frames name one vendor and product, a range of revisions and a range of serial numbers; every matching LSS
/// slave answers 4Fh, whatever its node-ID. Known devices, registered or found, answer too, so the search asks for what
/// lies between them.
///
/// The sweep, for each kind from serial number 0 upwards:
/// - It asks for a range after the last device, as wide as the distance between the last devices, and eight times wider
///   after silence.
/// - An answered range is halved until one serial number is left: the lowest, so that nothing lies below it. That takes
///   about log2(distance) + 2 questions per device, some 27 for 120 random numbers.
/// - Consecutive numbers and numbers at equal steps are guessed and asked for by name (40h to 43h) at once: no question
///   at all.
/// - An open revision is searched for after the serial number is known: first revisions seen before, then those of
///   registered devices.
/// - If a descent ends in silence, and haste has failed already, it goes back to the last answered range, twice at
///   most: a device may lose questions.
///
/// Every device that is left must answer for itself (`lss::select_alone`) and report its node-ID (5Eh). The assigner
/// gives it one if it has none. It gets `04 00`, and the observer is told, before the search goes on.
///
/// The search is over when no gap between known devices is answered within the longest window. For each kind this takes
/// one question more than there are known devices outside a row, and up to two more for each when a kind's revision is
/// open. With `Options::configured` false it is over as soon as identify non-configured (4Ch) stays unanswered.
///
/// It has no time limit of its own. With `Options::most_time`, or when `Observer::goes_on` says so, it ends with
/// `Report::End::more`; the next `find` on the same object continues there, with what it has learnt. Meanwhile a found
/// device may be seated: it then belongs in `Known::registered`, and costs nothing.
///
/// Addresses that were answered for but not confirmed by the device itself are counted (`Report::unproven`) and
/// skipped. After `Options::retries` + 4 of them in a row some device answers every request: the search leaves the kind
/// and ends with `gave_up`.
#pragma once

#include <optional>
#include <vector>

#include "berth/discovery/auto.hpp"
#include "berth/discovery/haste.hpp"
#include "berth/discovery/latency.hpp"
#include "berth/lss/select_alone.hpp"

namespace berth::discovery {

/// Ranges of revisions and serial numbers, both ends included.
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
  /// The halves; `single` must be false. Splits serial numbers first.
  [[nodiscard]] Box lower() const noexcept;
  [[nodiscard]] Box upper() const noexcept;
  friend constexpr bool operator==(const Box&, const Box&) noexcept = default;
};
/// The parts of `all` without `known`: disjoint boxes that, with the known, make up `all`.
[[nodiscard]] std::vector<Box> gaps(const Box& all, std::vector<R_SN> known);

class Pauses;  // identify_parts.hpp

class Identify final : public Discovery {
 public:
  explicit Identify(const Services& services) : services_(services) {}
  [[nodiscard]] Method method() const noexcept override { return Method::identify; }
  /// Searches for `Known::kinds` and the types of `Known::expected`. Asks the assigner for devices without a node-ID.
  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override;
  /// LSS identify non-configured (4Ch): only devices without a node-ID.
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override;

 private:
  struct Run;
  struct Descent;
  /// How far one kind has been swept.
  struct Cursor {
    Kind kind{};
    std::uint64_t next = 0;    // every device below it has been heard
    std::uint64_t width = 0;   // of the next range; 0: unknown
    std::uint64_t apart = 0;   // average distance of the last devices
    std::uint32_t last = 0;    // the last device
    std::uint32_t stride = 1;  // the guess: last + stride
    unsigned row = 0;          // consecutive correct guesses
    bool any = false;
    bool guesses = false;                    // guess the next one
    bool closed = false;                     // all gaps were silent
    std::optional<Box> open{};               // contains a device: the search was stopped on the way down
    std::vector<Box> quiet{};                // gaps that were silent
    std::vector<std::uint32_t> revisions{};  // seen so far, the last one first
  };
  enum class Sweep : std::uint8_t { nobody, found, unproven };
  /// How long to wait for an answer.
  enum class Window : std::uint8_t {
    quick,    ///< the usual time of answers; patient after haste has failed
    patient,  ///< the slowest answer of a device met in this search
    bound,    ///< the longest time any device may need: this silence ends the search
  };
  [[nodiscard]] rt::Task<Result<bool>> ask(Run& run, const Cursor& cursor, Box box, Window window);
  [[nodiscard]] rt::Task<Result<void>> sweep(Run& run, Cursor& cursor, std::uint64_t end);
  [[nodiscard]] rt::Task<Result<bool>> guess(Run& run, Cursor& cursor);
  [[nodiscard]] rt::Task<Result<bool>> one_kind(Run& run, Cursor& cursor, Pauses& pace);
  [[nodiscard]] rt::Task<Result<bool>> all_kinds(Run& run, std::vector<Cursor>& cursors, Pauses& pace);
  [[nodiscard]] rt::Task<Result<bool>> slowly(Run& run, std::vector<Cursor>& cursors, Pauses& pace);
  [[nodiscard]] rt::Task<Result<bool>> close(Run& run, Cursor& cursor);
  [[nodiscard]] rt::Task<Result<void>> lowest_in(Run& run, Cursor& cursor, Box box);
  [[nodiscard]] rt::Task<Result<std::optional<Box>>> descend(Run& run, const Cursor& cursor, Box box);
  [[nodiscard]] rt::Task<Result<bool>> step(Run& run, const Cursor& cursor, Descent& way, bool arrived);
  [[nodiscard]] static std::vector<std::uint32_t> likely_revisions(const Run& run, const Cursor& cursor);
  [[nodiscard]] rt::Task<Result<std::optional<Box>>> surely(Run& run, const Cursor& cursor, Box box);
  [[nodiscard]] rt::Task<Result<Sweep>> device_in(Run& run, Cursor& cursor, Box box);
  [[nodiscard]] rt::Task<Result<Sweep>> proven(Run& run, Cursor& cursor, LssAddress device, bool guess);
  [[nodiscard]] rt::Task<Result<void>> settle(Run& run, Found& found, const lss::AloneOptions& how);
  [[nodiscard]] rt::Task<Result<bool>> blank_left(Run& run);
  [[nodiscard]] std::vector<Cursor> begin(const Known& known);
  Services services_;
  [[nodiscard]] rt::Duration window_of(const Run& run, Window window) const;
  Latency latency_;
  Patience patience_;
  std::vector<Cursor> cursors_;  // of a search that ended with `more`
  bool slowly_ = false;          // and asks all gaps again, with pauses
  bool busy_ = false;
};

}  // namespace berth::discovery
