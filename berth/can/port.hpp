/// A node's access to a bus: the interface between Berth and the bus hardware or simulation.
///
/// Every port guarantees:
/// - Own frames come back as `sent`, never as `received`. A frame is `sent` when it was acknowledged on the wire.
/// - In every scheme here an answer outranks the next request. So frames received before the `sent` of a request belong
///   to the request before. Reply windows start at that confirmation.
/// - The queue is bounded; `send` reports when it is full.
/// - `Listener` is called from the executor, one call per job, never from inside `send`.
#pragma once

#include <cstdint>
#include <span>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::can {

struct Status {
  std::uint32_t bit_rate = 0;  ///< bit/s; 0 = unknown to this port
  std::uint16_t tec = 0;       ///< transmit error counter, where the port knows it
  std::uint16_t rec = 0;       ///< receive error counter, where the port knows it
  std::uint16_t queued = 0;    ///< frames that wait to be sent
  std::uint32_t errors = 0;    ///< errors noticed by this node so far, also of its own frames; wraps at 2^32
  std::uint32_t lost = 0;      ///< received frames that never reached the listener, as far as known; keeps counting
  bool listen_only = false;
  bool bus_off = false;
  bool up = false;                 ///< interface up, cable in, power on
  bool knows_counters = false;     ///< `tec` and `rec` are real
  bool knows_sent = false;         ///< `sent` comes at the true end of the frame, not when the driver accepted it
  bool knows_errors = false;       ///< `errors` is real, like error frames of a SocketCAN interface
  bool bit_rate_is_label = false;  ///< `bit_rate` is the user's value: the interface (vcan) has none

  [[nodiscard]] bool error_passive() const noexcept { return tec > 127 || rec > 127; }
};

/// Result of `send`.
enum class Queued : std::uint8_t { yes, full, bus_off, listen_only, closed };

class Listener {
 public:
  /// A frame from another node that passed the filter; `at` is the end of the frame.
  virtual void received(const Frame& frame, rt::Time at) noexcept = 0;
  /// True: the listener has stored the frame for later, and `received` is not called. A simulated bus calls this from
  /// its own job, which saves one job of each node: the listener must do nothing else, neither send nor call.
  virtual bool put_by(const Frame& /*frame*/, rt::Time /*at*/) noexcept { return false; }
  /// The frame that was sent with this tag was acknowledged on the wire.
  virtual void sent(std::uint32_t tag, rt::Time at) noexcept = 0;
  /// Error state, bus-off, cable or interface changed. Not called for each error: `Port::status` counts them.
  virtual void changed(const Status& status, rt::Time at) noexcept = 0;
  /// The port reports an error on the bus (bus_error.hpp), if it can: for lists of frames. It may report fewer than
  /// there were.
  virtual void error(const Frame& /*report*/, rt::Time /*at*/) noexcept {}

 protected:
  ~Listener() = default;
};

class Port {
 public:
  virtual ~Port() = default;
  /// Queues a frame. `Listener::sent` returns `tag`; with tag 0 `sent` is not called.
  virtual Queued send(const Frame& frame, std::uint32_t tag) noexcept = 0;
  /// Withdraws a queued frame. A frame already on the wire is still sent, but not repeated if that attempt fails.
  virtual void withdraw(std::uint32_t tag) noexcept = 0;
  /// Sets the listener and the keys (`Frame::key`) that pass, like a controller's acceptance filter; both are replaced.
  /// A null listener receives nothing. The listener must stay until replaced.
  virtual void listen(Listener* listener, std::span<const IdRange> accept) noexcept = 0;
  [[nodiscard]] virtual Status status() const noexcept = 0;
  /// Restarts the controller at a bit rate: for LSS bit timing and after bus-off. Queued frames are dropped.
  virtual bool restart(std::uint32_t bit_rate) noexcept = 0;
};

/// A frame ended by an error, as seen by a bus that knows all nodes.
struct BusError {
  Frame report;               ///< bus_error.hpp; its counters are those of `first`
  Frame frame;                ///< the frame that was sent
  int sender = -1;            ///< port of the sender
  int first = -1;             ///< the port that signalled the error first, by an error flag
  unsigned beside_first = 0;  ///< ports that signalled it in the same bit
};

/// Receives every frame of a bus when it ends: for recorders and monitors. Called from the executor.
class Tap {
 public:
  /// `sender` is the bus's number of a port, or -1 if unknown.
  virtual void frame(const Frame& frame, rt::Time at, int sender) noexcept = 0;
  /// `at` is the beginning of the first error flag.
  virtual void error(const BusError& /*error*/, rt::Time /*at*/) noexcept {}

 protected:
  ~Tap() = default;
};

}  // namespace berth::can
