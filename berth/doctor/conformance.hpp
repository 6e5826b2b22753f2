/// Checks like those of a conformance tester, from CiA 301's paragraphs, for one device on this bus.
///
///     Conformance report;                                       // must outlive the task
///     auto done = co_await examine(dispatcher, options, report);
///
/// Checked: SDO services and their refusals (§7.2.4), the mandatory objects, every object of the description (access,
/// length, limits, sub-index 0), and the rules of each communication object (§7.5.2): COB-IDs, PDO parameters,
/// signatures, write protection.
///
/// Harmless unless `lasting`: every write must be refused, or writes back the value that was read. Objects of the
/// application (2000h and up) are written only if the description says that they are not writable. If a device accepts
/// a write that it must refuse, the old value is written back at once. Still it is SDO traffic, which disturbs another
/// SDO client of the device.
///
/// With `lasting`, for a device that is not in use: also writes to all objects, re-mapping of PDOs, NMT commands,
/// resets, heartbeat, guarding and SYNC. A reset node restores the changes.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/od/description.hpp"
#include "berth/rt/task.hpp"

namespace berth::doctor {

enum class Verdict : std::uint8_t { passed, failed, skipped };
[[nodiscard]] const char* name(Verdict verdict) noexcept;

struct Check {
  std::string_view paragraph{};  ///< of CiA 301 v4.2.0: "7.2.4.3.17"; the chapter if the paragraph is not known
  ObjectRef object{};
  bool has_object = false;  ///< false: a service
  std::string what{};       ///< the requirement
  Verdict verdict = Verdict::passed;
  std::string told{};  ///< failed: the device's reaction; skipped: the reason
};

struct Conformance {
  std::vector<Check> checks{};
  [[nodiscard]] std::size_t count(Verdict verdict) const noexcept;
};
/// "§7.5.2.17  1014h:00  a malformed COB-ID is refused: failed: it was taken".
[[nodiscard]] std::string to_string(const Check& check);

struct ConformanceOptions {
  NodeId node{};
  std::shared_ptr<const od::Description> description{};  ///< null: only the objects that every device has
  bool lasting = false;
  rt::Duration timeout = std::chrono::milliseconds(500);  ///< for an answer; expected silence takes as long
  rt::Duration boot = std::chrono::seconds(3);            ///< reset to boot-up message
};

/// The paragraph of a communication object ("7.5.2.17" for 1014h); "7.4" for every other.
[[nodiscard]] std::string_view paragraph_of(std::uint16_t index) noexcept;

/// Errors: `bus` a request could not be sent, `timeout` the device does not answer its first question, `invalid` an
/// unconfigured node-ID. Everything else is a check.
[[nodiscard]] rt::Task<Result<void>> examine(can::Dispatcher& dispatcher, const ConformanceOptions& options,
                                             Conformance& report);

}  // namespace berth::doctor
