/// Reads and writes the objects of one device, wherever it is. Boot-up, configuration and tools use this and never a
/// bare node-ID, so that they also work for a device behind gateways.
#pragma once

#include "berth/base/result.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/rt/task.hpp"

namespace berth::co {

class SdoAccess {
 public:
  virtual ~SdoAccess() = default;
  /// Fails as `SdoTransfer` does.
  [[nodiscard]] virtual rt::Task<Result<SdoValue>> read(std::uint16_t index, std::uint8_t sub) = 0;
  /// The same for an object of at most so many bytes: a longer or endless answer is given up (Errc::mismatch). The
  /// default implementation calls `read`.
  [[nodiscard]] virtual rt::Task<Result<SdoValue>> read_up_to(std::uint16_t index, std::uint8_t sub, std::size_t most);
  /// `data` must stay until the task is done.
  [[nodiscard]] virtual rt::Task<Result<void>> write(std::uint16_t index, std::uint8_t sub,
                                                     std::span<const std::uint8_t> data) = 0;
  /// Writes the bytes of a source, which must stay until the task is done: a program, by block transfer or as `how`
  /// says. The default implementation reads all bytes into memory and writes them with `write`.
  [[nodiscard]] virtual rt::Task<Result<void>> download(std::uint16_t index, std::uint8_t sub, SdoSource& source,
                                                        const SdoOptions& how);
  /// Errc::mismatch when the object has another length.
  [[nodiscard]] rt::Task<Result<std::uint32_t>> read_u32(std::uint16_t index, std::uint8_t sub);
  [[nodiscard]] rt::Task<Result<void>> write_u32(std::uint16_t index, std::uint8_t sub, std::uint32_t value);
};

/// A node on this bus. The client must stay. If no options are given, the client's at the time of each access apply.
class NodeAccess final : public SdoAccess {
 public:
  NodeAccess(SdoClient& client, NodeId node) noexcept : client_(&client), node_(node) {}
  NodeAccess(SdoClient& client, NodeId node, const SdoOptions& options) noexcept
      : client_(&client), options_(options), node_(node) {}
  [[nodiscard]] NodeId node() const noexcept { return node_; }
  rt::Task<Result<SdoValue>> read(std::uint16_t index, std::uint8_t sub) override;
  rt::Task<Result<SdoValue>> read_up_to(std::uint16_t index, std::uint8_t sub, std::size_t most) override;
  rt::Task<Result<void>> write(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> data) override;
  rt::Task<Result<void>> download(std::uint16_t index, std::uint8_t sub, SdoSource& source,
                                  const SdoOptions& how) override;

 private:
  SdoClient* client_;
  std::optional<SdoOptions> options_;
  NodeId node_;
};

}  // namespace berth::co
