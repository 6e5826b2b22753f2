/// The SDO gateway of paper 3 (Figures 11 to 13; docs/multilevel.md §SDO): three objects in the dictionary of the
/// gateway's upstream side carry any SDO access to any node of the bus beneath.
///
///     od::DescriptionBuilder b;
///     device::add_device(b, {.name = "Gateway"});
///     multilevel::add_sdo_gateway(b);
///     device::Device upper(dispatcher, b.build(), &flash, options);
///     multilevel::SdoGateway gateway(upper.values(), client_of_the_bus_beneath);
///
/// A download: the downstream node-ID, the data, and then the command specifier with the multiplexer, whose write is
/// answered when the node beneath has answered. An upload: the node-ID, the command specifier with the multiplexer, and
/// then an upload of the data object, which is answered when the node beneath has answered, however early it comes
/// (S3.27). The node-ID counts until another is written.
///
/// The command specifier says how the access beneath is done:
///   - 23h 27h 2Bh 2Fh 22h: expedited download of the data that were written before; their number must be that of the
///     specifier (0607 0010)
///   - 21h, C2h, C6h, which indicate a size: segmented or block download of the data that were written before
///   - 20h, C0h, C4h, which do not: of what is written next. That is handed on as it comes, and its write is answered
///     when the node beneath has answered; what was written before is dropped
///   - 40h, A0h, A4h: upload, segmented or in blocks; handed on as it comes
/// Others: 0504 0001. Without a node-ID: 0800 0022. A download without data, an upload of data that no command asked
/// for: 0800 0024. What the node beneath refuses, the client gets with that code, and 0504 0000 for one that does not
/// answer.
///
/// Each SDO channel of the upstream side (1200h..127Fh) has node-ID, data and command of its own, so that clients do
/// not mix. Accesses to one node are done one after the other, and to several side by side. A client that aborts, or
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
  unsigned levels_beneath = 0;  ///< gateways one beneath the other, under this one: an access to such a gateway's
                                ///< objects gets so many more `sdo.timeout`s (S3.27)
  bool literal = false;         ///< answers name the object beneath, as published (S3.25); CiA 301 clients ignore them
  std::size_t store = 4096;     ///< bytes of a download that are kept until their command comes; more: 0504 0005
  /// A client that does not fetch what was uploaded for it keeps the node beneath waiting no longer than this.
  rt::Duration client_timeout = std::chrono::seconds(2);
  rt::Duration save_timeout = std::chrono::seconds(10);  ///< of the gateway's own device beneath
};

class SdoSession;

class SdoGateway final : private od::Hook, private od::Stream, private od::Completions {
 public:
  /// Both must stay. `upper` has the three objects (`add_sdo_gateway`); without them nothing can be asked. Uses the
  /// heap.
  SdoGateway(od::Values& upper, co::SdoClient& beneath, rt::Executor& executor, const SdoGatewayOptions& options = {});
  ~SdoGateway();

  /// The gateway's own device on the bus beneath: accesses to its node-ID there go to its dictionary, as no node hears
  /// itself. What that answers later (`pending`: a saving) is waited for as long as `save_timeout`. Unconfigured: none.
  void set_own(NodeId own, od::Values& values) noexcept;
  /// The client beneath from now on: the one that the bus's master uses, as two in one device would mix their
  /// transfers. Ends what is under way.
  void set_client(co::SdoClient& beneath) noexcept;
  /// Forgets what all clients have said and ends what is under way: reset of the gateway.
  void reset() noexcept;
  /// Accesses beneath that are under way or waited for.
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
