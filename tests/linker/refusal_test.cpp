// A link that cannot be says which, why, and what would help.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/linker/devices.hpp"

using namespace berth;
using namespace berth::test;
using namespace std::chrono_literals;
using linker::make_plan;

namespace {

class LinkRefusal : public ::testing::Test {
 protected:
  LinkRefusal() {
    auto spec = io_module();
    spec.objects.push_back({0x2000, 1, 5, "rw", "Setting", false});
    spec.objects.push_back({0x6020, 8, 1, "ro", "Read input bit"});
    const auto plc = file_of(controller());
    network = network_of({{"press", plc}, {"belt", plc}, {"io", file_of(spec)}});
  }

  std::string only() {
    const auto made = make_plan(network);
    EXPECT_EQ(made.findings.size(), 1U);
    for (std::size_t i = 1; i < made.findings.size(); ++i) ADD_FAILURE() << to_string(made.findings[i]);
    return made.findings.empty() ? "" : to_string(made.findings.front());
  }

  linker::LinkNetwork network;
};

}  // namespace

TEST_F(LinkRefusal, TypesDiffer) {
  add_link(network, "io/6401h:01", {"io/6200h:01"});
  network.links[0].to[0].node = 1;
  network.links[0].to[0].object = "2100h:01";
  EXPECT_EQ(
      only(),
      "machine.toml:100:1: error: link[1]: types differ: io/6401h:01 is INTEGER16, belt/2100h:01 is UNSIGNED8; link "
      "objects of one type; a network variable takes the type of what it is linked to");
}

TEST_F(LinkRefusal, AnObjectThatIsGone) {
  add_link(network, "io/6402h:01", {"press/x"});
  EXPECT_EQ(
      only(),
      "machine.toml:100:1: error: link[1]: io/6402h:01: the device in this slot has no object 6402h:01; take the link "
      "out, or name an object of the description that the slot has now");
}

TEST_F(LinkRefusal, NotMappable) {
  add_link(network, "io/2000h:01", {"press/x"});
  EXPECT_NE(
      only().find("io/2000h:01: UNSIGNED8 2000h:01 cannot be mapped into a TPDO; name an object with PDOMapping=1"),
      std::string::npos);
}

TEST_F(LinkRefusal, TheWrongWay) {
  add_link(network, "press/x", {"io/6000h:01"}, {}, 255, od::DataType::unsigned8);
  EXPECT_NE(only().find("io/6000h:01: UNSIGNED8 6000h:01 cannot be mapped into a RPDO"), std::string::npos);
}

TEST_F(LinkRefusal, ABitOfADeviceThatMapsBytes) {
  add_link(network, "io/6020h:03", {"press/x"});
  EXPECT_NE(only().find("it has 1 bit, and the device maps only multiples of 8; link the byte"), std::string::npos);
}

TEST_F(LinkRefusal, NothingSaysTheType) {
  add_link(network, "press/x", {"belt/x"});
  EXPECT_NE(only().find("press/x: the data type of this network variable is not known; write type ="),
            std::string::npos);
  // Another link of the same variable says it.
  add_link(network, "press/x", {"io/6411h:01"});
  EXPECT_TRUE(make_plan(network).good());
}

TEST_F(LinkRefusal, NoSegmentForTheType) {
  add_link(network, "press/x", {"belt/x"}, {}, 255, od::DataType::real64);
  EXPECT_NE(only().find("has no segment for REAL64 input (sent) variables"), std::string::npos);
}

TEST_F(LinkRefusal, NoNameOfAVariable) {
  add_link(network, "press/two words", {"belt/x"}, {}, 255, od::DataType::unsigned8);
  EXPECT_NE(only().find("\" \" is not a letter or digit; letters, digits and single underscores"), std::string::npos);
  network.links[0].from.object = "End_If";
  EXPECT_NE(only().find("IEC 61131-3 keeps this word for itself"), std::string::npos);
}

TEST_F(LinkRefusal, AVariableOfTwoDirections) {
  add_link(network, "press/x", {"belt/x"}, {}, 255, od::DataType::unsigned8);
  add_link(network, "belt/X", {"io/6200h:01"});
  const auto made = make_plan(network);
  ASSERT_FALSE(made.good());
  EXPECT_NE(to_string(made.findings[0]).find("received by one link and sent by another"), std::string::npos);
}

TEST_F(LinkRefusal, LinksThatRunInACircle) {
  auto spec = controller();
  spec.objects.push_back({0x2300, 4, 5, "rw", "Both ways"});
  network.nodes[0].file = network.nodes[1].file = file_of(spec);
  add_link(network, "press/2300h:01", {"belt/2300h:02"});
  add_link(network, "belt/2300h:02", {"press/2300h:01"});
  add_link(network, "press/2300h:01", {"io/6200h:01"});
  const auto made = make_plan(network);
  ASSERT_EQ(made.findings.size(), 2U);
  for (const auto& each : made.findings) {
    EXPECT_NE(to_string(each).find("these links form a loop: link[1] from press/2300h:01, link[2] from belt/2300h:02"),
              std::string::npos);
  }
  network.links.erase(network.links.begin() + 1);
  EXPECT_TRUE(make_plan(network).good());
}

TEST_F(LinkRefusal, TwoSourcesOfOneObject) {
  add_link(network, "press/a", {"io/6200h:01"});
  add_link(network, "belt/b", {"io/6200h:01"});
  EXPECT_NE(only().find("io/6200h:01 gets its value from press/a already (link[1] from press/a); keep one"),
            std::string::npos);
}

TEST_F(LinkRefusal, TwoObjectsOfOneConsumer) {
  add_link(network, "press/a", {"io/6200h:01", "io/6200h:02"});
  EXPECT_NE(only().find("press/a is to be received twice by io"), std::string::npos);
}

TEST_F(LinkRefusal, OneDevice) {
  add_link(network, "io/6000h:01", {"io/6200h:01"});
  EXPECT_NE(only().find("are objects of one device"), std::string::npos);
}

TEST_F(LinkRefusal, TwoBuses) {
  network.buses.push_back({.name = "other", .master = NodeId(127), .others = network.buses[0].others});
  network.nodes[1].bus = 1;
  add_link(network, "io/6000h:01", {"belt/x"});
  EXPECT_NE(only().find("io is on field, belt on other, and no gateway leads from one to the other"),
            std::string::npos);
}

TEST_F(LinkRefusal, ADeviceOfWhichNothingIsKnown) {
  network.nodes[2].file = nullptr;
  add_link(network, "io/6000h:01", {"press/x"});
  EXPECT_NE(only().find("nothing is known of the device in io; add eds = \"FILE\" to its slot"), std::string::npos);
}

TEST_F(LinkRefusal, ABusThatIsTooSlow) {
  network.buses[0].others.bit_rate = 10'000;
  add_link(network, "press/a", {"belt/a"}, 40ms, 255, od::DataType::unsigned64);
  add_link(network, "press/b", {"belt/b"}, 10s, 255, od::DataType::unsigned64);
  // A frame of 13.5 ms behind another one takes longer than the 20 ms that the inhibit time leaves.
  const std::string told = only();
  EXPECT_NE(told.find("link[1]: bus field is too slow for this link: it can take"), std::string::npos) << told;
  network.links[0].deadline = 500ms;
  EXPECT_TRUE(make_plan(network).good());
}

TEST_F(LinkRefusal, TooFewRpdos) {
  auto spec = io_module();
  spec.rpdos = 1;
  network.nodes[2].file = file_of(spec);
  add_link(network, "press/a", {"io/6200h:01"}, 20ms);
  add_link(network, "belt/b", {"io/6200h:02"}, 50ms);
  const auto text = only();
  EXPECT_NE(text.find("link[2]: no PDO is free for it: belt has 48 TPDOs for links, io 1 RPDOs, and they are full"),
            std::string::npos)
      << text;
}

TEST_F(LinkRefusal, GoodLinksArePlannedBesideBadOnes) {
  add_link(network, "io/6402h:01", {"press/x"});
  add_link(network, "io/6000h:01", {"press/y"});
  const auto made = make_plan(network);
  EXPECT_FALSE(made.good());
  ASSERT_EQ(made.plan.pdos.size(), 1U);
  EXPECT_EQ(made.plan.pdos[0].links, std::vector<std::size_t>{1});
}
