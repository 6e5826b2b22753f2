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
  /// schemes is reported once. The report ends with the worst end of its parts.
  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override;
  /// One question per scheme; ends at the first answer. For polls while the machine runs: 4 frames at most.
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override;
  /// One question per scheme, all of them.
  [[nodiscard]] rt::Task<Result<Spoken>> ask_spoken(const Options& options);
  /// Of the last `find` or `probe`.
  [[nodiscard]] const Spoken& spoken() const noexcept { return spoken_; }

 private:
  struct Run;
  [[nodiscard]] rt::Task<Result<void>> part(Run& run, Method method);
  [[nodiscard]] rt::Task<Result<void>> by_name(Run& run);
  [[nodiscard]] Discovery& of(Method method);
  Services services_;
  AutoOptions options_;
  Spoken spoken_{};
  std::size_t named_ = 0;  // of `Known::expected`, that were asked for by name
  Method last_ = Method::planner_fastscan;
  bool busy_ = false;
  std::array<std::unique_ptr<Discovery>, methods> parts_{};
};

}  // namespace berth::discovery
