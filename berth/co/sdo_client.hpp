/// SDO client: reads and writes objects of any node on this bus, expedited, segmented and in blocks (CiA 301 §7.2.4.3).
///
///     auto type = co_await client.read<std::uint32_t>(node, 0x1000, 0);   // Result<std::uint32_t>
///     auto name = co_await client.upload(node, 0x1008, 0);                // Result<SdoValue>
///     auto done = co_await client.write(node, 0x1017, 0, period);         // Result<void>; period: std::uint16_t
///     auto sent = co_await client.download(node, 0x1F50, 1, source);      // Result<void>; source: an SdoSource
///
/// `SdoClient` uses the default channels of all nodes, `SdoChannelClient` one channel of its own (1280h..). Transfers
/// in different channels run side by side; those in one channel run first come, first served. Destroying an operation
/// cancels it; a transfer of several frames that is under way is then aborted on the bus (0800 0000). An operation may
/// be started anywhere, also in a callback: the executor wakes the waiting task.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <optional>

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/block_pace.hpp"
#include "berth/co/sdo_client_data.hpp"
#include "berth/co/sdo_segments.hpp"
#include "berth/rt/task.hpp"

namespace berth::co {

/// How an object is transferred.
enum class SdoMode : std::uint8_t {
  segmented,  ///< expedited up to 4 bytes, else segmented: works with every server
  block,      ///< block transfer
  automatic,  ///< a download of `block_from` bytes or more, or of unknown size, and every upload as block transfer
};

/// How a transfer is done, and how long it may take. Besides the time for each answer, the whole transfer has a limit:
/// without source or sink, a transfer that is slower than `slowest_pace` for longer than `most_lingering` (or 8
/// `timeout`s) is given up with Errc::timeout, however punctual each answer is.
struct SdoOptions {
  /// For each answer, from the moment the request was on the wire; each new attempt adds a sixteenth.
  rt::Duration timeout = std::chrono::seconds(1);
  rt::Duration send_timeout = std::chrono::seconds(1);  ///< for each request to get onto the wire
  unsigned retries = 0;          ///< new attempts of the whole transfer after a time-out, also the server's
  bool abort_on_timeout = true;  ///< send an abort (0504 0000) when giving up; block: always
  std::size_t longest = std::size_t{16} << 20U;  ///< longest upload accepted without a sink, in bytes; else 0504 0005
  SdoMode mode = SdoMode::segmented;
  /// A server that does not know block transfer (0504 0001 to its initiate) is asked once more, segmented.
  bool fall_back = true;
  bool crc = true;                   ///< block: use CRC, if the server can, too
  std::uint8_t block_size = 127;     ///< block upload: segments in a sub-block, 1..127
  std::uint8_t protocol_switch = 0;  ///< block upload: a server may send so few bytes (or fewer) segmented; 0 = never
  std::size_t block_from = 64;       ///< automatic, in bytes; also its protocol switch threshold, less one
  /// By node-ID: the minimum time for each answer of this node. Null: `timeout` is for all.
  const std::array<rt::Duration, 128>* least = nullptr;
  /// Shared by all block downloads that run side by side on this bus; null: each sends as fast as it can.
  BlockPace* pace = nullptr;
};

/// How slow each node was. A late answer to an upload raises the time of its node to the time it took plus a quarter.
/// For `SdoOptions::least`: each question to that node then waits as long as its slowest answer needed. A late answer
/// to a download changes nothing: the device may have been saving.
struct SdoPatience {
  std::array<rt::Duration, 128> times{};  ///< by node-ID
  rt::Duration most{};                    ///< upper limit of the learnt times
  /// Used by the client: when the first request with outstanding answers of a node was on the wire; 0: not known.
  std::array<rt::Time, 128> owed_since{};
};

inline constexpr std::size_t slowest_pace = 64;  ///< bytes a second
inline constexpr rt::Duration most_lingering = std::chrono::seconds(4);

class SdoLine;
class SdoClient;
class SdoChannelClient;

/// One transfer; use the derived classes. Its errors (node, index and sub are filled in):
/// - Errc::aborted: the server refused; detail = abort code
/// - Errc::timeout: the request was on the wire and no answer came in time
/// - Errc::bus: a request was never sent: bus-off, listen-only, closed port, no other node that acknowledges (detail:
///   0)
/// - Errc::mismatch: the answer broke the protocol, or has a length other than asked for, or the source or sink
///   refused; detail = abort code sent
/// - Errc::invalid: the node-ID is unconfigured, the channel is not valid
/// - Errc::cancelled: the client was destroyed, or `cancel` was called
class SdoTransfer : public rt::Operation<SdoTransfer>, private can::Confirmation {
 public:
  bool start();

 protected:
  SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options) noexcept
      : line_(&line), options_(options), data_(options.longest), ref_(ref), node_(node) {}
  SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options,
              std::span<const std::uint8_t> data) noexcept
      : SdoTransfer(line, node, ref, options) {
    data_.download(data);
  }
  SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSource& source);
  SdoTransfer(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSink& sink);
  ~SdoTransfer();
  [[nodiscard]] const std::optional<Error>& error() const noexcept { return error_; }
  [[nodiscard]] SdoClientData& data() noexcept { return data_; }
  [[nodiscard]] Error make_error(Errc code, std::uint32_t detail, const char* text) const noexcept;

 private:
  friend class SdoLine;
  friend class SdoClient;
  friend class SdoChannelClient;
  class Waiter;
  class Block;
  struct Extra;
  struct FreeExtra {
    void operator()(Extra* extra) const noexcept;
  };
  enum class State : std::uint8_t { idle, queued, initiate, segments, block, done };
  /// The newest request.
  struct Request {
    can::Frame frame;          // kept in case the port was full
    rt::Time give_up{};        // when it must have left
    rt::Time deadline{};       // when `run` has something to do
    std::uint8_t answers = 1;  // outstanding answers to it
    bool on_wire = false;      // answers count
  };
  void run() noexcept;  // its turn has come, or its time
  void sent(rt::Time at) noexcept override;
  void attempt() noexcept;
  void send(unsigned answers = 1) noexcept;
  void send_request() noexcept;
  void wait_until(rt::Time when) noexcept;
  void send_abort(AbortCode code) noexcept;
  void next_segment() noexcept;
  void follow(const SdoSegments::Step& step) noexcept;
  void timed_out() noexcept;
  /// True: the transfer took too long for the bytes that came, and has ended.
  [[nodiscard]] bool lingers() noexcept;
  /// False when the frame is no answer to the current request.
  bool answer(const can::Frame& frame) noexcept;
  [[nodiscard]] bool awaits(const can::Frame& frame) const noexcept;
  void take_expedited(const can::Frame& frame) noexcept;
  bool take_abort(const can::Frame& frame) noexcept;
  bool initiate_answer(const can::Frame& frame) noexcept;
  void take_initiate(const can::Frame& frame) noexcept;
  // Ends
  void refuse(AbortCode code, const char* text) noexcept;
  void complete() noexcept;
  void fail_with(Errc code, std::uint32_t detail, const char* text) noexcept;
  void leave() noexcept;

  SdoLine* line_;
  SdoTransfer* next_ = nullptr;  // the transfer that waits behind this one in the same channel
  SdoOptions options_;
  SdoClientData data_;
  std::optional<Error> error_;
  std::unique_ptr<Extra, FreeExtra> extra_;  // only for streams and block transfers
  rt::Time began_{};                         // when this attempt began
  Request request_;
  unsigned attempts_ = 0;
  static constexpr std::uint32_t not_quick = 0xFFFF'FFFFU;  // matches no frame
  std::uint32_t quick_ =
      not_quick;  // bytes 0..3 of an expedited answer but for its length, while that ends the transfer
  ObjectRef ref_;
  NodeId node_;
  State state_ = State::idle;
  SdoSegments segments_;
  bool block_ = false;     // this attempt is a block transfer
  bool no_block_ = false;  // the server does not know block transfers
};

/// Reads an object of any length.
class SdoUpload final : public SdoTransfer {
 public:
  SdoUpload(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options) noexcept
      : SdoTransfer(line, node, ref, options) {}
  Result<SdoValue> await_resume() {
    if (error()) return fail(*error());
    return std::move(data().value());
  }
};

/// Reads an integer of exactly `sizeof(T)` bytes.
template <class T>
class SdoRead final : public SdoTransfer {
 public:
  SdoRead(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options) noexcept
      : SdoTransfer(line, node, ref, options) {
    data().expect_at_most(longest);
  }
  Result<T> await_resume() noexcept {
    if (error()) return fail(*error());
    const SdoValue& value = data().value();
    if (data().unsized() && value.size() > sizeof(T)) {
      if (const auto cut = SdoValue(value.bytes().first(sizeof(T))).template as<T>()) return *cut;
    }
    if (const auto whole = value.template as<T>()) return *whole;
    return fail(make_error(Errc::mismatch, 0, "the object has another length than expected"));
  }

 private:
  static constexpr std::size_t longest = 8;  // of any integer: longer objects are refused
};

/// Writes bytes, which must stay until the transfer is done.
class SdoDownload final : public SdoTransfer {
 public:
  SdoDownload(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options,
              std::span<const std::uint8_t> data) noexcept
      : SdoTransfer(line, node, ref, options, data) {}
  Result<void> await_resume() const noexcept {
    if (error()) return fail(*error());
    return {};
  }
};

/// Writes an integer, which the transfer holds itself.
template <class T>
class SdoWrite final : public SdoTransfer {
 public:
  SdoWrite(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, T value) noexcept
      : SdoTransfer(line, node, ref, options, {}) {
    if constexpr (std::is_same_v<T, bool>) {
      bytes_[0] = value ? 1 : 0;
    } else {
      store_le(bytes_.data(), static_cast<std::make_unsigned_t<T>>(value));
    }
    data().download(bytes_);
  }
  Result<void> await_resume() const noexcept {
    if (error()) return fail(*error());
    return {};
  }

 private:
  std::array<std::uint8_t, sizeof(T)> bytes_{};
};

/// Writes the bytes of a source, which must stay until the transfer is done. Always segmented or block.
class SdoStreamDownload final : public SdoTransfer {
 public:
  SdoStreamDownload(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSource& source)
      : SdoTransfer(line, node, ref, options, source) {}
  Result<void> await_resume() const noexcept {
    if (error()) return fail(*error());
    return {};
  }
};

/// Reads into a sink, which must stay until the transfer is done.
class SdoStreamUpload final : public SdoTransfer {
 public:
  SdoStreamUpload(SdoLine& line, NodeId node, ObjectRef ref, const SdoOptions& options, SdoSink& sink)
      : SdoTransfer(line, node, ref, options, sink) {}
  Result<void> await_resume() const noexcept {
    if (error()) return fail(*error());
    return {};
  }
};

/// Informed of answers without a request.
class SdoObserver {
 public:
  /// A second answer to one request: two devices share `node`'s node-ID, or another client uses its channel (and, with
  /// `SdoClient::heed_other_clients`, its request was not heard).
  virtual void surplus(NodeId node, const can::Frame& frame, rt::Time at) noexcept = 0;

 protected:
  ~SdoObserver() = default;
};

/// The requests of another client of a node's default channel.
class OtherClientRequests {
 public:
  /// Heard a request of the other client. Frames of its block downloads look like any request: answers are expected for
  /// `patience`.
  void asked(const can::Frame& request, rt::Time at, rt::Duration patience) noexcept;
  /// True, once for each answer: the answer is for the other client.
  [[nodiscard]] bool take(const can::Frame& answer, rt::Time at) noexcept;
  /// True if any request of the other client was heard, however long ago.
  [[nodiscard]] bool any() const noexcept { return until_ != rt::Time{}; }

 private:
  std::uint32_t answers_ = 0;  // outstanding answers
  bool block_ = false;         // a block upload, whose segments look like any frame
  rt::Time until_{};           // answers are expected until then
  std::uint64_t objects_ = 0;  // requested objects, a bit each
};

/// Shared by the channels of one client.
struct SdoClientSettings {
  can::Dispatcher* dispatcher;
  SdoOptions options{};
  SdoObserver* observer = nullptr;
  rt::Duration late_window = std::chrono::seconds(5);
  OtherClientRequests* other_clients = nullptr;  ///< by node-ID; null: other clients are not heeded
  SdoPatience* learnt = nullptr;                 ///< null: nothing is learnt
};

/// The client side of one channel: its transfers, one after another. A part of the clients below. The timer belongs to
/// the channel, because it keeps running when a transfer ends: most transfers end long before it.
class SdoLine : private rt::Job {
 public:
  SdoLine() = default;
  SdoLine(const SdoLine&) = delete;
  SdoLine& operator=(const SdoLine&) = delete;

 private:
  friend class SdoTransfer;
  friend class SdoClient;
  friend class SdoChannelClient;
  void received(NodeId node, const can::Frame& frame, rt::Time at) noexcept;
  void received_other(NodeId node, const can::Frame& frame, rt::Time at) noexcept;
  void enqueue(SdoTransfer& transfer) noexcept;
  void remove(SdoTransfer& transfer) noexcept;
  void remove_of_several(SdoTransfer& transfer) noexcept;
  void cancel(const char* why = "the SDO transfer was cancelled") noexcept;
  [[nodiscard]] bool may_be_owed(const can::Frame& frame) const noexcept;
  [[nodiscard]] bool is_for_another(NodeId node, const can::Frame& answer, rt::Time at) noexcept;
  void give_up_open(rt::Time at) noexcept;
  [[gnu::cold]] void owe(std::uint32_t answers) noexcept;
  /// Null: nothing is learnt.
  [[nodiscard]] rt::Time* owed_since() const noexcept;
  [[gnu::cold]] void learn(NodeId node, const can::Frame& frame, rt::Time at) noexcept;
  void booted() noexcept;
  void run() noexcept override {
    if (first_ != nullptr) first_->run();
  }
  // A timer that fires too early may stay: `SdoTransfer::run` sets it anew.
  void wake_at(rt::Time when) noexcept {
    if (!timed() || due() > when) executor().at(when, *this);
  }
  [[nodiscard]] can::Dispatcher& dispatcher() const noexcept { return *settings_->dispatcher; }
  [[nodiscard]] rt::Executor& executor() const noexcept { return dispatcher().executor(); }

  const SdoClientSettings* settings_ = nullptr;
  SdoTransfer* first_ = nullptr;  // under way; others wait behind it
  CobId request_;
  std::uint32_t surplus_ = 0;
  std::uint32_t late_ = 0;
  std::uint32_t open_ = 0;  // outstanding answers to the newest request on the wire
  ObjectRef open_ref_{};
  rt::Time open_until_{};
  std::uint32_t owed_ = 0;  // outstanding answers to the requests before it
  rt::Time owed_until_{};
  std::uint64_t silent_ = 0;  // a bit for each object of those requests: an answer for another object is none of theirs
};

inline void SdoTransfer::wait_until(rt::Time when) noexcept {
  request_.deadline = when;
  line_->wake_at(when);
}

/// The transfers that a client can begin with one server. Without options: the client's, as they are then. Objects are
/// named by index and sub-index; data, sources and sinks must stay until the transfer is done.
class SdoTransfers {
 public:
  [[nodiscard]] SdoUpload upload(std::uint16_t index, std::uint8_t sub) const noexcept {
    return upload(index, sub, *options_);
  }
  [[nodiscard]] SdoUpload upload(std::uint16_t index, std::uint8_t sub, const SdoOptions& options) const noexcept {
    return SdoUpload(*line_, server_, {index, sub}, options);
  }
  [[nodiscard]] SdoStreamUpload upload(std::uint16_t index, std::uint8_t sub, SdoSink& sink) const {
    return upload(index, sub, sink, *options_);
  }
  [[nodiscard]] SdoStreamUpload upload(std::uint16_t index, std::uint8_t sub, SdoSink& sink,
                                       const SdoOptions& options) const {
    return SdoStreamUpload(*line_, server_, {index, sub}, options, sink);
  }
  [[nodiscard]] SdoDownload download(std::uint16_t index, std::uint8_t sub,
                                     std::span<const std::uint8_t> data) const noexcept {
    return download(index, sub, data, *options_);
  }
  [[nodiscard]] SdoDownload download(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data,
                                     const SdoOptions& options) const noexcept {
    return SdoDownload(*line_, server_, {index, sub}, options, data);
  }
  [[nodiscard]] SdoStreamDownload download(std::uint16_t index, std::uint8_t sub, SdoSource& source) const {
    return download(index, sub, source, *options_);
  }
  [[nodiscard]] SdoStreamDownload download(std::uint16_t index, std::uint8_t sub, SdoSource& source,
                                           const SdoOptions& options) const {
    return SdoStreamDownload(*line_, server_, {index, sub}, options, source);
  }
  template <class T>
  [[nodiscard]] SdoRead<T> read(std::uint16_t index, std::uint8_t sub) const noexcept {
    return read<T>(index, sub, *options_);
  }
  template <class T>
  [[nodiscard]] SdoRead<T> read(std::uint16_t index, std::uint8_t sub, const SdoOptions& options) const noexcept {
    return SdoRead<T>(*line_, server_, {index, sub}, options);
  }
  template <class T>
  [[nodiscard]] SdoWrite<T> write(std::uint16_t index, std::uint8_t sub, T value) const noexcept {
    return write(index, sub, value, *options_);
  }
  template <class T>
  [[nodiscard]] SdoWrite<T> write(std::uint16_t index, std::uint8_t sub, T value,
                                  const SdoOptions& options) const noexcept {
    return SdoWrite<T>(*line_, server_, {index, sub}, options, value);
  }
  [[nodiscard]] NodeId server() const noexcept { return server_; }

 private:
  friend class SdoClient;
  friend class SdoChannelClient;
  SdoTransfers(SdoLine& line, NodeId server, const SdoOptions& options) noexcept
      : line_(&line), options_(&options), server_(server) {}
  SdoLine* line_;
  const SdoOptions* options_;
  NodeId server_;
};

/// The client of all nodes' default channels.
class SdoClient final : private can::Handler {
 public:
  using Observer = SdoObserver;

  explicit SdoClient(can::Dispatcher& dispatcher, const SdoOptions& options = {});
  /// Ends all transfers with Errc::cancelled.
  ~SdoClient();

  /// Transfers with one node. A transfer with an unconfigured node-ID fails.
  [[nodiscard]] SdoTransfers with(NodeId node) noexcept { return {line(node), node, settings_.options}; }
  /// As `with(node)` has them.
  template <class... More>
  [[nodiscard]] auto upload(NodeId node, std::uint16_t index, std::uint8_t sub, More&&... more) {
    return with(node).upload(index, sub, std::forward<More>(more)...);
  }
  template <class... More>
  [[nodiscard]] auto download(NodeId node, std::uint16_t index, std::uint8_t sub, More&&... more) {
    return with(node).download(index, sub, std::forward<More>(more)...);
  }
  template <class T, class... More>
  [[nodiscard]] SdoRead<T> read(NodeId node, std::uint16_t index, std::uint8_t sub, const More&... more) noexcept {
    return with(node).read<T>(index, sub, more...);
  }
  template <class T, class... More>
  [[nodiscard]] SdoWrite<T> write(NodeId node, std::uint16_t index, std::uint8_t sub, T value,
                                  const More&... more) noexcept {
    return with(node).write<T>(index, sub, value, more...);
  }

  /// Ends the transfers of a node with Errc::cancelled, without a frame: it has booted, and answers no earlier request.
  void cancel(NodeId node) noexcept {
    if (node.configured()) line(node).cancel("the node booted during the SDO transfer");
  }

  void set_options(const SdoOptions& options) noexcept { settings_.options = options; }
  [[nodiscard]] const SdoOptions& options() const noexcept { return settings_.options; }
  void set_observer(Observer* observer) noexcept { settings_.observer = observer; }
  /// How late an answer may come after its request timed out without counting as surplus. Default 5 s. `learnt`
  /// collects what late answers teach; it must stay.
  void set_late_window(rt::Duration window, SdoPatience* learnt = nullptr) noexcept {
    settings_.late_window = window;
    settings_.learnt = learnt;
  }

  /// A boot-up message of this node was heard: its outstanding answers will not come. After the one answer to a
  /// request, any further answer is surplus.
  void booted(NodeId node) noexcept {
    if (node.configured()) line(node).booted();
  }

  /// From the call on, this client listens to the requests of other clients on the default channels of this bus
  /// (another process, a panel). Each such request has one answer, which is not surplus; a second one is. Costs an
  /// entry of the dispatcher.
  void heed_other_clients();

  /// Answers of this node without a request (see `SdoObserver::surplus`).
  [[nodiscard]] std::uint32_t surplus(NodeId node) const noexcept { return line(node).surplus_; }
  /// Answers to requests that had been given up.
  [[nodiscard]] std::uint32_t late(NodeId node) const noexcept { return line(node).late_; }
  /// Transfers under way or waiting.
  [[nodiscard]] bool busy(NodeId node) const noexcept { return line(node).first_ != nullptr; }

 private:
  /// Hears the requests of other clients on the bus.
  class Requests final : public can::Handler {
   public:
    explicit Requests(SdoClient& client) noexcept : client_(&client) {}

   private:
    void received(const can::Frame& frame, rt::Time at) noexcept override;
    SdoClient* client_;
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  // A transfer to an unconfigured node-ID fails before it uses its line.
  [[nodiscard]] SdoLine& line(NodeId id) noexcept { return lines_[id.value() & 0x7FU]; }
  [[nodiscard]] const SdoLine& line(NodeId id) const noexcept { return lines_[id.value() & 0x7FU]; }

  SdoClientSettings settings_;
  std::array<SdoLine, 128> lines_;
  std::array<OtherClientRequests, 128> other_clients_;
  Requests requests_{*this};
};

/// The client of one channel: an additional SDO client (1280h..12FFh), or any pair of COB-IDs. `server`: the answering
/// node, for errors and `SdoObserver`.
class SdoChannelClient final : public SdoTransfers, private can::Handler {
 public:
  SdoChannelClient(can::Dispatcher& dispatcher, SdoChannel channel, NodeId server, const SdoOptions& options = {});
  /// Ends all transfers with Errc::cancelled.
  ~SdoChannelClient();

  /// Ends the transfers with Errc::cancelled, without a frame.
  void cancel() noexcept { line_.cancel(); }
  void set_options(const SdoOptions& options) noexcept { settings_.options = options; }
  [[nodiscard]] const SdoOptions& options() const noexcept { return settings_.options; }
  void set_observer(SdoObserver* observer) noexcept { settings_.observer = observer; }
  [[nodiscard]] SdoChannel channel() const noexcept { return channel_; }
  [[nodiscard]] bool busy() const noexcept { return line_.first_ != nullptr; }

 private:
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  SdoClientSettings settings_;
  SdoLine line_;
  SdoChannel channel_;
};

}  // namespace berth::co
