// Nodelist projects (CiA 306-3 §6.2.2).
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>

#include "berth/base/random.hpp"
#include "berth/eds/cpj.hpp"
#include "support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;

constexpr const char* project =
    "[Topology]\nNetName=Line 1\nNetRefd=plan 7\nNodes=0x02\nNode2Present=0x01\nNode2Name=Drive\nNode2Refd=+A1\n"
    "Node2DCFName=drive.dcf\nNode127Present=0x00\nNode127Name=Spare\nEDSBaseName=dcf\\line1\n"
    "[Topology3]\nNetName=Line 3\nNodes=0x00\n";

TEST(Cpj, E4_1_NodesOfSeveralNetworks) {
  const auto r = read_cpj(project, "p.cpj");
  EXPECT_TRUE(r.findings.empty()) << to_string(r.findings.front());
  ASSERT_EQ(r.project.topologies.size(), 2U);
  const Topology& first = r.project.topologies[0];
  EXPECT_EQ(first.number, 1);
  EXPECT_EQ(first.net_name, "Line 1");
  EXPECT_EQ(first.net_refd, "plan 7");
  EXPECT_EQ(first.eds_base_name, "dcf\\line1");
  ASSERT_EQ(first.nodes.size(), 2U);
  EXPECT_EQ(first.nodes[0].node_id, 2);
  EXPECT_TRUE(first.nodes[0].present);
  EXPECT_EQ(first.nodes[0].name, "Drive");
  EXPECT_EQ(first.nodes[0].refd, "+A1");
  EXPECT_EQ(first.nodes[0].line, 5U);
  EXPECT_FALSE(first.nodes[1].present);
  EXPECT_EQ(r.project.topologies[1].number, 3);
  EXPECT_EQ(*dcf_path("/plant/p.cpj", first, first.nodes[0]), "/plant/dcf/line1/drive.dcf");
  EXPECT_EQ(*dcf_path("p.cpj", first, first.nodes[0]), "dcf/line1/drive.dcf");
  EXPECT_EQ(dcf_path("p.cpj", first, first.nodes[1]).error().code, Errc::not_found);
}

TEST(Cpj, E4_1_FilesThatAreNotQuiteRight) {
  const auto r = read_cpj(
      "[topology]\nNODES=5\nnode1name=a\nNode0Present=1\nNode128Name=x\nNode1Colour=red\nOther=1\n[Else]\nx=1\n", "p");
  EXPECT_TRUE(r.usable());
  const auto has = [&](Severity severity, std::string_view key) {
    return std::ranges::any_of(r.findings, [&](const Finding& f) { return f.severity == severity && f.key == key; });
  };
  EXPECT_TRUE(has(Severity::warning, "[topology] NODES"));
  EXPECT_TRUE(has(Severity::warning, "[topology] Node0Present"));
  EXPECT_TRUE(has(Severity::warning, "[topology] Node128Name"));
  EXPECT_TRUE(has(Severity::note, "[topology] Node1Colour"));
  EXPECT_TRUE(has(Severity::note, "[topology] Other"));
  EXPECT_TRUE(has(Severity::note, "[Else]"));
  ASSERT_EQ(r.project.topologies.at(0).nodes.size(), 1U);
  EXPECT_FALSE(r.project.topologies[0].nodes[0].present) << "a node is present when the file says so";
  EXPECT_FALSE(read_cpj("", "p").usable());
  EXPECT_FALSE(read_cpj("[Topologyx]\n[Topology0]\n", "p").usable());
  EXPECT_FALSE(read_cpj_file("/nowhere/p.cpj").usable());
  EXPECT_EQ(read_cpj("[Topology]\nNodes=0\nNetName=a\n[TOPOLOGY]\nNodes=0\nNetName=b\n", "p")
                .project.topologies.at(0)
                .net_name,
            "b");
}

TEST(Cpj, E4_1_PathsStayInTheProject) {
  for (const char* name : {"../x.dcf", "/etc/x", "\\\\server\\x", "C:\\x", "a/../../x", "a\nb"}) {
    EXPECT_EQ(dcf_path("p.cpj", {}, {.node_id = 1, .dcf_name = name}).error().code, Errc::invalid) << name;
    EXPECT_EQ(dcf_path("p.cpj", {.eds_base_name = name}, {.node_id = 1, .dcf_name = "x"}).error().code, Errc::invalid);
  }
  EXPECT_EQ(*dcf_path("q/p.cpj", {}, {.node_id = 1, .dcf_name = "sub/x..dcf"}), "q/sub/x..dcf");
}

RC_GTEST_PROP(Cpj, E4_1_AnyProjectSurvivesWriteAndRead, (std::uint64_t seed)) {
  Random random(seed);
  const auto word = [&random] { return random.chance(300'000) ? std::string() : "w" + std::to_string(random.next()); };
  Project made;
  for (std::uint16_t number = 1; number < 4; ++number) {
    if (number != 1 && random.chance(500'000)) continue;
    Topology topology{number, word(), word(), word(), {}};
    for (unsigned id = 1; id <= 127; ++id) {
      if (!random.chance(100'000)) continue;
      topology.nodes.push_back({static_cast<std::uint8_t>(id), random.chance(500'000), word(), word(), word()});
    }
    made.topologies.push_back(std::move(topology));
  }
  const auto written = write_cpj(made);
  RC_ASSERT(written.findings.empty());
  const auto back = read_cpj(written.text, "p");
  if (!back.findings.empty()) RC_FAIL(to_string(back.findings.front()));
  RC_ASSERT(back.project.topologies.size() == made.topologies.size());
  for (std::size_t i = 0; i < made.topologies.size(); ++i) {
    const Topology& a = made.topologies[i];
    const Topology& b = back.project.topologies[i];
    RC_ASSERT(a.number == b.number);
    RC_ASSERT(a.net_name == b.net_name);
    RC_ASSERT(a.net_refd == b.net_refd);
    RC_ASSERT(a.eds_base_name == b.eds_base_name);
    RC_ASSERT(a.nodes.size() == b.nodes.size());
    for (std::size_t k = 0; k < a.nodes.size(); ++k) {
      RC_ASSERT(a.nodes[k].node_id == b.nodes[k].node_id);
      RC_ASSERT(a.nodes[k].present == b.nodes[k].present);
      RC_ASSERT(a.nodes[k].name == b.nodes[k].name);
      RC_ASSERT(a.nodes[k].refd == b.nodes[k].refd);
      RC_ASSERT(a.nodes[k].dcf_name == b.nodes[k].dcf_name);
    }
  }
  RC_ASSERT(write_cpj(back.project).text == written.text);
}

}  // namespace
