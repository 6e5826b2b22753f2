// Paper 3's numbers: how many nodes its EMCY layouts distinguish, and what an access through its SDO gateways costs,
// counted on a simulated bus (docs/multilevel.md).
#include <fmt/format.h>

#include <memory>
#include <vector>

#include "berth/multilevel/emcy_layout.hpp"
#include "berth/multilevel/gateway_access.hpp"
#include "berth/multilevel/gateway_device.hpp"
#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"
#include "berth/study/reproduce.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;
using multilevel::EmcyLayout;

constexpr std::uint8_t target_id = 50;

struct Count final : can::Tap {
  explicit Count(sim::Bus& line) : bus(&line) { line.add_tap(*this); }
  ~Count() { bus->remove_tap(*this); }
  void frame(const can::Frame&, rt::Time, int) noexcept override { ++frames; }
  sim::Bus* bus;
  unsigned frames = 0;
};

// A chain of buses, each beneath a gateway on the one above, with a device on the lowest.
class Tower {
 public:
  explicit Tower(unsigned depth) {
    for (unsigned level = 0; level <= depth; ++level) world_.add_bus(fmt::format("level {}", level), 500'000);
    for (unsigned level = 0; level < depth; ++level) {
      multilevel::GatewayOptions above{.upper = {.node_id = NodeId(3)}};
      multilevel::BusOptions beneath{.device = {.node_id = NodeId(1)}};
      beneath.sdo.levels_beneath = depth - 1 - level;
      gateways_.push_back(std::make_unique<multilevel::GatewayDevice>(world_.executor(), port(level), above));
      gateways_.back()->add_bus(port(level + 1), beneath);
      gateways_.back()->power_on();
      path_.gateways.push_back({NodeId(3)});
    }
    path_.node = NodeId(target_id);
    dispatchers_.push_back(std::make_unique<can::Dispatcher>(world_.executor(), port(depth)));
    target_ = std::make_unique<device::Device>(*dispatchers_.back(), device::minimal_description(), nullptr,
                                               device::Options{.node_id = NodeId(target_id)});
    target_->power_on();
    dispatchers_.push_back(std::make_unique<can::Dispatcher>(world_.executor(), port(0)));
    client_ = std::make_unique<co::SdoClient>(*dispatchers_.back());
    routes_ = std::make_unique<multilevel::Routes>(*client_);
    world_.run_for(100ms);
  }

  /// Accesses on the client's bus for reading one object; 0: it was not read.
  unsigned accesses() {
    const Count count(*world_.buses().front());
    bool good = false;
    rt::Scope scope(world_.executor());
    scope.spawn(read(routes_->access(path_), good));
    world_.run_until([&] { return scope.running() == 0; }, 10s);
    return good ? count.frames / 2 : 0;
  }

 private:
  can::Port& port(unsigned level) {
    return *ports_.emplace_back(world_.buses()[level]->attach({.queue_depth = 16, .rx_depth = 16}));
  }
  static rt::Task<void> read(co::SdoAccess& access, bool& good) {
    const auto type = co_await access.read_u32(0x1000, 0);
    good = type.has_value();
  }

  sim::World world_;
  std::vector<std::unique_ptr<sim::Controller>> ports_;
  std::vector<std::unique_ptr<multilevel::GatewayDevice>> gateways_;
  std::vector<std::unique_ptr<can::Dispatcher>> dispatchers_;
  std::unique_ptr<device::Device> target_;
  std::unique_ptr<co::SdoClient> client_;
  std::unique_ptr<multilevel::Routes> routes_;
  multilevel::Path path_;
};

void add_nodes(EmcyLayout layout, double published, const char* note, Figures& figures) {
  Row row{.paper = 3, .what = fmt::format("nodes that an EMCY tells apart, {}", multilevel::name(layout))};
  row.published = published;
  row.formula = static_cast<double>(multilevel::nodes(layout));
  row.unit = "nodes";
  row.note = note;
  figures.rows.push_back(std::move(row));
}

void add_accesses(unsigned depth, Figures& figures) {
  Tower tower(depth);
  for (const bool first : {true, false}) {
    Row row{.paper = 3,
            .what = fmt::format("SDO accesses for {} upload beneath {} gateway{}", first ? "the first" : "a further",
                                depth, depth == 1 ? "" : "s")};
    if (depth == 1) row.published = first ? 3 : 2;
    row.formula = first ? (2U << depth) - 1 : 1U << depth;
    const auto counted = tower.accesses();
    if (counted != 0) row.counted = counted;
    row.unit = "accesses";
    row.note = depth == 1 ? "Figures 11 and 13"
                          : "the paper gives no number: each access to a gateway beneath is one through that above";
    if (counted != static_cast<unsigned>(*row.formula)) {
      figures.wrong.push_back(fmt::format("{}: {} counted, {} by formula", row.what, counted, *row.formula));
    }
    figures.rows.push_back(std::move(row));
  }
}

}  // namespace

void reproduce_paper3(Figures& figures) {
  add_nodes(EmcyLayout::source, 4195872914689.0, "127 nodes on each of 6 levels", figures);
  add_nodes(EmcyLayout::source_and_exit, 260144641.0, "127 nodes on each of 4 levels", figures);
  add_nodes(EmcyLayout::complete, 16129.0, "127 nodes on each of 2 levels", figures);
  for (unsigned depth = 1; depth <= 6; ++depth) add_accesses(depth, figures);
}

}  // namespace berth::study
