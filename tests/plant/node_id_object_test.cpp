// Devices whose node-ID is an object: the words of the plant file.
#include <gtest/gtest.h>
#include <string>

#include "berth/plant/plant_file.hpp"
#include "tests/pch.hpp"

using namespace berth;
using namespace berth::plant;

namespace {

PlantResult read(const std::string& more) {
  return read_plant(
      "[bus.b]\nbitrate = 125_000\n[[device]]\nbus = \"b\"\nname = \"d\"\ntype = { vendor = 1, product = 2 }\nnode_id "
      "= "
      "1\nspeaks = []\n" +
          more,
      "p.toml");
}

std::string error_of(const std::string& more) {
  const auto result = read(more);
  std::string all;
  for (const auto& finding : result.findings) all += to_string(finding) + "\n";
  return all;
}

}  // namespace

TEST(NodeIdObject, IsReadAndWrittenBack) {
  for (const char* more :
       {"node_id_object = \"2000h:00\"",
        "node_id_object = \"2000h:05\"\nnode_id_signature = { object = \"2001h\", value = "
        "\"save\" }",
        "node_id_object = \"2000h\"\nnode_id_signature = { object = \"2001h:01\", value = \"0x1234\", size = 2 }"}) {
    const auto result = read(more);
    ASSERT_TRUE(result.plant) << error_of(more);
    const auto again = read_plant(write_plant(*result.plant), "again.toml");
    ASSERT_TRUE(again.plant) << write_plant(*result.plant);
    EXPECT_EQ(*again.plant, *result.plant) << more;
  }
  const auto result =
      read("node_id_object = \"2000h:00\"\nnode_id_signature = { object = \"2001h\", value = \"save\" }");
  ASSERT_TRUE(result.plant);
  EXPECT_EQ(result.plant->devices[0].node_id_object.object, (ObjectRef{0x2000, 0}));
  EXPECT_EQ(result.plant->devices[0].node_id_object.signature, (PlantSignature{{0x2001, 0}, 0x65766173, 4}));
}

TEST(NodeIdObject, MistakesAreNamed) {
  EXPECT_NE(error_of("node_id_object = \"1017h\""), "") << "CiA 301's objects are not the maker's";
  EXPECT_NE(error_of("node_id_object = \"two\""), "");
  EXPECT_NE(error_of("node_id_signature = { object = \"2001h\", value = \"save\" }"), "");
  const std::string id = "node_id_object = \"2000h\"\nnode_id_signature = ";
  EXPECT_NE(error_of(id + "{ object = \"2000h:01\", value = \"save\" }"), "");
  EXPECT_NE(error_of(id + "{ object = \"2001h\" }"), "");
  EXPECT_NE(error_of(id + "{ object = \"2001h\", value = \"\" }"), "");
  EXPECT_NE(error_of(id + "{ object = \"2001h\", value = \"0x\" }"), "");
  EXPECT_NE(error_of(id + "{ object = \"2001h\", value = \"0x12345\", size = 2 }"), "");
  EXPECT_NE(error_of(id + "{ object = \"2001h\", value = \"123456789\" }"), "");
}
