/// The SDO gateway of paper 3 (Figures 11 to 13; docs/multilevel.md §SDO): three objects in the dictionary of the
/// gateway's upstream side carry any SDO access to any node of the bus beneath.
///
///     od::DescriptionBuilder b;
///     device::add_device(b, {.name = "Gateway"});
///     multilevel::add_sdo_gateway(b);
///     device::Device upper(dispatcher, b.build(), &flash, options);
///     multilevel::SdoGateway gateway(upper.values(), client_of_the_bus_beneath);
///
/// A download: write the downstream node-ID, the data, and then the command specifier with the multiplexer; this last
/// write is answered after the node beneath has answered. An upload: write the node-ID, the command specifier with the
/// multiplexer, and then upload the data object, which is answered after the node beneath has answered, however early
/// the upload begins (S3.27). The node-ID is valid until another is written.
///
/// The command specifier selects the access beneath:
///   - 23h 27h 2Bh 2Fh 22h: expedited download of the data that were written before; their number must be that of the
///     specifier (0607 0010)
///   - 21h, C2h, C6h, which indicate a size: segmented or block download of the data that were written before
///   - 20h, C0h, C4h, which do not: of what is written next. That is handed on as it comes, and its write is answered
///     when the node beneath has answered; what was written before is dropped
///   - 40h, A0h, A4h: upload, segmented or in blocks; handed on as it comes
/// Others: 0504 0001. Without a node-ID: 0800 0022. A download without data, an upload of data that no command asked
/// for: 0800 0024. If the node beneath refuses, the client gets its code; if it does not answer, 0504 0000.
///
/// Each SDO channel of the upstream side (1200h..127Fh) has its own node-ID, data and command, so that clients do not
/// mix. Accesses to one node run one after the other, those to different nodes in parallel. A client that aborts, or
/// asks for something else, or is silent too long, ends the access beneath.
#pragma once

#include <array>
#include <memory>

#include "berth/co/sdo_client.hpp"
#include "berth/multilevel/objects.hpp"
#include "berth/od/values.hpp"

namespace berth::multilevel {

struct SdoGatewayOptions {
  unsigned port = 1;            ///< which bus beneath, 1..8
  co::SdoOptions sdo{};         ///< accesses beneath; mode and retries come from the client above
  unsigned levels_beneath = 0;  ///< levels of gateways beneath this one: an access to such a gateway's objects gets so
                                ///< many more `sdo.timeout`s (S3.27)
  bool literal = false;         ///< answers name the object beneath, as in the paper (S3.25); CiA 301 clients ignore
                                ///< such answers
  std::size_t store = 4096;     ///< bytes of a download kept until its command comes; more: 0504 0005
  /// The node beneath waits no longer than this for a client that does not fetch its upload.
  rt::Duration client_timeout = std::chrono::seconds(2);
  rt::Duration save_timeout = std::chrono::seconds(10);  ///< of the gateway's own device beneath
};

class SdoSession;

class SdoGateway final : private od::Hook, private od::Stream, private od::Completions {
 public:
  /// Both must outlive it. `upper` needs the three objects (`add_sdo_gateway`). Uses the heap.
  SdoGateway(od::Values& upper, co::SdoClient& beneath, rt::Executor& executor, const SdoGatewayOptions& options = {});
  ~SdoGateway();

  /// The gateway's own device on the bus beneath: accesses to its node-ID there go to its dictionary, because a node
  /// does not hear itself. An answer that comes later (`pending`: it saves) is awaited for `save_timeout`.
  /// Unconfigured: none.
  void set_own(NodeId own, od::Values& values) noexcept;
  /// Replaces the client beneath by the one of the bus's master, because two clients in one device would mix their
  /// transfers. Ends accesses in progress.
  void set_client(co::SdoClient& beneath) noexcept;
  /// At a reset of the gateway: forgets what all clients have written, and ends accesses in progress.
  void reset() noexcept;
  /// Accesses beneath that are in progress or waiting.
  [[nodiscard]] std::size_t busy() const noexcept;
  [[nodiscard]] const SdoGatewayOptions& options() const noexcept { return options_; }

 private:
  friend class SdoSession;
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void abandoned(od::Values& values, ObjectRef ref) noexcept override;
  od::Stream& of(std::uint8_t channel) noexcept override;
  void completed(ObjectRef object, od::AbortCode code) noexcept override;
  [[nodiscard]] SdoSession* session() noexcept;
  [[nodiscard]] od::Values* own(NodeId node) const noexcept {
    return own_.configured() && node == own_ ? own_values_ : nullptr;
  }

  od::Values* upper_;
  co::SdoClient* beneath_;
  rt::Executor* executor_;
  SdoGatewayOptions options_;
  SdoGatewayObjects objects_;
  NodeId own_;
  od::Values* own_values_ = nullptr;
  std::array<std::unique_ptr<SdoSession>, od::Channels::most> sessions_;
};

}  // namespace berth::multilevel
