/// Makes the methods of one bus, and finds the devices of a bus whatever each of them speaks.
///
///     Auto all({dispatcher, lss_master});
///     auto report = co_await all.find(known, options);
///
/// `Auto` asks one question per scheme (Fastscan's "anybody?", with an ear for feedback; RAND's and AND's phase 0; LSS
/// identify non-configured), runs the planner of each scheme that was answered, one scheme after the other and
/// never two at once (S1.24: RAND's DIS and the feedback have the same identifiers), and looks with LSS identify ranges
/// for those that no scheme finds: devices without Fastscan, and devices that have a node-ID and are in no slot. The
/// ranges need `Known::kinds`. A device that answers none of these is asked for by name (40h to 43h) where
/// `Known::expected` has its address: eight of them in each search for devices with a node-ID.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "berth/discovery/discovery.hpp"
#include "berth/lss/master.hpp"

namespace berth::discovery {

/// What the methods are made of. Both must outlive them. Nothing else may use the LSS master while a method is under
/// way.
struct Services {
  can::Dispatcher& dispatcher;
  lss::Master& lss;
};

/// A method on a bus. Never null.
[[nodiscard]] std::unique_ptr<Discovery> make(Method method, const Services& services);

/// What devices on the bus answered to.
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
  bool and_protocol = false;  ///< no device outside laboratories speaks it
  bool identify = true;       ///< unconfigured devices of known kinds that speak nothing else
  /// Devices that have a node-ID and are not registered: `identify` over every known kind. They are in no other
  /// scheme, and a search for them costs about 10 ms a registered device of the kind; so once at a start, not in a
  /// poll.
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
  /// Finds every device that is not registered. `Found::by` tells how each was found. A device that speaks several
  /// schemes is reported once. The report ends with `more` when a part did, else as the first part that was not
  /// complete. `more` among the ranges, and nobody new found by the schemes that were answered: the next `find` goes on
  /// there, four times in a row at most, and asks no scheme.
  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override;
  /// One question per scheme; ends at the first answer. For polls while the machine runs: 4 frames at most.
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override;
  /// One question per scheme, all of them.
  [[nodiscard]] rt::Task<Result<Spoken>> ask_spoken(const Options& options);
  /// Of the last `find` that asked the schemes, or of the last `ask_spoken`.
  [[nodiscard]] const Spoken& spoken() const noexcept { return spoken_; }

 private:
  struct Run;
  // A search that was broken off among the ranges, and whose schemes had found nobody new, goes on there: on a slow bus
  // the schemes take all the time that a search gets.
  class OpenRanges {
   public:
    void broken_off(Report::End schemes_end);
    /// How the schemes ended that need not be asked again.
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
  std::size_t named_ = 0;  // of `Known::expected`, that were asked for by name
  Method last_ = Method::planner_fastscan;
  bool busy_ = false;
  std::array<std::unique_ptr<Discovery>, methods> parts_{};
};

}  // namespace berth::discovery
