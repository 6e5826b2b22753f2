// What a fuzz target says about what must hold.
#pragma once

#include <cstdlib>

namespace berth::fuzz {

inline void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace berth::fuzz
