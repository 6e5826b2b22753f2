/// A serial CAN adapter that speaks LAWICEL's ASCII protocol (slcan_codec.hpp): CANable, CANUSB, USBtin and kin, on a
/// USB serial line, a real one, or a pseudo-terminal.
///
///     auto port = io::SlcanPort::open(loop, "/dev/ttyACM0", {.bit_rate = 125'000});
///     auto port = io::SlcanPort::open(loop, "/dev/ttyUSB0@115200", {.bit_rate = 125'000});   // a line with a speed
///
/// Opening closes the adapter's channel, asks for its version, sets the bit rate, opens the channel. An adapter that
/// answers each command is led step by step, and a refusal is told; one that answers nothing (first firmware of
/// CANable) is written to blindly. Without a bit rate it is left at the one it has, which the port does not know.
///
/// **What `sent` means** depends on the adapter, learned when it is opened (`confirms`):
/// - `events`: it reports frames that were acknowledged on the bus (CANable 2 with newer firmware): as it should be,
///   `knows_sent`.
/// - `answers`: it has taken the frame into its queue (z, Z or CR). One frame at a time is given to it, so its order
/// holds;
///   one that it refuses (BEL: its queue is full) is given again every 2 ms, 500 times.
/// - `nothing`: the line has taken the frame.
///
/// Rubbish on the line is passed over up to the next CR, counted in `lost` (it may have been a frame) and told with its
/// place
/// (`faults`). Flags that the adapter reports (asked every second) count: bus errors in `errors`, full buffers in
/// `lost`. Unplugged: the port is down (`up` false, the listener is told, what was given is dropped), and the device is
/// opened again by its path, every 500 ms, and set up anew; /dev/serial/by-id/... names the same adapter in any socket.
/// The device is locked against other programs that lock (TIOCEXCL, flock).
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
  std::uint32_t bit_rate = 0;  ///< bit/s; 0: as the adapter stands
  /// The channel is opened with L; the first CANables, which have no L, are put into silent mode.
  bool listen_only = false;
  /// FD frames may be sent, at this bit rate of the data phase (1, 2, 4, 5 or 8 Mbit/s: Y1 ... Y8); 0: classic only.
  std::uint32_t data_bit_rate = 0;
  rt::Duration timeout = std::chrono::seconds(3);  ///< how long `open` waits
};

class SlcanPort final : public can::Port {
 public:
  static constexpr unsigned queue_depth = 64;  ///< frames given and not yet `sent`; then `Queued::full`

  /// `address`: the device's path, and `@` with the line's speed in bit/s where it has one (default 115200; a USB
  /// adapter takes any). What is wrong is told in words: no such device, used by another program, a bit rate that it
  /// refuses.
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
  /// Sets the adapter up anew; down meanwhile. False: no adapter is given this bit rate.
  bool restart(std::uint32_t bit_rate) noexcept override;

  [[nodiscard]] const LineFaults& faults() const noexcept;
  [[nodiscard]] Confirms confirms() const noexcept;
  /// What the adapter says of itself; empty: nothing.
  [[nodiscard]] const std::string& version() const noexcept;
  /// Flags of the last `F` (slcan_flag).
  [[nodiscard]] std::uint8_t flags() const noexcept;

 private:
  class Impl;
  explicit SlcanPort(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::io
