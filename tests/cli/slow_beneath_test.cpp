// `--until operational` on a machine of which a bus beneath comes up long after everything else.
#include <gtest/gtest.h>

#include <string>

#include "machines.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

constexpr const char* machine = R"([machine]
name = "slow"
[bus.top]
port    = "sim"
bitrate = 250_000
[bus.quick]
port      = "gateway"
bitrate   = 250_000
master_id = 1
gateway   = { bus = "top", slot = 3, mandatory = false }
[bus.slow]
port      = "gateway"
bitrate   = 10_000
master_id = 1
gateway   = { bus = "quick", slot = 3 }
[[slot]]
bus  = "top"
id   = 3
name = "gateway 1"
type = { vendor = 1, product = 88 }
[[slot]]
bus  = "quick"
id   = 3
name = "gateway 2"
type = { vendor = 1, product = 88 }
[[slot]]
bus  = "slow"
ids  = "5..31"
name = "valve {id}"
type = { vendor = 1, product = 7 }
)";

constexpr const char* plant = R"([plant]
[bus.top]
[bus.quick]
[bus.slow]
[[device]]
bus    = "top"
name   = "gateway 1"
type   = { vendor = 1, product = 88 }
serial = 1
[[device]]
bus    = "quick"
name   = "gateway 2"
type   = { vendor = 1, product = 88 }
serial = 2
[[device]]
bus     = "quick"
name    = "port 1"
type    = { vendor = 1, product = 89 }
serial  = 3
node_id = 1
source  = "hard-coded"
master  = { flying = false }
[[device]]
bus     = "slow"
name    = "port 2"
type    = { vendor = 1, product = 89 }
serial  = 4
node_id = 1
source  = "hard-coded"
master  = { flying = false }
[[device]]
bus   = "slow"
name  = "valve {n}"
count = 27
type  = { vendor = 1, product = 7 }
[[gateway]]
above   = "gateway 1"
beneath = ["port 1"]
[[gateway]]
above   = "gateway 2"
beneath = ["port 2"]
)";

}  // namespace

// The slow bus is left to its gateway's master after 30 s, and has not come up by then: that is no end.
TEST(SlowBeneath, UntilOperationalWaitsForWhatComesUpStill) {
  const Folder folder;
  const auto outcome = berth({"up", folder.write("m.toml", machine), "--sim", folder.write("m.plant.toml", plant),
                              "--fast", "--until", "operational", "--json"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
}

// Nor without `--until`: the report is that of the end.
TEST(SlowBeneath, ARunEndsWhenNothingComesUpAnyMore) {
  const Folder folder;
  const auto outcome =
      berth({"up", folder.write("m.toml", machine), "--sim", folder.write("m.plant.toml", plant), "--fast"});
  EXPECT_EQ(outcome.status, 0) << outcome.err;
}

}  // namespace berth::test
