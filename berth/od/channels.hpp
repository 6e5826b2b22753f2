/// The SDO channels through which the network accesses a dictionary: which one it is now, for hooks and streams that
/// keep something for each client, and answers that come later.
#pragma once

#include <cstdint>
#include <span>

#include "berth/base/ids.hpp"
#include "berth/od/abort_code.hpp"

namespace berth::od {

/// An SDO frame's data.
using ChannelBytes = std::span<const std::uint8_t, 8>;

/// Looks at requests before their server does: a router's, which hands those on that are for another network.
class ChannelRelay {
 public:
  /// True: the relay deals with it, and answers by `Channels::send`.
  virtual bool request(std::uint8_t channel, ChannelBytes bytes) noexcept = 0;
  /// The channel hears nothing any more.
  virtual void stopped(std::uint8_t channel) noexcept = 0;

 protected:
  ~ChannelRelay() = default;
};

/// The servers of a dictionary, as who answers later sees them.
class ChannelServers {
 public:
  /// As `Channels::answer`.
  virtual bool answer(std::uint8_t channel, ObjectRef object, AbortCode code, ObjectRef named) noexcept = 0;
  /// As `Channels::send`.
  virtual bool send(std::uint8_t channel, ChannelBytes bytes) noexcept = 0;

 protected:
  ~ChannelServers() = default;
};

/// A channel's number: 0 is the default channel (1200h), n the additional server 1200h + n.
class Channels {
 public:
  static constexpr std::uint8_t most = 128;  ///< 1200h..127Fh

  /// The channel of the access under way, or of the one before.
  [[nodiscard]] std::uint8_t now() const noexcept { return now_; }
  /// What a server says before it accesses.
  void enter(std::uint8_t channel) noexcept { now_ = channel; }

  /// Answers the access of `object` that a hook or stream answered with `pending`: `none` confirms a write, and asks a
  /// stream again; other codes refuse. False: none is pending there. Not from inside an access.
  bool answer(std::uint8_t channel, ObjectRef object, AbortCode code) noexcept {
    return answer(channel, object, code, object);
  }
  /// The same, with another object's name in a confirmation of a write or a refusal.
  bool answer(std::uint8_t channel, ObjectRef object, AbortCode code, ObjectRef named) noexcept {
    return servers_ != nullptr && servers_->answer(channel, object, code, named);
  }
  /// A frame to the client of this channel. False: nobody serves it, or the port takes none.
  bool send(std::uint8_t channel, ChannelBytes bytes) noexcept {
    return servers_ != nullptr && servers_->send(channel, bytes);
  }
  /// Null: none. It must stay until it is taken out.
  void set_relay(ChannelRelay* relay) noexcept { relay_ = relay; }
  [[nodiscard]] ChannelRelay* relay() const noexcept { return relay_; }
  /// Who answers; null: nobody.
  void serve(ChannelServers* servers) noexcept { servers_ = servers; }
  [[nodiscard]] const ChannelServers* servers() const noexcept { return servers_; }

 private:
  ChannelServers* servers_ = nullptr;
  ChannelRelay* relay_ = nullptr;
  std::uint8_t now_ = 0;
};

}  // namespace berth::od
