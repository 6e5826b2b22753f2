/// One node's CAN controller on a simulated bus.
#pragma once

#include <cstdint>
#include <string>

#include "berth/can/port.hpp"
#include "berth/rt/executor.hpp"
#include "berth/sim/bus_node.hpp"

namespace berth::sim {

class Bus;

struct ControllerOptions {
  std::string name{};
  TxOrder queue = TxOrder::in_order;
  unsigned queue_depth = 32;   ///< frames that can wait to be sent; beyond that `send` returns `full`
  unsigned rx_depth = 64;      ///< frames that can wait for the host; 1 = single-slot receive buffer
  rt::Duration rx_service{0};  ///< time the host needs to take one frame out of the buffer; 0 = never overruns
  std::uint32_t bit_rate = 0;  ///< bit/s; 0 = the bus's
  bool powered = true;
  bool listen_only = false;
  bool fd = false;  ///< an FD controller: an FD bus accepts no other (`Bus::attach`)
};

/// A `can::Port` whose TEC, REC and `sent` are exact. Made by `Bus::attach`, owned by the caller, to be destroyed
/// before its `World`; destroying it takes the node off the bus at that instant.
///
/// Each `Listener` call comes in its own job; `received` and `sent` both come at the end of the frame's last bit. FD
/// frames are refused (`Queued::closed`) on a bus that is not an FD bus, and so are frames of a size that their format
/// does not have. An FD frame of an error-passive sender has ESI recessive. The identifier does not show the format: a
/// listener checks `can::Frame::fd`.
class Controller final : public can::Port {
 public:
  ~Controller() override;
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  // can::Port
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override;
  /// Drops the queue and resets the counters; then the node takes part after 11 recessive bits, after bus-off 128 times
  /// 11 (Bosch CAN 2.0 §8 rule 12). False for bit rate 0, without power.
  bool restart(std::uint32_t bit_rate) noexcept override;

  // What happens to a node
  /// Off: silent at once; queue, receive buffer and counters are lost. On: takes part after 11 recessive bits.
  void power(bool on) noexcept;
  /// Unplugged (false), the node is alone on its stub and notices only that no node acknowledges. See also
  /// `Bus::split`.
  void cable(bool in) noexcept;
  /// As `restart`, but keeps the queue: a node at another bit rate than the rest destroys their frames until it is
  /// error-passive, and they destroy its frames. It hard-synchronises on start of frame and does not resynchronise
  /// within a frame.
  void set_bit_rate(std::uint32_t bit_rate) noexcept;
  /// On: receives, but neither acknowledges nor signals errors nor sends; counters do not change. The queue is dropped.
  void listen_only(bool on) noexcept;
  /// On: the controller acknowledges, but its host reads nothing: received frames are lost (overruns).
  void deaf(bool on) noexcept { node_.host.deaf(on); }
  /// On: queued frames are not offered to the bus; the node still receives and acknowledges.
  void silent(bool on) noexcept;

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// 0, 1, ... in the order of attachment to the bus; never reused.
  [[nodiscard]] int number() const noexcept { return node_.number; }
  [[nodiscard]] Bus& bus() const noexcept { return *bus_; }
  /// TEC, REC and the resulting state.
  [[nodiscard]] const ErrorCounters& errors() const noexcept { return node_.errors; }
  [[nodiscard]] bool powered() const noexcept { return node_.powered; }
  [[nodiscard]] bool cable_in() const noexcept { return cable_; }
  [[nodiscard]] std::uint32_t bit_rate() const noexcept { return node_.bit_rate; }
  [[nodiscard]] const NodeStatistics& statistics() const noexcept;
  void reset_statistics() noexcept { node_.statistics = {}; }
  /// For tests: sets the counters as if errors had happened (TEC up to 255).
  void preset_counters(std::uint16_t tec, std::uint16_t rec) noexcept;

 private:
  friend class Bus;
  Controller(Bus& bus, int number, const ControllerOptions& options);
  void integrate_anew() noexcept;

  Bus* bus_;
  bool cable_ = true;
  BusNode node_;
  std::string name_;
};

}  // namespace berth::sim
