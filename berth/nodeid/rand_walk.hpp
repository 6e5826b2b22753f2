/// The walk through the tree of chunks: Berth's own master for RAND slaves, with the same requests as `RandMaster`.
///
/// The published procedure needs nine requests for each device and discards what it heard. The walk keeps every chunk
/// of every window: the addresses of all devices form a tree of eight levels, and an IUS of phase 7 under a full prefix
/// is a whole address (docs/rand.md, "Walk"). There are two kinds of slaves:
///
/// - *Resuming* slaves (the extension of docs/rand.md, `RandSlaveOptions::resume`) can be asked for any prefix in one
///   request. So each node of the tree is visited once, and known parts of their types are skipped.
/// - *Paper* slaves have to be led from phase 0 to each further branch. On known parts of the way a window closes at
///   the expected chunk.
///
/// In the end every found device is `identified`, and phase 0 is asked until no slave answers, like at the end of the
/// published procedure. So another round finds a missed slave (late answer, lost frame, new device). An address that
/// could combine answers of two devices is not reported: see `WalkOptions::longest`.
///
///     WalkOptions options;                            // must outlive the task, as `kinds` must
///     auto report = co_await walk.discover(kinds, options);
#pragma once

#include <map>
#include <optional>
#include <span>
#include <vector>

#include "berth/nodeid/exchange.hpp"
#include "berth/nodeid/rand_master.hpp"

namespace berth::nodeid {

/// A device type that may be present: its chunks need not be asked for. A wrong guess costs time.
struct WalkKind {
  TypeCode type{};
  std::optional<std::uint32_t> revision{};  ///< if known
};

struct WalkOptions {
  /// The longest time from a sent request to any device's answer, frame and bus load included. It is the window of a
  /// request that no device answers, and the shortest time from a request to a phase 7, whose answers must not be
  /// confused with the previous ones. A later answer costs time if it is alone; see `prove_all`.
  rt::Duration longest = std::chrono::milliseconds(20);
  /// A window closes this time after its last answer. 0: learnt from the gaps between answers, within `shortest` and
  /// `longest`, plus `blocking`.
  rt::Duration after_last{0};
  rt::Duration shortest = std::chrono::milliseconds(1);
  rt::Duration blocking{0};  ///< the bus's worst blocking of an answer: added to the learnt time
  rt::Duration most = std::chrono::milliseconds(500);  ///< longest window
  rt::Duration inhibit{0};                             ///< shortest time from the end of a window to the next request
  bool resume = true;      ///< ask for resuming slaves first; costs one unanswered request if there are none
  bool prove_all = false;  ///< DIRS and DIS prove every paper slave's address: against forged answers
  unsigned retries = 4;    ///< rounds in a row without a new device while phase 0 is answered
  unsigned most_devices = 1000;
  rt::Duration send_timeout = std::chrono::seconds(1);
};

/// A found device.
struct Walked {
  LssAddress address{};
  rt::Time at{};             ///< its IUS of phase 7
  bool resumes = false;      ///< supports the extension
  bool proven = false;       ///< it sent DIS
  unsigned times_found = 1;  ///< rounds in which it was heard
  /// Two devices seem to have this address: answers came twice, and twice again when asked again.
  bool possible_clone = false;
};

struct WalkReport {
  DiscoveryReport::End end = DiscoveryReport::End::complete;
  std::vector<Walked> found{};  ///< in the order of finding: no order is guaranteed (SX.2)
  unsigned requests = 0;        ///< IURS, resume requests and DIRS
  unsigned switches = 0;        ///< switch identification state frames
  unsigned rounds = 0;          ///< closing phase 0s, including the last, unanswered one
  unsigned dead_branches = 0;   ///< prefixes that no slave answered
  unsigned dropped = 0;         ///< addresses heard once that could not be proven
  rt::Time began{};
  rt::Time known{};     ///< when every address was known and heard alone under its prefix
  rt::Time silenced{};  ///< when all were identified
  rt::Time ended{};     ///< when phase 0 stayed unanswered
};

/// Observes a walk. Must not destroy it.
class WalkObserver {
 public:
  virtual void found(const Walked& device) noexcept = 0;
  /// Called between two requests. False: the heard addresses are proven and reported, and the walk ends as `stopped`.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~WalkObserver() = default;
};

/// One procedure at a time: a second one gives `invalid`. Must outlive its tasks. Must not run beside an active
/// `RandMaster` or a Fastscan with feedback on one bus (S1.24).
class RandWalk final : private can::Handler {
 public:
  explicit RandWalk(can::Dispatcher& dispatcher);

  /// Finds all unknown devices. Errors: `bus` a request cannot be sent; `invalid` something else is under way.
  [[nodiscard]] rt::Task<Result<WalkReport>> discover(std::span<const WalkKind> kinds, const WalkOptions& options,
                                                      WalkObserver* observer = nullptr);

 private:
  struct Run;
  struct Lease;
  struct Node;
  /// The first `depth` chunks of an address.
  struct Prefix {
    std::array<std::uint16_t, 8> chunks{};
    unsigned depth = 0;
    friend auto operator<=>(const Prefix&, const Prefix&) = default;
  };
  struct Heard {
    std::uint16_t chunk = 0;
    unsigned times = 0;
    rt::Time at{};
  };
  /// How to wait for the answers to one request.
  struct Wait {
    rt::Duration first{0};
    rt::Duration after_last{0};
    bool direct = false;  ///< waits for DIS instead of IUS
    bool early = false;   ///< closes when all of `expected_` were heard
  };
  enum class Proof : std::uint8_t { none, once, twice };

  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void note(std::uint16_t chunk, rt::Time at) noexcept;
  [[nodiscard]] bool is_heard(std::uint16_t chunk) const noexcept;
  [[nodiscard]] rt::Duration response(const WalkOptions& options) const noexcept;
  [[nodiscard]] rt::Time now() const noexcept { return exchanges_.dispatcher().executor().now(); }
  [[nodiscard]] rt::Task<Result<bool>> ask(Run& run, const can::Frame& frame, Wait wait);
  [[nodiscard]] rt::Task<Result<void>> tell(Run& run, LssAddress address, Identification target);
  // Resuming slaves
  [[nodiscard]] rt::Task<Result<unsigned>> resuming(Run& run);
  [[nodiscard]] rt::Task<Result<void>> subtree(Run& run, const Prefix& root);
  // Paper slaves
  [[nodiscard]] rt::Task<Result<void>> paper(Run& run, const std::vector<std::uint16_t>& first);
  [[nodiscard]] rt::Task<Result<void>> descend(Run& run, bool root_heard);
  [[nodiscard]] bool expect(Run& run, const Prefix& prefix);
  [[nodiscard]] rt::Task<Result<void>> leaf(Run& run, const Prefix& prefix);
  [[nodiscard]] rt::Task<Result<void>> try_serial(Run& run, const Prefix& prefix, std::uint16_t chunk);
  [[nodiscard]] rt::Task<Result<bool>> lead(Run& run, LssAddress address);
  // Both
  [[nodiscard]] rt::Task<Result<Proof>> prove(Run& run, LssAddress address, bool resumes, bool whole_window);
  [[nodiscard]] rt::Task<Result<void>> settle(Run& run);
  [[nodiscard]] rt::Task<Result<void>> clones(Run& run);
  [[nodiscard]] rt::Task<Result<bool>> closing(Run& run);
  [[nodiscard]] rt::Task<Result<bool>> look(Run& run);

  Exchanges exchanges_;
  bool busy_ = false;
  bool direct_ = false;  // the window is for DIS
  bool early_ = false;
  std::vector<Heard> heard_;              // of the open or last window, ascending
  std::vector<std::uint16_t> expected_;   // not heard yet
  std::vector<std::uint16_t> late_;       // IUS between the end of a window and the sending of the next request
  std::vector<std::uint16_t> extra_dis_;  // DIS outside their windows
  rt::Duration slowest_{0};               // longest time from a request to an answer
  unsigned answers_ = 0;
};

}  // namespace berth::nodeid
