/// SDO server: expedited and segmented transfers to and from an object dictionary (CiA 301 §7.2.4.3).
///
/// `SdoServer` is the protocol alone: a request in, an answer out, no port and no clock; a device that answers late
/// (paper 1's T_resp) holds the answer back itself. `SdoServerService` binds it to a port and a time-out.
///
/// Block transfer is answered with 0504 0001 (command specifier unknown), as CiA 301 demands of a server without it.
#pragma once

#include <memory>
#include <optional>

#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

/// One channel. No heap use after construction.
///
/// - Not heard: frames that are not 8 bytes, remote frames (hard-cases S16); an abort ends the transfer without an
///   answer (S13).
/// - A new initiate replaces the running transfer (S14). A segment that does not fit the transfer aborts it: wrong
/// toggle
///   0503 0000 (S5), no such transfer 0504 0001, more bytes than indicated 0607 0012, fewer 0607 0013.
/// - Uploads of at most `buffer` bytes are taken whole at the initiate, so that the client gets one consistent value;
///   longer ones are read from the dictionary piece by piece, and aborted with 0800 0022 when the length changes
///   meanwhile. Downloads are collected in the buffer and written once, at the end; what does not fit is refused with
///   0504 0005.
/// - Downloads without indicated size, segmented and expedited, are legal (S1, S17).
class SdoServer {
 public:
  SdoServer(od::Values& values, std::size_t buffer);

  /// Where answers go: 580h + node-ID for the default channel. The request's identifier is not looked at.
  void set_response_id(std::uint32_t id) noexcept { response_id_ = id; }

  /// The answer to a request, if there is one.
  [[nodiscard]] std::optional<can::Frame> handle(const can::Frame& request) noexcept;
  /// A segmented transfer is under way, and the next segment is the client's turn.
  [[nodiscard]] bool busy() const noexcept { return state_ != State::idle; }
  /// Gives the answer to a write that a hook or stream answered with `pending` (never seen on the wire): the
  /// confirmation when `code` is `none`, else an abort. While a write is pending the server is busy, the client's
  /// silence counts for nothing, the same request again is not executed again, and an abort, a new initiate or a reset
  /// drops it. Empty, and harmless, when nothing is pending.
  [[nodiscard]] std::optional<can::Frame> complete(AbortCode code) noexcept;
  /// The object whose write waits for `complete`.
  [[nodiscard]] std::optional<ObjectRef> pending() const noexcept;
  /// The client was silent too long: ends the transfer; the abort 0504 0000 to send, once (S20). Empty when idle.
  [[nodiscard]] std::optional<can::Frame> expire() noexcept;
  /// Forgets the transfer without a word: reset, NMT stop.
  void reset() noexcept { state_ = State::idle; }

 private:
  enum class State : std::uint8_t { idle, download, upload, pending };
  void begin_download(const can::Frame& request, can::Frame& answer) noexcept;
  [[nodiscard]] AbortCode expedited_download(const can::Frame& request) noexcept;
  [[nodiscard]] AbortCode begin_segmented_download(const can::Frame& request) noexcept;
  void download_segment(const can::Frame& request, can::Frame& answer) noexcept;
  void begin_upload(can::Frame& answer) noexcept;
  void upload_segment(const can::Frame& request, can::Frame& answer) noexcept;
  [[nodiscard]] AbortCode take(std::span<const std::uint8_t> bytes, bool last) noexcept;
  [[nodiscard]] od::Answer<const std::uint8_t*> upload_source() noexcept;
  void defer(const can::Frame& request, const can::Frame& answer) noexcept;
  void refuse_unknown(const can::Frame& request, can::Frame& answer) noexcept;
  void abort(can::Frame& answer, ObjectRef ref, AbortCode code) noexcept;
  [[nodiscard]] bool toggled(const can::Frame& request, can::Frame& answer) noexcept;

  od::Values* values_;
  std::unique_ptr<std::uint8_t[]> buffer_;
  std::size_t capacity_;
  std::uint32_t response_id_ = 0;
  State state_ = State::idle;
  bool toggle_ = false;  // expected in the next segment
  bool size_indicated_ = false;
  bool buffered_ = false;  // upload: the value stands in the buffer
  can::Frame pending_answer_;
  std::array<std::uint8_t, 8> pending_request_{};
  ObjectRef ref_;
  std::size_t size_ = 0;    // upload: of the value; download: as indicated
  std::size_t offset_ = 0;  // bytes done
};

/// The default SDO channel of a node, bound to its port.
class SdoServerService final : private can::Handler, private rt::Job {
 public:
  static constexpr std::size_t default_buffer = 1024;
  SdoServerService(can::Dispatcher& dispatcher, od::Values& values, std::size_t buffer = default_buffer)
      : dispatcher_(&dispatcher), server_(values, buffer) {}

  /// Serves 600h + node-ID (configured); a running transfer is forgotten.
  void start(NodeId node);
  /// Hears nothing (initialising, stopped).
  void stop() noexcept;
  /// How long the client may take between two segments before 0504 0000; 0 = for ever. Default 1 s.
  void set_timeout(rt::Duration timeout) noexcept { timeout_ = timeout; }
  [[nodiscard]] bool busy() const noexcept { return server_.busy(); }
  /// As `SdoServer::complete`: sends the answer; false when nothing was pending.
  bool complete(AbortCode code) noexcept;
  /// The same, only when the write that is pending is one of `object`.
  bool complete(ObjectRef object, AbortCode code) noexcept;
  [[nodiscard]] std::optional<ObjectRef> pending() const noexcept { return server_.pending(); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void answer(const can::Frame& frame) noexcept;
  void arm() noexcept;
  can::Dispatcher* dispatcher_;
  SdoServer server_;
  rt::Duration timeout_ = std::chrono::seconds(1);
  std::optional<can::Frame> unsent_;  // the port was full
  rt::Time unsent_until_{};
};

}  // namespace berth::co
