/// A value read from a user's text, or the error in it.
#pragma once

#include <string>
#include <tl/expected.hpp>

namespace berth::command {

template <class T>
using Checked = tl::expected<T, std::string>;  ///< the error is for users

}  // namespace berth::command
