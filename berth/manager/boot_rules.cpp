#include "berth/manager/boot_rules.hpp"

#include <algorithm>
#include <array>
#include <chrono>

namespace berth::manager {
namespace {

constexpr bool bit(std::uint32_t value, unsigned n) noexcept { return (value >> n & 1U) != 0; }
constexpr std::uint32_t put(bool set, unsigned n) noexcept { return set ? 1U << n : 0U; }

struct Words {
  BootStatus status;
  std::string_view text;
  std::string_view advice;
};

constexpr std::array status_words{
    Words{BootStatus::booted, "booted", ""},
    Words{BootStatus::a, "the node is not in the network list (1F81h)",
          "take the device off the bus, or assign it in 1F81h or by a slot"},
    Words{BootStatus::b, "no answer to the upload of 1000h",
          "switch the device on; check its node-ID, bit rate and cable"},
    Words{BootStatus::c, "its device type (1000h) is not the expected one (1F84h)",
          "plug in a device of the right type, or correct its slot, or 1F84h"},
    Words{BootStatus::d, "its vendor-ID (1018h:01) is not the expected one (1F85h)",
          "plug in the right maker's device, or correct its slot, or 1F85h"},
    Words{BootStatus::e, "no heartbeat was heard when its state was checked",
          "check its producer heartbeat time (1017h) against the master's 1016h"},
    Words{BootStatus::f, "node guarding had no answer when its state was checked",
          "the device may not support node guarding: use a heartbeat"},
    Words{BootStatus::g, "no expected software is given (1F55h), or the device reports none (1F56h)",
          "enter the expected software in 1F55h, or by `program` in its slot; or take bit 5 out of 1F81h"},
    Words{BootStatus::h, "its software is not the expected one, and it may not be updated (1F81h bits 4 and 6)",
          "update it by hand, or allow the update in 1F81h"},
    Words{BootStatus::i, "its software is not the expected one, and the update failed",
          "look at its flash status (1F57h) and download the program again"},
    Words{BootStatus::j, "its configuration failed", "see which object it refused; correct the configuration file"},
    Words{BootStatus::k, "no heartbeat was heard when error control was started",
          "check its producer heartbeat time (1017h): it must be shorter than the master's 1016h"},
    Words{BootStatus::l, "it was operational already", ""},
    Words{BootStatus::m, "its product code (1018h:02) is not the expected one (1F86h)",
          "plug in the right product, or correct its slot, or 1F86h"},
    Words{BootStatus::n, "its revision (1018h:03 or 1009h) is not the expected one (1F87h)",
          "plug in a device of that revision, or correct its slot, or 1F87h"},
    Words{BootStatus::o, "its serial number (1018h:04) is not the expected one (1F88h)",
          "it was exchanged: correct its slot, or 1F88h, or plug the former device in"},
};

const Words& words_of(BootStatus status) noexcept {
  const auto it = std::ranges::find(status_words, status, &Words::status);
  return it == status_words.end() ? status_words.front() : *it;
}

}  // namespace

Result<Startup> startup_of(std::uint32_t object_1f80) noexcept {
  constexpr unsigned used = 7;
  if (object_1f80 >> used != 0) return fail(Errc::invalid, "a reserved bit of 1F80h (7 to 31) is set");
  return Startup{.master = bit(object_1f80, 0),
                 .starts_all_at_once = bit(object_1f80, 1),
                 .application_operates = bit(object_1f80, 2),
                 .application_starts = bit(object_1f80, 3),
                 .resets_all_on_error = bit(object_1f80, 4),
                 .flying = bit(object_1f80, 5),
                 .stops_all_on_error = bit(object_1f80, 6)};
}

std::uint32_t value_of(const Startup& startup) noexcept {
  return put(startup.master, 0) | put(startup.starts_all_at_once, 1) | put(startup.application_operates, 2) |
         put(startup.application_starts, 3) | put(startup.resets_all_on_error, 4) | put(startup.flying, 5) |
         put(startup.stops_all_on_error, 6);
}

SlaveRules slave_rules_of(std::uint32_t object_1f81) noexcept {
  SlaveRules rules;
  rules.assigned = bit(object_1f81, 0);
  if (!rules.assigned) return rules;
  rules.boots = bit(object_1f81, 2);
  rules.mandatory = bit(object_1f81, 3);
  rules.keep_alive = bit(object_1f81, 4);
  rules.checks_software = bit(object_1f81, 5);
  rules.may_update = bit(object_1f81, 6);
  rules.restores = bit(object_1f81, 7);
  rules.retry_factor = static_cast<std::uint8_t>(object_1f81 >> 8U);
  rules.guard_time = std::chrono::milliseconds(object_1f81 >> 16U);
  return rules;
}

std::uint32_t value_of(const SlaveRules& rules) noexcept {
  if (!rules.assigned) return 0;
  const auto guard_ms = std::chrono::duration_cast<std::chrono::milliseconds>(rules.guard_time).count();
  return put(true, 0) | put(rules.boots, 2) | put(rules.mandatory, 3) | put(rules.keep_alive, 4) |
         put(rules.checks_software, 5) | put(rules.may_update, 6) | put(rules.restores, 7) |
         std::uint32_t{rules.retry_factor} << 8U |
         static_cast<std::uint32_t>(std::clamp<std::int64_t>(guard_ms, 0, 0xFFFF)) << 16U;
}

std::string_view text(BootStatus status) noexcept { return words_of(status).text; }
std::string_view advice(BootStatus status) noexcept { return words_of(status).advice; }

}  // namespace berth::manager
