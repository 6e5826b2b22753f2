/// The SDO channels through which the network accesses a dictionary: the current one, for hooks and streams with state
/// for each client, and answers that come later.
#pragma once

#include <cstdint>
#include <span>

#include "berth/base/ids.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::od {

/// An SDO frame's data.
using ChannelBytes = std::span<const std::uint8_t, 8>;

/// Sees requests before their server: a router, which forwards those for another network.
class ChannelRelay {
 public:
  /// True: the relay handles the request, and answers by `Channels::send`.
  virtual bool request(std::uint8_t channel, ChannelBytes bytes) noexcept = 0;
  /// The channel receives nothing any more.
  virtual void stopped(std::uint8_t channel) noexcept = 0;

 protected:
  ~ChannelRelay() = default;
};

/// The servers of a dictionary, as used by code that answers later.
class ChannelServers {
 public:
  /// See `Channels::answer`.
  virtual bool answer(std::uint8_t channel, ObjectRef object, AbortCode code, ObjectRef named) noexcept = 0;
  /// See `Channels::send`.
  virtual bool send(std::uint8_t channel, ChannelBytes bytes) noexcept = 0;

 protected:
  ~ChannelServers() = default;
};

/// Called at the end of writes that were answered with `pending`, for code that writes a dictionary without a channel.
class Completions {
 public:
  virtual void completed(ObjectRef object, AbortCode code) noexcept = 0;

 protected:
  ~Completions() = default;
};

/// A channel's number: 0 is the default channel (1200h), n the additional server 1200h + n.
class Channels {
 public:
  static constexpr std::uint8_t most = 128;  ///< 1200h..127Fh

  /// The channel of the current access, or of the last one.
  [[nodiscard]] std::uint8_t now() const noexcept { return now_; }
  /// A server calls this before an access.
  void enter(std::uint8_t channel) noexcept { now_ = channel; }

  /// Answers the access of `object` that a hook or stream answered with `pending`: `none` confirms a write, and asks a
  /// stream again; other codes refuse. False: none is pending there. Do not call it inside an access.
  bool answer(std::uint8_t channel, ObjectRef object, AbortCode code) noexcept {
    return answer(channel, object, code, object);
  }
  /// The same, but the confirmation of a write, or the refusal, names another object.
  bool answer(std::uint8_t channel, ObjectRef object, AbortCode code, ObjectRef named) noexcept {
    return servers_ != nullptr && servers_->answer(channel, object, code, named);
  }
  /// Sends a frame to the client of this channel. False: the channel has no server, or the port refuses the frame.
  bool send(std::uint8_t channel, ChannelBytes bytes) noexcept {
    return servers_ != nullptr && servers_->send(channel, bytes);
  }
  /// Null: none. It must stay until removed.
  void set_relay(ChannelRelay* relay) noexcept { relay_ = relay; }
  [[nodiscard]] ChannelRelay* relay() const noexcept { return relay_; }
  /// Null: none. It must stay until removed.
  void tell(Completions* completions) noexcept { completions_ = completions; }
  void completed(ObjectRef object, AbortCode code) noexcept {
    if (completions_ != nullptr) completions_->completed(object, code);
  }
  /// The servers that answer; null: none.
  void serve(ChannelServers* servers) noexcept { servers_ = servers; }
  [[nodiscard]] const ChannelServers* servers() const noexcept { return servers_; }

 private:
  ChannelServers* servers_ = nullptr;
  ChannelRelay* relay_ = nullptr;
  Completions* completions_ = nullptr;
  std::uint8_t now_ = 0;
};

}  // namespace berth::od
