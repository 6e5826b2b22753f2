// What an engineer finds in a description beyond its form.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/eds/review.hpp"
#include "xdd_support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;
namespace fs = std::filesystem;

/// A device with heartbeat, one RPDO and one TPDO, LSS and one bit rate: nothing to find.
std::string good() {
  return "[FileInfo]\nFileName=t.eds\nEDSVersion=4.0\n[DeviceInfo]\nVendorName=v\nVendorNumber=0x147\nProductName="
         "p\nProductNumber=2\nRevisionNumber=3\nBaudRate_250=1\n"
         "Granularity=8\nNrOfRXPDO=1\nNrOfTXPDO=1\nLSS_Supported=1\n[DummyUsage]\nDummy0005=1\n"
         "[MandatoryObjects]\nSupportedObjects=3\n1=0x1000\n2=0x1001\n3=0x1018\n"
         "[OptionalObjects]\nSupportedObjects=6\n1=0x1014\n2=0x1017\n3=0x1400\n4=0x1600\n5=0x1800\n6=0x1A00\n"
         "[ManufacturerObjects]\nSupportedObjects=2\n1=0x2000\n2=0x2001\n"
         "[1000]\nParameterName=Device type\nDataType=7\nAccessType=ro\nDefaultValue=0\n"
         "[1001]\nParameterName=Error register\nDataType=5\nAccessType=ro\n"
         "[1014]\nParameterName=COB-ID EMCY\nDataType=7\nAccessType=rw\nDefaultValue=$NODEID+0x80\n"
         "[1017]\nParameterName=Heartbeat\nDataType=6\nAccessType=rw\nDefaultValue=0\n"
         "[1018]\nParameterName=Identity\nObjectType=9\nSubNumber=5\n"
         "[1018sub0]\nParameterName=n\nDataType=5\nAccessType=const\nDefaultValue=4\n"
         "[1018sub1]\nParameterName=Vendor-ID\nDataType=7\nAccessType=ro\nDefaultValue=0x147\n"
         "[1018sub2]\nParameterName=Product code\nDataType=7\nAccessType=ro\nDefaultValue=2\n"
         "[1018sub3]\nParameterName=Revision\nDataType=7\nAccessType=ro\nDefaultValue=3\n"
         "[1018sub4]\nParameterName=Serial\nDataType=7\nAccessType=ro\n"
         "[1400]\nParameterName=RPDO 1\nObjectType=9\nSubNumber=3\n"
         "[1400sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=2\n"
         "[1400sub1]\nParameterName=COB-ID\nDataType=7\nAccessType=rw\nDefaultValue=$NODEID+0x200\n"
         "[1400sub2]\nParameterName=Type\nDataType=5\nAccessType=rw\nDefaultValue=255\n"
         "[1600]\nParameterName=Mapping\nObjectType=9\nSubNumber=3\n"
         "[1600sub0]\nParameterName=n\nDataType=5\nAccessType=rw\nDefaultValue=2\n"
         "[1600sub1]\nParameterName=1\nDataType=7\nAccessType=rw\nDefaultValue=0x20000010\n"
         "[1600sub2]\nParameterName=2\nDataType=7\nAccessType=rw\nDefaultValue=0x00050008\n"
         "[1800]\nParameterName=TPDO 1\nObjectType=9\nSubNumber=3\n"
         "[1800sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=2\n"
         "[1800sub1]\nParameterName=COB-ID\nDataType=7\nAccessType=rw\nDefaultValue=$NODEID+0x180\n"
         "[1800sub2]\nParameterName=Type\nDataType=5\nAccessType=rw\nDefaultValue=255\n"
         "[1A00]\nParameterName=Mapping\nObjectType=9\nSubNumber=2\n"
         "[1A00sub0]\nParameterName=n\nDataType=5\nAccessType=rw\nDefaultValue=1\n"
         "[1A00sub1]\nParameterName=1\nDataType=7\nAccessType=rw\nDefaultValue=0x20010020\n"
         "[2000]\nParameterName=Out\nDataType=6\nAccessType=rww\nPDOMapping=1\n"
         "[2001]\nParameterName=In\nDataType=7\nAccessType=ro\nPDOMapping=1\n";
}

std::string changed(std::string text, std::string_view from, std::string_view to) {
  const auto at = text.find(from);
  if (at == std::string::npos) throw std::logic_error("nothing to change: " + std::string(from));
  return text.replace(at, from.size(), to);
}

Findings found(const std::string& text) {
  const auto r = read_text(text);
  return review(r.file, "t.eds");
}

TEST(EdsReview, ASoundDescriptionHasNoFinding) {
  EXPECT_EQ(complaints(read_text(good())), "");
  EXPECT_EQ(all_findings(found(good())), "");
}

TEST(EdsReview, EachMistakeIsFoundWhereItStands) {
  struct Case {
    const char* from;
    const char* to;
    Severity severity;
    const char* key;
    const char* says;
  };
  const std::vector<Case> cases{
      {"DefaultValue=0x147", "DefaultValue=0x148", Severity::warning, "[1018sub1] DefaultValue",
       "a device answers one of them"},
      {"DefaultValue=2\n[1018sub3]", "DefaultValue=9\n[1018sub3]", Severity::warning, "[1018sub2] DefaultValue",
       "product code"},
      {"DefaultValue=3\n[1018sub4]", "DefaultValue=9\n[1018sub4]", Severity::warning, "[1018sub3] DefaultValue",
       "revision number"},
      {"[1018sub4]\nParameterName=Serial\nDataType=7\nAccessType=ro\n", "", Severity::warning, "[1018]",
       "LSS address has four parts"},
      {"[1017]\nParameterName=Heartbeat\nDataType=6\nAccessType=rw\nDefaultValue=0\n", "", Severity::warning, "[1017]",
       "nobody sees the device fail"},
      {"[1017]\nParameterName=Heartbeat\nDataType=6", "[1017]\nParameterName=Heartbeat\nDataType=7", Severity::warning,
       "[1017] DataType", "CiA 301 has UNSIGNED16"},
      {"DataType=5\nAccessType=ro\n[1014]", "DataType=5\nAccessType=rw\n[1014]", Severity::warning, "[1001] AccessType",
       "read only"},
      {"AccessType=const\nDefaultValue=4", "AccessType=const\nDefaultValue=3", Severity::warning,
       "[1018sub0] DefaultValue", "highest sub-index is 3; 4"},
      {"AccessType=const\nDefaultValue=4", "AccessType=const\nDefaultValue=6", Severity::note,
       "[1018sub0] DefaultValue", "highest sub-index is 6; 4"},
      {"[1400sub0]\nParameterName=n\nDataType=5", "[1400sub0]\nParameterName=n\nDataType=7", Severity::warning,
       "[1400sub0] DataType", "sub-index 0 is UNSIGNED8"},
      {"$NODEID+0x80", "$NODEID+0x100", Severity::warning, "[1014] DefaultValue",
       "101h (node-ID 1): this one is restricted"},
      {"$NODEID+0x200", "$NODEID+0x600", Severity::warning, "[1400sub1] DefaultValue",
       "601h (node-ID 1): this one is restricted (the default SDO"},
      {"$NODEID+0x200", "0x6E5", Severity::warning, "[1400sub1] DefaultValue", "CAN-ID 6E5h: this one is restricted"},
      {"$NODEID+0x200", "0", Severity::warning, "[1400sub1] DefaultValue", "CAN-ID 000h: this one is restricted (NMT)"},
      {"$NODEID+0x180", "$NODEID+0x80", Severity::warning, "[1800sub1] DefaultValue",
       "has the CAN-ID 85h of EMCY (1014h)"},
      {"$NODEID+0x180", "$NODEID+0x200", Severity::warning, "[1800sub1] DefaultValue",
       "does not receive its own frames"},
      {"$NODEID+0x180", "0x185", Severity::note, "[1800sub1] DefaultValue",
       "two devices of this type on one bus collide"},
      {"$NODEID+0x180", "0x00010185", Severity::warning, "[1800sub1] DefaultValue", "bits 11 to 28 are not 0"},
      {"0x20000010", "0x21000010", Severity::warning, "[1600sub1] DefaultValue", "there is no such object"},
      {"0x20000010", "0x20000110", Severity::warning, "[1600sub1] DefaultValue", "no such sub-index"},
      {"0x20000010", "0x20000008", Severity::warning, "[1600sub1] DefaultValue",
       "it has 16 bits (UNSIGNED16); write 20000010h"},
      {"0x20000010", "0x20010020", Severity::warning, "[1600sub1] DefaultValue",
       "its access is ro, which an RPDO does not carry"},
      {"0x20010020", "0x20000010", Severity::warning, "[1A00sub1] DefaultValue",
       "its access is rww, which an TPDO does not carry"},
      {"0x20010020", "0x00050008", Severity::warning, "[1A00sub1] DefaultValue", "a dummy has no place in a TPDO"},
      {"0x00050008", "0x00060010", Severity::warning, "[1600sub2] DefaultValue", "does not take this dummy"},
      {"0x00050008", "0x00050010", Severity::warning, "[1600sub2] DefaultValue", "this dummy has 8 bits"},
      {"0x00050008", "0", Severity::warning, "[1600sub2] DefaultValue", "names none"},
      {"0x00050008", "0x20000040", Severity::warning, "[1600]", "maps 80 bits"},
      {"AccessType=rww\nPDOMapping=1", "AccessType=rww\nPDOMapping=0", Severity::warning, "[1600sub1] DefaultValue",
       "cannot be mapped"},
      {"AccessType=rw\nDefaultValue=2\n[1600sub1]", "AccessType=rw\nDefaultValue=65\n[1600sub1]", Severity::warning,
       "[1600sub0] DefaultValue", "maps 65 objects"},
      {"AccessType=rw\nDefaultValue=2\n[1600sub1]", "AccessType=rw\nDefaultValue=3\n[1600sub1]", Severity::warning,
       "[1600]", "number 3 names none"},
      {"Granularity=8", "Granularity=0", Severity::note, "Granularity", "mapping parameters can be written"},
      {"BaudRate_250=1", "", Severity::warning, "BaudRate", "no bit rate"},
      {"LSS_Supported=1", "LSS_Supported=0", Severity::note, "LSS_Supported", "set at the device itself"},
      {"[2001]\n", "[C001]\nParameterName=r\nDataType=5\nAccessType=ro\n[2001]\n", Severity::warning, "[C001]",
       "reserved"},
  };
  for (const Case& each : cases) {
    SCOPED_TRACE(std::string(each.from) + " -> " + each.to);
    const std::string text = changed(good(), each.from, each.to);
    const auto findings = found(text);
    const auto at = std::ranges::find_if(findings, [&](const Finding& finding) {
      return finding.key == each.key && to_string(finding).find(each.says) != std::string::npos;
    });
    ASSERT_NE(at, findings.end()) << all_findings(findings);
    EXPECT_EQ(at->severity, each.severity);
    EXPECT_EQ(at->file, "t.eds");
    const std::string_view key = each.key;
    if (key.starts_with("[") && text.find(key.substr(0, key.find(' '))) != std::string::npos) {
      const int section = line_of(text, key.substr(0, key.find(' ')));
      EXPECT_GE(at->line, section);
      EXPECT_LE(at->line, section + 5);
    }
  }
}

TEST(EdsReview, APdoThatIsSwitchedOffMayHaveAnyCanId) {
  EXPECT_EQ(all_findings(found(changed(good(), "$NODEID+0x200", "0x80000000"))), "");
  // 29 bits: another CAN-ID altogether.
  EXPECT_EQ(all_findings(found(changed(good(), "$NODEID+0x200", "0x20000601"))), "");
}

TEST(EdsReview, AdditionalSdoServersKeepOffRestrictedCanIds) {
  const std::string server =
      "[1201]\nParameterName=SDO 2\nObjectType=9\nSubNumber=3\n"
      "[1201sub0]\nParameterName=n\nDataType=5\nAccessType=ro\nDefaultValue=2\n"
      "[1201sub1]\nParameterName=rx\nDataType=7\nAccessType=rw\nDefaultValue=0x640\n"
      "[1201sub2]\nParameterName=tx\nDataType=7\nAccessType=rw\nDefaultValue=0x80000000\n";
  const std::string all = all_findings(found(good() + server));
  EXPECT_NE(all.find("[1201sub1] DefaultValue: SDO request with CAN-ID 640h: this one is restricted"),
            std::string::npos)
      << all;
  const std::string first =
      changed(changed(changed(server, "[1201]", "[1200]"), "[1201sub1]", "[1200sub1]"), "0x640", "$NODEID+0x600");
  EXPECT_EQ(
      all_findings(found(good() + changed(changed(first, "[1201sub0]", "[1200sub0]"), "[1201sub2]", "[1200sub2]"))),
      "");
}

TEST(EdsReview, PdosStandInPairs) {
  const std::string text = good();
  std::string without = text;
  without.erase(without.find("[1A00]"), without.find("[2000]") - without.find("[1A00]"));
  EXPECT_NE(all_findings(found(without)).find("[1800]: TPDO 1 has no mapping parameter 1A00h"), std::string::npos);
  without = text;
  without.erase(without.find("[1400]"), without.find("[1600]") - without.find("[1400]"));
  EXPECT_NE(all_findings(found(without)).find("[1600]: RPDO 1 has no communication parameter 1400h"),
            std::string::npos);
}

TEST(EdsReview, AConfigurationIsLookedAtWithItsNodeId) {
  const std::string text =
      changed(changed(good(), "$NODEID+0x180", "$NODEID+0x180\nParameterValue=0x191"), "[MandatoryObjects]",
              "[DeviceComissioning]\nNodeID=0x11\nBaudrate=500\n[MandatoryObjects]");
  const std::string all = all_findings(found(text));
  EXPECT_EQ(all.find("collide"), std::string::npos) << "a fixed CAN-ID is right in a configuration\n" << all;
  EXPECT_NE(all.find("Baudrate: the device does not support 500 kbit/s"), std::string::npos) << all;
}

TEST(EdsReview, FindingsOfAnXddHaveItsLines) {
  const std::string text = xdd_text({.objects = R"(<CANopenObject index="1800" name="TPDO" objectType="9">
<CANopenSubObject subIndex="00" name="n" dataType="0005" accessType="ro"/>
<CANopenSubObject subIndex="01" name="COB-ID" dataType="0007" accessType="rw" defaultValue="$NODEID+0x700"/>
</CANopenObject>)"});
  const auto r = read_xdd(text, "t.xdd");
  const auto findings = review(r.file, "t.xdd", text);
  const auto at = std::ranges::find(findings, "1800:01 defaultValue", &Finding::key);
  ASSERT_NE(at, findings.end()) << all_findings(findings);
  EXPECT_EQ(at->line, line_of(text, "$NODEID+0x700"));
  EXPECT_EQ(at->column, 93);
}

TEST(EdsReview, AHostileFileMakesABoundedNumberOfFindings) {
  std::string objects;
  for (int i = 0; i < 512; ++i) {
    objects += "<CANopenObject index=\"" +
               [](int n) {
                 char t[8];
                 std::snprintf(t, sizeof t, "%X", 0x1600 + n);
                 return std::string(t);
               }(i) +
               "\" name=\"m\" objectType=\"9\"><CANopenSubObject subIndex=\"00\" name=\"n\" dataType=\"0005\" "
               "accessType=\"rw\" defaultValue=\"64\"/></CANopenObject>";
  }
  const auto r = read_objects(objects);
  EXPECT_LE(review(r.file, "t.xdd").size(), 1001U);
}

TEST(EdsReview, RealFilesAreAnswered) {
  if (!fs::is_directory(eds_folder())) GTEST_SKIP() << "no folder of real device descriptions; set BERTH_EDS_DIR";
  for (const auto& entry : fs::directory_iterator(eds_folder())) {
    if (entry.path().extension() == ".md") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const auto r = read_any_file(entry.path());
    EXPECT_TRUE(r.usable());
    for (const auto& finding : review(r.file, "f")) {
      EXPECT_NE(finding.severity, Severity::error) << to_string(finding);
      EXPECT_FALSE(finding.message.empty());
    }
  }
}

RC_GTEST_PROP(EdsReview, AnyFileIsAnswered, (std::uint64_t seed)) {
  Random random(seed);
  std::string text = good();
  for (int i = 0; i < 8; ++i) {
    const auto at = random.below(text.size());
    if (random.below(2) == 0)
      text[at] = static_cast<char>('0' + random.below(10));
    else
      text.erase(at, random.below(30));
  }
  const auto r = read_text(text);
  for (const auto& finding : review(r.file, "f")) RC_ASSERT(!to_string(finding).empty());
}

}  // namespace
