/// Reading and writing the objects of one device, wherever it is. Boot-up, configuration and tools go through this and
/// never to a bare node-ID, so that they work for a device behind gateways as for one on this bus.
#pragma once

#include "berth/base/result.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/rt/task.hpp"

namespace berth::co {

class SdoAccess {
 public:
  virtual ~SdoAccess() = default;
  /// Errors as `SdoTransfer` has them.
  [[nodiscard]] virtual rt::Task<Result<SdoValue>> read(std::uint16_t index, std::uint8_t sub) = 0;
  /// The same for an object that has at most so many bytes: a device that gives more, or never ends, is given up
  /// (Errc::mismatch). As long as `read` where it is not overridden.
  [[nodiscard]] virtual rt::Task<Result<SdoValue>> read_up_to(std::uint16_t index, std::uint8_t sub, std::size_t most);
  /// `data` must stay until the task is done.
  [[nodiscard]] virtual rt::Task<Result<void>> write(std::uint16_t index, std::uint8_t sub,
                                                     std::span<const std::uint8_t> data) = 0;
  /// Writes what a source gives, which must stay until the task is done: a program, by block transfer or as `how` says.
  /// Where it is not overridden: all its bytes are taken into memory, and written as `write` does.
  [[nodiscard]] virtual rt::Task<Result<void>> download(std::uint16_t index, std::uint8_t sub, SdoSource& source,
                                                        const SdoOptions& how);
  /// Errc::mismatch when the object has another length.
  [[nodiscard]] rt::Task<Result<std::uint32_t>> read_u32(std::uint16_t index, std::uint8_t sub);
  [[nodiscard]] rt::Task<Result<void>> write_u32(std::uint16_t index, std::uint8_t sub, std::uint32_t value);
};

/// A node on this bus. The client must stay; options are the client's at the time of each access, unless given.
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
