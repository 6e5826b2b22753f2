/// The doctor's ear: what a node that only listens learns of a bus. It sends nothing, and takes nothing but what a real
/// controller gives: frames, and the port's own error counters.
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
  Count signs{};                     ///< what only this node sends: error control, EMCY, answers to SDO requests
  Count pdos{};                      ///< identifiers of its TPDOs by the predefined connection set (CiA 301 §7.3.5)
  Count flips{};                     ///< another state than before, with neither boot-up nor NMT command between
  Count resets{};                    ///< NMT reset node and reset communication to it, or to all
  std::uint64_t guard_requests = 0;  ///< remote frames on its error control identifier
  std::uint64_t guard_answers = 0;
  Count error_passive{};  ///< EMCY 8120h
  Count bus_off{};        ///< EMCY 8140h: it was bus-off and came back
  Count overrun{};        ///< EMCY 8110h
  Count collision{};      ///< EMCY 8150h
};

/// All that shows that a node is there. `predefined`: nobody moved a PDO to another identifier, where TPDOs of one node
/// would count as another's.
[[nodiscard]] Count signs_of(const HeardNode& node, bool predefined) noexcept;

/// Boot-ups while the node's heartbeat went on as if nothing had been: a device that starts anew begins its period with
/// its boot-up message. `period` 0: the usual one is what was heard.
[[nodiscard]] Count boots_beside(const HeardNode& node, rt::Duration period);

/// Errors that this port noticed with no good frame between.
struct ErrorRun {
  std::uint32_t count = 0;
  rt::Time first{};  ///< to the poll period
  rt::Time last{};
};

/// Of LSS slaves without a node-ID.
struct BlankAnswers {
  Count all{};          ///< 50h; 4Fh to Fastscan
  Count by_fastscan{};  ///< 4Fh alone, which Lely core's slaves give with a node-ID, too
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
  rt::Duration down{};                 ///< of that time, to the poll period: the port was down or bus-off
  std::uint32_t lost = 0;              ///< frames that reached the port and not the ear, as far as it knows
  bool knows_errors = false;           ///< the port counts errors: without that, no errors prove nothing
  bool knows_bit_rate = false;         ///< the port has a bit rate, and not only the name of one
  std::array<HeardNode, 128> nodes{};  ///< by node-ID; 0 is not used
  std::uint64_t frames = 0;
  std::uint64_t bits = 0;                     ///< of good frames, intermission included
  std::uint64_t worst_bits = 0;               ///< most in one second
  std::uint32_t errors = 0;                   ///< noticed by this port
  std::vector<ErrorRun> runs{};               ///< the first `most_runs`
  std::map<std::uint32_t, Count> collided{};  ///< by key: two different frames of it right after a long run
  std::vector<rt::Time> syncs{};              ///< the first `most_beats`
  BlankAnswers blank{};
  Count lss_requests{};  ///< of another LSS master
  Count given{};         ///< answers of devices that took a node-ID from it
  ShortAnswers short_answers{};
  can::Status worst{};  ///< highest counters of this port, and whether it was bus-off
  bool was_passive = false;

  /// Of an unconfigured node-ID: nothing was heard.
  [[nodiscard]] const HeardNode& node(NodeId id) const noexcept { return nodes[id.configured() ? id.value() : 0U]; }
  [[nodiscard]] std::size_t long_runs() const noexcept;
  [[nodiscard]] rt::Duration listened() const noexcept { return to - from - down; }
  /// Nothing that was sent passed it by: only then does it tell something that it did not hear.
  [[nodiscard]] bool complete() const noexcept { return down.count() == 0 && lost == 0; }
  /// Share of the time, 0..1, at `bit_rate`.
  [[nodiscard]] double load(std::uint32_t bit_rate) const noexcept;
  [[nodiscard]] double worst_load(std::uint32_t bit_rate) const noexcept;
};

/// Listens from its making to its end. Reads the port's status before each frame and every `poll_period`.
class Ear final : private can::Handler, private rt::Job {
 public:
  static constexpr rt::Duration poll_period = std::chrono::milliseconds(20);
  explicit Ear(can::Dispatcher& dispatcher);
  Ear(const Ear&) = delete;
  Ear& operator=(const Ear&) = delete;
  /// What was heard until now.
  [[nodiscard]] const Heard& heard() noexcept;
  /// A frame that this port itself sent, of an ear that shares the port with a master: it is on the bus like any other.
  /// Commands, SYNC, heartbeat and guarding count; its LSS requests are no other master's, and what else it sends is no
  /// sign of a device.
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
    bool excused = false;  // a command or a boot-up: the next state may be another
    bool asked = false;    // by guarding
    rt::Time asked_at{};   // a heartbeat that comes much later is no answer
  };
  can::Dispatcher* dispatcher_;
  Heard heard_{};
  std::array<Memory, 128> memory_{};
  std::uint32_t errors_at_ = 0;  // the port's count when last looked
  std::uint32_t lost_at_ = 0;
  rt::Time looked_at_{};
  bool began_ = false;  // the port was up
  std::optional<ErrorRun> run_{};
  std::optional<can::Frame> behind_run_{};  // the first good frame after a long run
  can::Frame last_request_{};               // on 7E5h
  rt::Time second_{};                       // when the second being measured began
  std::uint64_t second_bits_ = 0;
};

}  // namespace berth::doctor
