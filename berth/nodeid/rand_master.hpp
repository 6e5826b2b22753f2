/// The RAND master: finds every device in state unknown, lowest LSS address first (paper 1 §II, §III; S1.18 to S1.24).
///
/// One procedure finds one device: phase 0 asks all unknown devices; phases 1..7 ask those whose chunks so far are the
/// lowest answered; DIRS makes the remaining one identified. Procedures repeat until no slave answers phase 0. For N
/// devices without trouble: 9 N + 1 requests.
///
///     DiscoveryOptions options;                       // must outlive the task
///     auto report = co_await master.discover(options);
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/nodeid/rand_frames.hpp"
#include "berth/rt/task.hpp"

namespace berth::nodeid {

/// How the master waits after each request. All times from the request's `sent` confirmation.
struct DiscoveryOptions {
  enum class Window : std::uint8_t {
    fixed,  ///< `collect`, regardless of answers (the paper's way)
    quiet,  ///< until `t_resp` of silence, at most `most` (S1.41: the number of answers is not known before)
  };
  Window window = Window::quiet;
  rt::Duration collect = std::chrono::milliseconds(40);  ///< fixed window
  rt::Duration direct{0};  ///< fixed window after DIRS (the paper's T_resp + T_DIS); 0: as `collect`
  rt::Duration t_resp = std::chrono::milliseconds(
      20);                ///< longest time from a request to any device's answer, frame and bus load included
  rt::Duration first{0};  ///< quiet window: longest time to the first answer; 0: `t_resp`
  rt::Duration most = std::chrono::milliseconds(500);  ///< upper bound of the quiet window
  rt::Duration t_proc{0};        ///< the paper's T_proc: from the end of a window to the next request
  rt::Duration inhibit{0};       ///< after each frame of switch identification state selective
  unsigned retries = 4;          ///< restarts at phase 0 in a row without finding a device (S1.20)
  bool widen = true;             ///< each restart in a row doubles the window (up to 16 times), for late answers
  bool confirm_clones = true;    ///< a device that answered DIRS twice is asked again before it is reported as a clone
  unsigned most_devices = 1000;  ///< stop after this number
  rt::Duration send_timeout = std::chrono::seconds(1);  ///< a request not acknowledged by then: `Errc::bus`
};

/// A device that is found so often in one discovery cannot be silenced: the discovery ends.
inline constexpr unsigned most_times_found = 4;

/// A chunk heard in one window.
struct Heard {
  std::uint16_t chunk = 0;
  std::uint16_t times = 0;  ///< frames; equal frames may have merged into one on the bus (S1.19)
  rt::Time first{};
};

/// One request and its result, for live displays and traces.
struct PhaseEvent {
  enum class Kind : std::uint8_t { identify, direct, confirm, any_unknown };
  Kind kind = Kind::identify;  ///< `confirm`: the second question to a possible clone
  unsigned phase = 0;          ///< 0..7, 8 = DIRS
  std::uint16_t mask = 0;
  rt::Time sent{};
  rt::Time ended{};
  const std::vector<Heard>& heard;  ///< distinct chunks in ascending order; valid during the call
  bool answered = false;            ///< DIRS: the requested chunk was among them
  std::uint16_t chosen = 0;         ///< the lowest, when answered
};

/// A found device.
struct Discovered {
  LssAddress address{};
  rt::Time at{};                            ///< its DIS
  unsigned dis_frames = 0;                  ///< DIS heard in the window
  unsigned times_found = 1;                 ///< 2 or more: it returned to unknown (a reset), or there are two of them
  std::array<std::uint16_t, 8> distinct{};  ///< distinct chunks per phase 0..7 of the procedure that found it
  /// Two devices seem to have this address: DIRS was answered twice, or the address was found twice; and when asked
  /// again, DIRS was answered twice again (S1.22). Clones whose DIS always merge into one frame on the bus are not
  /// detected. Without `confirm_clones` the first sign is enough.
  bool possible_clone = false;
};

struct DiscoveryReport {
  enum class End : std::uint8_t {
    complete,  ///< phase 0 stayed unanswered
    gave_up,   ///< `retries` restarts in a row: a slave answers phase 0 and cannot be identified
    stuck,     ///< one address was found repeatedly although its device was switched to identified
    limit,     ///< `most_devices`
    stopped,   ///< by the observer; the next call finds the others
  };
  End end = End::complete;
  std::vector<Discovered> found{};  ///< in the order of finding: ascending unless there were restarts or new arrivals
  unsigned requests = 0;            ///< IURS and DIRS sent
  unsigned restarts = 0;            ///< procedures interrupted by silence in a phase > 0 or at DIRS
  rt::Time began{};
  rt::Time ended{};
};
[[nodiscard]] const char* name(DiscoveryReport::End end) noexcept;

/// Observes a discovery. Must not destroy it.
class DiscoveryObserver {
 public:
  virtual void phase(const PhaseEvent& event) noexcept = 0;
  /// Called again if the device is found again or turns out to be a possible clone.
  virtual void found(const Discovered& device) noexcept = 0;
  /// Silence in `phase` (8 = DIRS): restarts at phase 0.
  virtual void restarted(unsigned phase, rt::Time at) noexcept = 0;
  /// Called after each device. False: the discovery ends as `stopped`.
  virtual bool goes_on() noexcept { return true; }

 protected:
  ~DiscoveryObserver() = default;
};

/// The result of a probe.
struct UnknownReport {
  bool anybody = false;        ///< at least one device in state unknown (or selected)
  std::vector<Heard> heard{};  ///< their chunk(0), ascending
};

class RandMaster;

/// One request and its window. Made by `RandMaster`; its destruction ends it.
class Collect final : public rt::Operation<Collect>, private rt::Job, private can::Confirmation {
 public:
  ~Collect();
  bool start() noexcept;
  /// When the request was sent. The master keeps the answers.
  Result<rt::Time> await_resume() noexcept { return outcome_; }

 private:
  friend class RandMaster;
  // `window` 0: done when sent. `most` 0: fixed window.
  struct Waits {
    rt::Duration window{0};
    rt::Duration first{0};  // 0: `window`
    rt::Duration most{0};
    rt::Duration send_timeout{0};
  };
  Collect(RandMaster& master, const can::Frame& frame, const Waits& waits) noexcept
      : master_(&master), frame_(frame), waits_(waits) {}
  void send() noexcept;
  void sent(rt::Time at) noexcept override;
  void run() noexcept override;
  void heard(rt::Time at) noexcept;
  void fail_with(const char* text) noexcept;
  void end() noexcept;

  RandMaster* master_;
  can::Frame frame_;
  Waits waits_;
  bool listening_ = false;
  rt::Time limit_{};  // of the sending, then of the window
  Result<rt::Time> outcome_{};
};

/// One procedure at a time: a second one meanwhile gives `invalid`. Must outlive its tasks; options and observer are
/// used until the task ends. Must not run beside a Fastscan with feedback on one bus: the identifiers of DIS and
/// feedback overlap (S1.24).
class RandMaster final : private can::Handler {
 public:
  explicit RandMaster(can::Dispatcher& dispatcher);

  /// All slaves to `unknown` or `identified`. Done when sent.
  [[nodiscard]] rt::Task<Result<void>> switch_global(Identification state);
  /// Switches the device with this address to `identified` (S1.31 step 3) or back to `unknown`. Four frames, no answer;
  /// done when the last is sent. `inhibit`: pause after each frame, for devices with a single receive buffer.
  [[nodiscard]] rt::Task<Result<void>> switch_selective(LssAddress address,
                                                        Identification target = Identification::identified,
                                                        rt::Duration inhibit = rt::Duration{0});
  /// Finds all unknown devices. Errors: `bus` a request cannot be sent; `invalid` another procedure is under way.
  [[nodiscard]] rt::Task<Result<DiscoveryReport>> discover(const DiscoveryOptions& options,
                                                           DiscoveryObserver* observer = nullptr);
  /// One IURS of phase 0: whether an unknown slave is there. For polling while the machine runs. A slave that answered
  /// is then `selected`, and answers the next phase 0 again.
  [[nodiscard]] rt::Task<Result<UnknownReport>> any_unknown(const DiscoveryOptions& options,
                                                            DiscoveryObserver* observer = nullptr);

 private:
  friend class Collect;
  struct Run;    // one discovery or probe
  struct Lease;  // holds `busy_`
  enum class Outcome : std::uint8_t { nobody, silent, found };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void note(std::uint16_t chunk, rt::Time at) noexcept;
  [[nodiscard]] Collect request(const can::Frame& frame, const Collect::Waits& waits) noexcept;
  [[nodiscard]] rt::Task<Result<void>> tell(Run& run, LssAddress address, Identification target);
  [[nodiscard]] rt::Task<Result<bool>> ask(Run& run, unsigned phase, std::uint16_t mask);
  [[nodiscard]] rt::Task<Result<Outcome>> procedure(Run& run);
  [[nodiscard]] rt::Task<Result<bool>> asked_again(Run& run, LssAddress address);
  [[nodiscard]] rt::Task<Result<void>> record(Run& run);

  can::Dispatcher* dispatcher_;
  Collect* current_ = nullptr;
  bool busy_ = false;
  bool direct_ = false;       // the window belongs to a DIRS
  std::vector<Heard> heard_;  // of the last window, ascending
};

}  // namespace berth::nodeid
