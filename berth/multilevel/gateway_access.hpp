/// The client's side of the SDO gateway (paper 3; docs/multilevel.md §SDO): reaches the objects of a node beneath
/// gateways by `co::SdoAccess`, so that code that configures, boots or analyses a node need not know where it is.
///
///     multilevel::Routes routes(client);
///     co::SdoAccess& drive = routes.access(*parse_path("3/5"));
///     const auto type = co_await drive.read_u32(0x1000, 0);
///
/// Its cost, in accesses on the client's bus: the first access to a node beneath d gateways takes 2^(d+1) - 1, each
/// further one to the same node 2^d (S3.29).
#pragma once

#include <map>
#include <memory>

#include "berth/co/sdo_access.hpp"
#include "berth/multilevel/objects.hpp"
#include "berth/multilevel/path.hpp"
#include "berth/rt/turn.hpp"

namespace berth::multilevel {

/// `Error::text` when a gateway answered, but the node that it asked did not.
inline constexpr const char* node_silent = "no answer beneath the gateway";

/// What one client knows of a gateway's bus beneath: the node that it wrote there. One access at a time.
struct GatewayLine {
  rt::Turn turn;
  NodeId selected;  ///< unconfigured: unknown
};

/// Accesses the node beneath one gateway. Errors name the node and its object, as in `co::SdoTransfer`. Errc::timeout:
/// the node does not answer the gateway in time, or the gateway does not answer. Errc::unsupported: a node on the way
/// (`Error::node`) has no gateway objects for that bus.
class GatewayAccess final : public co::SdoAccess {
 public:
  /// `line`: shared by all accesses of this client to that bus. `gateway`: the objects of the gateway, which may itself
  /// be beneath another. Both must outlive it.
  GatewayAccess(GatewayLine& line, co::SdoAccess& gateway, NodeId node, unsigned port = 1) noexcept
      : line_(&line), gateway_(&gateway), at_once_(&gateway), objects_(SdoGatewayObjects::of(port)), node_(node) {}
  [[nodiscard]] NodeId node() const noexcept { return node_; }
  /// Values of at least so many bytes use block transfer on the bus beneath; other values longer than 4 are segmented.
  void set_block_from(std::size_t bytes) noexcept { block_from_ = bytes; }
  /// The same gateway with an ordinary device's time-out, for answers that do not need the node: so a silent gateway is
  /// reported sooner than a silent node beneath it. Must outlive it.
  void set_at_once(co::SdoAccess& gateway) noexcept { at_once_ = &gateway; }
  /// Repetitions of a whole access after a time-out, also the gateway's (0504 0000); default 0. `gateway` itself must
  /// not repeat: after a gateway has taken a command its data are gone, and it refuses a repeated command.
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
    unsigned lost = 0;      // a gateway had lost what this client wrote
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

/// Time-outs of the gateways beneath a client.
struct GatewayTimes {
  rt::Duration timeout = co::SdoOptions{}.timeout;  ///< of the slowest gateway, for one level
                                                    ///< (`SdoGatewayOptions::sdo`)
  std::size_t levels = 1;                           ///< most gateways in a row
};

/// All nodes that one client reaches, by path.
class Routes {
 public:
  /// `client` must outlive it. An access waits `options.timeout` longer than the first gateway waits for an answer from
  /// beneath: `gateways.timeout` for a node, and for a gateway that times the number of levels (S3.27). So the client
  /// hears that gateway's answer before it gives up. `options.retries` applies to whole accesses.
  explicit Routes(co::SdoClient& client) noexcept : Routes(client, client.options()) {}
  Routes(co::SdoClient& client, const co::SdoOptions& options, const GatewayTimes& gateways = {}) noexcept
      : client_(&client), options_(options), gateways_(gateways) {}

  /// Valid as long as this object. The path's node-IDs must be configured.
  [[nodiscard]] co::SdoAccess& access(const Path& path);
  /// A gateway was reset, or another client changed this client's node-ID beneath it: write it again.
  void forget() noexcept;

 private:
  struct Key {
    std::size_t depth;  // of the path that contains it: longer paths need longer time-outs
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
