/// The client's side of the SDO gateway (paper 3; docs/multilevel.md §SDO): the objects of a node beneath gateways by
/// `co::SdoAccess`, so that what configures, boots or analyses a node does not ask where it is.
///
///     multilevel::Routes routes(client);
///     co::SdoAccess& drive = routes.access(*parse_path("3/5"));
///     const auto type = co_await drive.read_u32(0x1000, 0);
///
/// What it costs, in accesses on the bus where it begins: the first one to a node beneath d gateways 2^(d+1) - 1, each
/// further one to the same node 2^d (S3.29).
#pragma once

#include <map>
#include <memory>

#include "berth/co/sdo_access.hpp"
#include "berth/multilevel/objects.hpp"
#include "berth/multilevel/path.hpp"
#include "berth/rt/turn.hpp"

namespace berth::multilevel {

/// `Error::text` where a gateway answered, and who it asked beneath it did not.
inline constexpr const char* node_silent = "no answer beneath the gateway";

/// What one client knows of one gateway's bus beneath: which node it has written there. One access at a time.
struct GatewayLine {
  rt::Turn turn;
  NodeId selected;  ///< unconfigured: not known
};

/// The node beneath one gateway. Errors name it and its object, and are as `co::SdoTransfer` has them: a node that does
/// not answer the gateway in time is Errc::timeout here too, as a gateway that does not answer is. Errc::unsupported: a
/// node on the way (`Error::node`) has no objects of a gateway to that bus.
class GatewayAccess final : public co::SdoAccess {
 public:
  /// `line`: shared by all accesses of this client to that bus. `gateway`: the objects of the gateway, which may itself
  /// be beneath another. Both must stay.
  GatewayAccess(GatewayLine& line, co::SdoAccess& gateway, NodeId node, unsigned port = 1) noexcept
      : line_(&line), gateway_(&gateway), at_once_(&gateway), objects_(SdoGatewayObjects::of(port)), node_(node) {}
  [[nodiscard]] NodeId node() const noexcept { return node_; }
  /// Values of so many bytes and more are carried by block transfer on the bus beneath, longer ones than 4 segmented.
  void set_block_from(std::size_t bytes) noexcept { block_from_ = bytes; }
  /// The same gateway with the time-out of any device, for what it answers by itself, before it asks the node: so one
  /// that is silent is told sooner than a node beneath it. Must stay.
  void set_at_once(co::SdoAccess& gateway) noexcept { at_once_ = &gateway; }
  /// New attempts of a whole access after a time-out, the gateway's as well (0504 0000): 0 unless told. What is asked
  /// of `gateway` has none of its own: a gateway that took a command once has its data no more, and refuses a repeated
  /// one.
  void set_retries(unsigned count) noexcept { retries_ = count; }

  rt::Task<Result<co::SdoValue>> read(std::uint16_t index, std::uint8_t sub) override;
  rt::Task<Result<co::SdoValue>> read_up_to(std::uint16_t index, std::uint8_t sub, std::size_t most) override;
  rt::Task<Result<void>> write(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data) override;

 private:
  rt::Task<Result<void>> select();
  rt::Task<Result<void>> command(co::SdoAccess& gateway, std::uint8_t specifier, ObjectRef object);
  rt::Task<Result<co::SdoValue>> fetch(ObjectRef object, std::size_t most);
  rt::Task<Result<void>> write_short(ObjectRef object, std::span<const std::uint8_t> data);
  rt::Task<Result<void>> write_long(ObjectRef object, std::span<const std::uint8_t> data);
  [[nodiscard]] Error about(const Error& error, ObjectRef object) const noexcept;
  struct Attempts {
    unsigned lost = 0;      // a gateway had forgotten what this client wrote
    unsigned timeouts = 0;  // this client's or a gateway's
  };
  [[nodiscard]] bool try_again(const Error& error, ObjectRef object, Attempts& made) noexcept;

  GatewayLine* line_;
  co::SdoAccess* gateway_;
  co::SdoAccess* at_once_;
  SdoGatewayObjects objects_;
  NodeId node_;
  std::size_t block_from_ = 64;
  unsigned retries_ = 0;
};

/// How long the gateways beneath a client wait themselves.
struct GatewayTimes {
  rt::Duration timeout = co::SdoOptions{}.timeout;  ///< of the slowest, for one level (`SdoGatewayOptions::sdo`)
  std::size_t levels = 1;                           ///< gateways one beneath the other, at most
};

/// All nodes that one client reaches, by their paths.
class Routes {
 public:
  /// `client` must stay. An access has `options.timeout` beyond what the first gateway waits for an answer from
  /// beneath: `gateways.timeout` for a node, and for a gateway as often as there are levels (S3.27). So that gateway's
  /// answer is heard before the client gives up. `options.retries` counts for whole accesses.
  explicit Routes(co::SdoClient& client) noexcept : Routes(client, client.options()) {}
  Routes(co::SdoClient& client, const co::SdoOptions& options, const GatewayTimes& gateways = {}) noexcept
      : client_(&client), options_(options), gateways_(gateways) {}

  /// It stays as long as this object. The path's node-IDs are configured.
  [[nodiscard]] co::SdoAccess& access(const Path& path);
  /// A gateway was reset, or this client's node-ID beneath it was changed by somebody else: it is told anew.
  void forget() noexcept;

 private:
  struct Key {
    std::size_t depth;  // of the path that it is a part of: longer ones need longer time-outs
    Path path;
    friend auto operator<=>(const Key&, const Key&) noexcept = default;
  };
  co::SdoAccess& reach(const Path& path, std::size_t depth);
  [[nodiscard]] rt::Duration timeout_at(std::size_t depth) const noexcept;
  co::SdoAccess& at_once(NodeId gateway);

  co::SdoClient* client_;
  co::SdoOptions options_;
  GatewayTimes gateways_;
  std::map<std::vector<Hop>, std::unique_ptr<GatewayLine>> lines_;
  std::map<Key, std::unique_ptr<co::SdoAccess>> accesses_;
  std::map<NodeId, std::unique_ptr<co::SdoAccess>> at_once_;  // gateways on the client's own bus
};

}  // namespace berth::multilevel
