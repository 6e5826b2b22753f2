/// Emergency objects (CiA 301 §7.2.7, objects 1001h, 1003h, 1014h, 1015h; docs/protocols/cia301.md §Emergencies).
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/cob_id.hpp"

namespace berth::co {

/// Bits of the error register 1001h. `generic` is set whenever any other is.
namespace error_register {
inline constexpr std::uint8_t generic = 0x01, current = 0x02, voltage = 0x04, temperature = 0x08, communication = 0x10,
                              profile = 0x20, manufacturer = 0x80;
}

/// Codes that Berth itself sends (CiA 301 table 26).
namespace emcy_code {
inline constexpr std::uint16_t error_reset = 0x0000, can_overrun = 0x8110, error_passive = 0x8120,
                               life_guard_or_heartbeat = 0x8130, recovered_from_bus_off = 0x8140, id_collision = 0x8150,
                               pdo_length = 0x8210, pdo_too_long = 0x8220, mpdo_destination = 0x8230,
                               sync_length = 0x8240, rpdo_timeout = 0x8250;
}

/// What an emergency code means: "life guard or heartbeat error"; by class for others ("current, device input side");
/// never null.
[[nodiscard]] const char* emcy_text(std::uint16_t code) noexcept;

struct Emcy {
  std::uint16_t code = 0;
  std::uint8_t error_register = 0;
  std::array<std::uint8_t, 5> info{};  ///< manufacturer-specific
  friend bool operator==(const Emcy&, const Emcy&) noexcept = default;
};

/// Messages about other devices, sent under this device's identifier after its own: a gateway forwards them.
class EmcyBacklog {
 public:
  /// The next message; null: none.
  [[nodiscard]] virtual const Emcy* front() const noexcept = 0;
  /// The message was sent.
  virtual void pop() noexcept = 0;

 protected:
  ~EmcyBacklog() = default;
};

/// Keeps a device's active errors, its error register and its emergency messages.
///
/// An error is raised once and cleared once. Its code identifies it, together with its source if one code has several
/// sources (heartbeats of several nodes: 8130h). Clearing the last error sends 0000h "error reset" with register 0.
/// Clearing one of several sends the newest remaining error again, with its own manufacturer-specific bytes and the
/// current register. CiA 301 allows 00xxh there, too, but peers take each 00xxh for a reset of all errors
/// (python-canopen, `emcy.py`: `code & 0xFF00 == 0` empties its list).
/// Messages wait while the service is off (initialising, stopped), while 1014h is invalid, and for the inhibit time. If
/// more than `queue_size` wait, the oldest is dropped and counted.
class EmcyProducer final : private rt::Job {
 public:
  static constexpr std::size_t most_errors = 16;
  static constexpr std::size_t queue_size = 16;
  explicit EmcyProducer(can::Dispatcher& dispatcher) noexcept : dispatcher_(&dispatcher) {}

  /// 1014h: the COB-ID of messages. A device's default is `CobId(emcy_id(node))`.
  void set_cob_id(CobId id) noexcept;
  /// 1015h (as a duration): shortest time between two messages.
  void set_inhibit(rt::Duration time) noexcept { inhibit_ = time; }
  /// Whether the NMT state allows EMCY (`Services::emcy`).
  void enable(bool on) noexcept;
  /// Sends the messages of `backlog` when none of the device's own waits, under the same conditions. `backlog` must
  /// stay until it is replaced by null; a reset keeps it.
  void set_backlog(EmcyBacklog* backlog) noexcept { backlog_ = backlog; }
  /// Call when the backlog has more messages.
  void send_backlog() noexcept { flush(); }
  /// Messages about a cleared error carry its code in the last two manufacturer-specific bytes (paper 3 Figure 8).
  void tell_exits(bool on) noexcept { tells_exits_ = on; }
  /// Reset: forgets errors and waiting messages and sends nothing; the register is 0, the service off.
  void reset() noexcept;

  /// False when the error is active already, the code is 00xxh, or `most_errors` are active.
  bool raise(std::uint16_t code, std::uint8_t register_bits, const std::array<std::uint8_t, 5>& info = {},
             std::uint8_t source = 0) noexcept;
  /// False when the error is not active.
  bool clear(std::uint16_t code, const std::array<std::uint8_t, 5>& info = {}, std::uint8_t source = 0) noexcept;
  /// True for an error from any source.
  [[nodiscard]] bool active(std::uint16_t code) const noexcept;
  [[nodiscard]] bool active(std::uint16_t code, std::uint8_t source) const noexcept;
  /// Object 1001h.
  [[nodiscard]] std::uint8_t error_register() const noexcept;
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  struct Active {
    std::uint16_t code = 0;
    std::uint8_t bits = 0;
    std::uint8_t source = 0;
    std::array<std::uint8_t, 5> info{};
  };
  void queue(const Emcy& message) noexcept;
  void flush() noexcept;
  [[nodiscard]] const Emcy* next() const noexcept;
  void sent() noexcept;
  void run() noexcept override { flush(); }
  can::Dispatcher* dispatcher_;
  CobId cob_id_;
  rt::Duration inhibit_{};
  rt::Time free_at_{};
  std::array<Active, most_errors> errors_{};
  std::size_t error_count_ = 0;
  std::array<Emcy, queue_size> queue_{};
  std::size_t first_ = 0;
  std::size_t waiting_ = 0;
  std::uint64_t dropped_ = 0;
  EmcyBacklog* backlog_ = nullptr;
  bool enabled_ = false;
  bool tells_exits_ = false;
};

/// Pre-defined error field, object 1003h: the newest error is at sub-index 1, the oldest drops out. Codes 0000h and
/// 00xxh are not kept.
class ErrorField {
 public:
  static constexpr std::size_t size = 16;
  void push(const Emcy& message) noexcept;
  void clear() noexcept { count_ = 0; }
  [[nodiscard]] std::uint8_t count() const noexcept { return static_cast<std::uint8_t>(count_); }
  /// Sub-index 1..count: bits 15..0 code, 31..16 the first two bytes of `info`. 0 beyond the count (there the
  /// dictionary answers 0800 0024).
  [[nodiscard]] std::uint32_t at(std::uint8_t sub) const noexcept;

 private:
  std::array<std::uint32_t, size> entries_{};
  std::size_t count_ = 0;
};

/// Receives emergency messages. Ignores frames shorter than 8 bytes (CiA 301 fixes DLC 8).
class EmcyConsumer final : private can::Handler {
 public:
  class Observer {
   public:
    virtual void emergency(NodeId node, const Emcy& message, rt::Time at) noexcept = 0;

   protected:
    ~Observer() = default;
  };
  EmcyConsumer(can::Dispatcher& dispatcher, Observer& observer) noexcept
      : dispatcher_(&dispatcher), observer_(&observer) {}

  /// Hears all nodes on 081h..0FFh.
  void hear_all();
  /// Reserves memory for so many identifiers, so that `hear` allocates none.
  void reserve(std::size_t identifiers) { sources_.reserve(identifiers); }
  /// Hears one node on another identifier (1028h). An invalid `id` is ignored.
  void hear(NodeId node, CobId id);
  void clear() noexcept;

 private:
  struct Source {
    std::uint32_t key;
    NodeId node;
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  can::Dispatcher* dispatcher_;
  Observer* observer_;
  std::vector<Source> sources_;
  bool all_ = false;
};

}  // namespace berth::co
