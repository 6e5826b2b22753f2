/// 1F20h and 1F22h of the manager's own device: DCFs, concise or not, read and written by node-ID as streams. Memory is
/// used only during a transfer. Only one transfer runs at a time: a second one is refused with 0800 0022.
#pragma once

#include <vector>

#include "berth/manager/stored_dcf.hpp"
#include "berth/od/values.hpp"

namespace berth::operate {

class DcfStream final : public od::Stream {
 public:
  class Owner {
   public:
    /// Empty: there is none.
    virtual std::vector<std::uint8_t> dcf(ObjectRef ref) = 0;
    /// Asked before the first byte: whether it may be written now.
    virtual od::AbortCode may_store(ObjectRef ref) = 0;
    /// Called when all bytes have arrived. Returns the answer to the client.
    virtual od::AbortCode store(ObjectRef ref, std::span<const std::uint8_t> bytes) = 0;

   protected:
    ~Owner() = default;
  };

  /// A longer one is refused with 0607 0012, at once when the client states its size.
  static constexpr std::size_t longest = manager::longest_stored_text;

  /// `owner` must outlive this.
  explicit DcfStream(Owner& owner) noexcept : owner_(&owner) {}
  /// Serves both objects for every node-ID. `values` must have been made with them.
  void attach_to(od::Values& values);

 private:
  od::Answer<std::optional<std::size_t>> open_read(ObjectRef ref) noexcept override;
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override;
  od::AbortCode open_write(ObjectRef ref, std::optional<std::size_t> size) noexcept override;
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override;
  od::AbortCode close(ObjectRef ref, bool complete) noexcept override;

  Owner* owner_;
  std::vector<std::uint8_t> bytes_;  // of the present transfer
  std::size_t given_ = 0;            // read: how many of these were given
  bool writes_ = false;
};

}  // namespace berth::operate
