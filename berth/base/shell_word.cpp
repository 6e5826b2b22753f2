#include "berth/base/shell_word.hpp"

#include "berth/base/words.hpp"

namespace berth {

std::string shell_word(std::string_view name) {
  const bool plain = !name.empty() && name.find_first_of(" \t\"'$`\\&|;<>()*?[]#~!{}") == name.npos;
  return plain ? std::string(name) : quoted(name);
}

}  // namespace berth
