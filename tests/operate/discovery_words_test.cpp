// The machine file's words for discovery and the methods are two lists in two rooms.
#include <gtest/gtest.h>

#include "berth/design/machine.hpp"
#include "berth/discovery/discovery.hpp"

namespace berth::test {
namespace {

bool is_read(std::string_view word) {
  const std::string text = "[machine]\nname = \"m\"\n[bus.line]\nport = \"sim\"\nbitrate = 125000\ndiscovery = \"" +
                           std::string(word) + "\"\n";
  const auto read = design::read_machine(text, "m.toml", {});
  return read.machine && read.machine->buses.at(0).discovery == word;
}

TEST(DiscoveryWords, OfTheMachineFileAreTheMethods) {
  for (std::size_t i = 0; i < discovery::methods; ++i) {
    const auto word = discovery::name(static_cast<discovery::Method>(i));
    EXPECT_TRUE(is_read(word)) << word;
  }
  EXPECT_TRUE(is_read("auto"));
  EXPECT_FALSE(is_read("magic"));
}

}  // namespace
}  // namespace berth::test
