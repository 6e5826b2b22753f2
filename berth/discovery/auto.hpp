/// Makes the methods of one bus, and finds the devices of a bus whichever scheme each one uses.
///
///     Auto all({dispatcher, lss_master});
///     auto report = co_await all.find(known, options);
///
/// `Auto` works in these steps:
/// - It asks one question per scheme: Fastscan's "anybody?", listening for feedback; RAND's and AND's phase 0; LSS
///   identify non-configured.
/// - It runs the planner of each scheme that was answered, one scheme after the other, never two at once (S1.24: RAND's
///   DIS and the feedback have the same identifiers).
/// - It searches by LSS identify ranges for devices that no scheme finds: devices without Fastscan, and devices that
///   have a node-ID and are in no slot. The ranges need `Known::kinds`.
/// - A device that answers none of these is asked for by name (40h to 43h) if `Known::expected` has its address: eight
///   of them in each search for devices with a node-ID.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "berth/discovery/discovery.hpp"
#include "berth/lss/master.hpp"

namespace berth::discovery {

/// What the methods need. Both must outlive them. Nothing else may use the LSS master while a method is running.
struct Services {
  can::Dispatcher& dispatcher;
  lss::Master& lss;
};

/// A method on a bus. Never null.
[[nodiscard]] std::unique_ptr<Discovery> make(Method method, const Services& services);

/// The schemes that devices on the bus answered.
struct Spoken {
  bool fastscan = false;
  bool feedback = false;  ///< of either form
  bool rand = false;
  bool and_protocol = false;
  bool non_configured = false;  ///< LSS identify non-configured (4Ch)
  [[nodiscard]] constexpr bool anybody() const noexcept { return fastscan || rand || and_protocol || non_configured; }
};

struct AutoOptions {
  bool fastscan = true;
  bool rand = true;
  bool and_protocol = false;  ///< no device outside laboratories uses it
  bool identify = true;       ///< unconfigured devices of known kinds that use nothing else
  /// Devices that have a node-ID and are not registered: `identify` over every known kind. No other scheme finds them,
  /// and the search costs about 10 ms per registered device of the kind; so do it once at a start, not in a poll.
  bool configured = true;
};

class Auto final : public Discovery {
 public:
  explicit Auto(const Services& services, const AutoOptions& options = {});
  ~Auto() override;
  void set_options(const AutoOptions& options) noexcept { options_ = options; }
  [[nodiscard]] const AutoOptions& options() const noexcept { return options_; }

  /// The planner that was used last.
  [[nodiscard]] Method method() const noexcept override { return last_; }
  /// Finds every device that is not registered. `Found::by` is the method that found it. A device that uses several
  /// schemes is reported once. The report ends with `more` if a part did, else as the first part that was not complete.
  /// If the ranges ended with `more` and the answered schemes found no new device, the next `find` continues the ranges
  /// without asking the schemes, at most four times in a row.
  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override;
  /// One question per scheme; ends at the first answer. For polls while the machine runs: at most 4 frames.
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override;
  /// One question to every scheme.
  [[nodiscard]] rt::Task<Result<Spoken>> ask_spoken(const Options& options);
  /// Of the last `find` that asked the schemes, or of the last `ask_spoken`.
  [[nodiscard]] const Spoken& spoken() const noexcept { return spoken_; }

 private:
  struct Run;
  // A search that stopped among the ranges, and whose schemes had found no new device, continues there: on a slow bus
  // the schemes take all of a search's time.
  class OpenRanges {
   public:
    void broken_off(Report::End schemes_end);
    /// How the schemes ended, if they need not be asked again.
    [[nodiscard]] std::optional<Report::End> go_on(const Options& options);

   private:
    std::optional<Report::End> open_{};
    unsigned times_ = 0;  // in a row
  };
  [[nodiscard]] rt::Task<Result<void>> by_schemes(Run& run);
  [[nodiscard]] rt::Task<Result<void>> by_the_rest(Run& run, bool goes_on);
  [[nodiscard]] rt::Task<Result<void>> part(Run& run, Method method);
  [[nodiscard]] rt::Task<Result<void>> by_name(Run& run);
  [[nodiscard]] Discovery& of(Method method);
  Services services_;
  AutoOptions options_;
  OpenRanges ranges_;
  Spoken spoken_{};
  std::size_t named_ = 0;  // of `Known::expected`, asked for by name so far
  Method last_ = Method::planner_fastscan;
  bool busy_ = false;
  std::array<std::unique_ptr<Discovery>, methods> parts_{};
};

}  // namespace berth::discovery
