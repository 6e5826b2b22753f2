/// LSS identify remote slave (46h to 4Bh; CiA 305) as a search: devices of known kinds, with or without a node-ID, with
/// or without Fastscan.
///
/// The six frames ask for one vendor and product and a range of revisions and of serial numbers; every LSS slave that
/// fits answers 4Fh, whatever its node-ID. So devices that are known, because they are registered or were found, answer
/// too, and the search asks for what lies between them.
///
/// The sweep, for each kind from serial number 0 upwards. A range after the last device is asked, as wide as the last
/// devices lay apart, eight times wider after silence; one that is answered is halved until one serial number is left:
/// the lowest, so that nothing lies below it. That takes about log2(distance) + 2 questions a device, some 27 for 120
/// random numbers. Numbers in a row and numbers at equal steps are guessed and asked for by name (40h to 43h) at once:
/// no question at all. A revision that is open is looked for with the serial number known, those that were seen first,
/// then those of registered devices. A way down that ends in silence, once haste has led nowhere, goes back to the last
/// range that was answered, twice at most: a device may lose questions.
///
/// Every device that is left must answer for itself (`lss::select_alone`), tells its node-ID (5Eh), gets one from the
/// assigner when it has none, and `04 00`, and the observer is told, before the search goes on.
///
/// The search is over when no gap between the known is answered within the longest window: one question more than there
/// are known devices that do not lie in a row, for each kind; up to two more for each when a kind's revision is open.
/// With `Options::configured` false it is over as soon as identify non-configured (4Ch) stays unanswered.
///
/// It has no bound of its own. With `Options::most_time`, or when `Observer::goes_on` says so, it ends with
/// `Report::End::more`; the next `find` on the same object goes on where it was, with what it has learnt. Meanwhile
/// a device that was found may be seated: it belongs into `Known::registered` then, and costs nothing.
///
/// Addresses that were answered for and whose device did not say so itself are counted (`Report::unproven`) and passed
/// over; after `Options::retries` + 4 of them in a row some device answers whatever is asked, the kind is left, and the
/// search ends with `gave_up`.
#pragma once

#include <optional>
#include <vector>

#include "berth/discovery/auto.hpp"
#include "berth/discovery/haste.hpp"
#include "berth/discovery/latency.hpp"
#include "berth/lss/select_alone.hpp"

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
  /// Halves; `single` must be false. Serial numbers first.
  [[nodiscard]] Box lower() const noexcept;
  [[nodiscard]] Box upper() const noexcept;
  friend constexpr bool operator==(const Box&, const Box&) noexcept = default;
};
/// What of `all` holds none of `known`: disjoint boxes that, with the known, make up `all`.
[[nodiscard]] std::vector<Box> gaps(const Box& all, std::vector<R_SN> known);

class Pauses;  // identify_parts.hpp

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
  struct Descent;
  /// How far one kind has been swept.
  struct Cursor {
    Kind kind{};
    std::uint64_t next = 0;    // below it every device has been heard
    std::uint64_t width = 0;   // of the next range; 0: nothing is known
    std::uint64_t apart = 0;   // the last devices', on average
    std::uint32_t last = 0;    // the last device
    std::uint32_t stride = 1;  // the guess: last + stride
    unsigned row = 0;          // devices in a row that were guessed
    bool any = false;
    bool guesses = false;                    // the next one is worth a guess
    bool closed = false;                     // all gaps were silent
    std::optional<Box> open{};               // a device is in there: the search was stopped on the way down
    std::vector<Box> quiet{};                // gaps that were silent
    std::vector<std::uint32_t> revisions{};  // that were seen, the last one first
  };
  enum class Sweep : std::uint8_t { nobody, found, unproven };
  /// How long a silence is listened to.
  enum class Window : std::uint8_t {
    quick,    ///< as answers usually take; patient where haste has led nowhere
    patient,  ///< as long as the slowest answer of a device that was met in this search
    bound,    ///< as long as any device may need: by this silence the search ends
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
  bool busy_ = false;
};

}  // namespace berth::discovery
