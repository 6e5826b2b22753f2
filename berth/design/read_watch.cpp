#include "berth/design/read_parts.hpp"

#include <fmt/format.h>

#include "berth/text/quantity.hpp"

namespace berth::design {

namespace {

using places::SlotWatch;
using std::string_view;
using text::Table;
using namespace std::chrono_literals;

constexpr std::array<string_view, 4> error_control_words{"automatic", "heartbeat", "guarding", "none"};

// 1017h and 100Ch count whole milliseconds in 16 bits (CiA 301 §7.5.2.11, .20).
void read_milliseconds(Table& table, string_view key, Duration& into) {
  const auto value = table.duration(key, 1ms, 65535ms);
  if (!value) return;
  into = *value;
  if (*value % 1ms != 0ns) table.error(key, "the object holds whole milliseconds", "round it");
}

void refuse(Table& table, string_view key, const char* why, const char* fix) {
  if (table.has(key)) table.error(key, why, fix);
}

}  // namespace

void check_heartbeat(Table& table, Duration period, Duration timeout) {
  if (timeout > period) return;
  table.error("heartbeat_timeout",
              fmt::format("{} is not longer than the period of {}", text::write_duration(timeout),
                          text::write_duration(period)),
              "use about three times the period");
}

void read_watch(Table& table, SlotWatch& watch) {
  read_word(table, "error_control", error_control_words, watch.by);
  read_milliseconds(table, "heartbeat_period", watch.heartbeat_period);
  read_milliseconds(table, "heartbeat_timeout", watch.heartbeat_timeout);
  read_milliseconds(table, "guard_time", watch.guard_time);
  if (const auto factor = table.u32("life_time_factor", {1, 255}))
    watch.life_time_factor = static_cast<std::uint8_t>(*factor);
  if (const auto patience = table.duration("sdo_timeout", 1ms, 1min)) watch.sdo_timeout = *patience;
  const bool both = watch.heartbeat_period.count() > 0 && watch.heartbeat_timeout.count() > 0;
  if (both) check_heartbeat(table, watch.heartbeat_period, watch.heartbeat_timeout);
  const bool beats = watch.by == SlotWatch::By::automatic || watch.by == SlotWatch::By::heartbeat;
  const bool guards = watch.by == SlotWatch::By::automatic || watch.by == SlotWatch::By::guarding;
  for (const char* const key : {"heartbeat_period", "heartbeat_timeout"}) {
    if (!beats) refuse(table, key, "error_control says that no heartbeat watches this slot", "leave one of them out");
  }
  for (const char* const key : {"guard_time", "life_time_factor"}) {
    if (!guards) refuse(table, key, "error_control says that no guarding watches this slot", "leave one of them out");
  }
  const bool hears_both = table.has("guard_time") && table.has("heartbeat_period");
  if (hears_both) {
    table.error("guard_time", "a device uses node guarding or heartbeat, not both (CiA 301 §7.2.8.3.2)",
                "leave heartbeat_period out, or guard_time");
  }
  // A guard time means that the user wants node guarding.
  const bool means_guarding = watch.by == SlotWatch::By::automatic && watch.guard_time.count() > 0;
  if (means_guarding) watch.by = SlotWatch::By::guarding;
}

void refuse_watch(Table& table, const SlotWatch& watch) {
  if (watch == SlotWatch{}) return;
  for (const char* const key :
       {"error_control", "heartbeat_period", "heartbeat_timeout", "guard_time", "life_time_factor", "sdo_timeout"}) {
    if (!table.has(key)) continue;
    return table.error(key, "the gateway's own master watches this device, by the [timing] of its bus",
                       "leave the key out, or set it in [bus.NAME.timing]");
  }
}

}  // namespace berth::design
