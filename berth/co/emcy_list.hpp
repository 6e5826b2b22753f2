/// Object 1028h, the emergency consumer object (CiA 301 §7.5.2.31; docs/protocols/cia301.md §Emergencies): an
/// `EmcyConsumer` for the nodes that the dictionary names. Sub-index n is the COB-ID of node n's emergencies; bit 31 =
/// not heard. These writes from the network are refused with 0609 0030:
/// - another value of bits 29..0 while the entry is and stays valid
/// - a restricted CAN-ID
/// - bits above bit 10 of an 11-bit identifier
#pragma once

#include "berth/co/emcy.hpp"
#include "berth/od/values.hpp"

namespace berth::co {

class EmcyList final : private od::Hook {
 public:
  /// Hears nothing until `start`, and never without object 1028h.
  EmcyList(can::Dispatcher& dispatcher, od::Values& values, EmcyConsumer::Observer& observer);
  /// An NMT state with EMCY is entered, or left.
  void start() noexcept;
  void stop() noexcept;

 private:
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  void apply() noexcept;

  od::Values* values_;
  EmcyConsumer consumer_;
  bool running_ = false;
};

}  // namespace berth::co
