/// A serial CAN adapter with LAWICEL's ASCII protocol (slcan_codec.hpp): CANable, CANUSB, USBtin and similar, on a USB
/// serial line, a real one, or a pseudo-terminal.
///
///     auto port = io::SlcanPort::open(loop, "/dev/ttyACM0", {.bit_rate = 125'000});
///     auto port = io::SlcanPort::open(loop, "/dev/ttyUSB0@115200", {.bit_rate = 125'000});   // a line with a speed
///
/// Opening closes the adapter's channel, asks for its version, sets the bit rate, and opens the channel. If the adapter
/// answers each command, this is done step by step, and a refusal is reported; if it answers nothing (first firmware of
/// CANable), the port writes blindly. Without a bit rate the adapter keeps its own, which the port does not know.
///
/// **The meaning of `sent`** depends on the adapter, and is detected when it is opened (`confirms`):
/// - `events`: the adapter reports frames that were acknowledged on the bus (CANable 2 with newer firmware):
///   `knows_sent`.
/// - `answers`: the adapter has taken the frame into its queue (z, Z or CR). It is given one frame at a time, so the
///   order holds; a refused frame (BEL: its queue is full) is given again every 2 ms, 500 times.
/// - `nothing`: the line has taken the frame.
///
/// Garbage on the line is skipped up to the next CR, counted in `lost` (it may have been a frame) and reported with its
/// place (`faults`). The adapter's flags (polled every second) count: bus errors in `errors`, full buffers in `lost`.
/// If it is unplugged, the port is down (`up` false, the listener is called, queued frames are dropped). The port tries
/// to open the device's path again every 500 ms, and sets it up anew; /dev/serial/by-id/... names the same adapter in
/// any socket. The device is locked against other programs that lock (TIOCEXCL, flock).
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>

#include "berth/can/port.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/socketcand_port.hpp"

namespace berth::io {

enum class Confirms : std::uint8_t { nothing, answers, events };

struct SlcanOptions {
  std::uint32_t bit_rate = 0;  ///< bit/s; 0: the adapter's own rate
  /// The channel is opened with L; the first CANables, which have no L, are put into silent mode.
  bool listen_only = false;
  /// FD frames may be sent, at this bit rate of the data phase (1, 2, 4, 5 or 8 Mbit/s: Y1 ... Y8); 0: classic only.
  std::uint32_t data_bit_rate = 0;
  rt::Duration timeout = std::chrono::seconds(3);  ///< how long `open` waits
};

class SlcanPort final : public can::Port {
 public:
  static constexpr unsigned queue_depth = 64;  ///< frames queued and not yet `sent`; then `Queued::full`

  /// `address`: the device's path, and `@` with the line's speed in bit/s if it has one (default 115200; a USB adapter
  /// accepts any). Errors are in words: no such device, used by another program, a bit rate that it refuses.
  [[nodiscard]] static tl::expected<std::unique_ptr<SlcanPort>, std::string> open(Loop& loop,
                                                                                  const std::string& address,
                                                                                  const SlcanOptions& options);
  ~SlcanPort() override;
  SlcanPort(const SlcanPort&) = delete;
  SlcanPort& operator=(const SlcanPort&) = delete;

  // can::Port
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override;
  /// Sets the adapter up anew; down meanwhile. False: adapters do not support this bit rate.
  bool restart(std::uint32_t bit_rate) noexcept override;

  [[nodiscard]] const LineFaults& faults() const noexcept;
  [[nodiscard]] Confirms confirms() const noexcept;
  /// The adapter's version text; empty: none.
  [[nodiscard]] const std::string& version() const noexcept;
  /// Flags of the last `F` (slcan_flag).
  [[nodiscard]] std::uint8_t flags() const noexcept;

 private:
  class Impl;
  explicit SlcanPort(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::io
