/// SDO client: reads and writes objects of any node on this bus over the default channels, expedited and segmented
/// (CiA 301 §7.2.4.3).
///
///     auto type = co_await client.read<std::uint32_t>(node, 0x1000, 0);   // Result<std::uint32_t>
///     auto name = co_await client.upload(node, 0x1008, 0);                // Result<SdoValue>
///     auto done = co_await client.write(node, 0x1017, 0, period);         // Result<void>; period: std::uint16_t
///
/// Transfers to different nodes run side by side; those to one node wait for each other, first come, first served.
/// Destroying an operation cancels it; a segmented transfer on its way is then aborted on the bus (0800 0000).
#pragma once

#include <array>
#include <optional>

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo.hpp"
#include "berth/rt/task.hpp"

namespace berth::co {

/// How patient a transfer is.
struct SdoOptions {
  rt::Duration timeout = std::chrono::seconds(1);  ///< for each answer, from the moment the request was on the wire
  rt::Duration send_timeout = std::chrono::seconds(1);  ///< for each request to get onto the wire
  unsigned retries = 0;                                 ///< new attempts of the whole transfer after a time-out
  bool abort_on_timeout = true;                         ///< tell the server (0504 0000) when giving up
  std::size_t longest = std::size_t{16} << 20U;         ///< longest upload accepted, in bytes; else 0504 0005
};

class SdoClient;

/// One transfer; use the derived classes. How it ends otherwise than well (node, index and sub are filled in):
/// - Errc::aborted: the server refused; detail = abort code
/// - Errc::timeout: the request was on the wire and nobody answered in time
/// - Errc::bus: a request never left: bus-off, listen-only, closed port, no other node that acknowledges (detail: 0)
/// - Errc::mismatch: the answer broke the protocol, or has another length than asked for; detail = abort code sent
/// - Errc::invalid: the node-ID is unconfigured
/// - Errc::cancelled: the client was destroyed
class SdoTransfer : public rt::Operation<SdoTransfer>, private rt::Job, private can::Confirmation {
 public:
  bool start();

 protected:
  SdoTransfer(SdoClient& client, NodeId node, ObjectRef ref, const SdoOptions& options) noexcept
      : client_(&client), options_(options), ref_(ref), node_(node) {}
  SdoTransfer(SdoClient& client, NodeId node, ObjectRef ref, const SdoOptions& options,
              std::span<const std::uint8_t> data) noexcept
      : SdoTransfer(client, node, ref, options) {
    data_ = data;
    download_ = true;
  }
  ~SdoTransfer();
  [[nodiscard]] const std::optional<Error>& error() const noexcept { return error_; }
  [[nodiscard]] SdoValue& value() noexcept { return value_; }
  [[nodiscard]] Error make_error(Errc code, std::uint32_t detail, const char* text) const noexcept;
  void set_data(std::span<const std::uint8_t> data) noexcept { data_ = data; }
  /// True when the server did not say how many of the four expedited bytes count.
  [[nodiscard]] bool unsized() const noexcept { return unsized_; }

 private:
  friend class SdoClient;
  enum class State : std::uint8_t { idle, queued, initiate, segments, done };
  void run() noexcept override;
  void sent(rt::Time at) noexcept override;
  void attempt() noexcept;
  void send() noexcept;
  void send_request() noexcept;
  void send_abort(AbortCode code) noexcept;
  void next_segment() noexcept;
  void timed_out() noexcept;
  /// False when the frame is no answer to the request on its way.
  bool answer(const can::Frame& frame) noexcept;
  bool initiate_answer(const can::Frame& frame) noexcept;
  bool segment_answer(const can::Frame& frame) noexcept;
  void take_initiate(const can::Frame& frame) noexcept;
  void take_segment(const can::Frame& frame) noexcept;
  void refuse(AbortCode code, const char* text) noexcept;
  void complete() noexcept;
  void fail_with(Errc code, std::uint32_t detail, const char* text) noexcept;
  void leave() noexcept;
  void prepare_initiate() noexcept;

  SdoClient* client_;
  SdoTransfer* next_ = nullptr;  // waits behind this one for the same node
  SdoOptions options_;
  std::span<const std::uint8_t> data_;
  SdoValue value_;
  std::optional<Error> error_;
  std::size_t offset_ = 0;
  std::size_t indicated_ = 0;
  rt::Time give_up_{};  // for the request that waits for the wire
  can::Frame request_;  // the newest, in case the port was full
  unsigned attempts_ = 0;
  ObjectRef ref_;
  NodeId node_;
  State state_ = State::idle;
  bool download_ = false;
  bool toggle_ = false;
  bool window_ = false;  // the request is on the wire: answers count
  bool last_ = false;
  bool unsized_ = false;
  bool size_indicated_ = false;
};

/// Reads an object of any length.
class SdoUpload final : public SdoTransfer {
 public:
  SdoUpload(SdoClient& client, NodeId node, ObjectRef ref, const SdoOptions& options) noexcept
      : SdoTransfer(client, node, ref, options) {}
  Result<SdoValue> await_resume() {
    if (error()) return fail(*error());
    return std::move(value());
  }
};

/// Reads an integer of exactly `sizeof(T)` bytes.
template <class T>
class SdoRead final : public SdoTransfer {
 public:
  SdoRead(SdoClient& client, NodeId node, ObjectRef ref, const SdoOptions& options) noexcept
      : SdoTransfer(client, node, ref, options) {}
  Result<T> await_resume() noexcept {
    if (error()) return fail(*error());
    if (unsized() && value().size() > sizeof(T)) {
      if (const auto cut = SdoValue(value().bytes().first(sizeof(T))).template as<T>()) return *cut;
    }
    if (const auto whole = value().template as<T>()) return *whole;
    return fail(make_error(Errc::mismatch, 0, "the object has another length than expected"));
  }
};

/// Writes bytes, which must stay until it is done.
class SdoDownload final : public SdoTransfer {
 public:
  SdoDownload(SdoClient& client, NodeId node, ObjectRef ref, const SdoOptions& options,
              std::span<const std::uint8_t> data) noexcept
      : SdoTransfer(client, node, ref, options, data) {}
  Result<void> await_resume() const noexcept {
    if (error()) return fail(*error());
    return {};
  }
};

/// Writes an integer, which it holds itself.
template <class T>
class SdoWrite final : public SdoTransfer {
 public:
  SdoWrite(SdoClient& client, NodeId node, ObjectRef ref, const SdoOptions& options, T value) noexcept
      : SdoTransfer(client, node, ref, options, {}) {
    if constexpr (std::is_same_v<T, bool>) {
      bytes_[0] = value ? 1 : 0;
    } else {
      store_le(bytes_.data(), static_cast<std::make_unsigned_t<T>>(value));
    }
    set_data(bytes_);
  }
  Result<void> await_resume() const noexcept {
    if (error()) return fail(*error());
    return {};
  }

 private:
  std::array<std::uint8_t, sizeof(T)> bytes_{};
};

class SdoClient final : private can::Handler {
 public:
  /// Told of answers that nobody asked for.
  class Observer {
   public:
    /// A second answer to one request: two devices share `node`'s node-ID, or another client uses its default channel.
    virtual void surplus(NodeId node, const can::Frame& frame, rt::Time at) noexcept = 0;

   protected:
    ~Observer() = default;
  };

  explicit SdoClient(can::Dispatcher& dispatcher, const SdoOptions& options = {});
  /// Ends all transfers with Errc::cancelled.
  ~SdoClient();

  [[nodiscard]] SdoUpload upload(NodeId node, std::uint16_t index, std::uint8_t sub) noexcept {
    return SdoUpload(*this, node, {index, sub}, options_);
  }
  [[nodiscard]] SdoUpload upload(NodeId node, std::uint16_t index, std::uint8_t sub,
                                 const SdoOptions& options) noexcept {
    return SdoUpload(*this, node, {index, sub}, options);
  }
  [[nodiscard]] SdoDownload download(NodeId node, std::uint16_t index, std::uint8_t sub,
                                     std::span<const std::uint8_t> data) noexcept {
    return SdoDownload(*this, node, {index, sub}, options_, data);
  }
  [[nodiscard]] SdoDownload download(NodeId node, std::uint16_t index, std::uint8_t sub,
                                     std::span<const std::uint8_t> data, const SdoOptions& options) noexcept {
    return SdoDownload(*this, node, {index, sub}, options, data);
  }
  template <class T>
  [[nodiscard]] SdoRead<T> read(NodeId node, std::uint16_t index, std::uint8_t sub) noexcept {
    return SdoRead<T>(*this, node, {index, sub}, options_);
  }
  template <class T>
  [[nodiscard]] SdoRead<T> read(NodeId node, std::uint16_t index, std::uint8_t sub,
                                const SdoOptions& options) noexcept {
    return SdoRead<T>(*this, node, {index, sub}, options);
  }
  template <class T>
  [[nodiscard]] SdoWrite<T> write(NodeId node, std::uint16_t index, std::uint8_t sub, T value) noexcept {
    return SdoWrite<T>(*this, node, {index, sub}, options_, value);
  }
  template <class T>
  [[nodiscard]] SdoWrite<T> write(NodeId node, std::uint16_t index, std::uint8_t sub, T value,
                                  const SdoOptions& options) noexcept {
    return SdoWrite<T>(*this, node, {index, sub}, options, value);
  }

  /// Ends the transfers of a node with Errc::cancelled, without a frame: the node was reset or is gone.
  void cancel(NodeId node) noexcept;

  void set_options(const SdoOptions& options) noexcept { options_ = options; }
  [[nodiscard]] const SdoOptions& options() const noexcept { return options_; }
  void set_observer(Observer* observer) noexcept { observer_ = observer; }
  /// How long an answer may come late after its request timed out and still not count as surplus. Default 5 s.
  void set_late_window(rt::Duration window) noexcept { late_window_ = window; }

  /// Answers of this node that no request had asked for (see `Observer::surplus`).
  [[nodiscard]] std::uint32_t surplus(NodeId node) const noexcept { return nodes_[node.value() & 0x7FU].surplus; }
  /// Answers to requests that were given up before.
  [[nodiscard]] std::uint32_t late(NodeId node) const noexcept { return nodes_[node.value() & 0x7FU].late; }
  /// Transfers under way or waiting.
  [[nodiscard]] bool busy(NodeId node) const noexcept { return nodes_[node.value() & 0x7FU].first != nullptr; }

 private:
  friend class SdoTransfer;
  struct Node {
    SdoTransfer* first = nullptr;  // on its way; others wait behind it
    std::uint32_t surplus = 0;
    std::uint32_t late = 0;
    std::uint16_t owed = 0;  // answers that requests on the wire have not had
    rt::Time owed_until{};
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  [[nodiscard]] Node& node(NodeId id) noexcept { return nodes_[id.value()]; }
  void enqueue(SdoTransfer& transfer) noexcept;
  void remove(SdoTransfer& transfer) noexcept;

  can::Dispatcher* dispatcher_;
  SdoOptions options_;
  Observer* observer_ = nullptr;
  rt::Duration late_window_ = std::chrono::seconds(5);
  std::array<Node, 128> nodes_{};
};

}  // namespace berth::co
