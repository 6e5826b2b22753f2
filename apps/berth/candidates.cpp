#include "candidates.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <set>
#include <string_view>

#include "berth/io/list_ports.hpp"
#include "described.hpp"
#include "machine_file.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {
namespace {

constexpr std::string_view any_files = ":files";
constexpr std::string_view table_files = ":tables";
constexpr std::string_view only_folders = ":folders";

/// What a placeholder of the help stands for.
enum class ValueKind : std::uint8_t { none, file, table, folder, port, bus, node };

bool is_negative(const std::string& word) {
  return word.size() > 1 && word.front() == '-' && std::isdigit(static_cast<unsigned char>(word[1])) != 0;
}

// The placeholders of options, and the names of positional words: the same for all verbs.
ValueKind value_kind(const WordText& word) {
  using enum ValueKind;
  const std::string& value = word.value;
  const auto has = [&](std::string_view part) { return value.find(part) != std::string::npos; };
  if (value == "MACHINE" || value == "PLANT" || value == "plant" || value == "machine") return table;
  if (has("FOLDER") || value == "folder") return folder;
  if (has("FILE") || has("IN OUT") || value == "SOCKET" || value == "file" || value == "image" || value == "from") {
    return file;
  }
  if (value == "PORT" || value == "[BUS=]PORT" || value == "[NAME=]PORT") return port;
  if (word.names.front() == "--bus" || value == "BUS...") return bus;
  if (value == "NODE" || value == "NODE..." || value == "SLOT/OBJECT...") return node;
  constexpr std::array nodes{"slot", "node", "target", "server", "client"};
  return std::ranges::find(nodes, value) != nodes.end() && word.positional ? node : none;
}

/// The words of a command line up to the last one, as the parser would take them.
class BegunLine {
 public:
  BegunLine(const VerbText& program, const std::vector<std::string>& words) : at_(&program), words_(words) {
    for (next_ = 0; next_ + 1 < words_.size(); ++next_) take(words_[next_]);
  }

  [[nodiscard]] std::vector<Candidate> candidates() {
    const std::string& word = words_.back();
    if (open_ != nullptr) offer_value(*open_, "", word);
    // A word that takes many takes options' names after it, too.
    const bool closed = open_ == nullptr || (open_->many && value_taken_);
    if (!closed) return std::move(offered_);
    if (word.starts_with("-") && !plain_) {
      offer_options(word);
    } else {
      offer_words(word);
    }
    return std::move(offered_);
  }

 private:
  void take(const std::string& word) {
    const bool dashed = word.size() > 1 && word.front() == '-' && !is_negative(word) && !plain_;
    if (dashed) return take_option(word);
    if (open_ != nullptr && !(open_->many && value_taken_ && next_verb(word) != nullptr)) {
      note_machine(*open_, word);
      value_taken_ = true;
      if (!open_->many) open_ = nullptr;
      return;
    }
    open_ = nullptr;
    const VerbText* const below = next_verb(word);
    if (below != nullptr) {
      at_ = below;
    } else {
      take_positional(word);
    }
  }

  void take_option(const std::string& word) {
    open_ = nullptr;
    value_taken_ = false;
    if (word == "--") {
      plain_ = true;
      return;
    }
    const auto equals = word.find('=');
    const WordText* const option = at_->option(word.substr(0, equals));
    if (option == nullptr) return;
    used_.insert(option->names.front());
    if (option->value.empty()) return;
    if (equals == std::string::npos) {
      open_ = option;
    } else {
      note_machine(*option, word.substr(equals + 1));
    }
  }

  void take_positional(const std::string& word) {
    const WordText* const place = positional();
    const bool names_machine = is_table(word) && (place == nullptr || takes_machine());
    if (names_machine) {
      machine_ = word;
      return;
    }
    if (place != nullptr) note_machine(*place, word);
    ++positional_;
  }

  // A verb is no longer looked for after the first other word.
  [[nodiscard]] const VerbText* next_verb(const std::string& word) const {
    return positional_ == 0 && !plain_ ? at_->verb(word) : nullptr;
  }
  void note_machine(const WordText& option, const std::string& word) {
    if (option.value == "MACHINE") machine_ = word;
  }
  [[nodiscard]] static bool is_table(const std::string& word) { return word.ends_with(".toml"); }
  // A machine file may stand among the other words (verb.cpp).
  [[nodiscard]] bool takes_machine() const {
    const auto positional = [](const WordText& word) {
      return word.positional && (word.value == "MACHINE" || value_kind(word) == ValueKind::table);
    };
    return at_->option("--machine") != nullptr && std::ranges::none_of(at_->words, positional);
  }
  [[nodiscard]] const WordText* positional() const {
    int left = positional_;
    const WordText* last = nullptr;
    for (const auto& word : at_->words) {
      if (!word.positional) continue;
      if (left-- == 0) return &word;
      last = &word;
    }
    return last != nullptr && last->many ? last : nullptr;
  }

  void offer(const std::string& word, const std::string& meaning, const std::string& begun) {
    if (word.starts_with(begun)) offered_.push_back({word, meaning});
  }

  void offer_options(const std::string& begun) {
    if (const auto equals = begun.find('='); equals != std::string::npos) {
      const WordText* const option = at_->option(begun.substr(0, equals));
      if (option != nullptr) offer_value(*option, begun.substr(0, equals + 1), begun.substr(equals + 1));
      return;
    }
    for (const auto& word : at_->words) {
      if (word.positional || (used_.contains(word.names.front()) && !word.repeated) || excluded(word)) continue;
      for (const auto& name : word.names) {
        // Short forms only where the user has begun one.
        if (name.starts_with("--") || begun == name) offer(name, word.help, begun);
      }
    }
  }
  [[nodiscard]] bool excluded(const WordText& word) const {
    return std::ranges::any_of(word.excludes, [&](const std::string& name) { return used_.contains(name); });
  }

  void offer_words(const std::string& begun) {
    if (positional_ == 0 && !plain_) {
      for (const auto& verb : at_->verbs) offer(verb.name, verb.help, begun);
    }
    if (const WordText* const word = positional(); word != nullptr) offer_value(*word, "", begun);
    if (takes_machine() && machine_.empty()) offer_names(table_files, "");
    if (offered_.empty() && begun.empty()) offer_options(begun);
  }

  void offer_names(std::string_view which, const std::string& before) {
    const bool there = std::ranges::find(offered_, which, &Candidate::word) != offered_.end();
    if (!there) offered_.push_back({std::string(which), before});
  }

  // `before`: what of the word precedes the value.
  void offer_value(const WordText& option, std::string before, std::string begun) {
    if (option.delimiter != '\0') {
      const auto last = begun.rfind(option.delimiter);
      if (last != std::string::npos) {
        before += begun.substr(0, last + 1);
        begun = begun.substr(last + 1);
      }
    }
    const std::string whole = before + begun;
    for (const auto& choice : option.choices) offer(before + choice, "", whole);
    switch (value_kind(option)) {
      case ValueKind::none: break;
      case ValueKind::file: offer_names(any_files, before); break;
      case ValueKind::table: offer_names(table_files, before); break;
      case ValueKind::folder: offer_names(only_folders, before); break;
      case ValueKind::port:
        for (const auto& seen : io::list_ports()) offer(before + can::to_string(seen.port), seen.driver, whole);
        break;
      case ValueKind::bus:
        if (const auto machine = machine_meant()) {
          for (const auto* const bus : machine->all_buses()) offer(before + bus->name, "", whole);
        }
        break;
      case ValueKind::node: offer_slots(before, whole); break;
    }
  }

  void offer_slots(const std::string& before, const std::string& whole) {
    const auto machine = machine_meant();
    if (!machine) return;
    const bool one_bus = machine->all_buses().size() == 1;
    for (const auto& slot : machine->slots) {
      const places::SlotName& name = slot.spec.name;
      const bool twice = machine->slots_named("", name.name).size() > 1;
      offer(before + (twice ? name.bus + "/" + name.name : name.name), one_bus ? "" : "on bus " + name.bus, whole);
    }
  }

  // Errors are for the command itself: here they mean that there is nothing to offer.
  [[nodiscard]] tl::expected<design::Machine, Failure> machine_meant() const {
    Options options;
    options.json = true;
    options.machine = machine_;
    return machine_by_file(options);
  }

  const VerbText* at_;  // the verb so far
  const std::vector<std::string>& words_;
  std::size_t next_ = 0;
  int positional_ = 0;              // how many words without a name so far
  const WordText* open_ = nullptr;  // the option whose value is next
  bool value_taken_ = false;        // it has one value at least
  bool plain_ = false;              // after "--"
  std::set<std::string> used_;      // options, by their first names
  std::string machine_;
  std::vector<Candidate> offered_;
};

}  // namespace

std::vector<Candidate> candidates(const std::vector<AddVerb>& verbs, const std::vector<std::string>& words) {
  std::vector<std::string> line = words.empty() ? std::vector<std::string>{""} : words;
  VerbText program = described(verbs, &line);
  // `berth help sdo` knows the verbs, and nothing else is there to know.
  VerbText help{.name = "help", .path = "berth help", .help = "the help of a verb", .verbs = program.verbs};
  if (line.front() == "help" && line.size() > 1) {
    line.erase(line.begin());
    for (auto& verb : program.verbs) verb.words.clear();
    program.words.clear();
  } else {
    program.verbs.push_back(std::move(help));
  }
  return BegunLine(program, line).candidates();
}

int run_complete(const std::vector<AddVerb>& verbs, const std::vector<std::string>& words) {
  for (const auto& [word, meaning] : candidates(verbs, words)) print_line(word + "\t" + meaning);
  return Exit::done;
}

}  // namespace berth::cli
