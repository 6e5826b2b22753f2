// `[bus.NAME.sync]`: Berth's own device produces SYNC (CiA 301 §7.2.5).
#include <gtest/gtest.h>

#include "tests/harness/berths.hpp"

using namespace berth;
using namespace berth::harness;

namespace {

// The SYNCs on a bus: what each counts, 0 without data.
class Syncs final : public can::Tap {
 public:
  explicit Syncs(sim::Bus& bus) : bus_(bus) { bus_.add_tap(*this); }
  ~Syncs() { bus_.remove_tap(*this); }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    if (frame.key() != 0x80) return;
    counts_.push_back(frame.size == 0 ? 0 : frame.data[0]);
  }
  [[nodiscard]] const std::vector<unsigned>& counts() const noexcept { return counts_; }

 private:
  sim::Bus& bus_;
  std::vector<unsigned> counts_;
};

}  // namespace

TEST(BusSync, BerthProducesItWithItsPeriodAndItsCounter) {
  design::Machine machine = five_slots();
  machine.buses.front().sync = design::BusSync{20ms, 4};
  Rig rig(machine, five_slaves());
  const Syncs syncs(*rig.world().bus("backbone"));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.network().operational(); }, 60s)) << rig.log();
  const std::size_t before = syncs.counts().size();
  ASSERT_GT(before, 4U);
  rig.run_for(2s);
  EXPECT_NEAR(static_cast<double>(syncs.counts().size() - before), 100, 1) << "one each 20 ms";
  for (std::size_t i = 0; i < syncs.counts().size(); ++i) ASSERT_EQ(syncs.counts()[i], i % 4 + 1) << i;
}

TEST(BusSync, WithoutTheTableBerthSendsNone) {
  Rig rig(five_slots(), five_slaves());
  const Syncs syncs(*rig.world().bus("backbone"));
  rig.begin();
  ASSERT_TRUE(rig.run_until([&] { return rig.network().operational(); }, 60s)) << rig.log();
  rig.run_for(2s);
  EXPECT_TRUE(syncs.counts().empty());
}

// One SYNC producer for a bus: the standby, which has the same machine file, sends none until it takes over.
TEST(BusSync, OfSeveralMastersTheActiveOneProducesIt) {
  design::Machine machine = five_slots();
  machine.buses.front().sync = design::BusSync{20ms, 0};
  Berths berths(machine, five_slaves(), {0, 1});
  berths.begin(0);
  berths.begin(1);
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(0) && berths.operational(0); })) << berths.log();
  EXPECT_GT(berths.sent_by(0)[0x80], 10U);
  EXPECT_EQ(berths.sent_by(1)[0x80], 0U);
  berths.kill(0);
  berths.forget();
  ASSERT_TRUE(berths.run_until([&] { return berths.leads(1) && berths.operational(1); }, 60s)) << berths.log();
  berths.run_for(1s);
  EXPECT_GT(berths.sent_by(1)[0x80], 10U);
}
