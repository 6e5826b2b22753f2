/// The errors of a device and where they appear: emergency messages (1014h, 1015h), the error register 1001h, the
/// pre-defined error field 1003h, and the effect of an error on the NMT state (1029h; CiA 301 §7.2.7, §7.5.2.3,
/// §7.5.2.5, §7.5.2.17, §7.5.2.18, §7.5.2.32).
///
///     device.errors().raise(0x4210, co::error_register::temperature);   // EMCY, 1001h and 1003h follow
///     device.errors().clear(0x4210);
///
/// Objects that the dictionary lacks have no effect; without 1014h messages go to 080h + node-ID. Writes to 1014h may
/// change the identifier only while the object is not valid before or after, and only to one that is not restricted;
/// else 0609 0030. 1003h:00 accepts only 0. No heap after construction.
#pragma once

#include <array>
#include <memory>

#include "berth/co/emcy.hpp"
#include "berth/co/nmt_slave.hpp"
#include "berth/co/service_owner.hpp"
#include "berth/device/host.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

class Errors final : public co::ServiceOwner, private od::Hook {
 public:
  class Owner {
   public:
    /// The device itself changed the value of an object: 1001h.
    virtual void value_changed(ObjectRef object) noexcept = 0;

   protected:
    ~Owner() = default;
  };
  using Info = std::array<std::uint8_t, 5>;  ///< manufacturer-specific bytes of a message
  /// Error classes of 1029h that the device itself uses.
  static constexpr std::uint8_t communication = 1;

  /// All must outlive it; `nmt` and `owner` are used after `start` only.
  Errors(can::Dispatcher& dispatcher, od::Values& values, co::NmtSlave& nmt, const Host& host, Owner& owner);

  /// An error began, or is gone. False: it was active already, or was not active. See `co::EmcyProducer`.
  bool raise(std::uint16_t code, std::uint8_t register_bits, const Info& info = {}) noexcept {
    return raise(code, register_bits, info, 0);
  }
  bool clear(std::uint16_t code) noexcept { return clear(code, {}, 0); }
  /// The same for a code with several sources, each of them an error of its own.
  bool raise(std::uint16_t code, std::uint8_t register_bits, const Info& info, std::uint8_t source) noexcept;
  bool clear(std::uint16_t code, const Info& info, std::uint8_t source) noexcept;
  /// An error of the class 1029h:`error_class` happened: changes the NMT state as that object says (without such a
  /// sub-index: pre-operational if operational). Class 0 does nothing; it is the number of entries.
  void behave(std::uint8_t error_class) noexcept;
  [[nodiscard]] bool active(std::uint16_t code) const noexcept { return emcy_.active(code); }
  /// The emergency messages: for a gateway, which adds to them.
  [[nodiscard]] co::EmcyProducer& emcy() noexcept { return emcy_; }

  /// The node-ID is in use: reads 1014h and 1015h.
  void start() noexcept;
  /// Whether the NMT state allows EMCY (`co::Services::emcy`).
  void enable(bool on) noexcept { emcy_.enable(on); }
  /// Reset or power off: no error is active any more, and nothing is sent. 1003h keeps its content.
  void reset() noexcept { emcy_.reset(); }

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept { return field_ ? sizeof(co::ErrorField) : 0; }

 private:
  void raise_error(std::uint16_t code, std::uint8_t register_bits, const Info& info) noexcept override {
    raise(code, register_bits, info);
  }
  void clear_error(std::uint16_t code) noexcept override { clear(code); }
  [[nodiscard]] rt::Duration in_world(rt::Duration own) const noexcept override { return host_->in_world(own); }
  od::AbortCode reading(const od::Values& values, ObjectRef ref,
                        std::span<const std::uint8_t>& value) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  void show() noexcept;

  od::Values* values_;
  co::NmtSlave* nmt_;
  const Host* host_;
  Owner* owner_;
  co::EmcyProducer emcy_;
  std::unique_ptr<co::ErrorField> field_;  // only with object 1003h
  std::array<std::uint8_t, 4> shown_{};    // returned by `reading`
};

}  // namespace berth::device
