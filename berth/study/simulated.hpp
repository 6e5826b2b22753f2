/// One measured job: a task on a stage, its trace kept, its time that of the trace.
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

/// The stage settles; a mark, the task, a mark; the trace is kept under `name`. The time is its span, to the
/// microsecond of the log. Empty: not over after `limit`, which is noted as wrong; the trace is kept all the same.
[[nodiscard]] std::optional<double> measured(Stage& stage, rt::Task<void> task, rt::Duration limit, Figures& figures,
                                             const std::string& name);

/// How Berth works for `by_planner` and `by_method`.
struct Job {
  bool known_types = false;      ///< the slot table knows the types
  bool known_revisions = false;  ///< and the revisions
  rt::Duration window{0};        ///< `discovery::Options::window`
  bool bind = false;             ///< `Commissioning` binds them from `first_id` on, in the order of finding
  unsigned first_id = 3;
};
/// The devices of `cast` found by a method, from mark to mark; empty unless all were found, and no other.
[[nodiscard]] std::optional<double> by_planner(const Cast& cast, std::uint32_t bit_rate, discovery::Method method,
                                               const Job& job, Figures& figures, const std::string& name);
/// The same for any plant. With `job.bind` the last frame is a boot-up message, and it is the end mark; empty unless
/// each device has stored its own node-ID and uses it.
[[nodiscard]] std::optional<double> by_method(const plant::PlantFile& plant, std::uint32_t bit_rate,
                                              discovery::Method method, const Job& job, Figures& figures,
                                              const std::string& name);
/// Keeps what a stage has recorded; the span as the log has it.
double keep(const Stage& stage, std::uint32_t bit_rate, Figures& figures, const std::string& name);

}  // namespace berth::study
