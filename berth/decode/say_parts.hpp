/// Text that is put together piece by piece.
#pragma once

#include <fmt/format.h>

#include <iterator>
#include <string>
#include <utility>

namespace berth::decode {

template <class... T>
void say(std::string& out, fmt::format_string<T...> format, T&&... values) {
  fmt::format_to(std::back_inserter(out), format, std::forward<T>(values)...);
}

}  // namespace berth::decode
