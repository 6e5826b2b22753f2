// `berth man`, `berth completion`: what shells and `man` need, made from the table of the verbs.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "candidates.hpp"
#include "described.hpp"
#include "man.hpp"
#include "output.hpp"
#include "shell_scripts.hpp"
#include "verbs.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

struct ManOptions {
  std::vector<std::string> verb;
  std::string folder;
};

// By SOURCE_DATE_EPOCH, as packages are made: a page that is printed on the spot has none.
std::string date_of_build() {
  const char* const given = std::getenv("SOURCE_DATE_EPOCH");
  if (given == nullptr) return {};
  const std::string_view text(given);
  std::time_t seconds = 0;
  const auto read = std::from_chars(text.data(), text.data() + text.size(), seconds);
  return read.ec == std::errc() ? fmt::format("{:%Y-%m-%d}", fmt::gmtime(seconds)) : std::string();
}

int write_pages(const ManOptions& man, const VerbText& program, const Options& options) {
  if (const auto bad = make_folder(man.folder)) return tell(*bad, options.json);
  const auto pages = man_pages(program, date_of_build());
  std::vector<WholeFile> files;
  for (const auto& page : pages) {
    files.push_back({(std::filesystem::path(man.folder) / (page.name + ".1")).string(), page.text});
  }
  if (const auto bad = write_whole(files, options.files.force)) return tell(*bad, options.json);
  print_progress(fmt::format("{}: {} pages", man.folder, pages.size()));
  return Exit::done;
}

int run_man(const ManOptions& man, const Options& options) {
  const VerbText program = described(all_verbs(), nullptr);
  const VerbText* at = &program;
  for (const auto& word : man.verb) {
    const VerbText* const below = at->verb(word);
    if (below == nullptr) {
      return tell(
          failure(Exit::usage, fmt::format("{} has no command \"{}\"; see {} --help", at->path, word, at->path)),
          options.json);
    }
    at = below;
  }
  if (!man.folder.empty()) return write_pages(man, *at, options);
  write_text(man_page(*at, date_of_build()).text);
  return Exit::done;
}

int run_completion(const std::string& shell) {
  const char* const script = shell == "bash" ? bash_completion : shell == "zsh" ? zsh_completion : fish_completion;
  write_text(script);
  return Exit::done;
}

}  // namespace

void add_man(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<ManOptions>();
  const Verb man = berth.add("man", "manual page of a command, for man(1)",
                             [&options, wanted] { return run_man(*wanted, options); });
  man.word("command", wanted->verb, "the command, such as sdo read (default: berth itself)");
  man.word("--all", wanted->folder, "write the page of each command, and of those below it, into this folder")
      .shown("FOLDER");
  force_word(man, options);
  man.footer("Examples:\n  berth man sdo read > read.1 && man ./read.1\n  berth man --all ~/.local/share/man/man1");
}

void add_completion(Verb& berth, Options&) {
  const auto shell = std::make_shared<std::string>();
  const Verb completion = berth.add("completion", "script that lets a shell complete berth's words",
                                    [shell] { return run_completion(*shell); });
  completion.word("shell", *shell, "bash, zsh or fish").one_of({"bash", "zsh", "fish"}).required();
  completion.footer(
      "Examples:\n  berth completion zsh > ~/.zfunc/_berth   # a folder of $fpath\n"
      "  berth completion fish > ~/.config/fish/completions/berth.fish\n"
      "  source <(berth completion bash)          # in ~/.bashrc");
}

}  // namespace berth::cli
