/// What was read from a person's words, or what is wrong with them.
#pragma once

#include <string>
#include <tl/expected.hpp>

namespace berth::command {

template <class T>
using Checked = tl::expected<T, std::string>;  ///< the error is for people

}  // namespace berth::command
