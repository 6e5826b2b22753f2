/// Measures one job: a task on a stage, whose trace is kept and gives the time.
#pragma once

#include <optional>
#include <string>

#include "berth/discovery/discovery.hpp"
#include "berth/study/reproduce.hpp"
#include "berth/study/stage.hpp"

namespace berth::study {

[[nodiscard]] constexpr double seconds(rt::Duration time) noexcept {
  return std::chrono::duration<double>(time).count();
}

/// The stage settles; then a mark, the task, a mark. Keeps the trace under `name`. Returns its span, to the microsecond
/// of the log. Empty: not finished after `limit`, which is recorded as wrong; the trace is kept nevertheless.
[[nodiscard]] std::optional<double> measured(Stage& stage, rt::Task<void> task, rt::Duration limit, Figures& figures,
                                             const std::string& name);

/// Berth's settings for `by_planner` and `by_method`.
struct Job {
  bool known_types = false;      ///< the slot table knows the types
  bool known_revisions = false;  ///< and the revisions
  rt::Duration window{0};        ///< `discovery::Options::window`
  bool bind = false;             ///< `Commissioning` binds the devices from `first_id` on, in the order of finding
  unsigned first_id = 3;
};
/// Finds the devices of `cast` by a method, from mark to mark; empty unless exactly these were found.
[[nodiscard]] std::optional<double> by_planner(const Cast& cast, std::uint32_t bit_rate, discovery::Method method,
                                               const Job& job, Figures& figures, const std::string& name);
/// The same for any plant. With `job.bind` the last frame is a boot-up message, which is the end mark; empty unless
/// each device has stored its own node-ID and uses it.
[[nodiscard]] std::optional<double> by_method(const plant::PlantFile& plant, std::uint32_t bit_rate,
                                              discovery::Method method, const Job& job, Figures& figures,
                                              const std::string& name);
/// Keeps a stage's record; returns its span as in the log.
double keep(const Stage& stage, std::uint32_t bit_rate, Figures& figures, const std::string& name);

}  // namespace berth::study
