/// The shells' scripts of completion, built in (apps/berth/completion).
#pragma once

namespace berth::cli {

extern const char* const bash_completion;
extern const char* const zsh_completion;
extern const char* const fish_completion;

}  // namespace berth::cli
