#include "berth/io/loop_driver.hpp"

#include <algorithm>

namespace berth::io {

bool LoopDriver::run_until(const Predicate& over, rt::Time end) {
  while (!over()) {
    if (now() >= end) return false;
    loop_.turn(std::min(longest_sleep_, end - now()));
  }
  return true;
}

}  // namespace berth::io
