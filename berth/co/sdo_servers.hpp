/// All SDO channels of a device, as its dictionary describes them: the default channel (1200h), additional servers
/// 1201h..127Fh, and the parameters of its clients 1280h..12FFh (CiA 301 §7.5.2.33, §7.5.2.34;
/// docs/protocols/cia301.md §SDO).
///
///     co::SdoServers servers(dispatcher, values);
///     servers.start(node_id);                                   // pre-operational is entered
///     ...
///     if (const auto c = co::client_channel(values, 1))         // 1280h
///       co::SdoChannelClient client(dispatcher, c->channel, c->server);
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "berth/co/sdo_server.hpp"

namespace berth::co {

/// Channel `number` (1..128) of a device as client, object 127Fh + number; empty when there is no such object or one of
/// its COB-IDs is not valid.
struct SdoClientChannel {
  SdoChannel channel;
  NodeId server;  ///< sub-index 3; unconfigured when the value is no node-ID
};
[[nodiscard]] std::optional<SdoClientChannel> client_channel(const od::Values& values, unsigned number) noexcept;

/// Hooks its objects and refuses writes that the standard forbids:
/// - 1200h:01 and :02 are read-only 0601 0002 and show the default channel, whatever the description says;
/// - a COB-ID of the others may change only while it is not valid (bit 31), and only to an identifier that is not
///   restricted: otherwise 0609 0030. An additional server serves while both its COB-IDs are valid, from the write on.
///
/// Memory: an additional server is allocated when its COB-IDs become valid for the first time (at the latest by the
/// write that makes them valid, which then uses the heap). Nothing else allocates after construction.
class SdoServers final : private od::Hook, private od::ChannelServers {
 public:
  /// `buffer`: for collecting values, for each server, see `SdoServer`.
  SdoServers(can::Dispatcher& dispatcher, od::Values& values, std::size_t buffer = SdoServerService::default_buffer);
  ~SdoServers();

  /// Serves the default channel of `node` (configured) and all valid additional ones. It uses the objects' values, so
  /// reset them before.
  void start(NodeId node);
  /// No channel receives anything (initialising, stopped).
  void stop() noexcept;
  /// See `SdoServerService::set_timeout`.
  void set_timeout(rt::Duration timeout) noexcept;
  /// True if a transfer is under way in any channel.
  [[nodiscard]] bool busy() const noexcept;
  /// Answers the pending writes of `object`, in any channel; false when there is none.
  bool complete(ObjectRef object, AbortCode code) noexcept;
  /// The default channel.
  [[nodiscard]] const SdoServerService& first() const noexcept { return first_; }
  /// Number of additional servers that serve.
  [[nodiscard]] std::size_t additional() const noexcept;
  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept;

 private:
  struct Additional {
    std::uint16_t index;
    std::unique_ptr<SdoServerService> service;  // null: never valid so far
  };
  AbortCode reading(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t>& value) noexcept override;
  AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  bool answer(std::uint8_t channel, ObjectRef object, AbortCode code, ObjectRef named) noexcept override;
  bool send(std::uint8_t channel, od::ChannelBytes bytes) noexcept override;
  [[nodiscard]] SdoServerService* service(std::uint8_t channel) noexcept;
  void apply(Additional& server);

  can::Dispatcher* dispatcher_;
  od::Values* values_;
  std::size_t buffer_;
  SdoServerService first_;
  std::vector<Additional> additional_;  // ascending
  rt::Duration timeout_ = std::chrono::seconds(1);
  std::array<std::uint8_t, 4> shown_{};
  bool running_ = false;
};

}  // namespace berth::co
