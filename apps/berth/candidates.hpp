/// What a shell offers at TAB. The scripts of `berth completion` ask for it by `berth __complete WORD...`: the words
/// after the program's name, the last one as far as it is written, perhaps empty. Each line of the answer is one of
/// these:
///
///     --machine       machine file (default: …)      a candidate for the whole word, a tab, and what it means
///     :files          --record=                      a file's name, after these first characters of the word
///     :tables         -                              the same for a .toml file
///     :folders                                       the same for a folder
///
/// Nothing is sent and nothing is opened but the machine file, for the names of its slots and buses.
#pragma once

#include <string>
#include <vector>

#include "verb.hpp"

namespace berth::cli {

inline constexpr const char* complete_word = "__complete";

struct Candidate {
  std::string word;     ///< or ":files", ":tables", ":folders"
  std::string meaning;  ///< of those three: the characters before the name
};

/// In the order in which they are to be shown.
[[nodiscard]] std::vector<Candidate> candidates(const std::vector<AddVerb>& verbs,
                                                const std::vector<std::string>& words);

/// Prints them. Exit status: done.
int run_complete(const std::vector<AddVerb>& verbs, const std::vector<std::string>& words);

}  // namespace berth::cli
