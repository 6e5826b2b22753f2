/// A node on a bus of a plant that another process simulates (`berth plant`), and the server for it. plant_protocol.hpp
/// has the protocol.
///
///     auto port = io::PlantPort::connect(loop, "/tmp/plant.sock", "backbone");   // client: a can::Port
///     auto server = io::PlantServer::listen(loop, "/tmp/plant.sock", factory);   // the plant's process
///
/// Both live in one loop's executor. Times are those of the own process: `sent` and `received` come later than on the
/// plant's bus, by the delay between the processes. Therefore `knows_sent` guarantees only the order.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/can/port.hpp"
#include "berth/io/loop.hpp"

namespace berth::io {

class PlantPort final : public can::Port {
 public:
  static constexpr unsigned queue_depth = 32;    ///< frames queued and not yet sent; then `Queued::full`
  static constexpr unsigned events_kept = 4096;  ///< received and not yet delivered; then the connection is closed

  /// Waits at most `timeout` for the plant to accept (its machine may be busy); errors are in words. Destroy the port
  /// before the loop.
  [[nodiscard]] static tl::expected<std::unique_ptr<PlantPort>, std::string> connect(
      Loop& loop, const std::string& path, std::string_view bus, rt::Duration timeout = std::chrono::seconds(10));
  ~PlantPort() override;
  PlantPort(const PlantPort&) = delete;
  PlantPort& operator=(const PlantPort&) = delete;

  // can::Port. When the plant's process ends, the status is down (`up` false) for ever: connect again.
  can::Queued send(const can::Frame& frame, std::uint32_t tag) noexcept override;
  void withdraw(std::uint32_t tag) noexcept override;
  /// More than `most_ranges` ranges: everything passes.
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override;
  [[nodiscard]] can::Status status() const noexcept override;
  bool restart(std::uint32_t bit_rate) noexcept override;

 private:
  class Impl;
  explicit PlantPort(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// `Seats` decides which client keeps its seat. A client's whole request is its `hello`; after it the client is a node
/// of the bus, and is never displaced.
class PlantServer {
 public:
  static constexpr std::size_t most_clients = 16;  ///< clients that are nodes; one more is refused with an explanation
  /// Gives a new client its own node on the bus; null, with `why` in words: there is no such bus. Destroying the port
  /// takes the node off the bus.
  using Factory = std::function<std::unique_ptr<can::Port>(const std::string& bus, std::string& why)>;

  /// Makes the socket (mode 0600). Refused when another process answers there; a socket left by a dead process is taken
  /// over.
  [[nodiscard]] static tl::expected<std::unique_ptr<PlantServer>, std::string> listen(Loop& loop,
                                                                                      const std::string& path,
                                                                                      Factory factory);
  ~PlantServer();
  PlantServer(const PlantServer&) = delete;
  PlantServer& operator=(const PlantServer&) = delete;
  [[nodiscard]] std::size_t clients() const noexcept;

 private:
  class Impl;
  explicit PlantServer(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::io
