#include "verb.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <sstream>
#include <utility>

#include "berth/io/realtime.hpp"
#include "berth/text/quantity.hpp"
#include "describe.hpp"
#include "help.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

// ---- Word ----

Word& Word::required() {
  if (option_ != nullptr) option_->required();
  return *this;
}

Word& Word::shown(const std::string& value) {
  if (option_ != nullptr) option_->option_text(value);
  return *this;
}

Word& Word::one_of(const std::vector<std::string>& words) {
  if (option_ != nullptr) option_->check(CLI::IsMember(words));
  return *this;
}

Word& Word::one_of(const std::vector<std::uint32_t>& numbers) {
  if (option_ != nullptr) option_->check(CLI::IsMember(numbers));
  return *this;
}

Word& Word::offers(const std::vector<std::string>& words) {
  if (option_ != nullptr) option_->type_name(fmt::format("{{{}}}", fmt::join(words, ",")));
  return *this;
}

Word& Word::from_to(std::uint32_t low, std::uint32_t high) {
  if (option_ != nullptr) option_->check(CLI::Range(low, high));
  return *this;
}

Word& Word::values(int least, int most) {
  if (option_ != nullptr) option_->expected(least, most);
  return *this;
}

Word& Word::one_each() {
  if (option_ != nullptr) option_->allow_extra_args(false);
  return *this;
}

Word& Word::separated_by(char delimiter) {
  if (option_ != nullptr) option_->delimiter(delimiter);
  return *this;
}

Word& Word::excludes(const Word& other) {
  if (option_ != nullptr) option_->excludes(other.option_);
  return *this;
}

// ---- Verb ----

Verb Verb::sub(const std::string& name, CLI::App* made) const {
  const bool wanted = written_ == nullptr || std::ranges::find(*written_, name) != written_->end();
  return {wanted ? made : nullptr, *this};
}

Verb Verb::add(const std::string& name, const std::string& help, Action does) const {
  if (app_ == nullptr) return *this;
  CLI::App* const made = app_->add_subcommand(name, help);
  // One that has verbs of its own is called after them.
  made->callback([made, action = action_, does = std::move(does)] {
    if (made->get_subcommands().empty()) *action = does;
  });
  return sub(name, made);
}

Verb Verb::group(const std::string& name, const std::string& help) const {
  if (app_ == nullptr) return *this;
  CLI::App* const made = app_->add_subcommand(name, help);
  made->require_subcommand(1);
  return sub(name, made);
}

void Verb::footer(const std::string& text) const {
  if (app_ != nullptr) app_->footer(text);
}

Word Verb::word(const std::string& names, std::string& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_option(names, into, help));
}
Word Verb::word(const std::string& names, std::vector<std::string>& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_option(names, into, help));
}
Word Verb::word(const std::string& names, std::vector<unsigned>& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_option(names, into, help));
}
Word Verb::word(const std::string& names, int& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_option(names, into, help));
}
Word Verb::word(const std::string& names, unsigned& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_option(names, into, help));
}
Word Verb::word(const std::string& names, std::optional<unsigned>& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_option(names, into, help));
}

// CLI11 would read "-3" as a very large number.
Word Verb::seed(const std::string& names, std::optional<std::uint64_t>& into, const std::string& help) const {
  const auto is_seed = [](const std::string& text) {
    return text.empty() || text.front() == '-' ? fmt::format("\"{}\" is not a seed; write a number from 0", text)
                                               : std::string();
  };
  return Word(app_ == nullptr ? nullptr
                              : app_->add_option(names, into, help)->check(CLI::Validator(is_seed, "NUMBER")));
}

Word Verb::word(const std::string& names, const std::function<void(const std::string&)>& take,
                const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_option_function<std::string>(names, take, help));
}

// The check itself takes the value, so that a wrong one is reported like every wrong value.
Word Verb::read(const std::string& names, const std::string& kind, const Read& read, const std::string& help) const {
  if (app_ == nullptr) return Word(nullptr);
  const auto nothing = [](const std::string&) {};
  return Word(app_->add_option_function<std::string>(names, nothing, help)->check(CLI::Validator(read, kind)));
}

Word Verb::read_each(const std::string& names, const std::string& kind, const Read& read,
                     const std::string& help) const {
  if (app_ == nullptr) return Word(nullptr);
  const auto nothing = [](const std::vector<std::string>&) {};
  return Word(
      app_->add_option_function<std::vector<std::string>>(names, nothing, help)->check(CLI::Validator(read, kind)));
}

Word Verb::time(const std::string& names, const std::function<void(std::chrono::nanoseconds)>& take,
                const std::string& help) const {
  const auto reads = [take](const std::string& text) {
    auto time = text::parse_duration(text);
    if (!time) time = text::parse_duration(text + " s");
    if (!time || time->count() <= 0) return fmt::format("\"{}\" is not a time; write 30, \"30 s\" or \"500 ms\"", text);
    take(*time);
    return std::string();
  };
  return read(names, "TIME", reads, help);
}

Word Verb::time(const std::string& names, std::optional<std::chrono::nanoseconds>& into,
                const std::string& help) const {
  return time(
      names, [&into](std::chrono::nanoseconds time) { into = time; }, help);
}

Word Verb::time(const std::string& names, std::chrono::nanoseconds& into, const std::string& help) const {
  return time(
      names, [&into](std::chrono::nanoseconds time) { into = time; }, help);
}

Word Verb::flag(const std::string& names, bool& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_flag(names, into, help));
}

Word Verb::flag(const std::string& names, const std::function<void()>& take, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_flag_callback(names, take, help));
}

Word Verb::flag_or_value(const std::string& name, std::string& into, const std::string& help) const {
  return Word(app_ == nullptr ? nullptr : app_->add_flag(name, into, help));
}

void Verb::exactly_one(const std::function<void(const Verb&)>& add) const {
  if (app_ == nullptr) return add(*this);
  auto* const these = app_->add_option_group("how");
  add(Verb(these, *this));
  these->require_option(1);
}

// ---- the command line ----

namespace {

/// The command with the wrong words: the deepest one named.
const CLI::App& deepest(const CLI::App& app) {
  const CLI::App* at = &app;
  while (!at->get_subcommands().empty()) at = at->get_subcommands().front();
  return *at;
}

std::string path_of(const CLI::App& app) {
  const auto* const parent = app.get_parent();
  return parent == nullptr || parent->get_name().empty() ? app.get_name() : path_of(*parent) + " " + app.get_name();
}

/// "; did you mean --bitrate?" for a word that the command does not know; empty: no word is similar.
std::string did_you_mean(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  if (word.starts_with("-")) {
    for (const auto* const option : app.get_options()) {
      for (const auto& name : option->get_lnames()) names.push_back("--" + name);
    }
  } else {
    for (const auto* const sub : app.get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(sub->get_name());
    }
  }
  const std::vector<std::string_view> known(names.begin(), names.end());
  // What some verbs call --for, others call --timeout.
  const std::string said = word.substr(0, word.find('='));
  const bool lasts = said == "--for" && std::ranges::find(names, "--timeout") != names.end();
  auto meant = lasts ? std::string_view("--timeout") : closest(said, known);
  const auto begins = [&](std::string_view name) { return said.size() > 2 && name.starts_with(said); };
  if (meant.empty() && std::ranges::count_if(known, begins) == 1) meant = *std::ranges::find_if(known, begins);
  return meant.empty() ? std::string() : fmt::format("; did you mean {}?", meant);
}

/// The same for the first unknown word after the command.
std::string suggestion(const CLI::App& command, int argc, char** argv) {
  const auto names = command.get_subcommands([](const CLI::App*) { return true; });
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool option = word.starts_with("--");
    const bool known = option ? command.get_option_no_throw(word.substr(0, word.find('='))) != nullptr
                              : names.empty() || std::string_view(word) == command.get_name();
    if (known || word == "--") continue;
    const auto meant = did_you_mean(command, word);
    if (!meant.empty()) return meant;
  }
  return {};
}

bool wants_json(int argc, char** argv) {
  return std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--json"; });
}

int no_such_command(const CLI::App& app, int argc, char** argv, const char* word) {
  const std::string what =
      fmt::format("there is no command {}{}; see berth --help", text::quoted(word), did_you_mean(app, word));
  return tell(failure(Exit::usage, what), wants_json(argc, argv));
}

int wrong_use(const CLI::App& app, const CLI::ParseError& error, int argc, char** argv) {
  if (error.get_exit_code() == 0) {  // --help
    std::ostringstream page;
    const int status = app.exit(error, page, page);
    write_text(page.str());
    return status;
  }
  const auto used = app.get_subcommands();
  if (used.empty() && argc > 1 && argv[1][0] != '-') return no_such_command(app, argc, argv, argv[1]);
  const CLI::App& command = deepest(app);
  return tell(failure(Exit::usage, fmt::format("{}{}; see {} --help", error.what(), suggestion(command, argc, argv),
                                               path_of(command))),
              wants_json(argc, argv));
}

}  // namespace

namespace {

/// Rewrites a command line's words for CLI11, which does not understand two things that users may write. One is a
/// machine file without `--machine` among a verb's other words. Its ending ".toml" shows it: no slot, node or object
/// has that ending, but a plant file has. The other is a negative number, which CLI11 takes for an option.
class CommandLine {
 public:
  CommandLine(const CLI::App& app, int argc, char** argv) : at_(&app), words_(argv + 1, argv + argc) {}

  std::vector<std::string> made() {
    for (next_ = 0; next_ < words_.size(); ++next_) take(words_[next_]);
    if (!negative_) return std::move(words_);
    // After "--", no word is an option.
    named_.emplace_back("--");
    named_.insert(named_.end(), plain_.begin(), plain_.end());
    return std::move(named_);
  }

 private:
  void take(std::string& word) {
    const bool dashed = word.size() > 1 && word.front() == '-' && !rest_is_plain_;
    const bool number = dashed && std::isdigit(static_cast<unsigned char>(word[1])) != 0;
    if (dashed && !number) return option(word);
    negative_ = negative_ || number;
    if (!rest_is_plain_ && plain_.empty() && verb(word)) return;
    const bool names = at_->get_option_no_throw("--machine") != nullptr;
    const bool positional =
        at_->get_option_no_throw("machine") != nullptr || at_->get_option_no_throw("plant") != nullptr;
    if (names && !positional && !rest_is_plain_ && word.ends_with(".toml")) {
      word = "--machine=" + word;
      named_.push_back(word);
    } else {
      plain_.push_back(word);
    }
  }

  void option(std::string& word) {
    if (word == "--") {
      rest_is_plain_ = true;
      return;
    }
    // The time of --watch may be left out: then the next word does not begin with a digit.
    const bool last = next_ + 1 == words_.size();
    const bool timed = !last && std::isdigit(static_cast<unsigned char>(words_[next_ + 1].front())) != 0;
    if (word == "--watch" && !timed) word = "--watch=1 s";
    named_.push_back(word);
    const auto equals = word.find('=');
    const CLI::Option* const option = at_->get_option_no_throw(word.substr(0, equals));
    const bool takes = option != nullptr && option->get_items_expected_max() > 0;
    if (takes && equals == std::string::npos && next_ + 1 < words_.size()) named_.push_back(words_[++next_]);
  }

  bool verb(const std::string& word) {
    const auto subs = at_->get_subcommands([&](const CLI::App* sub) { return sub->check_name(word); });
    if (subs.empty()) return false;
    at_ = subs.front();
    named_.push_back(word);
    return true;
  }

  const CLI::App* at_;  // the verb so far
  std::vector<std::string> words_;
  std::size_t next_ = 0;
  std::vector<std::string> named_;  // verbs, options and their values
  std::vector<std::string> plain_;  // the other words
  bool rest_is_plain_ = false;
  bool negative_ = false;
};

constexpr const char* what_it_is = "Berth gives every CANopen device its place.";

void make_first_words(CLI::App& app) {
  app.require_subcommand(1);
  app.set_version_flag("-V,--version", std::string("berth ") + BERTH_VERSION, "print version");
  app.formatter(std::make_shared<HelpFormat>());
  app.set_help_flag("-h,--help", "this help");
  app.footer(
      "Examples:\n  berth demo\n  berth init --eds drive.eds --eds io.eds:4\n  berth up\n  berth help sdo read\n"
      "docs/commands.md: how machines, buses, nodes and objects are named.\n"
      "Exit status: 0 done, 1 the answer is no, 2 wrong usage or an unreadable file,\n3 the bus or a file failed.");
}

}  // namespace

VerbText described(const std::vector<AddVerb>& verbs, const std::vector<std::string>* written) {
  CLI::App app(what_it_is, "berth");
  make_first_words(app);
  Options options;
  Verb::Action action;
  Verb berth(app, action, written);
  for (const auto add : verbs) add(berth, options);
  return described(app, "");
}

int run_command_line(int argc, char** argv, const std::vector<AddVerb>& verbs) {
  CLI::App app(what_it_is, "berth");
  make_first_words(app);
  Options options;
  Verb::Action action;
  const std::vector<std::string> written(argv, argv + argc);
  Verb berth(app, action, &written);
  for (const auto add : verbs) add(berth, options);
  // `berth help sdo read` is `berth sdo read --help`.
  std::vector<char*> given(argv, argv + argc);
  std::string help = "--help";
  if (given.size() > 1 && std::string_view(given[1]) == "help") {
    given.erase(given.begin() + 1);
    const auto is_named = [&](const CLI::App* sub) { return sub->check_name(given[1]); };
    if (given.size() > 1 && app.get_subcommands(is_named).empty()) return no_such_command(app, argc, argv, given[1]);
    given.push_back(help.data());
  }
  const int count = static_cast<int>(given.size());
  try {
    auto words = CommandLine(app, count, given.data()).made();
    std::ranges::reverse(words);
    app.parse(std::move(words));
  } catch (const CLI::ParseError& error) {
    return wrong_use(app, error, count, given.data());
  }
  if (options.real_time == 0) return action();
  const auto done = io::go_real_time({.priority = options.real_time, .lock_memory = true});
  return done ? action() : tell(failure(Exit::failed, done.error()), options.json);
}

// ---- words that several verbs have ----

namespace {
constexpr std::array<std::string_view, 3> colour_words{"auto", "always", "never"};  // in the order of `Colour`
}

void json_flag(const Verb& verb, Options& options, const char* help) { verb.flag("--json", options.json, help); }

void reach_word(const Verb& verb, Options& options) {
  verb.word("--allow-outside", options.files.allow_outside,
            "folder outside of the machine's own and its project that its files may name files in")
      .one_each()
      .shown("FOLDER");
}

void anywhere_flag(const Verb& verb, bool& anywhere) {
  verb.flag("--listen-anywhere", anywhere,
            "allow an address that other computers reach: anybody who reaches the port may use it, without a password");
}

void colour_word(const Verb& verb) {
  const auto take = [](const std::string& word) {
    const auto known = std::ranges::find(colour_words, word);
    if (known == colour_words.end()) return fmt::format("\"{}\" is none of auto, always and never", word);
    choose_colour(static_cast<Colour>(known - colour_words.begin()));
    return std::string();
  };
  verb.read("--color", "WHEN", take, "auto (default: on a terminal, unless NO_COLOR is set), always or never")
      .shown("WHEN")
      .offers({colour_words.begin(), colour_words.end()});
}

void force_word(const Verb& verb, Options& options) {
  verb.flag("--force", options.files.force, "replace files that are there");
}

void plant_words(const Verb& verb, Options& options) {
  verb.word("--sim-state,--plant-state", options.sim.state,
            "file that keeps what the simulated devices remember between runs")
      .shown("FILE");
  verb.seed("--seed", options.sim.seed, "seed of the simulated world, instead of the plant file's");
}

void world_words(const Verb& verb, Options& options, bool stores) {
  plant_words(verb, options);
  if (stores)
    verb.word("--store", options.store.file, "slot table's file (default: in memory on a simulated world)")
        .shown("FILE");
  verb.word("--record", options.files.record, "write every frame to this file, as candump -L does").shown("FILE");
  force_word(verb, options);
  verb.time("--timeout", options.timeout, "longest time, of the bus when it is simulated");
}

void machine_option(const Verb& verb, Options& options) {
  verb.word("--machine,-m", options.machine, "machine file (default: berth.toml, or the only one of the folder)")
      .shown("MACHINE");
  reach_word(verb, options);
}

void machine_words(const Verb& verb, Options& options, MachineWords which) {
  json_flag(verb, options);
  machine_option(verb, options);
  verb.word("--bus", options.bus, "one bus of the machine").shown("NAME");
  verb.word("--port,-p", options.ports, "port of the bus, or BUS=PORT, instead of the machine file's")
      .one_each()
      .shown("[BUS=]PORT");
  verb.word("--sim", options.sim.plant, "plant file: run on a simulated world").shown("PLANT");
  world_words(verb, options, which.stores);
  if (which.confirms) verb.flag("--yes,-y", options.yes, "confirm what Berth would otherwise ask");
  if (which.sends) {
    verb.flag("--dry-run", options.dry_run, "print every frame that Berth would send, and change nothing");
  }
}

void beside_master_flag(const Verb& verb, Options& options) {
  verb.flag("--beside-master", options.master.beside_another,
            "start for the first time even if a node may be the plant's master; --yes alone does not confirm this");
}

void machine_word(const Verb& verb, Options& options) {
  verb.word("machine", options.machine, "machine file (the same as -m)").shown("MACHINE");
}

void control_word(const Verb& verb, Options& options) {
  verb.word("--control", options.control, "socket of the running `berth up` (default: by the machine's name)")
      .shown("SOCKET");
}

void real_time_word(const Verb& verb, Options& options) {
  verb.word("--real-time", options.real_time, "run with this SCHED_FIFO priority, memory locked")
      .from_to(1, 99)
      .shown("PRIORITY");
}

}  // namespace berth::cli
