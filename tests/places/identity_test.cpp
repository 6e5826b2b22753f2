// Who answers under a node-ID, and whether one or two do: an answer that CAN repeats is no second device.
#include "berth/places/identity.hpp"

#include <gtest/gtest.h>
#include <chrono>
#include <optional>

#include "berth/rt/scope.hpp"
#include "berth/sim/world.hpp"

namespace berth::places {
namespace {

using namespace std::chrono_literals;

/// Answers each upload of 1018h with the sub-index, and the first `twice` of them twice.
class Answers final : public can::Handler {
 public:
  explicit Answers(can::Dispatcher& dispatcher) : dispatcher_(&dispatcher) { dispatcher.add(can::only(0x605), *this); }
  void received(const can::Frame& frame, rt::Time) noexcept override {
    const auto answer =
        can::Frame::base(0x585, {0x43, frame.data[1], frame.data[2], frame.data[3], frame.data[3], 0, 0, 0});
    static_cast<void>(dispatcher_->send(answer));
    if (twice > 0) static_cast<void>(dispatcher_->send(answer));
    twice -= twice > 0 ? 1 : 0;
  }
  int twice = 0;

 private:
  can::Dispatcher* dispatcher_;
};

class Asked : public ::testing::Test {
 protected:
  [[nodiscard]] Identified identify() {
    std::optional<Identified> answer;
    const auto ask = [&]() -> rt::Task<void> {
      Identified got = co_await places::identify(sdo_, NodeId(5), second_answer);
      answer = got;
    };
    rt::Scope scope(world_.executor());
    scope.spawn(ask());
    world_.run_for(2s);
    EXPECT_TRUE(answer.has_value());
    return answer.value_or(Identified{});
  }

  sim::World world_{1};
  sim::Bus& bus_ = world_.add_bus("bus", 125'000);
  std::unique_ptr<sim::Controller> own_ = bus_.attach();
  std::unique_ptr<sim::Controller> other_ = bus_.attach();
  can::Dispatcher dispatcher_{world_.executor(), *own_};
  can::Dispatcher others_{world_.executor(), *other_};
  Answers device_{others_};
  co::SdoClient sdo_{dispatcher_};
};

TEST_F(Asked, OneAnswersEachQuestionOnce) {
  const auto answer = identify();
  ASSERT_TRUE(answer.who);
  EXPECT_EQ(answer.who->address, (LssAddress{1, 2, 3, 4}));
  EXPECT_FALSE(answer.by_two);
}

TEST_F(Asked, ARepeatedFrameIsNoSecondDevice) {
  for (int repeated = 1; repeated <= 4; ++repeated) {
    device_.twice = repeated;
    const auto answer = identify();
    EXPECT_TRUE(answer.who) << repeated;
    EXPECT_FALSE(answer.by_two) << repeated << " of the first four answers came twice, and none of the next";
  }
}

TEST_F(Asked, TwoAnswerEachTimeTheyAreAsked) {
  device_.twice = 5;
  EXPECT_TRUE(identify().by_two) << "an answer to the repeated question came twice, too";
}

}  // namespace
}  // namespace berth::places
