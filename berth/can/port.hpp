/// A node's access to a bus: the border between Berth and whatever moves frames.
///
/// What every port promises:
/// - Own frames come back as `sent`, never as `received`. A frame is `sent` when it was acknowledged on the wire.
/// - In every scheme here an answer outranks the next request, so the `sent` of a request is the fence: what was heard
///   before it belongs to the request before. Reply windows start at that confirmation.
/// - The queue is bounded; `send` says when it is full.
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
  std::uint32_t errors = 0;    ///< errors this node has noticed so far, its own frames' included; counts on over 2^32
  std::uint32_t lost = 0;      ///< frames that came in and never reached the listener, as far as known; counts on
  bool listen_only = false;
  bool bus_off = false;
  bool up = false;                 ///< interface up, cable in, power on
  bool knows_counters = false;     ///< `tec` and `rec` are real
  bool knows_sent = false;         ///< `sent` comes at the true end of the frame, not when the driver took it
  bool knows_errors = false;       ///< `errors` is real, as error frames of a SocketCAN interface are
  bool bit_rate_is_label = false;  ///< `bit_rate` is what the user said: the interface (vcan) has none

  [[nodiscard]] bool error_passive() const noexcept { return tec > 127 || rec > 127; }
};

/// What became of a frame given to `send`.
enum class Queued : std::uint8_t { yes, full, bus_off, listen_only, closed };

class Listener {
 public:
  /// A frame that another node sent and that passed the filter; `at` is the end of the frame.
  virtual void received(const Frame& frame, rt::Time at) noexcept = 0;
  /// True: the listener has put the frame by, to deal with it later, and `received` is not called. A simulated bus asks
  /// from its own job, which saves one of each node: the listener must do nothing else, neither send nor call.
  virtual bool put_by(const Frame& /*frame*/, rt::Time /*at*/) noexcept { return false; }
  /// The frame that was sent with this tag was acknowledged on the wire.
  virtual void sent(std::uint32_t tag, rt::Time at) noexcept = 0;
  /// Error state, bus-off, cable or interface changed. Not for each error: to count them, ask `Port::status`.
  virtual void changed(const Status& status, rt::Time at) noexcept = 0;
  /// The port reports an error on the bus (bus_error.hpp), where it can: for who lists frames. A port may tell fewer
  /// than there were.
  virtual void error(const Frame& /*report*/, rt::Time /*at*/) noexcept {}

 protected:
  ~Listener() = default;
};

class Port {
 public:
  virtual ~Port() = default;
  /// Queues a frame. `tag` comes back with `Listener::sent`; tag 0: `sent` is not called.
  virtual Queued send(const Frame& frame, std::uint32_t tag) noexcept = 0;
  /// Takes a frame back that is still queued; one that is on the wire is sent all the same, and not repeated when that
  /// attempt fails.
  virtual void withdraw(std::uint32_t tag) noexcept = 0;
  /// Sets the listener and which keys (`Frame::key`) pass, like a controller's acceptance filter; both are replaced.
  /// A null listener hears nothing. The listener must stay until replaced.
  virtual void listen(Listener* listener, std::span<const IdRange> accept) noexcept = 0;
  [[nodiscard]] virtual Status status() const noexcept = 0;
  /// Starts the controller anew at a bit rate: LSS bit timing, and the way out of bus-off. Queued frames are dropped.
  virtual bool restart(std::uint32_t bit_rate) noexcept = 0;
};

/// A frame that an error ended, as a bus sees it that knows all nodes.
struct BusError {
  Frame report;               ///< bus_error.hpp; its counters are those of `first`
  Frame frame;                ///< that was sent
  int sender = -1;            ///< by this port
  int first = -1;             ///< the port that signalled the error first, by an error flag
  unsigned beside_first = 0;  ///< ports that did the same in the same bit
};

/// Sees every frame of a bus as it ends: recorders and monitors. Called from the executor.
class Tap {
 public:
  /// `sender` is a port number that the bus gives, or -1 where it is unknown.
  virtual void frame(const Frame& frame, rt::Time at, int sender) noexcept = 0;
  /// `at` is the beginning of the first error flag.
  virtual void error(const BusError& /*error*/, rt::Time /*at*/) noexcept {}

 protected:
  ~Tap() = default;
};

}  // namespace berth::can
