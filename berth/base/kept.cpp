#include "berth/base/kept.hpp"

#include <mutex>
#include <set>
#include <utility>

namespace berth {

const char* kept(std::string text) {
  static std::mutex one_at_a_time;
  static std::set<std::string> texts;
  const std::lock_guard held(one_at_a_time);
  return texts.insert(std::move(text)).first->c_str();
}

}  // namespace berth
