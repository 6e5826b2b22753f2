/// The parts of `examine`: the device under test, its report, its description, and one class of checks for each group
/// of services. Only the sources of `conformance` include this.
#pragma once

#include <array>
#include <optional>

#include "berth/co/sdo_client.hpp"
#include "berth/doctor/conformance.hpp"
#include "berth/doctor/conformance_codes.hpp"
#include "berth/rt/mailbox.hpp"

namespace berth::doctor {

using Bytes = std::vector<std::uint8_t>;

/// The result of one access.
struct AccessResult {
  bool silent = false;
  od::AbortCode code = od::AbortCode::none;
  std::string problem{};  ///< the answer broke the protocol
  Bytes bytes{};          ///< uploaded
  [[nodiscard]] bool good() const noexcept { return !silent && code == od::AbortCode::none && problem.empty(); }
  [[nodiscard]] std::uint64_t number() const noexcept;
  [[nodiscard]] std::string words() const;
};

/// "0602 0000 (object does not exist)".
[[nodiscard]] std::string written(od::AbortCode code);

// Edges of the ranges of §7.3.5, and bit 11 of an 11-bit identifier.
inline constexpr std::array<std::uint32_t, 12> restricted{0x000, 0x07F, 0x101, 0x180, 0x581, 0x5FF,
                                                          0x601, 0x67F, 0x6E0, 0x6FF, 0x701, 0x7FF};
inline constexpr std::uint32_t malformed_bit = 0x800;

/// The examined device. After a frame that could not be sent every answer is silence, and `bus_error` gives the reason.
class DeviceUnderTest final : private can::Handler {
 public:
  DeviceUnderTest(can::Dispatcher& dispatcher, const ConformanceOptions& options);
  ~DeviceUnderTest();
  DeviceUnderTest(const DeviceUnderTest&) = delete;
  DeviceUnderTest& operator=(const DeviceUnderTest&) = delete;

  /// Waits until no other client has asked the node for a while, at most ten seconds: its answers to another client,
  /// for example a master that boots the node, would be mistaken for answers to the examination.
  rt::Task<void> await_quiet();
  /// SDO requests of other clients.
  [[nodiscard]] unsigned others() const noexcept { return others_; }
  rt::Task<AccessResult> read(std::uint16_t index, std::uint8_t sub);
  rt::Task<AccessResult> read_by_block(std::uint16_t index, std::uint8_t sub, bool crc);
  rt::Task<AccessResult> write(std::uint16_t index, std::uint8_t sub, const Bytes& bytes);
  rt::Task<AccessResult> write_number(std::uint16_t index, std::uint8_t sub, std::size_t size, std::uint64_t value);
  /// One frame on the default channel and the next frame back; empty: silence.
  rt::Task<std::optional<can::Frame>> raw(can::Frame request);
  /// The same for a request that may be repeated: it is repeated if another client asked meanwhile.
  rt::Task<std::optional<can::Frame>> raw_undisturbed(can::Frame request);
  /// The next frame of the node in this range, if one comes in time.
  rt::Task<std::optional<can::Frame>> hear(std::uint32_t key, rt::Duration limit);
  void send(const can::Frame& frame);
  /// Discards the frames received so far.
  void forget() noexcept { box_.clear(); }
  [[nodiscard]] can::Frame request(std::uint8_t command, std::uint16_t index, std::uint8_t sub,
                                   std::uint32_t number = 0) const noexcept;

  [[nodiscard]] rt::Time now() const noexcept { return dispatcher_->executor().now(); }
  /// When the last frame that `hear` returned was received.
  [[nodiscard]] rt::Time heard_at() const noexcept { return heard_at_; }
  [[nodiscard]] bool reachable() const noexcept { return !bus_error_; }
  [[nodiscard]] const std::optional<Error>& bus_error() const noexcept { return bus_error_; }

 private:
  struct Heard {
    can::Frame frame;
    rt::Time at;
  };
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  /// The result of an SDO transfer.
  AccessResult told_by(const Error& error);

  can::Dispatcher* dispatcher_;
  NodeId node_;
  rt::Duration timeout_;
  co::SdoClient client_;
  rt::Mailbox<Heard, 256> box_;
  std::optional<Error> bus_error_;
  rt::Time heard_at_{};
  unsigned others_ = 0;
  rt::Time others_at_{};
};

/// Writes verdicts into the report. Nothing is judged while the device cannot be reached.
class Verdicts {
 public:
  Verdicts(const DeviceUnderTest& device, Conformance& report) : device_(&device), report_(&report) {}
  void holds(std::string_view paragraph, ObjectRef object, std::string what, bool so, std::string told);
  void granted(std::string_view paragraph, ObjectRef object, std::string what, const AccessResult& told);
  void refused(std::string_view paragraph, ObjectRef object, std::string what, const AccessResult& told,
               const Codes& codes);
  void refused(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer,
               const Codes& codes);
  void silent(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer);
  void skip(std::string_view paragraph, ObjectRef object, std::string what, std::string why);

 private:
  void add(std::string_view paragraph, ObjectRef object, std::string what, Verdict verdict, std::string told);

  const DeviceUnderTest* device_;
  Conformance* report_;
};

/// The content of the description, if there is one.
class Described {
 public:
  explicit Described(const od::Description* description) noexcept : description_(description) {}
  [[nodiscard]] const od::SubObject* find(std::uint16_t index, std::uint8_t sub) const noexcept;
  [[nodiscard]] bool has(std::uint16_t index) const noexcept;
  /// A rw object that CiA 301 wants as a scalar of this size.
  [[nodiscard]] bool settable(std::uint16_t index, std::uint8_t sub, std::size_t size) const noexcept;
  /// An index that no device has.
  [[nodiscard]] std::uint16_t absent() const noexcept;
  /// The object is missing both in the device and in its description.
  [[nodiscard]] bool leaves_out(std::uint16_t index, std::uint8_t sub, const AccessResult& told) const noexcept;
  /// The object of an entry of a PDO mapping (1600h, 1A00h).
  [[nodiscard]] bool mappable(std::uint32_t entry) const noexcept;

 private:
  const od::Description* description_;
};

/// Shared by all groups of checks.
class Checks {
 public:
  Checks(DeviceUnderTest& device, Verdicts& report, const ConformanceOptions& options)
      : device_(device), report_(report), described_(options.description.get()), options_(options) {}

 protected:
  /// Writes a value that must be refused; if it is accepted, restores the old one.
  rt::Task<void> must_refuse(std::uint16_t index, std::uint8_t sub, std::size_t size, std::uint64_t value,
                             const Codes& codes, const char* what);

  DeviceUnderTest& device_;            // NOLINT(*-non-private-member-variables-in-classes)
  Verdicts& report_;                   // NOLINT(*-non-private-member-variables-in-classes)
  Described described_;                // NOLINT(*-non-private-member-variables-in-classes)
  const ConformanceOptions& options_;  // NOLINT(*-non-private-member-variables-in-classes)
};

/// SDO services: CiA 301 §7.2.4.3.
class SdoChecks final : private Checks {
 public:
  using Checks::Checks;
  rt::Task<void> run();

 private:
  rt::Task<void> refusals();
  rt::Task<void> commands();
  rt::Task<void> device_type();
  rt::Task<void> segmented_upload(std::uint16_t index, std::uint8_t sub);
  rt::Task<void> block_transfer(std::uint16_t index, std::uint8_t sub);
  rt::Task<void> download_toggle();
  rt::Task<std::optional<ObjectRef>> long_object();
};

/// Every object of the description: CiA 301 §7.4, and the access that it describes.
class ObjectChecks final : private Checks {
 public:
  using Checks::Checks;
  rt::Task<void> run();

 private:
  rt::Task<void> object(const od::Object& object);
  rt::Task<void> sub_object(const od::Object& object, const od::SubObject& sub);
  rt::Task<void> writing(const od::SubObject& sub, std::uint16_t index, const AccessResult& now);
  rt::Task<void> limits(const od::SubObject& sub, std::uint16_t index);
  [[nodiscard]] bool inside_limits(const od::SubObject& sub, const AccessResult& now) const noexcept;
  rt::Task<void> highest_sub(const od::Object& object);
};

/// The communication objects and their rules, without the PDOs': CiA 301 §7.5.2.
class CommunicationChecks final : private Checks {
 public:
  using Checks::Checks;
  /// Mandatory objects.
  rt::Task<void> mandatory();
  /// Optional objects.
  rt::Task<void> optional();
  /// Entries of 1016h; changes the device.
  rt::Task<void> consumer_entries();

 private:
  rt::Task<void> error_register();
  rt::Task<void> error_control();
  rt::Task<void> identity();
  rt::Task<void> errors();
  rt::Task<void> storage();
  rt::Task<void> identifiers();
  rt::Task<void> cob_id(std::uint16_t index, std::uint8_t sub, std::uint32_t in_use);
  rt::Task<void> sync_objects();
  rt::Task<void> default_channel();
};

/// PDO parameters and their mappings: CiA 301 §7.5.2.35 to §7.5.2.38.
class PdoChecks final : private Checks {
 public:
  using Checks::Checks;
  rt::Task<void> run();

 private:
  rt::Task<void> pdo(std::uint16_t index);
  rt::Task<void> mapping(std::uint16_t index);
};

/// NMT, error control and SYNC on the bus: CiA 301 §7.3.2, §7.2.8, §7.2.5. All of it changes the device.
class NmtChecks final : private Checks {
 public:
  using Checks::Checks;
  rt::Task<void> run();

 private:
  rt::Task<void> states();
  rt::Task<void> command(std::uint8_t command, std::uint8_t node, unsigned size);
  rt::Task<void> in_state(std::uint8_t state, const char* what);
  rt::Task<void> resets();
  rt::Task<bool> reset(std::uint8_t command);
  rt::Task<void> heartbeat();
  rt::Task<void> guarding();
  rt::Task<void> sync_counter();
  [[nodiscard]] const od::SubObject* application_object(ObjectRef& where) const noexcept;
};

}  // namespace berth::doctor
