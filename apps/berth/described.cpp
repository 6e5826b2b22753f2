#include "described.hpp"

#include <algorithm>

namespace berth::cli {

const VerbText* VerbText::verb(const std::string& called) const noexcept {
  const auto found = std::ranges::find(verbs, called, &VerbText::name);
  return found == verbs.end() ? nullptr : &*found;
}

const WordText* VerbText::option(const std::string& spelled) const noexcept {
  const auto found = std::ranges::find_if(words, [&](const WordText& word) {
    return !word.positional && std::ranges::find(word.names, spelled) != word.names.end();
  });
  return found == words.end() ? nullptr : &*found;
}

}  // namespace berth::cli
