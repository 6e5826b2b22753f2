#include "berth/study/simulated.hpp"

#include <algorithm>

#include "berth/discovery/auto.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;

class From final : public discovery::Assigner {
 public:
  explicit From(unsigned first) : next_(first) {}
  NodeId assign(const LssAddress&) noexcept override {
    return next_ > 126 ? NodeId() : NodeId(static_cast<std::uint8_t>(next_++));
  }

 private:
  unsigned next_;
};

struct Search {
  discovery::Method method;
  discovery::Known known;
  discovery::Options options;
};

rt::Task<void> search(Stage& stage, const Search& what, unsigned& found) {
  lss::Master lss(stage.master());
  const auto master = discovery::make(what.method, {stage.master(), lss});
  const auto report = co_await master->find(what.known, what.options);
  if (report) found = static_cast<unsigned>(report->found.size());
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
  if (!ended) return std::nullopt;
  return span;
}

std::optional<double> by_method(const plant::PlantFile& plant, std::uint32_t bit_rate, discovery::Method method,
                                const Job& job, Figures& figures, const std::string& name) {
  From ids(job.first_id);
  Search what{method, {}, {}};
  for (const auto& device : plant.devices) {
    const discovery::Kind kind{device.address.type(),
                               job.known_revisions ? std::optional(device.address.revision) : std::nullopt};
    if (job.known_types && std::ranges::find(what.known.kinds, kind) == what.known.kinds.end())
      what.known.kinds.push_back(kind);
  }
  what.options.window = job.window;
  what.options.store = job.store;
  if (job.assign) what.options.assigner = &ids;
  unsigned found = 0;
  Stage stage(plant, bit_rate);
  if (!job.assign) {
    const auto span = measured(stage, search(stage, what, found), 30min, figures, name);
    return found == plant.devices.size() ? span : std::nullopt;
  }
  stage.settle();
  stage.record();
  const bool ended = stage.run(search(stage, what, found), 30min);
  stage.run_until_quiet(100ms, 10s);
  stage.crop_after_boot_up();
  const double span = keep(stage, bit_rate, figures, name);
  if (!ended || found != plant.devices.size() || stage.bound() != found) return std::nullopt;
  return span;
}

std::optional<double> by_planner(const Cast& cast, std::uint32_t bit_rate, discovery::Method method, const Job& job,
                                 Figures& figures, const std::string& name) {
  return by_method(plant_of(cast), bit_rate, method, job, figures, name);
}

}  // namespace berth::study
