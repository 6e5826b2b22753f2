/// A command of the shell, as a test runs it.
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

#include "paths.hpp"

namespace berth::test {

struct Ran {
  int status = -1;  ///< 128: a signal ended it; -1: it was not started
  std::string out;
};

/// Its standard output alone: with `2>&1` in the command both streams.
inline Ran shell(const std::string& command) {
  Ran ran;
  std::FILE* const pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return ran;
  std::array<char, 65536> piece{};
  while (const auto got = std::fread(piece.data(), 1, piece.size(), pipe)) ran.out.append(piece.data(), got);
  const int status = ::pclose(pipe);
  ran.status = WIFEXITED(status) ? WEXITSTATUS(status) : 128;
  return ran;
}

/// The program is installed.
inline bool has(const std::string& program) { return shell("command -v '" + program + "' 2>&1").status == 0; }

/// The program of examples/NAME in this build.
inline std::string example_program(const std::string& name) {
  const auto berth = binary();
  return berth.substr(0, berth.rfind('/')) + "/examples/example_" + name;
}

}  // namespace berth::test
