/// What `berth up` and `berth demo` share.
#pragma once

#include "rig.hpp"
#include "verb.hpp"

namespace berth::cli {

/// Runs the main job, prints what it does and how it ended; the exit status.
int bring_up(const Options& options, const Sources& sources);

/// --until, --pace, --fast, --control; gives --fast.
Word drive_words(const Verb& verb, Options& options);

}  // namespace berth::cli
