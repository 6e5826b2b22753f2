/// Small machines and plants for the tests of the command line.
#pragma once

#include <string>

namespace berth::test {

/// Three slots; quick, so that paced runs are short.
inline constexpr const char* small_machine = R"([machine]
name = "cli test"

[bus.line]
port    = "sim"
bitrate = 500_000

[bus.line.timing]
heartbeat_period  = "100 ms"
heartbeat_timeout = "300 ms"
probe_period      = "200 ms"

[[slot]]
bus  = "line"
id   = 2
name = "left"
type = { vendor = 1, product = 1 }
when_ambiguous = "ascending"

[[slot]]
bus  = "line"
id   = 3
name = "right"
type = { vendor = 1, product = 1 }
when_ambiguous = "ascending"

[[slot]]
bus  = "line"
id   = 9
name = "drive"
type = { vendor = 1, product = 7 }
)";

/// The same for devices in another process, which a busy machine may hold up for longer than a heartbeat may be late.
inline std::string patient(std::string machine) {
  const std::string quick = "\"300 ms\"";
  machine.replace(machine.find(quick), quick.size(), "\"5 s\"");
  return machine;
}

/// Its devices, one spare, and what takes random time.
inline constexpr const char* small_plant = R"([plant]
seed = 5

[bus.line]

[[device]]
bus  = "line"
name = "a"
type = { vendor = 1, product = 1 }
serial = 0x21
response = { min = "200 us", max = "900 us" }

[[device]]
bus  = "line"
name = "b"
type = { vendor = 1, product = 1 }
serial = 0x20
response = { min = "200 us", max = "900 us" }

[[device]]
bus  = "line"
name = "c"
type = { vendor = 1, product = 7, revision = 3 }
serial = 0x30
response = { min = "200 us", max = "900 us" }

[[device]]
bus  = "line"
name = "spare"
type = { vendor = 1, product = 7, revision = 3 }
serial = 0x31
plugged = false
)";

/// To be put behind `small_plant`: the drive dies, and later the spare is plugged in.
inline constexpr const char* drive_dies = R"(
[[event]]
after  = "operational"
delay  = "200 ms"
action = "unplug"
device = "c"

[[event]]
after  = "operational"
delay  = "400 ms"
action = "plug"
device = "spare"
)";

}  // namespace berth::test
