/// The main job's questions about which device belongs in which slot, asked where `berth up` or `berth bind` runs on a
/// terminal. The answer is the request that `berth replace SLOT --device ADDRESS` makes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/rt/later.hpp"
#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"
#include "first_saves.hpp"
#include "interrupt.hpp"
#include "machine_run.hpp"

namespace berth::cli {

/// Standard input is a terminal, so a user can type.
[[nodiscard]] bool someone_types() noexcept;

/// A line that the user types after `question`, trimmed. Nothing: the input has ended, or a signal came.
[[nodiscard]] std::optional<std::string> ask_line(const std::string& question, Interrupt& interrupt);

/// Waits for "y" or "yes" and Enter. Anything else is no, also a signal.
[[nodiscard]] bool ask_yes(const std::string& question, Interrupt& interrupt);

/// How to answer, line by line: the devices are numbered.
[[nodiscard]] std::vector<std::string> lines_of(const operate::Event& question);

/// "left 2": the second device of the question for slot "left"; the slot may also be given by its node-ID. For anything
/// else: an empty verb, and the reason in `problem`.
[[nodiscard]] command::Request answer_of(const operate::Event& question, const std::string& line,
                                         const design::Machine& machine, std::string& problem);

/// Asks during a run, in the loop that drives it. `say` prints a line.
class Asker final : private io::Watcher {
 public:
  /// Session, loop and `saves` must outlive it. With `takes_lines` it reads no input itself: `take` gets what is typed.
  Asker(tree::Session& session, io::Loop& loop, FirstSaves& saves, std::function<void(const std::string&)> say,
        bool takes_lines);
  ~Asker();
  Asker(const Asker&) = delete;
  Asker& operator=(const Asker&) = delete;

  /// More lines for the help of "?".
  void also_helps(std::vector<std::string> lines) { help_ = std::move(lines); }
  /// Prints a question when it comes; from then on it reads what is typed.
  void event(const operate::Event& event);
  /// A typed line: the answer to an open question. Prints what is wrong with it.
  void take(const std::string& line);
  /// A key at the beginning of a line: "?" prints what can be typed; "q" ends the run as Ctrl-C does, unless an open
  /// question's answer may begin with it. False: the key begins a line.
  bool take(char key);

 private:
  struct Answer;
  void ready(std::uint32_t events) noexcept override;
  void read_typed();
  void report_answers() noexcept;
  [[nodiscard]] bool asks() const;

  tree::Session* session_;
  io::Loop* loop_;
  FirstSaves* saves_;
  std::function<void(const std::string&)> say_;
  std::string typed_;
  std::vector<std::string> help_;
  bool takes_lines_;
  bool over_ = false;  // the input has ended
  rt::Later<Asker, &Asker::report_answers> reporting_{*this, loop_->executor()};
  std::vector<std::unique_ptr<Answer>> answers_;
  rt::Scope scope_;  // last: its tasks use the other members
};

/// Asks until no question is open or no answer comes; the simulated world stands still meanwhile. For `berth bind`.
void ask_here(MachineRun& run, rt::Duration limit);

}  // namespace berth::cli
