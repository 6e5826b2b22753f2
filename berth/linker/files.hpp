/// The files of a plan: for each linked device a DCF (CiA 306) and a concise DCF (CiA 302-3, 1F22h), for each device
/// with network variables its symbols, for all a nodelist project (CPJ), and the plan itself. In memory: the caller
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

/// The name of a node's files without what follows the dot: its slot's name with `_` for what a file name should not
/// have, and its node-ID where two would be equal.
[[nodiscard]] std::string file_stem(const LinkNetwork& network, std::size_t node);

/// What the plan sets in a node, ascending by object: COB-IDs, transmission types, times and mappings of the PDOs that
/// it uses, and bit 31 in the COB-ID of every other that no configuration of its own sets.
[[nodiscard]] std::vector<eds::Parameter> settings_of(const LinkNetwork& network, const Plan& plan, std::size_t node);

/// All files, `network.cpj` and `plan.toml` last. The error, for people: a description that no DCF can be made of.
[[nodiscard]] tl::expected<std::vector<MadeFile>, std::string> make_files(const LinkNetwork& network, const Plan& plan);

}  // namespace berth::linker
