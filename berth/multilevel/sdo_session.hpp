/// The part of an SDO gateway for one client; see `SdoGateway`.
#pragma once

#include <optional>

#include "berth/co/sdo_client.hpp"
#include "berth/multilevel/byte_queue.hpp"
#include "berth/multilevel/sdo_gateway.hpp"
#include "berth/rt/later.hpp"
#include "berth/rt/scope.hpp"

namespace berth::multilevel {

/// A command specifier with its multiplexer, as written by the client above.
struct GatewayCommand {
  enum class Kind : std::uint8_t {
    expedited_download,  ///< of data that are already there
    download,            ///< of data that are already there
    passed_download,     ///< of data that come next
    upload,
  };
  Kind kind = Kind::upload;
  co::SdoMode mode = co::SdoMode::segmented;
  std::optional<std::size_t> length = {};  ///< of an expedited download that gives it
  ObjectRef object = {};
};
/// Empty: the command specifier begins no transfer.
[[nodiscard]] std::optional<GatewayCommand> parse_command(std::uint32_t value) noexcept;

/// One client above. The access beneath is a task that only records what it gets; `wake_` answers the client above, so
/// that no code runs inside another's call.
class SdoSession final : public od::Stream {
 public:
  SdoSession(SdoGateway& gateway, std::uint8_t channel) noexcept;
  ~SdoSession() { cancel(); }

  [[nodiscard]] od::AbortCode select(std::uint8_t node) noexcept;
  [[nodiscard]] od::AbortCode command(std::uint32_t value) noexcept;
  /// From the gateway's own device: an access that it answered with `pending` has ended.
  void completed(ObjectRef object, od::AbortCode code) noexcept;
  /// The client no longer waits, or the gateway is reset.
  void cancel() noexcept;
  void reset() noexcept;
  [[nodiscard]] bool busy() const noexcept { return scope_.running() != 0; }
  /// The last written command, or node-ID.
  [[nodiscard]] std::span<const std::uint8_t> shown(bool command) const noexcept {
    return command ? std::span<const std::uint8_t>(command_bytes_) : std::span<const std::uint8_t>(node_);
  }

 private:
  enum class State : std::uint8_t {
    idle,
    storing,    // data come in, their command is not known yet
    stored,     // all data are there
    armed,      // the command came first; data follow
    uploading,  // the client above reads what comes from beneath
    passing,    // data from above go down
    sending,    // stored data go down; the write of the command waits
  };
  // Takes the data uploaded beneath.
  class Sink final : public co::SdoSink {
   public:
    explicit Sink(SdoSession& session) noexcept : session_(&session) {}
    od::AbortCode begin(std::optional<std::size_t> size) noexcept override;
    od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override;

   private:
    SdoSession* session_;
  };
  // Gives the data to download beneath.
  class Source final : public co::SdoSource {
   public:
    explicit Source(SdoSession& session) noexcept : session_(&session) {}
    [[nodiscard]] std::optional<std::size_t> size() const noexcept override { return session_->size_; }
    [[nodiscard]] std::size_t ready() const noexcept override;
    od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override;

   private:
    SdoSession* session_;
  };

  // od::Stream: the data object, as the client above reads and writes it
  od::Answer<std::optional<std::size_t>> open_read(ObjectRef ref) noexcept override;
  [[nodiscard]] std::size_t ready() const noexcept override;
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override;
  [[nodiscard]] ObjectRef named(ObjectRef ref) const noexcept override;
  od::AbortCode open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept override;
  [[nodiscard]] std::size_t piece() const noexcept override { return 1; }
  [[nodiscard]] std::size_t sub_block() const noexcept override;
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override;
  od::AbortCode close(ObjectRef ref, bool complete) noexcept override;

  [[nodiscard]] NodeId node() const noexcept { return NodeId(node_[0]); }
  [[nodiscard]] od::AbortCode begin_sending() noexcept;
  void start(State state) noexcept;
  rt::Task<void> upload();
  rt::Task<void> pass();
  rt::Task<void> send();
  void ended(const Result<void>& done) noexcept;
  void wake() noexcept;
  void client_left() noexcept;

  SdoGateway* gateway_;
  GatewayCommand command_;
  ByteQueue queue_;
  Sink sink_{*this};
  Source source_{*this};
  std::optional<std::size_t> size_;  // of the transferred data, if known
  od::AbortCode failure_ = od::AbortCode::none;
  std::array<std::uint8_t, 1> node_{};
  std::array<std::uint8_t, 4> command_bytes_{};
  std::uint8_t channel_;
  State state_ = State::idle;
  bool waits_ = false;     // passing: nothing has come yet
  bool begun_ = false;     // an upload: its size is known, or that it has none
  bool all_in_ = false;    // passing: the client above has sent everything
  bool finished_ = false;  // the access beneath has ended, with `failure_`
  bool saves_ = false;     // sending: the gateway's own device answers later
  bool crowded_ = false;   // passing: the client above waits for room
  rt::Later<SdoSession, &SdoSession::wake> wake_;
  rt::Later<SdoSession, &SdoSession::client_left>
      client_left_;  // set while the node beneath waits for the client above
  rt::Scope scope_;
};

}  // namespace berth::multilevel
