// The client program of examples/real_port, on a plant in a process of its own, as docs/client.md calls it.
#include <gtest/gtest.h>

#include <string>

#include "../paths.hpp"
#include "../pch.hpp"
#include "../shell.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

/// Both streams.
Ran example_port(const std::string& arguments) {
  return shell(example_program("real_port") + " " + arguments + " 2>&1");
}

TEST(ExamplePort, AsksADeviceOfAPlantAndFollowsIt) {
  const Folder folder;
  const std::string socket = folder.file("plant.sock");
  Background plant({"plant", example("real_port/io.plant.toml"), "--listen", socket});
  ASSERT_TRUE(plant.says("Ctrl-C ends it"));
  // A device that boots just now cancels what it is asked.
  Ran ran;
  ASSERT_TRUE(eventually([&] {
    ran = example_port("plant:" + socket + " 0 5 " + example("eds/io.eds") + " 3 field");
    return ran.out.find("boot-up") == std::string::npos;
  })) << ran.out;
  EXPECT_EQ(ran.status, 0);
  EXPECT_NE(ran.out.find("vendor-ID 00000001h\n"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("heartbeat: each 200 ms\n"), std::string::npos) << ran.out;
  EXPECT_NE(ran.out.find("node 5: started, operational\n"), std::string::npos) << ran.out;
}

TEST(ExamplePort, SaysWhatIsWrong) {
  const Ran usage = example_port("plant:x 0 128 " + example("eds/io.eds"));
  EXPECT_EQ(usage.status, 2);
  EXPECT_NE(usage.out.find("usage: "), std::string::npos) << usage.out;
  const Ran nothing = example_port("plant:/nowhere.sock 0 5 " + example("eds/io.eds") + " 1 field");
  EXPECT_EQ(nothing.status, 3);
  EXPECT_NE(nothing.out.find("/nowhere.sock"), std::string::npos) << nothing.out;
}

}  // namespace
}  // namespace berth::test
