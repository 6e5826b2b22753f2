/// What `berth up` and `berth demo` share.
#pragma once

#include "machine_run.hpp"
#include "verb.hpp"

namespace berth::cli {

/// What is said to a person beside the events.
struct Story {
  std::vector<std::string> begin;
  std::function<std::string(const operate::Event&)> comment;  ///< after this event; empty: nothing
  std::vector<std::string> end;
};

/// Runs the main job, prints what it does and how it ended; the exit status.
int bring_up(const Options& options, const Sources& sources, const Story& story = {});

/// `berth up`: the machine of the options, or the folder's.
int run_up(const Options& options);

/// --until, --pace, --fast, --control; gives --fast.
Word drive_words(const Verb& verb, Options& options);
/// --studio and what belongs to it; `fast`: what `drive_words` gave.
void studio_words(const Verb& verb, Options& options, const Word& fast);
/// Who is let in; `prefix`: "--studio-" after `berth up`, "--" after `berth studio`.
void studio_door_words(const Verb& verb, Options& options, const std::string& prefix);

}  // namespace berth::cli
