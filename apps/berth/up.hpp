/// What `berth up` and `berth demo` share.
#pragma once

#include "rig.hpp"
#include "verb.hpp"

namespace berth::cli {

/// What is said to a person beside the events.
struct Story {
  std::vector<std::string> begin;
  std::function<std::string(const operate::Event&)> comment;  ///< behind this event; empty: nothing
  std::vector<std::string> end;
};

/// Runs the main job, prints what it does and how it ended; the exit status.
int bring_up(const Options& options, const Sources& sources, const Story& story = {});

/// --until, --pace, --fast, --control; gives --fast.
Word drive_words(const Verb& verb, Options& options);

}  // namespace berth::cli
