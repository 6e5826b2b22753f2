/// The AND master: finds every device in state unknown, lowest AND address first (docs/and.md; paper 1 §I, S1.44).
///
/// Non-recursive, as paper 1 counts it: each device takes twelve phases and a direct identification, 13 N + 1 requests.
/// Recursive: after a device the master goes on at the deepest phase in which another value was heard.
///
/// AND finds 48-bit addresses. With `inquire` the master asks each device for its whole LSS address right after its
/// DIS: two more requests, whose answers are the only frames of AND with data of one device.
///
///     AndOptions options;                             // must outlive the task
///     auto report = co_await master.discover(options);
#pragma once

#include <vector>

#include "berth/nodeid/exchange.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/research/and_frames.hpp"

namespace berth::research {

struct AndOptions {
  bool recursive = false;
  bool inquire = true;  ///< ask for the LSS addresses; false: `AndFound::address` stays empty
  /// Windows, retries and bounds as for RAND. `inhibit`, `confirm_clones` are not used.
  nodeid::DiscoveryOptions discovery{};
};

/// A found device.
struct AndFound {
  AndAddress short_address{};
  std::optional<LssAddress> address{};  ///< empty: not inquired, or not answered
  rt::Time at{};                        ///< its DIS
  unsigned dis_frames = 0;
  unsigned times_found = 1;
  /// DIS was heard twice, or two answers to an inquiry differ: several devices have this AND address.
  bool ambiguous = false;
};

struct AndReport {
  nodeid::DiscoveryReport::End end = nodeid::DiscoveryReport::End::complete;
  std::vector<AndFound> found{};  ///< in the order of finding
  unsigned requests = 0;
  unsigned restarts = 0;
  rt::Time began{};
  rt::Time known{};  ///< when the last device was found; without the closing phase 0 that no slave answered
  rt::Time ended{};
};

/// Observes an AND discovery. Must not destroy it.
class AndObserver {
 public:
  virtual void found(const AndFound& device) noexcept = 0;
  /// Called after each device. False: the discovery ends as `stopped`.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~AndObserver() = default;
};

/// One procedure at a time: a second one gives `invalid`. Must outlive its tasks; options and observer are used until
/// the task ends.
class AndMaster final : private can::Handler {
 public:
  explicit AndMaster(can::Dispatcher& dispatcher);

  /// All slaves to `unknown` or `identified`. Done when sent.
  [[nodiscard]] rt::Task<Result<void>> switch_global(nodeid::Identification state);
  /// The devices with this AND address. One frame, no answer.
  [[nodiscard]] rt::Task<Result<void>> switch_selective(AndAddress address, nodeid::Identification target);
  /// Finds all unknown devices. Errors: `bus` a request cannot be sent; `invalid` something else is under way.
  [[nodiscard]] rt::Task<Result<AndReport>> discover(const AndOptions& options, AndObserver* observer = nullptr);
  /// One IURS of phase 0: whether an unknown slave is there.
  [[nodiscard]] rt::Task<Result<bool>> any_unknown(const AndOptions& options);

 private:
  struct Run;
  struct Lease;
  enum class Outcome : std::uint8_t { nobody, silent, found };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  [[nodiscard]] rt::Task<Result<bool>> ask(Run& run, const can::Frame& frame, AndAnswer::Kind kind);
  [[nodiscard]] rt::Task<Result<Outcome>> procedure(Run& run);
  [[nodiscard]] rt::Task<Result<void>> record(Run& run);
  [[nodiscard]] rt::Task<Result<void>> inquire(Run& run, AndFound& device);
  [[nodiscard]] rt::Task<Result<void>> tell(const can::Frame& frame);

  nodeid::Exchanges exchanges_;
  bool busy_ = false;
  AndAnswer::Kind wanted_ = AndAnswer::Kind::ius;
  // Of the open or last window:
  std::uint16_t heard_ = 0;  // bit n: nibble n
  unsigned frames_ = 0;      // IUS or DIS of any nibble, address answers
  rt::Time first_{};
  AndAnswer last_{};       // address: the last answer
  std::uint8_t part_ = 0;  // inquired
  bool differ_ = false;    // two address answers were not equal
};

}  // namespace berth::research
