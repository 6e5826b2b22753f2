/// Where this build and its sources are. Functions of one file, not macros of every one: another clone compiles one
/// test file anew, not all of them.
#pragma once

#include <string>

namespace berth::test {

[[nodiscard]] std::string source_dir();  ///< the repository, no slash at its end
/// The command `berth` of this build, or what BERTH_TEST_BINARY names: tools/mutants puts a mistake into one.
[[nodiscard]] std::string binary();

}  // namespace berth::test
