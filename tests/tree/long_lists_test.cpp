// Network lists through many gateways on slow buses (docs/multilevel.md).
#include <algorithm>
#include <chrono>
#include <string>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::tree_tests {
namespace {

using namespace std::chrono_literals;

// Accesses that a gateway gives up because the node beneath does not answer it in time (0504 0000), to the data object.
struct GivenUp final : can::Tap {
  void frame(const can::Frame& frame, rt::Time, int) noexcept override {
    const auto text = can::to_string(frame);
    frames += text.starts_with("603#") || text.starts_with("583#") ? 1U : 0U;
    if (text == "583#80315F0000000405") ++count;
  }
  unsigned count = 0;
  unsigned frames = 0;
};

}  // namespace

// The whole list goes in one transfer, and each gateway hands it on in time: else it is refused by a time-out, tried
// again, and at last written value by value, each with 16 accesses on the backbone.
TEST(LongLists, OfFiveLevelsAreTakenAtOnce) {
  for (const unsigned rate : {50'000U, 20'000U}) {
    SCOPED_TRACE(rate);
    const auto made = chain(4, rate, 10);
    Rig rig(made.machine, made.plant);
    GivenUp given_up;
    rig.world().bus("top")->add_tap(given_up);
    EXPECT_TRUE(rig.up(2min)) << rig.log();
    rig.world().bus("top")->remove_tap(given_up);
    EXPECT_LE(given_up.count, 4U) << "one question to each master that was just told to restart";
    EXPECT_LT(given_up.frames, 12'000U);
    EXPECT_EQ(rig.log().find("value by value"), std::string::npos) << rig.log();
  }
}

// Berth wrote the list and ended before the reset from which it counts, and another master started the gateway: the
// next Berth finds a gateway that runs, with its list, and none of its nodes.
TEST(LongLists, AListThatNobodyBroughtIntoUseIsFinished) {
  const auto made = chain(1);
  Rig rig(made.machine, made.plant);
  const auto written = [&] { return rig.log().find("its gateway has a new network list") != std::string::npos; };
  ASSERT_TRUE(rig.run_until(written, 30s)) << rig.log();
  rig.end();
  rig.run_for(2s);
  rig.device("gateway 1").device().apply(co::NmtCommand::start);
  rig.run_for(5s);
  EXPECT_EQ(rig.device("valve 1").truth().active.configured(), false) << "its list is not in use";
  rig.forget_events();
  rig.begin();
  EXPECT_TRUE(rig.up()) << rig.log();
  EXPECT_NE(rig.log().find("finishing what an earlier run began"), std::string::npos) << rig.log();
}

namespace {

/// Refuses a configuration for the master itself, node 1: it takes its list object by object.
class NoneForItself final : public od::Hook {
 public:
  explicit NoneForItself(od::Values& values) { values.attach(*this, 0x1F22); }

 private:
  od::AbortCode writing(const od::Values&, ObjectRef ref, std::span<const std::uint8_t>) noexcept override {
    return ref.sub == 1 ? od::AbortCode::no_sub_index : od::AbortCode::none;
  }
};

}  // namespace

// A master that takes it value by value needs minutes there: how far it is is told meanwhile.
TEST(LongLists, TellHowFarTheyAre) {
  const auto made = chain(3, 10'000, 10);
  Rig rig(made.machine, made.plant);
  NoneForItself foreign(rig.device("port 3").device().values());
  ASSERT_TRUE(rig.up(20min)) << rig.log();
  std::vector<unsigned> done;
  for (const auto& event : rig.events()) {
    const auto at = event.text.find("value by value: writing, ");
    if (event.bus == "bus3" && at != std::string::npos)
      done.push_back(static_cast<unsigned>(std::stoul(event.text.substr(at + 25))));
  }
  EXPECT_GE(done.size(), 2U) << rig.log();
  EXPECT_TRUE(std::ranges::is_sorted(done));
}

}  // namespace berth::tree_tests
