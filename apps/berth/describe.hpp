/// Reads from CLI11 what it knows of the verbs (described.hpp). Included by verb.cpp alone.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <sstream>
#include <string>

#include "described.hpp"
#include "help.hpp"

namespace berth::cli {

inline WordText described(const CLI::Option& option) {
  WordText word;
  word.positional = option.get_positional();
  for (const auto& name : option.get_lnames()) word.names.push_back("--" + name);
  for (const auto& name : option.get_snames()) word.names.push_back("-" + name);
  if (word.positional) word.names = {option.get_name(true)};
  // In a list: CLI11 has commas between them, and the placeholder of "{a,b}" is "a|b".
  const std::string kind = option.get_type_name();
  if (const auto brace = kind.find('{'); brace != std::string::npos && option.get_type_size() != 0) {
    std::istringstream list(kind.substr(brace + 1, kind.rfind('}') - brace - 1));
    for (std::string choice; std::getline(list, choice, ',');) word.choices.push_back(choice);
  }
  word.help = option.get_description();
  word.value = HelpFormat::value_of(option);
  if (word.positional && word.value.empty()) word.value = option.get_name(true);
  for (const auto* const other : option.get_excludes()) word.excludes.push_back(other->get_name());
  word.delimiter = option.get_delimiter();
  word.required = option.get_required();
  const bool flag = option.get_type_size() == 0;
  const bool several = option.get_items_expected_max() > 1;
  word.many = !flag && several && option.get_allow_extra_args();
  word.repeated = !flag && several;
  return word;
}

inline void describe_words(const CLI::App& app, bool alternative, VerbText& into) {
  for (const auto* const option : app.get_options()) {
    // A group of options has a help flag of its own, which is the verb's.
    if (alternative && option == app.get_help_ptr()) continue;
    into.words.push_back(described(*option));
    into.words.back().alternative = alternative;
  }
}

/// `before`: the verbs before it.
inline VerbText described(const CLI::App& app, const std::string& before) {
  VerbText verb;
  verb.name = app.get_name();
  verb.path = before.empty() ? verb.name : before + " " + verb.name;
  verb.help = app.get_description();
  verb.footer = app.get_footer();
  verb.needs_verb = app.get_require_subcommand_min() > 0;
  describe_words(app, false, verb);
  for (const auto* const sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (sub->get_name().empty()) {
      describe_words(*sub, true, verb);
    } else {
      verb.verbs.push_back(described(*sub, verb.path));
    }
  }
  return verb;
}

}  // namespace berth::cli
