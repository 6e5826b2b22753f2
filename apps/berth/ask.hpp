/// The main job's questions, asked where `berth up` or `berth bind` runs on a terminal: which device belongs in which
/// slot? The answer is the request that `berth replace SLOT --device ADDRESS` makes.
#pragma once

#include <poll.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "berth/operate/session.hpp"
#include "berth/rt/scope.hpp"
#include "rig.hpp"

namespace berth::cli {

/// A person can type here: standard input is a terminal.
[[nodiscard]] bool someone_types() noexcept;

/// Waits for "y" or "yes" and Enter; anything else is no, a signal too.
[[nodiscard]] bool ask_yes(const std::string& question, Interrupt& interrupt);

/// What is open and how to answer, line by line: the devices are numbered.
[[nodiscard]] std::vector<std::string> lines_of(const operate::Event& question);

/// "left 2": the second device of the question for slot "left". An empty verb and the reason in `problem` for anything
/// else.
[[nodiscard]] operate::CommandRequest answer_of(const operate::Event& question, const std::string& line,
                                                std::string& problem);

/// Asks beside a run that goes on. `say` prints a line.
class Asker {
 public:
  Asker(operate::Session& session, std::function<void(const std::string&)> say);
  ~Asker();
  Asker(const Asker&) = delete;
  Asker& operator=(const Asker&) = delete;

  /// Tells a question when it comes.
  void event(const operate::Event& event);
  /// Adds standard input while a question is open.
  void fill(std::vector<pollfd>& descriptors) const;
  /// Takes what was typed, without waiting.
  void serve();

 private:
  struct Answer;
  void take(const std::string& line);

  operate::Session* session_;
  std::function<void(const std::string&)> say_;
  std::string typed_;
  bool over_ = false;  // the input has ended
  std::vector<std::unique_ptr<Answer>> answers_;
  rt::Scope scope_;  // last: its tasks use the answers
};

/// Asks until nothing is open or no answer comes; the world stands still meanwhile. For `berth bind`.
void ask_here(Rig& rig, rt::Duration limit);

}  // namespace berth::cli
