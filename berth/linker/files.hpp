/// The files of a plan: for each linked device a DCF (CiA 306) and a concise DCF (CiA 302-3, 1F22h), for each device
/// with network variables its symbols, for all a nodelist project (CPJ), and the plan itself. All in memory: the caller
/// writes them.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/linker/plan.hpp"

namespace berth::linker {

struct MadeFile {
  std::string name;  ///< plain: letters, digits, `-`, `_` and `.`
  std::string bytes;
};

/// The base name of a node's files: its slot's name with `_` for characters unsuitable in a file name, and its node-ID
/// if two names would be equal.
[[nodiscard]] std::string file_stem(const LinkNetwork& network, std::size_t node);

/// The plan's settings of a node, ascending by object: COB-IDs, transmission types, times and mappings of the PDOs that
/// it uses, and bit 31 in the COB-ID of every other PDO that its own configuration does not set.
[[nodiscard]] std::vector<eds::Parameter> settings_of(const LinkNetwork& network, const Plan& plan, std::size_t node);

/// All files, `network.cpj` and `plan.toml` last. The error, for users: a description from which no DCF can be made.
[[nodiscard]] tl::expected<std::vector<MadeFile>, std::string> make_files(const LinkNetwork& network, const Plan& plan);

}  // namespace berth::linker
