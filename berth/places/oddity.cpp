#include "berth/places/oddity.hpp"

#include <array>
#include <cstddef>

namespace berth::places {

const char* name(OddityKind kind) noexcept {
  constexpr std::array words{"surplus",  "foreign",    "clone", "wrong revision", "fixed mismatch", "misplaced",
                             "returned", "unfinished", "lent"};
  static_assert(words.size() == static_cast<std::size_t>(OddityKind::lent) + 1);
  return words[static_cast<std::size_t>(kind)];
}

}  // namespace berth::places
