// plan.toml's bytes: the reader ends with a plan or an error, what it reads is written and read again, and any plan is
// one that a new plan of a machine can go on from.
#include <cstdlib>
#include <string>
#include <string_view>

#include "berth/eds/eds.hpp"
#include "berth/linker/files.hpp"
#include "berth/linker/plan_file.hpp"

namespace link_plan_target {

namespace {

using namespace berth;

constexpr const char* device =
    "[DeviceInfo]\nGranularity=8\n[DummyUsage]\nDummy0005=1\n[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
    "[1000]\nParameterName=t\nObjectType=7\nDataType=7\nAccessType=ro\n"
    "[OptionalObjects]\nSupportedObjects=4\n1=0x1400\n2=0x1600\n3=0x1800\n4=0x1A00\n"
    "[1400]\nParameterName=r\nObjectType=9\nSubNumber=3\n[1400sub0]\nParameterName=n\nObjectType=7\nDataType=5\n"
    "AccessType=ro\nDefaultValue=2\n[1400sub1]\nParameterName=i\nObjectType=7\nDataType=7\nAccessType=rw\n"
    "[1400sub2]\nParameterName=y\nObjectType=7\nDataType=5\nAccessType=rw\n"
    "[1600]\nParameterName=m\nObjectType=9\nSubNumber=3\n[1600sub0]\nParameterName=n\nObjectType=7\nDataType=5\n"
    "AccessType=rw\n[1600sub1]\nParameterName=a\nObjectType=7\nDataType=7\nAccessType=rw\n"
    "[1600sub2]\nParameterName=b\nObjectType=7\nDataType=7\nAccessType=rw\n"
    "[1800]\nParameterName=t\nObjectType=9\nSubNumber=3\n[1800sub0]\nParameterName=n\nObjectType=7\nDataType=5\n"
    "AccessType=ro\nDefaultValue=2\n[1800sub1]\nParameterName=i\nObjectType=7\nDataType=7\nAccessType=rw\n"
    "[1800sub2]\nParameterName=y\nObjectType=7\nDataType=5\nAccessType=rw\n"
    "[1A00]\nParameterName=m\nObjectType=9\nSubNumber=3\n[1A00sub0]\nParameterName=n\nObjectType=7\nDataType=5\n"
    "AccessType=rw\n[1A00sub1]\nParameterName=a\nObjectType=7\nDataType=7\nAccessType=rw\n"
    "[1A00sub2]\nParameterName=b\nObjectType=7\nDataType=7\nAccessType=rw\n"
    "[DynamicChannels]\nNrOfSeg=2\nType1=5\nDir1=ro\nRange1=0xA040-0xA07F\nPPOffset1=0\nType2=5\nDir2=rww\n"
    "Range2=0xA4C0-0xA4FF\nPPOffset2=0\n";

linker::LinkNetwork machine() {
  static const auto file = std::make_shared<const eds::File>(eds::read(device, "device").file);
  linker::LinkNetwork network{.name = "m",
                              .file = "",
                              .buses = {{.name = "b", .master = NodeId(127)}},
                              .nodes = {},
                              .gateways = {},
                              .links = {}};
  for (const char* const name : {"a", "b"}) {
    network.nodes.push_back({.name = name, .bus = 0, .id = NodeId(name[0] == 'a' ? 1 : 2), .file = file});
  }
  network.links.push_back(
      {.from = {0, "x"}, .to = {{1, "x"}}, .type = od::DataType::unsigned8, .inhibit = std::chrono::milliseconds(10)});
  network.links.push_back(
      {.from = {1, "y"}, .to = {{0, "y"}}, .type = od::DataType::unsigned8, .inhibit = std::chrono::milliseconds(10)});
  return network;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  Findings findings;
  const auto plan = linker::read_plan(text, "plan.toml", findings);
  if (plan.has_value() == has_errors(findings)) std::abort();
  for (const auto& finding : findings) (void)to_string(finding);
  if (!plan) return 0;
  Findings none;
  const auto again = linker::read_plan(linker::write(*plan), "plan.toml", none);
  if (!again || !(*again == *plan)) std::abort();
  const auto network = machine();
  const auto planned = linker::make_plan(network, *plan);
  if (!planned.good() || planned.plan.pdos.size() != 2 || !linker::make_files(network, planned.plan)) std::abort();
  return 0;
}

}  // namespace link_plan_target
