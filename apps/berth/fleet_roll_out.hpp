/// `berth fleet roll-out`.
#pragma once

#include "options.hpp"
#include "verb.hpp"

namespace berth::cli {

void add_roll_out(const Verb& fleet, Options& options);

}  // namespace berth::cli
