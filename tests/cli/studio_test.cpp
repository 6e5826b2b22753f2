// `berth up --studio` in a process of its own.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "../pch.hpp"
#include "berth/io/stream.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

TEST(StudioCommand, PrintsItsAddressAndKeepsTheTokenBesideTheControlSocket) {
  const Folder folder;
  const std::string file = folder.file("control") + ".token";
  Background up({"up", example("five-slaves.toml"), "--sim", example("five-slaves.plant.toml"), "--studio=127.0.0.1:0",
                 "--control", folder.file("control")});
  std::string token;
  ASSERT_TRUE(eventually([&] { return static_cast<bool>(std::getline(std::ifstream(file), token)); }));
  struct stat status {};
  ASSERT_EQ(::stat(file.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  up.signal(SIGTERM);
  const auto end = up.end();
  EXPECT_NE(end.out.find("Berth Studio at http://127.0.0.1:"), std::string::npos) << end.out << end.err;
  EXPECT_NE(end.out.find("/#token=" + token), std::string::npos) << end.out;
  EXPECT_NE(::access(file.c_str(), F_OK), 0);
}

TEST(StudioCommand, WrongUse) {
  const auto machine = example("five-slaves.toml");
  const auto plant = example("five-slaves.plant.toml");
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--studio", "--fast"}).status, 2);
  EXPECT_EQ(berth({"up", machine, "--sim", plant, "--studio=nowhere:99999"}).status, 2);
  const auto anywhere = berth({"up", machine, "--sim", plant, "--studio=0.0.0.0:0"});
  EXPECT_EQ(anywhere.status, 3);
  EXPECT_NE(anywhere.err.find("TLS"), std::string::npos) << anywhere.err;
  const int taken = io::listen_tcp({"127.0.0.1", 0}).value();
  const auto where = io::to_string(*io::local_endpoint(taken));
  const auto refused = berth({"up", machine, "--sim", plant, "--studio=" + where});
  EXPECT_EQ(refused.status, 3);
  EXPECT_NE(refused.err.find(where), std::string::npos) << refused.err;
  ::close(taken);
}

}  // namespace
}  // namespace berth::test
