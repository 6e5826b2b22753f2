// The master program of examples/client: what it prints.
#include <gtest/gtest.h>
#include <string>

#include <fstream>

#include "../paths.hpp"
#include "../pch.hpp"
#include "../shell.hpp"
#include "berth/co/emcy.hpp"

namespace {

std::string printed(const std::string& arguments, int& status) {
  const auto ran = berth::test::shell(berth::test::example_program("client") + " " + arguments);
  status = ran.status;
  return ran.out;
}

TEST(ExampleClient, PrintsWhatTheModuleDoes) {
  int status = -1;
  const std::string out = printed(berth::test::source_dir() + "/examples/eds/io.eds", status);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(out, std::string("node 5: boot-up, initialising\n"
                             "device: Berth I/O module\n"
                             "debounce time: written\n"
                             "node 5, object 2000h:00 \"Debounce time\": the value is above the object's high limit "
                             "(0609 0031)\n"
                             "inputs 00\n"
                             "inputs 01\n"
                             "inputs 81\n"
                             "EMCY 3120: ") +
                     berth::co::emcy_text(0x3120) +
                     "\n"
                     "supply voltage: 24000 mV\n"
                     "outputs 7E\n");
  int again = -1;
  EXPECT_EQ(printed(berth::test::source_dir() + "/examples/eds/io.eds", again), out) << "deterministic";
}

TEST(ExampleClient, WithoutAFileItSaysSo) {
  int status = -1;
  EXPECT_EQ(printed("/nowhere/x.eds 2>&1", status).find("/nowhere/x.eds"), 0U);
  EXPECT_EQ(status, 2);
}

}  // namespace
