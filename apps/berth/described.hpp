/// What the parser knows of the command line, as data: for the man pages (man.hpp) and for completion (candidates.hpp),
/// which thereby offer and describe what the parser accepts. Made by `described` (verb.hpp).
#pragma once

#include <string>
#include <vector>

namespace berth::cli {

/// One word, option or flag of a verb.
struct WordText {
  /// As the user writes them, the long ones first: "--port", "-p"; of a positional word its one name: "slot".
  std::vector<std::string> names;
  std::string value;                 ///< placeholder for its value: "FILE"; empty: a flag
  std::vector<std::string> choices;  ///< all that its value may be; empty: something else
  std::string help;
  std::vector<std::string> excludes;  ///< names of those that may not be given with it
  char delimiter = '\0';              ///< between several values in one word; 0: none
  bool positional = false;
  bool required = false;
  bool alternative = false;  ///< exactly one of the alternatives of its verb is required
  bool repeated = false;     ///< may be given again
  bool many = false;         ///< takes all words up to the next option
};

struct VerbText {
  std::string name;
  std::string path;  ///< with the verbs before it: "berth sdo read"
  std::string help;
  std::string footer{};  ///< examples and notes, as `--help` ends
  std::vector<WordText> words{};
  std::vector<VerbText> verbs{};
  bool needs_verb = false;  ///< one of `verbs` is required

  /// Null: there is none of this name.
  [[nodiscard]] const VerbText* verb(const std::string& called) const noexcept;
  /// The option that is spelled so; null: there is none.
  [[nodiscard]] const WordText* option(const std::string& spelled) const noexcept;
};

}  // namespace berth::cli
