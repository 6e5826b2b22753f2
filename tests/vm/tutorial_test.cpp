// docs/tutorials/adapter.md, typed: the reader's adapter is can0, and the devices of the desk are behind can1.
#include <gtest/gtest.h>

#include <string>

#include "../pages.hpp"
#include "../paths.hpp"
#include "interface.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

TEST(Tutorial, RealAdapter) {
  if (const auto why = no_interface("can1"); !why.empty()) GTEST_SKIP() << "needs vm: " << why;
  ASSERT_TRUE(shell("ip link set can1 down; ip link set can1 up type can listen-only off bitrate 125000"));
  PageShell reader;
  reader.start("berth device ~/berth/examples/desk.plant.toml --port can1");
  ASSERT_TRUE(eventually([&] { return reader.screen().find("node-ID   6") != std::string::npos; })) << reader.screen();
  follow(reader, "docs/tutorials/adapter.md");
}

}  // namespace
}  // namespace berth::test
