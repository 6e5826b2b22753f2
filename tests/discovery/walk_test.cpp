// The planners on Fastscan slaves, plain and with feedback, on the simulated bus.
#include "berth/discovery/walk.hpp"

#include "discovery_world.hpp"

namespace berth::discovery::test {
namespace {

constexpr TypeCode type{0x0135'5341, 0x0447'0003};
constexpr std::uint32_t revision = 0x0002'0006;

void add_consecutive(World& w, unsigned count, const NodeOptions& like = {}) {
  for (unsigned i = 0; i < count; ++i) {
    NodeOptions o = like;
    o.address = {type.vendor, type.product, revision, 0x1000 + i};
    w.add(o);
  }
}
void add_random(World& w, unsigned count, const NodeOptions& like = {}) {
  Random serials = w.random.fork();
  for (unsigned i = 0; i < count; ++i) {
    NodeOptions o = like;
    o.address = {type.vendor, type.product, revision, static_cast<std::uint32_t>(serials.next())};
    w.add(o);
  }
}

class Planner : public testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(Both, Planner, testing::Values(Method::planner_fastscan, Method::planner_feedback));

TEST_P(Planner, FindsAndBindsThirtyConsecutive) {
  World w;
  add_consecutive(w, 30);
  Giver giver;
  w.known.kinds = {{type, revision}};
  w.options.assigner = &giver;
  const auto report = w.run(make(GetParam(), w.services())->find(w.known, w.options));
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(report->end, Report::End::complete);
  EXPECT_EQ(addresses(*report), addresses(w));
  w.expect_right(giver);
  printf("consecutive %ld us, %u requests, %u restarts\n", (report->ended - report->began).count() / 1000, report->requests, report->restarts);
}

TEST_P(Planner, FindsAndBindsThirtyRandom) {
  World w;
  add_random(w, 30);
  Giver giver;
  w.known.kinds = {{type, revision}};
  w.options.assigner = &giver;
  const auto report = w.run(make(GetParam(), w.services())->find(w.known, w.options));
  ASSERT_TRUE(report) << describe(report.error());
  EXPECT_EQ(report->end, Report::End::complete);
  EXPECT_EQ(addresses(*report), addresses(w));
  w.expect_right(giver);
  printf("random %ld us, %u requests, %u restarts\n", (report->ended - report->began).count() / 1000, report->requests, report->restarts);
}

}  // namespace
}  // namespace berth::discovery::test
