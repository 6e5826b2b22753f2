/// SDO server: expedited, segmented and block transfers to and from an object dictionary (CiA 301 §7.2.4.3).
///
/// `SdoServer` is the protocol alone: a request in, an answer out, no port and no clock. A device that answers late
/// (paper 1's T_resp) delays the answer itself. `SdoServerService` binds it to a port and a time-out; `SdoServers`
/// (`sdo_servers.hpp`) are all the channels of a device.
#pragma once

#include <optional>

#include "berth/can/dispatcher.hpp"
#include "berth/can/packed_frame.hpp"
#include "berth/co/sdo_server_block.hpp"
#include "berth/co/sdo_server_segments.hpp"

namespace berth::co {

/// One channel. No heap use after construction.
///
/// - Ignored: frames that are not 8 bytes, remote frames (HC1.S16). An abort ends the transfer without an answer
///   (HC1.S13).
/// - A new initiate replaces the running transfer (HC1.S14), except while a sub-block of a block download comes in:
///   there every frame except an abort is a segment. A segment that does not fit the transfer aborts it: wrong toggle
///   0503 0000 (HC1.S5), no such transfer 0504 0001, more bytes than indicated 0607 0012, fewer 0607 0013, sub-block
///   number out of range or more acknowledged than sent 0504 0003 (HC1.S6), block size 0 or above 127 0504 0002
///   (HC1.S8), CRC 0504 0004.
/// - Uploads of at most `buffer` bytes are copied at the initiate, so that the client gets one consistent value. Longer
///   ones are read from the dictionary piece by piece, and aborted with 0800 0022 if the length changes meanwhile. If a
///   stream does not have the bytes yet, the answer follows when it has them (`complete`). Downloads are collected in
///   the buffer and written once, at the end; values that do not fit are refused with 0504 0005. An object with an
///   `od::Stream` goes through the buffer, however long it is.
/// - The object dictionary refuses accesses itself: no such object or sub-index (0602 0000, 0609 0011) in
///   `od::StoredValues::find`; access, length and range in `od::Values`.
/// - Downloads without indicated size, segmented, block and expedited, are legal (HC1.S1, HC1.S3, HC1.S17).
/// - Block: CRC is used, and offered, if the client can, too (HC1.S10). A block upload of an object not longer than the
///   client's protocol switch threshold is answered as a normal upload (HC1.S11). A lost segment is requested again,
///   and sub-blocks become smaller; 16 sub-blocks in a row without progress end the transfer with 0504 0000.
class SdoServer {
 public:
  /// `channel`: as `od::Channels` counts.
  SdoServer(od::Values& values, std::size_t buffer, std::uint8_t channel = 0);

  /// The identifier of answers: 580h + node-ID for the default channel. The request's identifier is not checked.
  void set_response_id(CobId id) noexcept { response_key_ = id.key(); }

  /// Takes a request. True: send `answer`. False: check whether segments are to be sent (`sending`).
  [[nodiscard]] bool handle(const can::Frame& request, can::Frame& answer) noexcept;
  /// Block upload: the segments of a sub-block are to be sent, by `BlockPump`, or one after another with
  /// `segments().segment(frame)` and `advance()`, and `confirm()` when they are on the wire.
  [[nodiscard]] bool sending() const noexcept { return state_ == State::block_upload && block_.sender().sending(); }
  [[nodiscard]] sdo::BlockSender& segments() noexcept { return block_.sender(); }
  /// A transfer is under way: the client's next frame is expected, or segments are being sent, or a write is pending.
  [[nodiscard]] bool busy() const noexcept { return state_ != State::idle; }
  /// A sub-block comes in, so a short silence means a lost segment: call `expire` soon (`sdo::block_gap_part`).
  [[nodiscard]] bool collecting() const noexcept {
    return state_ == State::block_download && block_.receiver().heard();
  }
  /// Answers an access that a hook or stream answered with `pending` (which is never sent). The answer is an abort
  /// unless `code` is `none`; else the confirmation of a write, while an upload's stream is read again and its bytes
  /// are sent (see `sending`, too). Empty, and harmless, when nothing is pending. While an access is pending:
  /// - the server is busy, and the client's silence does not count
  /// - the same request is not executed again
  /// - an abort, a new initiate or a reset drops the access (`od::Hook::abandoned`)
  [[nodiscard]] std::optional<can::Frame> complete(AbortCode code) noexcept;
  /// The object whose access waits for `complete`.
  [[nodiscard]] std::optional<ObjectRef> pending() const noexcept {
    return state_ == State::pending ? std::optional(ref_) : std::nullopt;
  }
  /// The client was silent too long. Acknowledges what came of a sub-block (`collecting`), or else ends the transfer;
  /// returns the abort 0504 0000 to send, once (S20). Empty when idle, and while an access is pending.
  [[nodiscard]] std::optional<can::Frame> expire() noexcept;
  /// Forgets the transfer without an abort: reset, NMT stop.
  void reset() noexcept {
    if (std::exchange(state_, State::idle) == State::pending) [[unlikely]]
      data_.values().abandon(ref_);
    data_.drop();
  }
  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept { return data_.memory(); }

 private:
  enum class State : std::uint8_t {
    idle,
    download,
    upload,
    block_download,      // a sub-block comes in; from this state on the state decides first what a frame means
    block_download_end,  // all segments were received
    block_upload_start,  // initiated; waits for the client's start
    block_upload,        // a sub-block is being sent or is to be acknowledged
    block_upload_end,    // all acknowledged; waits for the client's end
    pending,
  };
  /// The action when the pending access is answered.
  struct Deferred {
    enum class Way : std::uint8_t {
      confirm,    // send `answer`
      ask_again,  // execute `request` again
      sub_block,  // send an upload's next sub-block
    };
    std::array<std::uint8_t, 8> request{};
    std::array<std::uint8_t, 8> answer{};
    State then = State::idle;
    Way way = Way::confirm;
    /// Only an abort and a new initiate end the waiting.
    [[nodiscard]] bool ended_by(const can::Frame& frame) const noexcept;
  };
  [[nodiscard]] bool respond(const can::Frame& request, can::Frame& answer) noexcept;
  [[nodiscard]] bool respond_in_block(const can::Frame& request, can::Frame& answer, bool& has_answer) noexcept;
  bool begin_download(const can::Frame& request, can::Frame& answer) noexcept;
  bool open_upload(const can::Frame& request, can::Frame& answer) noexcept;
  bool answer_upload(can::Frame& answer) noexcept;
  bool segment(const can::Frame& request, can::Frame& answer, bool download) noexcept;
  // Block
  bool block_download(const can::Frame& request, can::Frame& answer) noexcept;
  bool acknowledge_block(const can::Frame& segment, can::Frame& answer) noexcept;
  bool block_upload(const can::Frame& request, can::Frame& answer) noexcept;
  bool begin_block_upload(const can::Frame& request, can::Frame& answer) noexcept;
  bool send_block(can::Frame& answer) noexcept;
  // Ends
  bool settle(const can::Frame& request, can::Frame& answer, AbortCode code, State then,
              Deferred::Way way = Deferred::Way::confirm) noexcept;
  bool refuse_unknown(const can::Frame& request, can::Frame& answer) noexcept;
  bool abort(can::Frame& answer, AbortCode code) noexcept;

  SdoServerData data_;
  SdoServerBlock block_;
  std::uint32_t response_key_ = 0;
  ObjectRef ref_;
  State state_ = State::idle;
  SdoServerSegments segments_;
  Deferred deferred_;
};

/// The answer to a request; empty: none.
[[nodiscard]] inline std::optional<can::Frame> answer_of(SdoServer& server, const can::Frame& request) noexcept {
  can::Frame answer;
  return server.handle(request, answer) ? std::optional(answer) : std::nullopt;
}

/// One SDO channel bound to a port.
class SdoServerService final : private can::Handler, private rt::Job, private sdo::BlockPump::Owner {
 public:
  static constexpr std::size_t default_buffer = 1024;
  SdoServerService(can::Dispatcher& dispatcher, od::Values& values, std::size_t buffer = default_buffer,
                   std::uint8_t channel = 0);

  /// Serves the default channel, 600h + node-ID (configured); a running transfer is forgotten.
  void start(NodeId node) { start(SdoChannel::of(node)); }
  /// Serves any channel; an invalid channel receives nothing.
  void start(SdoChannel channel);
  /// Receives nothing (initialising, stopped).
  void stop() noexcept;
  [[nodiscard]] bool running() const noexcept { return channel_.valid(); }
  [[nodiscard]] SdoChannel channel() const noexcept { return channel_; }
  /// How long the client may take between two frames before 0504 0000; 0 = for ever. Default 1 s. An incoming sub-block
  /// that breaks off is acknowledged after a quarter of it.
  void set_timeout(rt::Duration timeout) noexcept { timeout_ = timeout; }
  [[nodiscard]] bool busy() const noexcept { return server_.busy(); }
  /// As `SdoServer::complete`: sends the answer; false when nothing was pending.
  bool complete(AbortCode code) noexcept;
  /// The same, only if the pending access is one of `object`; the confirmation or refusal names it `named`.
  bool complete(ObjectRef object, AbortCode code) noexcept { return complete(object, code, object); }
  bool complete(ObjectRef object, AbortCode code, ObjectRef named) noexcept;
  /// Sends a frame of a relay (`od::ChannelRelay`).
  bool send(od::ChannelBytes bytes) noexcept;
  [[nodiscard]] std::optional<ObjectRef> pending() const noexcept { return server_.pending(); }
  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept { return server_.memory(); }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void run() noexcept override;
  void pumped(rt::Time at) noexcept override;
  void stuck(can::Queued why) noexcept override;
  void answer(const can::Frame& frame) noexcept;
  void arm() noexcept;
  void after_timeout() noexcept;
  [[nodiscard]] rt::Duration patience() const noexcept {
    return server_.collecting() ? timeout_ / sdo::block_gap_part : timeout_;
  }

  can::Dispatcher* dispatcher_;
  od::Channels* channels_;
  SdoServer server_;
  sdo::BlockPump pump_;
  SdoChannel channel_;
  rt::Duration timeout_ = std::chrono::seconds(1);
  rt::Time heard_{};                        // when the client's last frame came, or ours was sent
  std::optional<can::PackedFrame> unsent_;  // refused by a full port
  rt::Time unsent_until_{};
  std::uint8_t number_;
};

}  // namespace berth::co
