// `berth device` with the gateways of a plant file: which devices it runs, and what it refuses before a port is opened.
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "process.hpp"
#include "tests/paths.hpp"

namespace berth::test {
namespace {

const std::string harvester_plant = source_dir() + "/examples/harvester/plant.toml";

std::string refused(std::vector<std::string> words) {
  words.insert(words.begin(), {"device", harvester_plant});
  const Outcome outcome = berth(words);
  EXPECT_EQ(outcome.status, 2) << outcome.out << outcome.err;
  return outcome.err;
}

}  // namespace

TEST(DeviceGateway, RunsWholeOrNotAtAll) {
  const auto half = refused({"--port", "backbone=vcan0", "--device", "left gateway"});
  EXPECT_NE(half.find("left port is on the bus \"left\", which has no port: add --port left=PORT; it is a port of the "
                      "gateway \"left gateway\""),
            std::string::npos)
      << half;
  const auto all = refused({"--port", "backbone=vcan0"});
  EXPECT_NE(all.find("with --except \"left gateway\""), std::string::npos) << all;
}

TEST(DeviceGateway, IsNamedByItsDeviceAbove) {
  const auto port = refused({"--port", "left=vcan0", "--device", "left port"});
  EXPECT_NE(port.find("left port is a port of the gateway \"left gateway\": name that one"), std::string::npos) << port;
  const auto except = refused({"--port", "left=vcan0", "--except", "left port"});
  EXPECT_NE(except.find("left port is a port of the gateway \"left gateway\": name that one"), std::string::npos);
}

TEST(DeviceGateway, NamesOfDevices) {
  const auto wrong = refused({"--port", "left=vcan0", "--except", "left gatewai"});
  EXPECT_NE(wrong.find("the plant has no device \"left gatewai\"; left gateway?"), std::string::npos) << wrong;
  const auto both = refused({"--port", "left=vcan0", "--except", "left gateway", "--device", "left guard"});
  EXPECT_NE(both.find("--except"), std::string::npos) << both;
}

}  // namespace berth::test
