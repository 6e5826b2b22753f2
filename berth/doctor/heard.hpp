/// The doctor's ear: what a listening node learns of a bus. It sends nothing, and uses only what a real controller
/// provides: frames, and the port's own error counters.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/dispatcher.hpp"

namespace berth::doctor {

/// How often, first and last.
struct Count {
  std::uint64_t count = 0;
  rt::Time first{};
  rt::Time last{};
  void add(rt::Time at) noexcept {
    if (count++ == 0) first = at;
    last = at;
  }
};

struct Beat {
  rt::Time at{};
  NmtState state = NmtState::initialising;
};

/// One node-ID.
struct HeardNode {
  std::vector<Beat> beats{};         ///< heartbeats, the first `most_beats`
  std::vector<rt::Time> boots{};     ///< boot-up messages, the first `most_boots`
  Count beat{};                      ///< all heartbeats
  Count boot{};                      ///< all boot-up messages
  Count signs{};                     ///< frames only from this node: error control, EMCY, answers to SDO requests
  Count pdos{};                      ///< identifiers of its TPDOs by the predefined connection set (CiA 301 §7.3.5)
  Count flips{};                     ///< a changed state without boot-up or NMT command in between
  Count resets{};                    ///< NMT reset node and reset communication to it, or to all
  std::uint64_t guard_requests = 0;  ///< remote frames on its error control identifier
  std::uint64_t guard_answers = 0;
  Count error_passive{};  ///< EMCY 8120h
  Count bus_off{};        ///< EMCY 8140h: it recovered from bus-off
  Count overrun{};        ///< EMCY 8110h
  Count collision{};      ///< EMCY 8150h
};

/// All signs that a node is there. `predefined`: no PDO was moved to another identifier; otherwise TPDOs of one node
/// would count as another's.
[[nodiscard]] Count signs_of(const HeardNode& node, bool predefined) noexcept;

/// Boot-ups during which the node's heartbeat continued undisturbed: a device that starts anew begins its period with
/// its boot-up message. `period` 0: the usual one is taken from the heartbeats.
[[nodiscard]] Count boots_beside(const HeardNode& node, rt::Duration period);

/// Errors seen by this port without a good frame in between.
struct ErrorRun {
  std::uint32_t count = 0;
  rt::Time first{};  ///< precise to the poll period
  rt::Time last{};
};

/// Of LSS slaves without a node-ID.
struct BlankAnswers {
  Count all{};          ///< 50h; 4Fh to Fastscan
  Count by_fastscan{};  ///< only 4Fh, which Lely core's slaves also send with a node-ID
};

/// Of LSS slaves, with fewer than 8 bytes.
struct ShortAnswers {
  Count all{};
  can::Frame first_frame{};
};

struct Heard {
  static constexpr std::size_t most_beats = 2048;
  static constexpr std::size_t most_boots = 64;
  static constexpr std::size_t most_runs = 512;
  static constexpr std::uint32_t long_run = 8;  ///< noise does not destroy so many attempts in a row

  rt::Time from{};  ///< when the port came up, if it was down at first
  rt::Time to{};
  rt::Duration down{};                 ///< part of that time, precise to the poll period: the port was down or bus-off
  std::uint32_t lost = 0;              ///< frames that reached the port but not the ear, as far as known
  bool knows_errors = false;           ///< the port counts errors: otherwise the absence of errors proves nothing
  bool knows_bit_rate = false;         ///< the port has a real bit rate, not only a nominal one
  std::array<HeardNode, 128> nodes{};  ///< by node-ID; 0 is not used
  std::uint64_t frames = 0;
  std::uint64_t bits = 0;                     ///< of good frames, intermission included
  std::uint64_t worst_bits = 0;               ///< most in one second
  std::uint32_t errors = 0;                   ///< seen by this port
  std::vector<ErrorRun> runs{};               ///< the first `most_runs`
  std::map<std::uint32_t, Count> collided{};  ///< by key: two different frames of one identifier right after a long run
  std::vector<rt::Time> syncs{};              ///< the first `most_beats`
  BlankAnswers blank{};
  Count lss_requests{};  ///< of another LSS master
  Count given{};         ///< answers of devices that accepted a node-ID from it
  ShortAnswers short_answers{};
  can::Status worst{};  ///< highest counters of this port, and whether it was bus-off
  bool was_passive = false;

  /// Of an unconfigured node-ID: nothing was heard.
  [[nodiscard]] const HeardNode& node(NodeId id) const noexcept { return nodes[id.configured() ? id.value() : 0U]; }
  [[nodiscard]] std::size_t long_runs() const noexcept;
  [[nodiscard]] rt::Duration listened() const noexcept { return to - from - down; }
  /// No frame was missed: only then does silence prove something.
  [[nodiscard]] bool complete() const noexcept { return down.count() == 0 && lost == 0; }
  /// Share of the time, 0..1, at `bit_rate`.
  [[nodiscard]] double load(std::uint32_t bit_rate) const noexcept;
  [[nodiscard]] double worst_load(std::uint32_t bit_rate) const noexcept;
};

/// Listens during its lifetime. Reads the port's status before each frame and every `poll_period`.
class Ear final : private can::Handler, private rt::Job {
 public:
  static constexpr rt::Duration poll_period = std::chrono::milliseconds(20);
  explicit Ear(can::Dispatcher& dispatcher);
  Ear(const Ear&) = delete;
  Ear& operator=(const Ear&) = delete;
  /// What was heard so far.
  [[nodiscard]] const Heard& heard() noexcept;
  /// A frame sent by this port itself, for an ear that shares the port with a master: it is on the bus like any other.
  /// Commands, SYNC, heartbeat and guarding count; its LSS requests do not count as another master's, and its other
  /// frames are no sign of a device.
  void own(const can::Frame& frame, rt::Time at) noexcept;

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void look(rt::Time at) noexcept;
  void attend(const can::Status& status, rt::Time at) noexcept;
  void end_run(rt::Time at) noexcept;
  void error_control(NodeId node, const can::Frame& frame, rt::Time at) noexcept;
  void emergency(NodeId node, const can::Frame& frame, rt::Time at) noexcept;
  void commanded(const can::Frame& frame, rt::Time at) noexcept;
  void lss(const can::Frame& frame, rt::Time at) noexcept;
  void measure(const can::Frame& frame, rt::Time at) noexcept;

  struct Memory {  // of one node-ID
    std::optional<NmtState> state{};
    bool excused = false;  // after a command or a boot-up, the next state may differ
    bool asked = false;    // by guarding
    rt::Time asked_at{};   // a much later heartbeat is no answer
  };
  can::Dispatcher* dispatcher_;
  Heard heard_{};
  std::array<Memory, 128> memory_{};
  std::uint32_t errors_at_ = 0;  // the port's counter at the last look
  std::uint32_t lost_at_ = 0;
  rt::Time looked_at_{};
  bool began_ = false;  // the port was up
  std::optional<ErrorRun> run_{};
  std::optional<can::Frame> behind_run_{};  // the first good frame after a long run
  can::Frame last_request_{};               // on 7E5h
  rt::Time second_{};                       // beginning of the measured second
  std::uint64_t second_bits_ = 0;
};

}  // namespace berth::doctor
