/// `berth world`: pauses, resumes, steps by frames or speeds up the time of a simulated world in real time, and damages
/// frames of a bus.
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
  /// The machine run must outlive it.
  explicit WorldTime(MachineRun& run) : run_(&run), stepped_(run.driver().executor()) {}

  /// One of the world's verbs.
  [[nodiscard]] static bool is_its(const command::Request& request) noexcept;
  /// Both must live until the task is done.
  [[nodiscard]] rt::Task<void> carry_out(const command::Request& request, command::Reply& reply);
  /// Call it between two turns of the loop: steps the requested number of frames.
  void between();
  /// For a paused world: "paused: `berth world run` lets it go on"; empty: it runs.
  [[nodiscard]] std::string standing() const;
  /// A request that waits for its answer, while this exists: if the world is paused meanwhile, its client is told.
  class Waiting {
   public:
    /// `time`: null, or must outlive it, as `reply` must.
    Waiting(WorldTime* time, const command::Reply& reply);
    ~Waiting();
    Waiting(const Waiting&) = delete;
    Waiting& operator=(const Waiting&) = delete;

   private:
    WorldTime* time_;
    const command::Reply* reply_;
  };
  /// At the end: a task that waits for world time must not wait for ever.
  void let_go();

 private:
  void stand();
  [[nodiscard]] command::Reply set(const command::Request& request);
  [[nodiscard]] command::Reply told(const std::string& words);
  [[nodiscard]] command::Reply damage(const command::Request& request);
  [[nodiscard]] std::optional<command::Reply> refusal_of(const command::Request& request);

  MachineRun* run_;
  std::optional<unsigned> frames_;    // of a requested step
  rt::Mailbox<unsigned, 1> stepped_;  // frames that came
  std::vector<const command::Reply*> waiting_;
};

}  // namespace berth::cli
