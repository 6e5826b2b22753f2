/// The examiner behind `examine`. Only its own sources include this.
#pragma once

#include <algorithm>
#include <array>
#include <optional>

#include "berth/co/sdo_client.hpp"
#include "berth/doctor/conformance.hpp"
#include "berth/rt/mailbox.hpp"

namespace berth::doctor {

using Bytes = std::vector<std::uint8_t>;

/// What came of one access.
struct Told {
  bool silent = false;
  od::AbortCode code = od::AbortCode::none;
  std::string problem{};  ///< the answer broke the protocol
  Bytes bytes{};          ///< uploaded
  [[nodiscard]] bool good() const noexcept { return !silent && code == od::AbortCode::none && problem.empty(); }
  [[nodiscard]] std::uint64_t number() const noexcept;
  [[nodiscard]] std::string words() const;
};

/// Abort codes of which any will do. Where stacks differ and CiA 301 leaves it open, there are several.
struct Codes {
  std::array<od::AbortCode, 4> any{};
  [[nodiscard]] bool has(od::AbortCode code) const noexcept {
    return code != od::AbortCode::none && std::ranges::find(any, code) != any.end();
  }
};
namespace codes {
using od::AbortCode;
inline constexpr Codes no_object{{AbortCode::no_object}};
inline constexpr Codes no_sub{{AbortCode::no_sub_index}};
inline constexpr Codes write_only{{AbortCode::write_only}};
inline constexpr Codes read_only{{AbortCode::read_only}};
inline constexpr Codes unknown_command{{AbortCode::command_specifier}};
inline constexpr Codes toggle{{AbortCode::toggle_bit}};
inline constexpr Codes block_size{{AbortCode::block_size}};
inline constexpr Codes too_long{{AbortCode::length_too_high, AbortCode::length_mismatch}};
inline constexpr Codes too_short{{AbortCode::length_too_low, AbortCode::length_mismatch}};
inline constexpr Codes too_high{{AbortCode::value_too_high, AbortCode::invalid_value}};
inline constexpr Codes too_low{{AbortCode::value_too_low, AbortCode::invalid_value}};
inline constexpr Codes bad_value{{AbortCode::invalid_value, AbortCode::value_too_high, AbortCode::value_too_low}};
inline constexpr Codes bad_cob_id{{AbortCode::invalid_value}};
inline constexpr Codes frozen{{AbortCode::invalid_value, AbortCode::device_state}};
inline constexpr Codes wrong_signature{{AbortCode::not_stored}};
inline constexpr Codes no_data{{AbortCode::no_data}};
inline constexpr Codes mapping_frozen{{AbortCode::unsupported_access, AbortCode::device_state}};
inline constexpr Codes not_mappable{{AbortCode::not_mappable, AbortCode::no_object}};
inline constexpr Codes pdo_length{{AbortCode::pdo_length, AbortCode::value_too_high}};
inline constexpr Codes twice{{AbortCode::parameter_incompatible}};
inline constexpr Codes state{{AbortCode::device_state}};
}  // namespace codes

class Examiner final : private can::Handler {
 public:
  Examiner(can::Dispatcher& dispatcher, const ConformanceOptions& options, Conformance& report);
  ~Examiner();
  rt::Task<Result<void>> run();

 private:
  // Asking. After a frame that could not be sent everything is silent and `bus_error_` says why.
  rt::Task<Told> read(std::uint16_t index, std::uint8_t sub);
  rt::Task<Told> read_by_block(std::uint16_t index, std::uint8_t sub, bool crc);
  rt::Task<Told> write(std::uint16_t index, std::uint8_t sub, const Bytes& bytes);
  rt::Task<Told> write_number(std::uint16_t index, std::uint8_t sub, std::size_t size, std::uint64_t value);
  /// One frame on the default channel and the next frame back; empty: silence.
  rt::Task<std::optional<can::Frame>> raw(can::Frame request);
  /// The next frame of the node in this range, if one comes in time.
  rt::Task<std::optional<can::Frame>> hear(std::uint32_t key, rt::Duration limit);
  void send(const can::Frame& frame);
  [[nodiscard]] can::Frame request(std::uint8_t command, std::uint16_t index, std::uint8_t sub,
                                   std::uint32_t number = 0) const noexcept;

  // Judging
  void add(std::string_view paragraph, ObjectRef object, std::string what, Verdict verdict, std::string told);
  void holds(std::string_view paragraph, ObjectRef object, std::string what, bool so, std::string told);
  void granted(std::string_view paragraph, ObjectRef object, std::string what, const Told& told);
  void refused(std::string_view paragraph, ObjectRef object, std::string what, const Told& told, const Codes& codes);
  void refused(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer,
               const Codes& codes);
  void silent(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer);
  void skip(std::string_view paragraph, ObjectRef object, std::string what, std::string why);
  /// Writes what must be refused; the old value comes back when it is not.
  rt::Task<void> must_refuse(std::uint16_t index, std::uint8_t sub, std::size_t size, std::uint64_t value,
                             const Codes& codes, const char* what);
  rt::Task<void> must_refuse_bytes(std::uint16_t index, std::uint8_t sub, const Bytes& bytes, const Codes& codes,
                                   const char* what);

  [[nodiscard]] const od::SubObject* described(std::uint16_t index, std::uint8_t sub) const noexcept;
  [[nodiscard]] bool has(std::uint16_t index) const noexcept;
  /// A rw object that CiA 301 wants as a scalar of this size.
  [[nodiscard]] bool settable(std::uint16_t index, std::uint8_t sub, std::size_t size) const noexcept;
  [[nodiscard]] std::uint16_t absent() const noexcept;
  /// The device has not what its description has not either.
  [[nodiscard]] bool described_away(std::uint16_t index, std::uint8_t sub, const Told& told) const noexcept;
  [[nodiscard]] bool mappable(std::uint32_t entry) const noexcept;

  // SDO (conformance_sdo.cpp)
  rt::Task<void> sdo();
  rt::Task<void> sdo_refusals();
  rt::Task<void> sdo_commands();
  rt::Task<void> sdo_device_type();
  rt::Task<void> sdo_segments(std::uint16_t index, std::uint8_t sub);
  rt::Task<void> sdo_blocks(std::uint16_t index, std::uint8_t sub);
  rt::Task<void> sdo_download_toggle();
  rt::Task<std::optional<ObjectRef>> long_object();
  // Every object (conformance_objects.cpp)
  rt::Task<void> objects();
  rt::Task<void> object(const od::Object& object);
  rt::Task<void> sub_object(const od::Object& object, const od::SubObject& sub);
  rt::Task<void> writing(const od::SubObject& sub, std::uint16_t index, const Told& now);
  rt::Task<void> limits(const od::SubObject& sub, std::uint16_t index);
  [[nodiscard]] bool inside_limits(const od::SubObject& sub, const Told& now) const noexcept;
  rt::Task<void> highest_sub(const od::Object& object);
  // Communication objects (conformance_communication.cpp)
  rt::Task<void> mandatory();
  rt::Task<void> error_register();
  rt::Task<void> error_control();
  rt::Task<void> identity();
  rt::Task<void> errors();
  rt::Task<void> storage();
  rt::Task<void> identifiers();
  rt::Task<void> cob_id(std::uint16_t index, std::uint8_t sub, std::uint32_t in_use);
  rt::Task<void> sync_objects();
  rt::Task<void> default_channel();
  rt::Task<void> pdos();
  rt::Task<void> pdo(std::uint16_t index);
  rt::Task<void> mapping(std::uint16_t index);
  rt::Task<void> consumer_entries();
  // NMT, error control, SYNC on the bus (conformance_nmt.cpp); only with `lasting`
  rt::Task<void> nmt();
  rt::Task<void> states();
  rt::Task<void> command(std::uint8_t command, std::uint8_t node, unsigned size);
  rt::Task<void> in_state(std::uint8_t state, const char* what);
  rt::Task<void> resets();
  rt::Task<bool> reset(std::uint8_t command);
  rt::Task<void> heartbeat();
  rt::Task<void> guarding();
  rt::Task<void> sync_counter();
  [[nodiscard]] const od::SubObject* application_object(ObjectRef& where) const noexcept;

  void received(const can::Frame& frame, rt::Time at) noexcept override;

  struct Heard {
    can::Frame frame;
    rt::Time at;
  };
  can::Dispatcher* dispatcher_;
  const ConformanceOptions* options_;
  Conformance* report_;
  co::SdoClient client_;
  rt::Mailbox<Heard, 256> box_;
  std::optional<Error> bus_error_;
  rt::Time heard_at_{};
};

}  // namespace berth::doctor
