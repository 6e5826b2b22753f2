/// Shared by `berth up` and `berth demo`.
#pragma once

#include "machine_run.hpp"
#include "verb.hpp"

namespace berth::cli {

/// Text for the user beside the events.
struct Story {
  std::vector<std::string> begin;
  std::function<std::string(const operate::Event&)> comment;  ///< after this event; empty: nothing
  std::vector<std::string> end;
};

/// Runs the main job and prints its progress and its end; returns the exit status.
int bring_up(const Options& options, const Sources& sources, const Story& story = {});

/// `berth up`: the machine of the options, or the folder's.
int run_up(const Options& options);

/// --until, --pace, --fast, --control; returns --fast.
Word drive_words(const Verb& verb, Options& options);
/// --studio and its options; `fast`: what `drive_words` returned.
void studio_words(const Verb& verb, Options& options, const Word& fast);
/// --mqtt, --no-mqtt; `fast` as above.
void mqtt_words(const Verb& verb, Options& options, const Word& fast);
/// Access to Studio; `prefix`: "--studio-" after `berth up`, "--" after `berth studio`.
void studio_door_words(const Verb& verb, Options& options, const std::string& prefix);

}  // namespace berth::cli
