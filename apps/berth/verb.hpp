/// Defines the command line. Each verb's file has one `add_…` function, which the table in main.cpp lists. It defines
/// what may follow the verb and what the verb does:
///
///     void add_forget(Verb& berth, Options& options) {
///       const auto device = std::make_shared<std::string>();
///       Verb forget = berth.add("forget", "a device is gone for good", [&options, device] { return … });
///       forget.word("device", *device, "its LSS address").required();
///     }
///
/// The variable of a word must live as long as the action, so the action holds it. Only verb.cpp uses CLI11, because it
/// is slow to compile. A verb that is not on the command line has only its name and help: making the words of all verbs
/// would take most of a short command's time.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace berth::cli {

struct Options;
struct VerbText;

/// One word, option or flag of a verb, with its constraints.
class Word {
 public:
  /// Null: its verb is not on the command line, so it has no constraints.
  explicit Word(CLI::Option* option) noexcept : option_(option) {}

  Word& required();
  /// What the help shows in place of its value.
  Word& shown(const std::string& value);
  Word& one_of(const std::vector<std::string>& words);
  Word& one_of(const std::vector<std::uint32_t>& numbers);
  /// What a shell completes; the verb itself checks the value.
  Word& offers(const std::vector<std::string>& words);
  Word& from_to(std::uint32_t low, std::uint32_t high);
  /// The number of values.
  Word& values(int least, int most);
  /// May be repeated, with one value each time.
  Word& one_each();
  Word& separated_by(char delimiter);
  Word& excludes(const Word& other);

 private:
  CLI::Option* option_;
};

class Verb {
 public:
  using Action = std::function<int()>;
  /// Reads a value; returns what is wrong with it, empty if nothing.
  using Read = std::function<std::string(const std::string&)>;

  /// `action` is set to what the written verb does; `written`: the words of the command line, null for all verbs
  /// whether written or not. They and `app` outlive it.
  Verb(CLI::App& app, Action& action, const std::vector<std::string>* written) noexcept
      : app_(&app), action_(&action), written_(written) {}

  Verb add(const std::string& name, const std::string& help, Action does) const;
  /// A word before verbs, such as `berth lss`; one of its verbs is required.
  [[nodiscard]] Verb group(const std::string& name, const std::string& help) const;
  /// Printed below the help: examples.
  void footer(const std::string& text) const;

  // `names`: "file" is a positional word; "--port,-p" is an option.
  Word word(const std::string& names, std::string& into, const std::string& help) const;
  Word word(const std::string& names, std::vector<std::string>& into, const std::string& help) const;
  Word word(const std::string& names, std::vector<unsigned>& into, const std::string& help) const;
  Word word(const std::string& names, int& into, const std::string& help) const;
  Word word(const std::string& names, unsigned& into, const std::string& help) const;
  Word word(const std::string& names, std::optional<unsigned>& into, const std::string& help) const;
  /// A text given to a function.
  Word word(const std::string& names, const std::function<void(const std::string&)>& take,
            const std::string& help) const;
  /// A value of a special kind, which the help calls `kind`.
  Word read(const std::string& names, const std::string& kind, const Read& read, const std::string& help) const;
  /// The same for several values.
  Word read_each(const std::string& names, const std::string& kind, const Read& read, const std::string& help) const;
  /// A time above 0: "500 ms", "30 s", or a number of seconds.
  Word time(const std::string& names, std::optional<std::chrono::nanoseconds>& into, const std::string& help) const;
  Word time(const std::string& names, std::chrono::nanoseconds& into, const std::string& help) const;
  /// A number from 0.
  Word seed(const std::string& names, std::optional<std::uint64_t>& into, const std::string& help) const;
  Word flag(const std::string& names, bool& into, const std::string& help) const;
  Word flag(const std::string& names, const std::function<void()>& take, const std::string& help) const;
  /// A flag with an optional value: "--name" gives "true", "--name=VALUE" the value.
  Word flag_or_value(const std::string& name, std::string& into, const std::string& help) const;
  /// Exactly one of these words is required.
  void exactly_one(const std::function<void(const Verb&)>& add) const;

 private:
  Word time(const std::string& names, const std::function<void(std::chrono::nanoseconds)>& take,
            const std::string& help) const;
  Verb(CLI::App* app, const Verb& parent) noexcept : app_(app), action_(parent.action_), written_(parent.written_) {}
  [[nodiscard]] Verb sub(const std::string& name, CLI::App* made) const;

  CLI::App* app_;  // null: the verb is not on the command line; no words are made
  Action* action_;
  const std::vector<std::string>* written_;
};

/// Adds its verb to `berth`; `options` lives as long as the command line.
using AddVerb = void (*)(Verb& berth, Options& options);

/// Reads the command line and carries it out; returns the exit status. Reports wrong use with status 2.
int run_command_line(int argc, char** argv, const std::vector<AddVerb>& verbs);

/// What `--help` and the parser know of the verbs. `written`: the words of only these verbs, as on a command line;
/// null: of all.
[[nodiscard]] VerbText described(const std::vector<AddVerb>& verbs, const std::vector<std::string>* written);

// ---- words of several verbs ----

/// `--json`.
void json_flag(const Verb& verb, Options& options, const char* help = "one JSON object");
/// Which of the common words a verb has.
struct MachineWords {
  bool confirms = true;  ///< --yes: it may ask the user
  bool sends = true;     ///< --dry-run: the frames it sends are known in advance
  bool stores = true;    ///< --store: it uses the slot table
};
/// The machine, its buses' ports, its simulated world, its store; --yes, --dry-run, --timeout.
void machine_words(const Verb& verb, Options& options, MachineWords which = {});
/// --beside-master.
void beside_master_flag(const Verb& verb, Options& options);
/// For a simulated world: what it remembers and begins with, its store, its record, its time limit.
void world_words(const Verb& verb, Options& options, bool stores = true);
/// `--machine`.
void machine_option(const Verb& verb, Options& options);
/// The machine file, which may also be a positional word.
void machine_word(const Verb& verb, Options& options);
/// `--control`: the socket of the running `berth up`.
void control_word(const Verb& verb, Options& options);
/// `--sim-state` and `--seed` of a simulated plant.
void plant_words(const Verb& verb, Options& options);
/// `--allow-outside`; `machine_option` has it.
void reach_word(const Verb& verb, Options& options);
/// `--listen-anywhere`: for a TCP server.
void anywhere_flag(const Verb& verb, bool& anywhere);
/// `--color`: for a table or rows.
void colour_word(const Verb& verb);
/// `--force`; `world_words` has it.
void force_word(const Verb& verb, Options& options);
/// `--real-time PRIORITY`: for long runs on a real bus.
void real_time_word(const Verb& verb, Options& options);

}  // namespace berth::cli
