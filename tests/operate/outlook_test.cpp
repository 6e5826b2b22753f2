// A search that takes minutes tells how much longer it will take.
#include <gtest/gtest.h>
#include <cstdlib>
#include <string>
#include <vector>

#include "tests/harness/rig.hpp"

using namespace berth;
using namespace berth::harness;

namespace outlook_tests {
namespace {

struct Told {
  double at = 0;
  double more = 0;
};

// The number before " s" at the end.
double seconds_at_end(const std::string& text) {
  const auto place = text.rfind("about ");
  return place == std::string::npos ? 0 : std::strtod(text.c_str() + place + 6, nullptr);
}

TEST(Outlook, ALongSearchByPlainLssTellsHowMuchLongerItTakes) {
  constexpr unsigned devices = 24;
  design::Machine m = one_bus(10'000);
  auto p = one_bus_plant(3);
  for (unsigned i = 0; i < devices; ++i) {
    add_slot(m, i + 1, type_b);
    add_device(p, "d" + std::to_string(i), type_b, 0x9E37'79B9U * (i + 1)).speaks = {plant::Speaks::lss};
  }
  Rig rig(m, p);
  std::vector<Told> told;
  double found_at = 0;
  rig.on_event([&](const operate::Event& e) {
    if (e.text.starts_with("searching on: ")) told.push_back({operate::seconds(e.at), seconds_at_end(e.text)});
    if (e.text.starts_with("found ")) found_at = operate::seconds(e.at);
  });
  rig.begin();
  ASSERT_TRUE(rig.until_operational(600s)) << rig.log();
  ASSERT_GE(told.size(), 3U);
  unsigned estimates = 0;
  for (const auto& t : told) {
    if (t.more == 0) continue;
    ++estimates;
    EXPECT_LT(t.at + t.more, 2 * found_at) << "told at " << t.at << " s\n" << rig.log();
    EXPECT_GT(t.more, (found_at - t.at) / 3) << "told at " << t.at << " s\n" << rig.log();
  }
  EXPECT_GE(estimates, 2U) << rig.log();
}

}  // namespace
}  // namespace outlook_tests
