/// The walk of the tree of chunks: Berth's own master for RAND slaves, made of the same requests as `RandMaster`.
///
/// The published procedure asks nine times for each device and forgets what it heard. The walk keeps every chunk of
/// every window: the addresses of all devices are a tree of eight levels, and an IUS of phase 7 under a full prefix is
/// a whole address (docs/rand.md, "Walk"). Two kinds of slaves:
///
/// - *Resuming* slaves (the extension of docs/rand.md, `RandSlaveOptions::resume`) are asked for any prefix in one
///   request, so each node of the tree is visited once, and what is known of their types is skipped.
/// - *Paper* slaves have to be led from phase 0 to each further branch. On the way through what is known a window
///   closes at the chunk that was expected.
///
/// In the end every device that was found is `identified`, and phase 0 is asked until no slave answers, as the
/// published procedure ends: so a slave that was missed (an answer too late, a frame lost, a device that joined) is
/// found by another round. No address is reported that could be made of answers of two devices: see
/// `WalkOptions::longest`.
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

/// A device type that may be there: its chunks need not be asked for. Being wrong costs time.
struct WalkKind {
  TypeCode type{};
  std::optional<std::uint32_t> revision{};  ///< when it is known
};

struct WalkOptions {
  /// No device answers later than this after a request is on the wire, frame and bus load included: the window of a
  /// request that no device answers, and the least time from one request to a phase 7 whose answers must not be those
  /// of the request before. An answer later than that costs time when it is alone; see `prove_all`.
  rt::Duration longest = std::chrono::milliseconds(20);
  /// A window closes so long after its last answer. 0: learnt from the gaps between answers that were heard, within
  /// `shortest` and `longest`, plus `blocking`.
  rt::Duration after_last{0};
  rt::Duration shortest = std::chrono::milliseconds(1);
  rt::Duration blocking{0};  ///< the bus's worst blocking of an answer: added to what is learnt
  rt::Duration most = std::chrono::milliseconds(500);  ///< no window is longer
  rt::Duration inhibit{0};                             ///< least time between the end of a window and the next request
  bool resume = true;      ///< ask for resuming slaves first; one unanswered request when there are none
  bool prove_all = false;  ///< every paper slave's address is proven by DIRS and DIS: against forged answers
  unsigned retries = 4;    ///< rounds in a row that find no new device while phase 0 is answered
  unsigned most_devices = 1000;
  rt::Duration send_timeout = std::chrono::seconds(1);
};

/// One device that was found.
struct Walked {
  LssAddress address{};
  rt::Time at{};             ///< its IUS of phase 7
  bool resumes = false;      ///< has the extension
  bool proven = false;       ///< has sent DIS
  unsigned times_found = 1;  ///< rounds in which it was heard
  /// Two devices seem to have this address: answers came twice, and when asked again twice again.
  bool possible_clone = false;
};

struct WalkReport {
  DiscoveryReport::End end = DiscoveryReport::End::complete;
  std::vector<Walked> found{};  ///< in the order of finding: no order is promised (SX.2)
  unsigned requests = 0;        ///< IURS, resume requests and DIRS
  unsigned switches = 0;        ///< switch identification state frames
  unsigned rounds = 0;          ///< closing phase 0s, the last of them unanswered
  unsigned dead_branches = 0;   ///< prefixes that no slave answered for
  unsigned dropped = 0;         ///< addresses that were heard once and could not be proven
  rt::Time began{};
  rt::Time known{};     ///< every address was known and heard alone under its prefix
  rt::Time silenced{};  ///< all are identified
  rt::Time ended{};     ///< phase 0 stayed unanswered
};

/// Watches a walk. Must not destroy it.
class WalkObserver {
 public:
  virtual void found(const Walked& device) noexcept = 0;
  /// Asked between two requests. False: what was heard is proven and told, and the walk ends, `stopped`.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~WalkObserver() = default;
};

/// One procedure at a time: a second one gives `invalid`. Must outlive its tasks. Never beside a `RandMaster` at work,
/// nor a Fastscan with feedback, on one bus (S1.24).
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
  /// How one request is to be waited for.
  struct Wait {
    rt::Duration first{0};
    rt::Duration after_last{0};
    bool direct = false;  ///< DIS counts, not IUS
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
  bool direct_ = false;  // the window is one for DIS
  bool early_ = false;
  std::vector<Heard> heard_;              // of the open or last window, ascending
  std::vector<std::uint16_t> expected_;   // not heard yet
  std::vector<std::uint16_t> late_;       // IUS between the end of a window and the next request on the wire
  std::vector<std::uint16_t> extra_dis_;  // DIS outside the windows for them
  rt::Duration slowest_{0};               // from a request to an answer
  unsigned answers_ = 0;
};

}  // namespace berth::nodeid
