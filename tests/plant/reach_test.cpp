// What a plant file names stays in its folder, by every key (docs/security.md).
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/plant/plant_file.hpp"

namespace berth::plant {

TEST(Reach, NoKeyOfAPlantFileLeadsOut) {
  const std::string type = "type = { vendor = 1, product = 2 }\n";
  for (const std::string& name : {std::string("/etc/hostname"), std::string("../outside"), std::string("x/../../y")}) {
    const std::string quoted = "\"" + name + "\"";
    for (const std::string& line : {"eds = " + quoted + "\n", type + "script = " + quoted + "\n",
                                    type + "programs = { loaded = " + quoted + " }\n"}) {
      SCOPED_TRACE(line);
      const std::string text = "[plant]\n[bus.a]\n[[device]]\nbus = \"a\"\nname = \"d\"\nserial = 1\n" + line;
      const auto result = read_plant(text, "/tmp/machines/p.toml");
      EXPECT_FALSE(result.plant);
      ASSERT_EQ(result.findings.size(), 1U);
      EXPECT_EQ(result.findings.front().message, quoted + " leads out of /tmp/machines");
      EXPECT_GE(result.findings.front().line, 7);
      const std::vector<std::string> allowed{"/etc", "/tmp"};
      const auto permitted = read_plant(text, "/tmp/machines/p.toml", allowed);
      EXPECT_TRUE(permitted.plant) << to_string(permitted.findings.front());
    }
  }
}

}  // namespace berth::plant
