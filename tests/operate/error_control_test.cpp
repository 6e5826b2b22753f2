// How a slot's device is watched when its 1017h is not what Berth wants (CiA 301 §7.5.2.20): limits, a constant, none.
#include <gtest/gtest.h>
#include <fstream>
#include <string>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;
using places::SlotState;

namespace error_control_tests {
namespace {

// A device with these objects behind the mandatory ones, for a slot with node-ID 5.
struct Described {
  std::string name;
  std::string objects;
};

std::string write_description(const Described& what) {
  const std::string file = ::testing::TempDir() + "error-control-" + what.name + ".eds";
  std::ofstream out(file);
  out << "[DeviceInfo]\nVendorNumber=0x1\nProductNumber=0x1\nLSS_Supported=0\n"
         "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n"
         "[1000]\nParameterName=Device type\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=0x20192\n"
         "[1001]\nParameterName=Error register\nObjectType=7\nDataType=5\nAccessType=ro\nDefaultValue=0\n"
         "[1018]\nParameterName=Identity\nObjectType=9\nSubNumber=2\n"
         "[1018sub0]\nParameterName=n\nObjectType=7\nDataType=5\nAccessType=ro\nDefaultValue=1\n"
         "[1018sub1]\nParameterName=p\nObjectType=7\nDataType=7\nAccessType=ro\nDefaultValue=1\n"
      << what.objects;
  return file;
}

const std::string guarding =
    "[100C]\nParameterName=Guard time\nObjectType=7\nDataType=6\nAccessType=rw\nDefaultValue=0\n"
    "[100D]\nParameterName=Life time factor\nObjectType=7\nDataType=5\nAccessType=rw\nDefaultValue=0\n";

std::string heartbeat(const std::string& access, unsigned period, const std::string& limits = {}) {
  return "[1017]\nParameterName=Producer heartbeat time\nObjectType=7\nDataType=6\nAccessType=" + access +
         "\nDefaultValue=" + std::to_string(period) + "\n" + limits;
}

std::string with(const std::string& numbers, const std::string& objects) {
  std::string list;
  unsigned count = 0;
  for (std::size_t at = 0; at + 4 <= numbers.size(); at += 5) {
    list += std::to_string(++count) + "=0x" + numbers.substr(at, 4) + "\n";
  }
  return "[OptionalObjects]\nSupportedObjects=" + std::to_string(count) + "\n" + list + objects;
}

design::Machine machine() {
  design::Machine m = one_bus(125'000);
  add_slot(m, 5, type_b);
  m.slots.back().spec.assign = places::Assign::fixed;
  return m;
}

plant::PlantFile plant_of(const Described& what) {
  auto p = one_bus_plant(1);
  auto& d = add_device(p, "d", type_b, 0);
  d.eds = d.eds_path = write_description(what);
  d.source = plant::NodeIdSource::switches;
  d.node_id = NodeId(5);
  d.speaks = {};
  return p;
}

// Operational, and so for a minute; then it is unplugged.
void runs_and_is_missed(Rig& rig) {
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.run_for(60s);
  ASSERT_TRUE(rig.operational()) << rig.log();
  EXPECT_EQ(rig.log().find("second device"), std::string::npos) << rig.log();
  rig.device("d").unplug();
  EXPECT_TRUE(rig.run_until([&] { return !rig.operational(); }, 60s)) << rig.log();
}

}  // namespace

// 500 ms are refused, and 1000 ms are not.
TEST(ErrorControl, ALowLimitIsFoundByAsking) {
  for (const unsigned own : {0U, 5000U}) {
    const std::string limit = "LowLimit=1000\n";
    Rig rig(machine(), plant_of({"low", with("100C 100D 1017", guarding + heartbeat("rw", own, limit))}));
    runs_and_is_missed(rig);
    EXPECT_NE(rig.log().find(own == 0 ? "it comes every 1000 ms" : "it comes every 5000 ms"), std::string::npos)
        << rig.log();
    EXPECT_NE(rig.log().find("1017h"), std::string::npos) << rig.log();
    EXPECT_NE(rig.log().find("0609003"), std::string::npos) << "the abort code is told\n" << rig.log();
  }
}

TEST(ErrorControl, AHighLimitIsFoundByAsking) {
  Rig rig(machine(), plant_of({"high", with("1017", heartbeat("rw", 100, "HighLimit=200\n"))}));
  runs_and_is_missed(rig);
}

TEST(ErrorControl, AConstantPeriodIsTakenAsItIs) {
  for (const unsigned period : {100U, 2000U, 5000U}) {
    Rig rig(machine(), plant_of({"constant", with("1017", heartbeat("ro", period))}));
    runs_and_is_missed(rig);
    rig.kill();
    rig.device("d").plug();
    rig.run_for(2s);
    // The next run does not know what this one has learnt.
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << rig.log();
    rig.kill();
    rig.begin();
    ASSERT_TRUE(rig.until_operational(60s)) << period << rig.log();
    rig.run_for(30s);
    ASSERT_TRUE(rig.until_operational(30s)) << period << rig.log();
    rig.run_for(60s);
    EXPECT_TRUE(rig.operational()) << period << rig.log();
  }
}

TEST(ErrorControl, WithoutAHeartbeatItIsAskedByGuarding) {
  Rig rig(machine(), plant_of({"guarding", with("100C 100D", guarding)}));
  rig.begin();
  ASSERT_TRUE(rig.until_operational(20s)) << rig.log();
  rig.run_for(60s);
  EXPECT_TRUE(rig.operational()) << rig.log();
}

}  // namespace error_control_tests
