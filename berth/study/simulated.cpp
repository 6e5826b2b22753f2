#include "berth/study/simulated.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/discovery/auto.hpp"
#include "berth/study/commissioning.hpp"
#include "berth/study/verdict.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;

struct Search {
  discovery::Method method;
  discovery::Known known;
  discovery::Options options;
};

rt::Task<void> search(Stage& stage, lss::Master& lss, const Search& what, std::vector<LssAddress>& found) {
  const auto master = discovery::make(what.method, {stage.master(), lss});
  const auto report = co_await master->find(what.known, what.options);
  if (!report) co_return;
  for (const auto& device : report->found) found.push_back(device.address);
}

// As `operate::Network` does it: all to waiting after the search, then the binder.
rt::Task<void> search_and_bind(Stage& stage, Commissioning& berth, const Search& what,
                               std::vector<places::Assignment>& seats, unsigned first) {
  std::vector<LssAddress> found;
  co_await search(stage, berth.lss(), what, found);
  const auto waiting = co_await berth.lss().switch_global(lss::State::waiting);
  if (!waiting) co_return;
  for (const auto& address : found) seats.push_back({address, NodeId(static_cast<std::uint8_t>(first++))});
  const std::vector<places::Assignment> wanted = seats;
  co_await berth.bind(wanted);
}

std::int64_t micros(rt::Duration time) noexcept { return (time.count() + 500) / 1000; }

}  // namespace

double keep(const Stage& stage, std::uint32_t bit_rate, Figures& figures, const std::string& name) {
  figures.traces.push_back({name, bit_rate, stage.trace()});
  const auto& entries = stage.trace().entries;
  if (entries.empty()) return 0;
  return static_cast<double>(micros(entries.back().at) - micros(entries.front().at)) / 1e6;
}

std::optional<double> measured(Stage& stage, rt::Task<void> task, rt::Duration limit, Figures& figures,
                               const std::string& name) {
  stage.settle();
  stage.record();
  stage.mark();
  const bool ended = stage.run(std::move(task), limit);
  stage.mark();
  const double span = keep(stage, stage.bit_rate(), figures, name);
  if (ended) return span;
  figures.wrong.push_back(name + ": not over in its time");
  return std::nullopt;
}

std::optional<double> by_method(const plant::PlantFile& plant, std::uint32_t bit_rate, discovery::Method method,
                                const Job& job, Figures& figures, const std::string& name) {
  Search what{method, {}, {}};
  for (const auto& device : plant.devices) {
    const discovery::Kind kind{device.address.type(),
                               job.known_revisions ? std::optional(device.address.revision) : std::nullopt};
    if (job.known_types && std::ranges::find(what.known.kinds, kind) == what.known.kinds.end())
      what.known.kinds.push_back(kind);
  }
  what.options.window = job.window;
  Stage stage(plant, bit_rate);
  if (!job.bind) {
    std::vector<LssAddress> found;
    lss::Master lss(stage.master());
    const auto span = measured(stage, search(stage, lss, what, found), 30min, figures, name);
    return right(figures, name, differences(stage, found)) ? span : std::nullopt;
  }
  std::vector<places::Assignment> seats;
  Commissioning berth(stage);
  stage.settle();
  stage.record();
  const bool ended = stage.run(search_and_bind(stage, berth, what, seats, job.first_id), 30min);
  stage.crop_after_boot_up();
  const double span = keep(stage, bit_rate, figures, name);
  auto wrong = differences(stage, seats, Hold::stored);
  if (!ended) wrong.emplace_back("not over in its time");
  if (seats.size() != plant.devices.size() || berth.bound() != seats.size())
    wrong.push_back(fmt::format("{} found and {} bound of {}", seats.size(), berth.bound(), plant.devices.size()));
  return right(figures, name, wrong) ? std::optional(span) : std::nullopt;
}

std::optional<double> by_planner(const Cast& cast, std::uint32_t bit_rate, discovery::Method method, const Job& job,
                                 Figures& figures, const std::string& name) {
  return by_method(plant_of(cast), bit_rate, method, job, figures, name);
}

}  // namespace berth::study
