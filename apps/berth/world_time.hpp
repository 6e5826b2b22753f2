/// `berth world`: the time of a simulated world that runs in real time stands, runs, goes a frame further, or goes
/// faster; and frames of a bus are damaged.
#pragma once

#include <optional>
#include <vector>

#include "berth/command/reply.hpp"
#include "berth/rt/mailbox.hpp"
#include "berth/rt/task.hpp"
#include "machine_run.hpp"

namespace berth::cli {

class WorldTime {
 public:
  /// The run must stay.
  explicit WorldTime(MachineRun& run) : run_(&run), stepped_(run.driver().executor()) {}

  /// Of the table's verbs, those of the world.
  [[nodiscard]] static bool is_its(const command::Request& request) noexcept;
  /// Both must stay until the task is done.
  [[nodiscard]] rt::Task<void> carry_out(const command::Request& request, command::Reply& reply);
  /// Between two turns of the loop: goes as many frames further as was asked.
  void between();
  /// Of a world that stands: "paused: `berth world run` lets it go on"; empty: it runs.
  [[nodiscard]] std::string standing() const;
  /// A request whose answer is awaited, as long as this stands: it is told when the world is paused meanwhile.
  class Waiting {
   public:
    /// `time`: null, or must stay longer; as `reply` must.
    Waiting(WorldTime* time, const command::Reply& reply);
    ~Waiting();
    Waiting(const Waiting&) = delete;
    Waiting& operator=(const Waiting&) = delete;

   private:
    WorldTime* time_;
    const command::Reply* reply_;
  };
  /// At the end: who waits for world time must not wait for ever.
  void let_go();

 private:
  void stand();
  [[nodiscard]] command::Reply set(const command::Request& request);
  [[nodiscard]] command::Reply told(const std::string& words);
  [[nodiscard]] command::Reply damage(const command::Request& request);
  [[nodiscard]] std::optional<command::Reply> refusal_of(const command::Request& request);

  MachineRun* run_;
  std::optional<unsigned> frames_;    // of a step that was asked
  rt::Mailbox<unsigned, 1> stepped_;  // frames that came
  std::vector<const command::Reply*> waiting_;
};

}  // namespace berth::cli
