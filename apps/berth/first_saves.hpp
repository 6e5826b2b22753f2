/// For devices that do not become operational because their memory holds nothing saved (`operate::Event::offers_save`;
/// CANopenNode without storage files): asks whether to save and reset them.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "berth/rt/scope.hpp"
#include "berth/tree/session.hpp"

namespace berth::cli {

class FirstSaves {
 public:
  using Say = std::function<void(const std::string&)>;
  /// The session must outlive it. `yes`: do it without asking. `say` prints a line.
  FirstSaves(tree::Session& session, Say say, bool yes)
      : session_(&session), say_(std::move(say)), yes_(yes), scope_(session.executor()) {}
  ~FirstSaves() { scope_.cancel(); }
  FirstSaves(const FirstSaves&) = delete;
  FirstSaves& operator=(const FirstSaves&) = delete;

  /// Asks once for each device in a run: memory wears out.
  void event(const operate::Event& event);
  /// A question is waiting for an answer.
  [[nodiscard]] bool is_open() const noexcept { return !open_.empty(); }
  /// "save left". False: the line is not such an answer.
  bool take(const std::string& line);

 private:
  struct Slot {
    std::string bus;
    std::string name;
  };
  void save(const Slot& slot);

  tree::Session* session_;
  Say say_;
  bool yes_;
  std::vector<Slot> open_;
  rt::Scope scope_;  // last: its tasks use the other members
};

}  // namespace berth::cli
